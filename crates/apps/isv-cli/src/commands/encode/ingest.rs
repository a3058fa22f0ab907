//! The part of the command line that says how captures become volumes.

use crate::cli_enums::{AxesName, FusionName, NormalsName, SampleAtName, SignName};
use crate::origin;
use isv::raw::ingest::DEFAULT_BLOCK_LIMIT;
use isv::raw::io::{DenseAxes, DenseOptions, SampleAt};
use isv::raw::take::Length;
use isv::raw::take::capture::ContentKind;
use isv::raw::take::encode::{DEFAULT_OFFSET_VOXELS, FieldOptions};

#[derive(Debug, clap::Args)]
pub(super) struct IngestArgs {
    /// How to tell inside from outside of meshes and points
    #[arg(help_heading = "Surface", long, value_enum, default_value = "auto")]
    sign: SignName,
    /// Half the thickness of the shell around an open surface, in voxels
    #[arg(help_heading = "Surface", long, value_name = "VOXELS", default_value_t = DEFAULT_OFFSET_VOXELS)]
    offset: f64,
    /// Normals of points
    #[arg(help_heading = "Points, depth images and fields", long, value_enum, default_value = "given")]
    normals: NormalsName,
    /// Place that points were seen from, in their unit and coordinates
    ///
    /// Estimated normals face it, and points without normals get estimated ones. Without it, they face the place
    /// that the file says, else the origin if the points look scanned from there, else outward.
    #[arg(help_heading = "Points, depth images and fields", long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    viewpoint: Option<[f64; 3]>,
    /// What a frame of depth images stands for
    #[arg(help_heading = "Points, depth images and fields", long, value_enum, default_value = "per-frame")]
    fusion: FusionName,
    /// Leave out what depth cameras saw farther away [default: nothing]
    #[arg(help_heading = "Points, depth images and fields", long, value_name = "LENGTH")]
    max_depth: Option<Length>,
    /// Order of the axes of a dense field (.npy, .npz) [default: zyx]
    #[arg(help_heading = "Points, depth images and fields", long, value_enum)]
    axes: Option<AxesName>,
    /// Place of a dense field's samples in their voxels [default: centre]
    #[arg(help_heading = "Points, depth images and fields", long, value_enum)]
    sample_at: Option<SampleAtName>,
    /// Length that a value of 1 in a dense field stands for [default: auto]
    ///
    /// In fields of integers it is the length of the largest one: 127 or 32767. Without it, the file says, or the
    /// values do by how fast they grow: metres, voxels or truncation distances.
    #[arg(help_heading = "Points, depth images and fields", long, value_name = "LENGTH")]
    tsdf_scale: Option<Length>,
    /// Refuse frames that need more blocks
    #[arg(help_heading = "Running", long, value_name = "N", default_value_t = DEFAULT_BLOCK_LIMIT)]
    max_blocks: usize,
}

impl IngestArgs {
    /// How dense fields are read.
    pub(super) fn dense(&self) -> DenseOptions {
        DenseOptions {
            axes: self.axes.map(DenseAxes::from).unwrap_or_default(),
            sample_at: self.sample_at.map(SampleAt::from).unwrap_or_default(),
            scale_m: self.tsdf_scale.map(Length::metres),
        }
    }

    /// What was asked for and has no effect on frames of a kind.
    pub(super) fn without_effect(
        &self,
        content: ContentKind,
        is_dense: bool,
    ) -> impl Iterator<Item = &'static str> {
        let (points, depth) = (content == ContentKind::Geometry, content == ContentKind::Depth);
        let flags = [
            // A volume on another grid becomes a mesh in between.
            ("--sign", !depth, self.sign != SignName::Auto),
            ("--offset", !depth, self.offset != DEFAULT_OFFSET_VOXELS),
            ("--normals", points, self.normals != NormalsName::Given),
            ("--viewpoint", points, self.viewpoint.is_some()),
            ("--fusion", depth, self.fusion != FusionName::PerFrame),
            ("--max-depth", depth, self.max_depth.is_some()),
            ("--axes", is_dense, self.axes.is_some()),
            ("--sample-at", is_dense, self.sample_at.is_some()),
            ("--tsdf-scale", is_dense, self.tsdf_scale.is_some()),
        ];
        flags.into_iter().filter(|(_, has_effect, given)| *given && !has_effect).map(|(flag, ..)| flag)
    }

    /// How captures become volumes.
    pub(super) fn options(&self) -> FieldOptions {
        FieldOptions {
            sign: self.sign.into(),
            offset_voxels: self.offset,
            normals: self.normals.into(),
            viewpoint: self.viewpoint,
            fusion: self.fusion.into(),
            max_depth: self.max_depth,
            max_blocks: self.max_blocks,
        }
    }
}
