//! The part of the command line that says how captures become volumes.

use super::volumes::{DepthFusion, VolumeMaker};
use crate::backend::Backend;
use crate::capture::{ContentKind, Hints};
use crate::failure::usage;
use crate::length::Length;
use crate::origin;
use crate::progress::Progress;
use crate::terms::{AxesName, BandName, FusionName, NormalsName, ProfileName, SampleAtName, SignName};
use anyhow::Result;
use glam::DVec3;
use isv::fusion::FusionSettings;
use isv::ingest::{DEFAULT_BLOCK_LIMIT, FaceTurner, MeshIngest, PointIngest, Reach};
use isv::io::{DenseAxes, DenseOptions, SampleAt};
use isv::volume::Grid;
use std::sync::Arc;

/// Share of a frame's surface that may be lost without a word.
const WORTH_A_WARNING: f64 = 0.005;

/// Half the thickness of a shell, unless told.
const OFFSET_VOXELS: f64 = 1.5;

#[derive(Debug, clap::Args)]
pub(super) struct IngestArgs {
    /// How to tell inside from outside of meshes and points
    #[arg(long, value_enum, default_value = "auto")]
    sign: SignName,
    /// Half the thickness of the shell around a surface without inside, in voxels
    #[arg(long, value_name = "VOXELS", default_value_t = OFFSET_VOXELS)]
    offset: f64,
    /// Normals of points
    #[arg(long, value_enum, default_value = "given")]
    normals: NormalsName,
    /// Place that points were seen from, in their unit and coordinates
    ///
    /// Estimated normals face it, and points without normals get estimated ones. Without it, they face the place that the file
    /// says, else the origin if the points look scanned from there, else outward.
    #[arg(long, value_name = "X,Y,Z", value_parser = origin::parse, allow_hyphen_values = true)]
    viewpoint: Option<[f64; 3]>,
    /// What a frame of depth images stands for
    #[arg(long, value_enum, default_value = "per-frame")]
    fusion: FusionName,
    /// Leave out what depth cameras saw farther away, with a unit; without it, nothing
    #[arg(long, value_name = "LENGTH")]
    max_depth: Option<Length>,
    /// Order of the axes of a dense field (.npy, .npz) [default: zyx]
    #[arg(long, value_enum)]
    axes: Option<AxesName>,
    /// Place of a dense field's samples in their voxels [default: centre]
    #[arg(long, value_enum)]
    sample_at: Option<SampleAtName>,
    /// Length that a value of 1 in a dense field stands for [default: auto]
    ///
    /// In fields of integers it is the length of the largest one: 127 or 32767. Without it, the file says, or the values do by how
    /// fast they grow: metres, voxels or truncation distances.
    #[arg(long, value_name = "LENGTH")]
    tsdf_scale: Option<Length>,
    /// Refuse frames that need more blocks
    #[arg(long, value_name = "N", default_value_t = DEFAULT_BLOCK_LIMIT)]
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
            ("--offset", !depth, self.offset != OFFSET_VOXELS),
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

    /// How meshes become volumes on a grid, of the whole band.
    pub(super) fn of_meshes(&self, grid: Grid) -> MeshIngest {
        let (sign, offset_voxels, max_blocks) = (self.sign.into(), self.offset, self.max_blocks);
        MeshIngest { sign, offset_voxels, max_blocks, ..MeshIngest::new(grid) }
    }

    /// How points become volumes on a grid.
    pub(super) fn of_points(&self, grid: Grid) -> PointIngest {
        let (sign, offset_voxels, max_blocks) = (self.sign.into(), self.offset, self.max_blocks);
        PointIngest { grid, sign, offset_voxels, max_blocks }
    }

    /// Depth up to which readings count, in metres; infinite unless it was given.
    pub(super) fn max_depth_m(&self) -> f64 {
        self.max_depth.map_or(f64::INFINITY, Length::metres)
    }

    /// What makes volumes on a grid, as far from the surface as is coded. `backend`: who does it, as far as it can.
    pub(super) fn volume_maker(
        &self,
        grid: Grid,
        profile: ProfileName,
        band: Option<BandName>,
        backend: Backend,
        progress: Arc<Progress>,
        hints: &Hints,
    ) -> Result<VolumeMaker> {
        let (unit, origin_m) = (hints.unit, DVec3::from(hints.origin_m));
        let (offset_voxels, max_blocks) = (self.offset, self.max_blocks);
        let truncation = grid.truncation.voxels();
        if !(offset_voxels > 0.0 && offset_voxels <= f64::from(truncation)) {
            return Err(usage(format!(
                "--offset {offset_voxels}: it must be above 0 and at most the truncation of {truncation} voxels"
            )));
        }
        let reach = match (profile, band) {
            (ProfileName::Main, None | Some(BandName::Surface)) => Reach::Surface,
            _ => Reach::Band,
        };
        let max_depth_m = self.max_depth_m();
        let settings = FusionSettings { max_depth_m, max_blocks, ..FusionSettings::new(grid) };
        Ok(VolumeMaker {
            backend,
            mesh: MeshIngest { reach, ..self.of_meshes(grid) },
            mesh_ingester: None,
            mesh_sign: None,
            face_turner: FaceTurner::default(),
            turning_said: false,
            loss_said: WORTH_A_WARNING / 2.0,
            points: self.of_points(grid),
            point_sign: None,
            normals: self.normals,
            unit,
            viewpoint_m: self.viewpoint.map(|place| DVec3::from(place) * unit.metres() - origin_m),
            scan_origin_m: -origin_m,
            sides_said: false,
            depth: DepthFusion { mode: self.fusion, settings, fuser: None },
            band: match profile {
                ProfileName::Main => BandName::Full,
                ProfileName::Paper => band.unwrap_or(BandName::Full),
            },
            extended: profile == ProfileName::Main,
            progress,
            shell: Arc::default(),
        })
    }
}
