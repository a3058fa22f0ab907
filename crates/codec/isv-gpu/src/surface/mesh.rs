//! Meshes on a GPU.

use crate::commands::Commands;
use crate::storage::Usage;
use crate::{Gpu, GpuError, Storage};
use bytemuck::Pod;
use isv_volume::TriangleMesh;

/// Bytes of a position, a normal or a triangle: three words.
const ITEM_BYTES: u64 = 12;

/// An indexed triangle mesh that is on a GPU: positions in metres as `f32`, triangles counter-clockwise seen from outside.
#[derive(Debug)]
pub struct GpuMesh {
    gpu: Gpu,
    pub(super) positions_m: Parts,
    /// One a vertex, if they were wanted.
    pub(super) normals: Option<Parts>,
    /// Numbers of vertices.
    pub(super) triangles: Parts,
}

impl GpuMesh {
    /// GrowingBuffer for so many vertices and triangles.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if a count is `u32::MAX`, which stands for any number from there on; and as [`Gpu::storage`].
    pub(super) fn new(gpu: &Gpu, [vertices, triangles]: [u32; 2], normals: bool) -> Result<Self, GpuError> {
        Ok(Self {
            gpu: gpu.clone(),
            positions_m: Parts::new(gpu, "vertices", vertices)?,
            normals: normals.then(|| Parts::new(gpu, "normals", vertices)).transpose()?,
            triangles: Parts::new(gpu, "triangles", triangles)?,
        })
    }

    /// A mesh without vertices.
    pub(super) fn empty(gpu: &Gpu, normals: bool) -> Self {
        let normals = normals.then(Parts::default);
        Self { gpu: gpu.clone(), positions_m: Parts::default(), normals, triangles: Parts::default() }
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.positions_m.count as usize
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.count as usize
    }

    /// Copies the mesh back.
    ///
    /// # Errors
    /// What went wrong on the GPU: [`GpuError::Lost`] and others.
    pub fn download(&self) -> Result<TriangleMesh, GpuError> {
        let vectors = |parts: &Parts| {
            let vectors: Vec<[f32; 3]> = parts.download(&self.gpu)?;
            Ok(vectors.into_iter().map(|vector| vector.map(f64::from).into()).collect())
        };
        Ok(TriangleMesh {
            vertices: vectors(&self.positions_m)?,
            normals: self.normals.as_ref().map(vectors).transpose()?.unwrap_or_default(),
            triangles: self.triangles.download(&self.gpu)?,
            appearance: None,
        })
    }
}

/// A list of items of three words, split into buffers that kernels can see: all are full but the last.
#[derive(Debug, Default)]
pub(super) struct Parts {
    count: u32,
    /// Items of a full buffer.
    each: u32,
    buffers: Vec<Storage>,
}

/// The part of a list that is in one buffer.
pub(super) struct Share<'a> {
    /// Number of its first item.
    pub(super) start: u32,
    /// How many there are.
    pub(super) count: u32,
    pub(super) storage: &'a Storage,
}

impl Parts {
    fn new(gpu: &Gpu, what: &'static str, count: u32) -> Result<Self, GpuError> {
        if count == u32::MAX {
            let limit = ITEM_BYTES * u64::from(u32::MAX - 1);
            return Err(GpuError::TooLarge { what, bytes: limit + ITEM_BYTES, limit });
        }
        let each = u32::try_from(gpu.binding_bytes() / ITEM_BYTES).unwrap_or(u32::MAX).max(1);
        let starts = (0..count).step_by(each as usize);
        let items = |start: u32| u64::from((count - start).min(each));
        let buffers = starts.map(|start| gpu.storage(what, ITEM_BYTES * items(start), Usage::Kernels));
        Ok(Self { count, each, buffers: buffers.collect::<Result<_, _>>()? })
    }

    pub(super) fn shares(&self) -> impl Iterator<Item = Share<'_>> {
        (0..).zip(&self.buffers).map(|(number, storage): (u32, _)| {
            let start = number * self.each;
            Share { start, count: (self.count - start).min(self.each), storage }
        })
    }

    fn download<T: Pod>(&self, gpu: &Gpu) -> Result<Vec<[T; 3]>, GpuError> {
        let mut items = Vec::with_capacity(self.count as usize);
        for Share { count, storage, .. } in self.shares() {
            let bytes = ITEM_BYTES * u64::from(count);
            let reading = gpu.storage("a mesh to read", bytes, Usage::Reading)?;
            let mut commands = Commands::new(gpu);
            commands.copy(storage, &reading, bytes);
            commands.submit()?;
            items.extend(bytemuck::pod_collect_to_vec::<u8, [T; 3]>(
                &gpu.read(&[(&reading, reading.bytes())])?[0],
            ));
        }
        Ok(items)
    }
}
