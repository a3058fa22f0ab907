//! Names that users write and read for the codec's choices.

use clap::ValueEnum;
use isv::raw::decode::Lod;
use isv::raw::encode::{Band, MotionMode, Preset, Refresh};
use isv::raw::format::Prediction;
use isv::raw::ingest::SignMode;
use isv::raw::io::{DenseAxes, GlbEncoding, SampleAt};
use isv::raw::take::Up;
use isv::raw::take::encode::{FusionMode, Normals, ProfileChoice, TimestampSource};

/// `--profile`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProfileName {
    /// The codec as the paper describes it
    Paper,
    /// The tools that compress best
    Main,
}

/// `--as`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormName {
    /// A triangle mesh of the surface
    Mesh,
    /// Points spread evenly over the surface
    Points,
    /// The truncated signed distances themselves
    Volume,
}

/// `--lod`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum LodName {
    /// Full resolution
    #[value(name = "1")]
    Full,
    /// Voxels twice as large
    #[value(name = "2")]
    Half,
    /// Voxels four times as large
    #[value(name = "4")]
    Quarter,
}

/// `--glb`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GlbName {
    /// Single-precision numbers, which every program reads
    Plain,
    /// Integers of 16 and 8 bits (KHR_mesh_quantization)
    Quantized,
    /// Integers, compressed (EXT_meshopt_compression)
    Meshopt,
}

/// `--motion`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MotionName {
    /// Code every frame by itself
    None,
    /// Predict each block from the same place
    Zero,
    /// Predict each block from a shifted place
    #[value(name = "3dof")]
    ThreeDof,
    /// Predict each block from a shifted and turned place
    #[value(name = "6dof")]
    SixDof,
    /// Whichever takes the fewest bytes, frame by frame; takes as long as all of them
    Auto,
}

/// `--after-loss`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AfterLossName {
    /// End there, and say what is wrong
    Stop,
    /// Show the last frame for every frame that is lost, and go on at the next keyframe, or at the next frame that can be read
    /// without those before it
    Hold,
}

/// `--refresh`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum RefreshName {
    /// At keyframes, one every --gop frames
    Keyframes,
    /// A part of each frame anew, all of it within --gop frames: for live streams over lossy channels, without bursts of
    /// keyframes; only the first frame is one
    Gradual,
}

impl From<RefreshName> for Refresh {
    fn from(name: RefreshName) -> Self {
        match name {
            RefreshName::Keyframes => Self::Keyframes,
            RefreshName::Gradual => Self::Gradual,
        }
    }
}

/// `--preset`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PresetName {
    /// Fast enough for a person as she is captured
    Realtime,
    /// A good size for the time
    Balanced,
    /// The smallest, however long it takes
    Archive,
}

/// `--timestamps`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TimestampsName {
    /// When the frame was taken, where the capture says: time stamps, times of scans, numbers and times in names, an .isv file
    Source,
    /// One frame after the other at the frame rate
    Rate,
    /// When the frame was read, in nanoseconds since 1970: live viewers see how late they are
    Clock,
}

/// `--band`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BandName {
    /// Only the blocks that the surface needs: the mesh is the same, the volume ends close to it
    Surface,
    /// All blocks within the truncation of the surface, as the paper has it
    Full,
}

/// `--normals` of points
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum NormalsName {
    /// Those of the points, if they have any
    Given,
    /// Planes through neighbouring points, turned to where the scanner was if the file says, or else outward
    Estimate,
}

/// `--axes`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AxesName {
    /// field[z, y, x]
    Zyx,
    /// field[x, y, z]
    Xyz,
}

impl From<AxesName> for DenseAxes {
    fn from(name: AxesName) -> Self {
        match name {
            AxesName::Zyx => Self::Zyx,
            AxesName::Xyz => Self::Xyz,
        }
    }
}

/// `--sample-at`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SampleAtName {
    /// In the middle of its voxel
    Centre,
    /// At the lowest corner of its voxel
    Corner,
}

impl From<SampleAtName> for SampleAt {
    fn from(name: SampleAtName) -> Self {
        match name {
            SampleAtName::Centre => Self::Centre,
            SampleAtName::Corner => Self::Corner,
        }
    }
}

/// `--fusion`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FusionName {
    /// A frame is what its cameras saw: things move
    PerFrame,
    /// A frame is all that was seen so far: the camera moves and the scene stands still
    Accumulate,
}

/// `--sign`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SignName {
    /// Look at the first frame and choose
    Auto,
    /// The surface has an inside
    Closed,
    /// It has none: code a thin shell around it
    Offset,
}

impl From<MotionName> for MotionMode {
    fn from(name: MotionName) -> Self {
        match name {
            MotionName::None => Self::Fixed(Prediction::None),
            MotionName::Zero => Self::Fixed(Prediction::ZeroMotion),
            MotionName::ThreeDof => Self::Fixed(Prediction::ThreeDof),
            MotionName::SixDof => Self::Fixed(Prediction::SixDof),
            MotionName::Auto => Self::Auto,
        }
    }
}

impl From<PresetName> for Preset {
    fn from(name: PresetName) -> Self {
        match name {
            PresetName::Realtime => Self::Realtime,
            PresetName::Balanced => Self::Balanced,
            PresetName::Archive => Self::Archive,
        }
    }
}

impl From<LodName> for Lod {
    fn from(name: LodName) -> Self {
        match name {
            LodName::Full => Self::Full,
            LodName::Half => Self::Half,
            LodName::Quarter => Self::Quarter,
        }
    }
}

impl From<GlbName> for GlbEncoding {
    fn from(name: GlbName) -> Self {
        match name {
            GlbName::Plain => Self::Plain,
            GlbName::Quantized => Self::Quantized,
            GlbName::Meshopt => Self::Meshopt,
        }
    }
}

impl From<SignName> for SignMode {
    fn from(name: SignName) -> Self {
        match name {
            SignName::Auto => Self::Auto,
            SignName::Closed => Self::Closed,
            SignName::Offset => Self::Offset,
        }
    }
}

impl FormName {
    /// All forms.
    pub(crate) const ALL: [Self; 3] = [Self::Mesh, Self::Points, Self::Volume];

    /// The form in a sentence.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mesh => "meshes",
            Self::Points => "points",
            Self::Volume => "volumes",
        }
    }
}

/// The name of a kind of prediction.
pub(crate) fn prediction(prediction: Prediction) -> &'static str {
    match prediction {
        Prediction::None => "none",
        Prediction::ZeroMotion => "zero",
        Prediction::ThreeDof => "3dof",
        Prediction::SixDof => "6dof",
    }
}

/// `--up`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum UpName {
    /// Y, as in most meshes and in glTF
    #[default]
    #[value(name = "y")]
    Y,
    /// Z, as in Blender, CAD, surveys and ROS
    #[value(name = "z")]
    Z,
    /// X
    #[value(name = "x")]
    X,
    /// Down is Y, as in the frame of a depth camera
    #[value(name = "-y")]
    MinusY,
    /// Down is Z
    #[value(name = "-z")]
    MinusZ,
    /// Down is X
    #[value(name = "-x")]
    MinusX,
}

impl From<UpName> for Up {
    fn from(name: UpName) -> Self {
        match name {
            UpName::Y => Self::Y,
            UpName::Z => Self::Z,
            UpName::X => Self::X,
            UpName::MinusY => Self::MinusY,
            UpName::MinusZ => Self::MinusZ,
            UpName::MinusX => Self::MinusX,
        }
    }
}

impl From<ProfileName> for ProfileChoice {
    fn from(name: ProfileName) -> Self {
        match name {
            ProfileName::Paper => Self::Paper,
            ProfileName::Main => Self::Main,
        }
    }
}

impl From<BandName> for Band {
    fn from(name: BandName) -> Self {
        match name {
            BandName::Surface => Self::Surface,
            BandName::Full => Self::Full,
        }
    }
}

impl From<NormalsName> for Normals {
    fn from(name: NormalsName) -> Self {
        match name {
            NormalsName::Given => Self::Given,
            NormalsName::Estimate => Self::Estimate,
        }
    }
}

impl From<FusionName> for FusionMode {
    fn from(name: FusionName) -> Self {
        match name {
            FusionName::PerFrame => Self::PerFrame,
            FusionName::Accumulate => Self::Accumulate,
        }
    }
}

impl From<TimestampsName> for TimestampSource {
    fn from(name: TimestampsName) -> Self {
        match name {
            TimestampsName::Source => Self::Source,
            TimestampsName::Rate => Self::Rate,
            TimestampsName::Clock => Self::Clock,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_the_names_of_the_library() {
        for name in UpName::value_variants() {
            let shown = name.to_possible_value().unwrap();
            assert_eq!(shown.get_name(), Up::from(*name).name());
        }
    }
}
