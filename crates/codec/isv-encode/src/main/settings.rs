//! What the encoder of profile `main` is told.

use super::motion_search::SearchEffort;
use super::rate_control::RateTarget;
use super::refresh::Refresh;
use super::tools::Tools;
use isv_format::MainFrameHeader;
use isv_kernels::quant::STEP_FRACTION_BITS;
use isv_volume::CODES_PER_VOXEL;

/// Which blocks are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Band {
    /// Blocks that the surface touches. The decoder extrapolates the field beyond them.
    Surface,
    /// All of the volume's.
    Full,
}

/// How much a frame may be distorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameQuality {
    /// Quantizer step of the orthonormal transform in voxels.
    pub step: f32,
    /// Lambda over the step squared: weighted squared steps of error that a bit is worth.
    pub lambda: f32,
}

impl FrameQuality {
    /// Lambda that goes well with any step, between keyframes.
    const LAMBDA: f32 = 0.05;

    /// Steps of the qualities 0 and 100, in voxels.
    const STEP_OF_0: f32 = 6.5;
    const STEP_OF_100: f32 = 0.5;

    /// The quality of a step.
    #[must_use]
    pub fn of_step(step: f32) -> Self {
        Self { step, lambda: Self::LAMBDA }
    }

    /// The step of a quality from 0 to 100: 6.5 voxels to 0.5 voxel, geometrically, as eyes judge by ratios. 50 is 1.8
    /// voxels.
    #[must_use]
    pub fn of_quality(quality: f32) -> Self {
        let share = quality.clamp(0.0, 100.0) / 100.0;
        Self::of_step(Self::STEP_OF_0 * (Self::STEP_OF_100 / Self::STEP_OF_0).powf(share))
    }

    /// Quality, 0 to 100, whose step is nearest.
    #[must_use]
    pub fn to_quality(self) -> f32 {
        let share = (self.step / Self::STEP_OF_0).ln() / (Self::STEP_OF_100 / Self::STEP_OF_0).ln();
        (100.0 * share).clamp(0.0, 100.0)
    }

    /// The step as it is coded.
    pub(super) fn code(self) -> u32 {
        let unit = (CODES_PER_VOXEL << STEP_FRACTION_BITS) as f32;
        ((self.step * unit).round() as u32).clamp(1, MainFrameHeader::MAX_STEP)
    }
}

/// Choices of the encoder of profile `main`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MainSettings {
    /// How much frames may be distorted, where no rate and no error is aimed at.
    pub quality: FrameQuality,
    /// What the steps of frames are chosen for.
    pub target: RateTarget,
    /// Which blocks are coded.
    pub band: Band,
    /// Which tools are used.
    pub tools: Tools,
    /// How many vectors of a block are coded to see what they cost, 1 or more.
    pub trials: usize,
    /// How thoroughly motion is searched for.
    pub effort: SearchEffort,
    /// Strength of the in-loop filter in sixty-fourths, and the most that it changes, in codes.
    pub filter: (u8, u8),
    /// Whether vectors count half voxels and not quarters.
    pub half_voxel_vectors: bool,
    /// Whether several strengths of the filter are tried on each frame, to keep the best.
    pub filter_search: bool,
    /// Whether levels are searched from several starts, under the models' own bits, and each is given up to see if the others
    /// do without it. Some ten times the work.
    pub refinement: bool,
    /// Lambda of keyframes, whose errors stay until the next one, over that of other frames.
    pub keyframe_lambda: f32,
    /// Slices of a frame, where the encoder's settings do not say.
    pub slices: u16,
    /// How decoders that lost something come to have all again. With [`Refresh::Gradual`] a GOP is a cycle of it.
    pub refresh: Refresh,
}

impl Default for MainSettings {
    fn default() -> Self {
        Self {
            quality: FrameQuality::of_step(1.8),
            target: RateTarget::Constant,
            band: Band::Surface,
            tools: Tools::ALL,
            trials: 2,
            effort: SearchEffort::THOROUGH,
            filter: (13, 38),
            half_voxel_vectors: true,
            filter_search: false,
            refinement: false,
            keyframe_lambda: 0.24,
            slices: 1,
            refresh: Refresh::Keyframes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qualities_come_back_from_their_steps() {
        for quality in [0.0, 12.5, 50.0, 77.7, 100.0] {
            assert!((FrameQuality::of_quality(quality).to_quality() - quality).abs() < 1e-3, "{quality}");
        }
    }
}
