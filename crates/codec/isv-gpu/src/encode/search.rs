//! Motion of every block (Sec. 3.5, Eq. 12 to 14).

use super::tools::EncodeTools;
use crate::commands::Commands;
use crate::decode::resources::DecodeResources;
use crate::{GpuError, GpuPaperFrame, GpuVolume};
use isv_kernels::warp::{MotionVector, ROTATION_LIMIT};
use isv_volume::BlockEdge;

/// Bytes of a vector as kernels write it.
const VECTOR_BYTES: u64 = 8;
/// Words of `SearchParameters::angles`.
const ANGLE_WORDS: usize = 36;

impl DecodeResources {
    /// One vector a block; zero for those without a reference.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn search_motion(
        &mut self,
        rotates: bool,
        source: &GpuVolume,
        references: &[Option<u32>],
        before: &GpuPaperFrame,
    ) -> Result<Vec<MotionVector>, GpuError> {
        let gpu = self.store.gpu();
        let tools = EncodeTools::of(&mut self.encoding, gpu)?;
        let count = references.len() as u32;
        let bytes = VECTOR_BYTES * u64::from(count);
        let has_reference: Vec<u32> = references.iter().map(|r| u32::from(r.is_some())).collect();
        let has_reference = tools.references.holding(gpu, &has_reference)?;
        let vectors = tools.vectors.of(gpu, bytes)?;
        let reading = tools.reading.of(gpu, bytes)?;
        let truncation = u32::from(source.grid.truncation.codes().unsigned_abs());
        let words = [&[truncation, count, rotates.into(), 0], &angles()[..]].concat();
        let (from, to) = (&before.volume.table, &source.table);
        let buffers = [&from.blocks, &from.table, &to.blocks, has_reference, vectors];
        let mut commands = Commands::new(gpu);
        commands.run(&tools.search, Some(&self.store.pool()), &words, &buffers, count)?;
        commands.copy(vectors, reading, bytes);
        commands.submit()?;
        let bytes = gpu.read(&[(reading, bytes)])?.remove(0);
        Ok(bytes.as_chunks::<8>().0.iter().map(unpack_vector).collect())
    }
}

/// Sine and cosine of each size of a rotation, times 2^14: the sine in the lower half of a word.
fn angles() -> [u32; ANGLE_WORDS] {
    let mut words = [0; ANGLE_WORDS];
    for (steps, word) in (0..=ROTATION_LIMIT as i8).zip(&mut words) {
        let rotation = [steps, 0, 0];
        // About x alone the matrix has them as they are.
        let [_, [_, cosine, _], [_, sine, _]] =
            MotionVector { translation: [0; 3], rotation }.rotation_matrix();
        *word = sine.cast_unsigned() | cosine.cast_unsigned() << 16;
    }
    words
}

/// A vector as kernels write it: a byte a component, translation and then rotation, each in four bytes.
fn unpack_vector(bytes: &[u8; 8]) -> MotionVector {
    let [translation, rotation] =
        [0, 4].map(|at| [bytes[at], bytes[at + 1], bytes[at + 2]].map(u8::cast_signed));
    let vector = MotionVector { translation, rotation };
    // A GPU's floating point is its own affair; what cannot be coded moves nothing.
    if vector.in_range(BlockEdge::E8) { vector } else { MotionVector::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_decoder() {
        for (steps, word) in (0..=ROTATION_LIMIT as i8).zip(angles()) {
            let angle = f64::from(steps) / 32.0;
            let (sine, cosine) = (word as u16 as i16, (word >> 16) as u16 as i16);
            assert_eq!(f64::from(sine), (16384.0 * angle.sin()).round());
            assert_eq!(f64::from(cosine), (16384.0 * angle.cos()).round());
        }
    }

    #[test]
    fn vectors_that_cannot_be_coded_move_nothing() {
        let vector = MotionVector { translation: [28, -28, 3], rotation: [-32, 32, -1] };
        assert_eq!(unpack_vector(&[28, 228, 3, 0, 224, 32, 255, 0]), vector);
        assert_eq!(unpack_vector(&[29, 228, 3, 0, 224, 32, 255, 0]), MotionVector::ZERO);
        assert_eq!(unpack_vector(&[28, 228, 3, 0, 128, 32, 255, 0]), MotionVector::ZERO);
    }
}
