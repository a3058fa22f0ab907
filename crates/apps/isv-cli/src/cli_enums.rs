//! Names on the command line for what the libraries enumerate. The comments of values are their help.

use clap::ValueEnum;
use isv::raw::decode::Lod;
use isv::raw::encode::{Band, MotionMode, Preset, Refresh};
use isv::raw::format::{MaskCoding, Prediction};
use isv::raw::ingest::SignMode;
use isv::raw::io::{DenseAxes, GlbEncoding, SampleAt};
use isv::raw::take::Up;
use isv::raw::take::decode::Form;
use isv::raw::take::encode::{FusionMode, Normals, ProfileChoice, TimestampSource};
use isv::raw::take::metadata::MetadataChoice;
use isv::raw::take::stream::AfterLoss;
use isv_render::{Background, NormalKind, PictureFormat, Shading};

/// An enumeration of the command line, each value with what it means to a library.
macro_rules! cli_enum {
    ($(#[$meta:meta])* $name:ident for $target:ty {
        $($(#[$value_meta:meta])* $value:ident => $means:expr,)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub(crate) enum $name {
            $($(#[$value_meta])* $value,)+
        }

        impl From<$name> for $target {
            fn from(name: $name) -> Self {
                match name {
                    $($name::$value => $means,)+
                }
            }
        }
    };
}

cli_enum! {
    /// `--profile`
    ProfileName for ProfileChoice {
        /// The codec as the paper describes it
        Paper => ProfileChoice::Paper,
        /// The tools that compress best
        Main => ProfileChoice::Main,
    }
}

cli_enum! {
    /// `--as`
    FormName for Form {
        /// A triangle mesh of the surface
        Mesh => Form::Mesh,
        /// Points spread evenly over the surface
        Points => Form::Points,
        /// The truncated signed distances themselves
        Volume => Form::Volume,
    }
}

cli_enum! {
    /// `--lod`
    LodName for Lod {
        /// Full resolution
        #[value(name = "1")]
        Full => Lod::Full,
        /// Voxels twice as large
        #[value(name = "2")]
        Half => Lod::Half,
        /// Voxels four times as large
        #[value(name = "4")]
        Quarter => Lod::Quarter,
    }
}

cli_enum! {
    /// `--glb`
    GlbName for GlbEncoding {
        /// Single-precision numbers, which every program reads
        Plain => GlbEncoding::Plain,
        /// Integers of 16 and 8 bits (KHR_mesh_quantization)
        Quantized => GlbEncoding::Quantized,
        /// Integers, compressed (EXT_meshopt_compression)
        Meshopt => GlbEncoding::Meshopt,
    }
}

cli_enum! {
    /// `--motion`
    MotionName for MotionMode {
        /// Code every frame by itself
        None => MotionMode::Fixed(Prediction::None),
        /// Predict each block from the same place
        Zero => MotionMode::Fixed(Prediction::ZeroMotion),
        /// Predict each block from a shifted place
        #[value(name = "3dof")]
        ThreeDof => MotionMode::Fixed(Prediction::ThreeDof),
        /// Predict each block from a shifted and turned place
        #[value(name = "6dof")]
        SixDof => MotionMode::Fixed(Prediction::SixDof),
        /// Whichever takes the fewest bytes, frame by frame; takes as long as all of them
        Auto => MotionMode::Auto,
    }
}

cli_enum! {
    /// `--masks`
    MasksName for MaskCoding {
        /// By cell: fewest bytes and the same surface. Needs format 2, and hides some observed voxels
        Cells => MaskCoding::Cells,
        /// By voxel: exact, and for readers of format 1
        Voxels => MaskCoding::Voxels,
    }
}

cli_enum! {
    /// `--after-loss`
    AfterLossName for AfterLoss {
        /// End there, and say what is wrong
        Stop => AfterLoss::Stop,
        /// Show the last frame for every frame that is lost. Go on at the next keyframe, or at the next frame that can be read
        /// without those before it
        Hold => AfterLoss::Hold,
    }
}

cli_enum! {
    /// `--refresh`
    RefreshName for Refresh {
        /// At keyframes, one every --gop frames
        Keyframes => Refresh::Keyframes,
        /// A part of each frame anew, all of it within --gop frames; only the first frame is a keyframe. For live streams over
        /// lossy channels, without bursts of keyframes
        Gradual => Refresh::Gradual,
    }
}

cli_enum! {
    /// `--preset`
    PresetName for Preset {
        /// Fast enough for a person as she is captured
        Realtime => Preset::Realtime,
        /// A good size for the time
        Balanced => Preset::Balanced,
        /// The smallest, however long it takes
        Archive => Preset::Archive,
    }
}

cli_enum! {
    /// `--timestamps`
    TimestampsName for TimestampSource {
        /// When the frame was taken, where the capture says: time stamps, times of scans, numbers and times in names, an .isv file
        Source => TimestampSource::Source,
        /// One frame after the other at the frame rate
        Rate => TimestampSource::Rate,
        /// When the frame was read, in nanoseconds since 1970: live viewers see how late they are
        Clock => TimestampSource::Clock,
    }
}

cli_enum! {
    /// `--metadata`
    MetadataName for MetadataChoice {
        /// Streams with colour, and those with a title or a capture device
        Auto => MetadataChoice::Auto,
        /// Any stream
        Always => MetadataChoice::Always,
        /// None
        Never => MetadataChoice::Never,
    }
}

cli_enum! {
    /// `--band`
    BandName for Band {
        /// Only the blocks that the surface needs: the mesh is the same, the volume ends close to it
        Surface => Band::Surface,
        /// All blocks within the truncation of the surface, as the paper has it
        Full => Band::Full,
    }
}

cli_enum! {
    /// `--normals` of points
    NormalsName for Normals {
        /// Normals of the points, if they have any
        Given => Normals::Given,
        /// Planes through neighbouring points, turned to where the scanner was if the file says, or else outward
        Estimate => Normals::Estimate,
    }
}

cli_enum! {
    /// `--axes`
    AxesName for DenseAxes {
        /// field[z, y, x]
        Zyx => DenseAxes::Zyx,
        /// field[x, y, z]
        Xyz => DenseAxes::Xyz,
    }
}

cli_enum! {
    /// `--sample-at`
    SampleAtName for SampleAt {
        /// In the middle of its voxel
        Centre => SampleAt::Centre,
        /// At the lowest corner of its voxel
        Corner => SampleAt::Corner,
    }
}

cli_enum! {
    /// `--fusion`
    FusionName for FusionMode {
        /// A frame is what its cameras saw: things move
        PerFrame => FusionMode::PerFrame,
        /// A frame is all that was seen so far: the camera moves and the scene stands still
        Accumulate => FusionMode::Accumulate,
    }
}

cli_enum! {
    /// `--sign`
    SignName for SignMode {
        /// Part by part: closed parts have an inside, open ones are single sheets. Profile `paper`: as the paper has it, closed or offset
        Auto => SignMode::Auto,
        /// The surface has an inside
        Closed => SignMode::Closed,
        /// It has none: code a thin shell around it
        Offset => SignMode::Offset,
        /// Single sheets for open parts from the first frame on
        Sheet => SignMode::Sheet,
    }
}

cli_enum! {
    /// `--up`
    UpName for Up {
        /// Y, as in most meshes and in glTF
        #[value(name = "y")]
        Y => Up::Y,
        /// Z, as in Blender, CAD, surveys and ROS
        #[value(name = "z")]
        Z => Up::Z,
        /// X
        #[value(name = "x")]
        X => Up::X,
        /// Down is Y, as in the frame of a depth camera
        #[value(name = "-y")]
        MinusY => Up::MinusY,
        /// Down is Z
        #[value(name = "-z")]
        MinusZ => Up::MinusZ,
        /// Down is X
        #[value(name = "-x")]
        MinusX => Up::MinusX,
    }
}

cli_enum! {
    /// `--format` of pictures
    PictureFormatName for PictureFormat {
        /// A still: one picture, or a contact sheet of several
        Png => PictureFormat::Png,
        /// An animation, 256 colours a picture
        Gif => PictureFormat::Gif,
        /// An animation in all colours
        Apng => PictureFormat::Apng,
    }
}

/// Look of a surface: what its colours mean, and the normals that light falls on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Look {
    pub(crate) shading: Shading,
    pub(crate) normals: NormalKind,
}

impl Look {
    /// The look of a sequence for which none was asked: its colours if it has any, else its normals.
    pub(crate) fn of_sequence(has_colours: bool) -> Self {
        Self::smooth(if has_colours { Shading::Colour } else { Shading::Normals })
    }

    fn smooth(shading: Shading) -> Self {
        Self { shading, normals: NormalKind::Smooth }
    }
}

cli_enum! {
    /// `--shade`
    ShadeName for Look {
        /// Colours of the input as they are
        Colour => Look::smooth(Shading::Colour),
        /// Colours of the input in soft light
        Lit => Look::smooth(Shading::LitColour),
        /// Grey in soft light
        Shaded => Look::smooth(Shading::Shaded),
        /// Vertex normals as colours
        #[value(alias = "smooth")]
        Normals => Look::smooth(Shading::Normals),
        /// Face normals as colours: the triangles show
        Flat => Look { shading: Shading::Normals, normals: NormalKind::Flat },
    }
}

cli_enum! {
    /// `--background`
    BackgroundName for Background {
        /// Nearly white
        Light => Background::Light,
        /// Nearly black
        Dark => Background::Dark,
        /// Nothing
        Transparent => Background::Transparent,
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
