//! Captures to streams.

mod auto_voxel;
mod coding;
mod describe;
mod error;
mod event;
mod frames;
mod groups;
mod job;
mod options;
mod settle;
mod spacing;
mod timestamps;
mod two_pass;
mod volumes;

pub use describe::MetadataOptions;
pub use error::{CaptureError, EncodeError, FrameError, OptionName, OptionsError};
pub use event::EncodeEvent;
pub use frames::FrameEncoder;
pub use job::{FrameReport, Job, Report, Unfinished, UnfinishedStream};
pub use options::{
    ColourOptions, DEFAULT_OFFSET_VOXELS, EncodeOptions, FieldOptions, FusionMode, MainOptions, Normals,
    PaperOptions, ProfileChoice, VoxelChoice, default_grid,
};
pub use settle::{Settled, settle};
pub use timestamps::TimestampSource;
pub use two_pass::Watch;
