//! Coding with the paper's profile, and measures.

use isv_encode::{Encoder, EncoderSettings};
use isv_format::{FrameRate, PaperParameters, Profile, StreamHeader};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};

/// Blocks of 8 voxels and a truncation of 8.
pub(crate) fn grid(voxel_m: f64) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

/// The paper's profile: K = 64, DC step 1 mm, AC step 10 mm.
pub(crate) struct Coder(Encoder);

impl Coder {
    pub(crate) fn new(grid: Grid) -> Self {
        let step = |metres: f64| (metres / grid.voxel_size.metres() * 256.0 * 16.0).round() as u32;
        let header = StreamHeader::new(
            Profile::Paper(PaperParameters { coefficients: 64, dc_step: step(0.001), ac_step: step(0.01) }),
            grid,
            FrameRate::DEFAULT,
        );
        Self(Encoder::new(&header, EncoderSettings::default()))
    }

    /// The surface as decoded, and the bytes that it took.
    pub(crate) fn code(&mut self, volume: &SparseVolume) -> (TriangleMesh, usize) {
        let frame = self.0.encode(volume);
        let bytes = frame.bytes_blocks() + frame.bytes_modes() + frame.bytes_coefficients();
        (surface(self.0.reconstruction().unwrap()), bytes)
    }
}

pub(crate) fn surface(volume: &SparseVolume) -> TriangleMesh {
    extract_surface(volume, &SurfaceOptions::default())
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Triangles of each connected piece of a mesh, the largest piece first.
pub(crate) fn pieces(mesh: &TriangleMesh) -> Vec<usize> {
    let mut parent: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(parent: &mut [usize], mut vertex: usize) -> usize {
        while parent[vertex] != vertex {
            parent[vertex] = parent[parent[vertex]];
            vertex = parent[vertex];
        }
        vertex
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|v| v as usize)) {
        for other in [b, c] {
            let (one, other) = (root(&mut parent, a), root(&mut parent, other));
            parent[one] = other;
        }
    }
    let mut sizes = vec![0; mesh.vertices.len()];
    for triangle in &mesh.triangles {
        sizes[root(&mut parent, triangle[0] as usize)] += 1;
    }
    sizes.retain(|size| *size > 0);
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}
