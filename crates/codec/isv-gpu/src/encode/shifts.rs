//! Search in the frame before for the blocks of a frame of profile `main`, in floating point.

use super::shaders;
use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::decode::coded_blocks::pack_vector;
use crate::kernel::Kernel;
use crate::pool::segment_bits;
use crate::storage::GrowingBuffer;
use crate::store::Slots;
use crate::{GpuError, GpuVolume, VolumeStore};
use isv_decode::BackendError;
use isv_decode::main::MainReference;
use isv_encode::{BlockShifts, MotionQuery, SearchBackend};
use isv_volume::BlockIndex;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Stride over the rows of voxels that are looked at: in cubes of 4^3 blocks, in cubes of 2^3 blocks, in blocks alone.
const ROWS: [u32; 3] = [4, 2, 1];
/// Gauss-Newton steps at most.
const STEPS: u32 = 8;
/// Bytes of a shift and its error as the kernel writes them.
const SHIFT_BYTES: u64 = 16;
/// Largest component of a shift, in voxels.
const LIMIT: f32 = 31.0;
/// Stands for a group that is not there.
const NO_GROUP: u32 = u32::MAX;

/// The search for motion of profile `main` on a GPU, for a [`MainEncoder`](isv_encode::MainEncoder). All of a frame's blocks are
/// searched for at once, as thoroughly as the CPU ever does.
#[derive(Debug)]
pub struct GpuMotionSearch {
    store: VolumeStore,
    kernel: Kernel,
    /// The frame that was taken last.
    pub(super) before: Option<GpuVolume>,
    sources: GrowingBuffer,
    marks: GrowingBuffer,
    groups: GrowingBuffer,
    shifts: GrowingBuffer,
    reading: GrowingBuffer,
}

impl GpuMotionSearch {
    /// A search that keeps its frames in a store.
    ///
    /// # Errors
    /// [`GpuError::Refused`] if the driver does not take the kernel.
    pub fn new(store: &VolumeStore) -> Result<Self, GpuError> {
        let gpu = store.gpu();
        Ok(Self {
            store: store.clone(),
            kernel: Kernel::new(gpu, &shaders::SHIFTS, "find_shifts", segment_bits(gpu))?,
            before: None,
            sources: GrowingBuffer::new("blocks that are looked for"),
            marks: GrowingBuffer::new("marks of voxels"),
            groups: GrowingBuffer::new("groups of blocks"),
            shifts: GrowingBuffer::new("shifts"),
            reading: GrowingBuffer::for_reading("shifts to read"),
        })
    }

    /// A decoded frame, of which only the fresh blocks are copied to the GPU.
    fn upload(&self, frame: &MainReference) -> Result<GpuVolume, GpuError> {
        let (store, gpu, volume) = (self.store.clone(), self.store.gpu(), frame.volume());
        let sets = frame.decoded().sets();
        let fresh = sets.fresh.marks_in(&sets.all);
        let before = self.before.as_ref().filter(|_| fresh.contains(&false));
        let before = before.map(|before| (before.slots.get(), BlockIndex::new(&before.coords)));
        let kept = |(coord, fresh): (_, &bool)| match &before {
            Some((slots, index)) if !fresh => Some(slots[index.get(coord)? as usize]),
            _ => None,
        };
        let coords = volume.coords();
        let kept: Vec<Option<u32>> = coords.iter().copied().zip(&fresh).map(kept).collect();
        let blocks: Vec<usize> = (0..kept.len()).filter(|block| kept[*block].is_none()).collect();

        let mut pool = store.pool();
        let own = pool.take(blocks.len())?;
        pool.share(&kept.iter().copied().flatten().collect::<Vec<_>>());
        pool.write(&own, |number| volume.block(blocks[number]));
        drop(pool);
        let mut own = own.into_iter();
        let slots = kept.iter().map(|kept| kept.or_else(|| own.next()).expect("a slot for each block"));
        let slots = Arc::new(Slots::new(&store, slots.collect()));
        let mut commands = Commands::new(gpu);
        let table = Arc::new(BlockTable::new(gpu, store.insert(), coords, slots.get(), &mut commands)?);
        commands.submit()?;
        let (grid, coords) = (*volume.grid(), Arc::new(coords.to_vec()));
        // Nobody asks which voxels were observed.
        Ok(GpuVolume { store, grid, coords, slots, table, unobserved: Arc::new(BTreeMap::new()) })
    }

    /// Shifts of all groups, as many as there are.
    fn search(&mut self, frame: &MotionQuery, groups: &Groups) -> Result<Option<Vec<[f32; 3]>>, GpuError> {
        let Self { store, kernel, before: Some(before), sources, marks, groups: rows, shifts, reading } =
            self
        else {
            return Ok(None);
        };
        let (gpu, count) = (store.gpu(), frame.coords().len());
        let slots = Slots::new(store, store.pool().take(count)?);
        let blocks = frame.coords().iter().zip(slots.get());
        let blocks = blocks.map(|(coord, slot)| [coord.x, coord.y, coord.z, slot.cast_signed()]);
        let sources = sources.holding(gpu, &blocks.collect::<Vec<_>>())?;
        let words = (0..count).flat_map(|block| [frame.crossed(block), frame.unobserved(block)]);
        let marks = marks.holding(gpu, &words.flatten().copied().collect::<Vec<u64>>())?;
        let rows = rows.holding(gpu, &groups.rows)?;
        let bytes = SHIFT_BYTES * groups.rows.len() as u64;
        let shifts = shifts.of(gpu, bytes)?;
        let reading = reading.of(gpu, bytes)?;
        let truncation = u32::from(before.grid.truncation.codes().unsigned_abs());
        let buffers = [&before.table.blocks, &before.table.table, sources, marks, rows, shifts];

        let pool = store.pool();
        pool.write(slots.get(), |block| frame.samples(block));
        let mut commands = Commands::new(gpu);
        for ((log2_edge, groups), every) in groups.sizes.iter().zip(ROWS) {
            let (first, count) = (groups.start as u32, groups.len() as u32);
            let words = [truncation, first, count, *log2_edge, every, STEPS, frame.near_weight().to_bits()];
            commands.run(kernel, Some(&pool), &words, &buffers, count)?;
        }
        commands.copy(shifts, reading, bytes);
        commands.submit()?;
        drop(pool);
        let bytes = gpu.read(&[(reading, bytes)])?.remove(0);
        let component = |bytes: &[u8; 4]| f32::from_le_bytes(*bytes);
        let shift = |bytes: &[u8; SHIFT_BYTES as usize]| {
            let [x, y, z, _error] = bytes.as_chunks::<4>().0 else { return [0.0; 3] };
            [x, y, z].map(|bytes| within_limits(component(bytes)))
        };
        Ok(Some(bytes.as_chunks().0.iter().map(shift).collect()))
    }
}

impl SearchBackend for GpuMotionSearch {
    fn keep(&mut self, frame: &MainReference) -> Result<(), BackendError> {
        self.before = Some(self.upload(frame)?);
        Ok(())
    }

    fn find_shifts(&mut self, frame: &MotionQuery) -> Result<Option<Vec<BlockShifts>>, BackendError> {
        let groups = Groups::new(frame);
        let shifts = self.search(frame, &groups)?;
        Ok(shifts.map(|shifts| groups.of_blocks.iter().map(|of| of.map(|n| shifts[n as usize])).collect()))
    }
}

/// A component of a shift. A GPU's floating point is its own affair; what is no number moves nothing.
fn within_limits(component: f32) -> f32 {
    if component.is_nan() { 0.0 } else { component.clamp(-LIMIT, LIMIT) }
}

/// Blocks that move as one: cubes of 4^3, cubes of 2^3, and then each block alone.
struct Groups {
    /// Rows as the kernel has them: first block, number of blocks, the two larger groups they are in, two packed vectors.
    rows: Vec<[u32; 6]>,
    /// Base-2 logarithm of each size's edge in blocks, and which groups there are of it.
    sizes: Vec<(u32, Range<usize>)>,
    /// For each block the groups it is in, the smallest first.
    of_blocks: Vec<[u32; 3]>,
}

impl Groups {
    fn new(frame: &MotionQuery) -> Self {
        let count = frame.coords().len();
        let vectors: Vec<u32> = (0..count).map(|block| pack_vector(frame.vector_before(block))).collect();
        let (mut rows, mut sizes) = (Vec::new(), Vec::new());
        let mut of_blocks = vec![[NO_GROUP; 3]; count];
        let blocks = (0, (0..count).map(|block| block..block + 1).collect());
        for (size, (log2_edge, groups)) in frame.cubes().into_iter().chain([blocks]).enumerate() {
            let first = rows.len();
            for group in groups {
                let number = rows.len() as u32;
                let [_, small, large] = of_blocks[group.start];
                let mut before = vectors[group.clone()].iter().copied().filter(|vector| *vector != 0);
                let mut next = || before.next().unwrap_or_default();
                rows.push([group.start as u32, group.len() as u32, large, small, next(), next()]);
                of_blocks[group].iter_mut().for_each(|of| of[2 - size] = number);
            }
            sizes.push((log2_edge, first..rows.len()));
        }
        Self { rows, sizes, of_blocks }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_moves_nothing() {
        assert_eq!([f32::NAN, f32::INFINITY, -40.0, 1.25].map(within_limits), [0.0, LIMIT, -LIMIT, 1.25]);
    }
}
