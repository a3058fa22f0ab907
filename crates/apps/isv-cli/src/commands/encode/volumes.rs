//! Captured frames to volumes: the part of encoding before the codec.

use crate::backend::{self, Backend};
use crate::capture::{CapturedFrame, Content};
use crate::length::Length;
use crate::memory;
use crate::progress::Progress;
use crate::stats::timed;
use crate::stream;
use crate::terms::{BandName, FusionName, NormalsName};
use anyhow::{Context, Result, anyhow, bail};
use glam::DVec3;
use isv::fusion::{FusionError, FusionSettings};
use isv::gpu::{AnyAccumulator, AnyFusion, AnyMeshIngester, GpuIngestError};
use isv::ingest::{
    FaceTurner, IngestError, MeshIngest, NormalSides, PointEvidence, PointIngest, PointSign, SideEvidence,
    SignDecision, SignEvidence, SignMode, decide_point_sign, decide_sign, estimate_normals_seen_from,
    ingest_points, lost_share,
};
use isv::io::{Geometry, Unit};
use isv::surface::{SurfaceOptions, surface_band};
use isv::volume::{DepthImage, FitError, Grid, PointCloud, SparseVolume, TriangleMesh};
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};
use std::time::SystemTime;

/// Share of the points whose side is a guess, above which that is said.
const WORTH_A_WORD: f64 = 0.05;

/// A frame ready to be encoded.
pub(super) struct IngestedFrame {
    /// Its number in the capture.
    pub(super) number: usize,
    /// When it had been read.
    pub(super) read: SystemTime,
    /// Of [`CapturedFrame`].
    pub(super) timestamp_ns: Option<u64>,
    pub(super) volume: SparseVolume,
    /// Whether any of it lies inside.
    pub(super) has_surface: bool,
    /// Blocks that ingest made, before any were left out: those of the truncation band, or as many as are near the surface.
    pub(super) blocks_band: usize,
    pub(super) ingest_ms: f64,
}

/// Makes volumes; what is decided on the first frame holds for all.
pub(super) struct VolumeMaker {
    pub(super) backend: Backend,
    pub(super) mesh: MeshIngest,
    /// Opened for the first mesh.
    pub(super) mesh_ingester: Option<AnyMeshIngester>,
    pub(super) mesh_sign: Option<SignDecision>,
    pub(super) face_turner: FaceTurner,
    /// Whether it was said that faces disagree.
    pub(super) turning_said: bool,
    /// Share of a frame's surface up to half of what is worth a warning.
    pub(super) loss_said: f64,
    pub(super) points: PointIngest,
    pub(super) point_sign: Option<PointSign>,
    pub(super) normals: NormalsName,
    /// Unit of the input's coordinates.
    pub(super) unit: Unit,
    /// Place that points were seen from, in metres, if the user gives it.
    pub(super) viewpoint_m: Option<DVec3>,
    /// The origin of the input's coordinates, in metres, where scanners often stand.
    pub(super) scan_origin_m: DVec3,
    /// Whether a word was said on the sides of normals.
    pub(super) sides_said: bool,
    pub(super) depth: DepthFusion,
    pub(super) band: BandName,
    /// Whether decoders extend the frames: profile `main`.
    pub(super) extended: bool,
    pub(super) progress: Arc<Progress>,
    pub(super) shell: Arc<Shell>,
}

/// Thickness of the shell around surfaces without inside (mm), once one was made.
pub(super) type Shell = OnceLock<f64>;

/// What becomes of depth images.
pub(super) struct DepthFusion {
    pub(super) mode: FusionName,
    pub(super) settings: FusionSettings,
    /// Opened for the first images.
    pub(super) fuser: Option<Fuser>,
}

/// Who fuses depth images.
pub(super) enum Fuser {
    /// Each frame's make that frame's volume.
    PerFrame(AnyFusion),
    /// Each frame's extend the volume of all frames before.
    Accumulate(AnyAccumulator),
}

impl VolumeMaker {
    /// The volume of a frame that had been read at a time.
    pub(super) fn ingest(&mut self, frame: CapturedFrame, read: SystemTime) -> Result<IngestedFrame> {
        let CapturedFrame { number, name, timestamp_ns, content } = frame;
        let (volume, ingest_ms) = timed(|| match content {
            Content::Geometry(geometry) if geometry.is_empty() => Ok(SparseVolume::empty(self.mesh.grid)),
            Content::Geometry(Geometry::Mesh(mesh)) => self.mesh_to_volume(&name, &mesh),
            Content::Geometry(Geometry::Points(cloud)) => self.points_to_volume(&name, cloud),
            Content::Depth(images) => self.depth.volume(&images, &self.backend),
            Content::Volume(volume) => self.volume_to_volume(&name, volume),
            Content::Decoded(volume) if *volume.grid() == self.mesh.grid => stream::with_distances(&volume),
            Content::Decoded(volume) => self.volume_to_volume(&name, volume),
        });
        let volume = volume.with_context(|| name.clone())?;
        let blocks_band = volume.block_count();
        let volume = match self.band {
            BandName::Full => volume,
            BandName::Surface => surface_band(&volume),
        };
        // Of what was seen once it is near the surface alone: no block is where nothing was seen on both sides.
        let has_surface = volume.samples().any(|sample| sample < 0);
        if !has_surface {
            self.progress.note(&format!("{name}: no surface in this frame"));
        }
        memory::check_frame(&volume, self.extended).with_context(|| name)?;
        Ok(IngestedFrame { number, read, timestamp_ns, volume, has_surface, blocks_band, ingest_ms })
    }

    fn mesh_to_volume(&mut self, name: &str, mesh: &TriangleMesh) -> Result<SparseVolume> {
        if self.point_sign.is_some() {
            bail!("a mesh, but the frames before it are points: a capture is one or the other");
        }
        let turned = match self.mesh.sign {
            SignMode::Offset => Cow::Borrowed(mesh),
            SignMode::Auto | SignMode::Closed => self.face_turner.turn(mesh),
        };
        if let (Cow::Owned(_), false) = (&turned, self.turning_said) {
            self.turning_said = true;
            self.progress
                .note(&format!("{name}: faces disagree on which side is outside, and are made to agree"));
        }
        let mesh = &*turned;
        let (sign, evidence) = match self.mesh_sign {
            Some(sign) => (sign, None),
            None => {
                let (sign, evidence) = decide_sign(mesh, self.mesh.sign);
                (sign, Some(evidence))
            }
        };
        let ingester = match self.mesh_ingester.take() {
            Some(ingester) => ingester,
            None => self.backend.mesh_ingester(self.mesh)?,
        };
        let ingester = self.mesh_ingester.insert(ingester);
        let volume = ingester.ingest(mesh, sign);
        if let Some(why) = ingester.take_notice() {
            backend::notify(&why);
        }
        let volume = volume.map_err(|error| match error {
            GpuIngestError::Ingest(error) => self.with_advice(error, mesh.bounds()),
            other => other.into(),
        })?;
        if let Some(evidence) = evidence {
            self.mesh_sign = Some(sign);
            self.tell_shell(sign == SignDecision::Offset);
            self.progress.note(&sign_sentence(sign, evidence, self.mesh.sign));
            self.warn_if_tiny(name, mesh.bounds().map(|(low, high)| low.distance(high)));
        }
        if let SignDecision::Closed { .. } = sign {
            self.warn_of_loss(name, mesh, &volume);
        }
        Ok(volume)
    }

    /// Keeps the thickness of a shell for the last line.
    fn tell_shell(&self, is_shell: bool) {
        if is_shell {
            let thickness_mm = 2e3 * self.mesh.offset_voxels * self.mesh.grid.voxel_size.metres();
            // What was decided on the first frame holds for all.
            let _ = self.shell.set((thickness_mm * 1e3).round() / 1e3);
        }
    }

    /// A sign by winding number has no place for sheets beside a body. Says so once, and again where it is much worse.
    fn warn_of_loss(&mut self, name: &str, mesh: &TriangleMesh, volume: &SparseVolume) {
        let share = lost_share(mesh, volume);
        if share > 2.0 * self.loss_said {
            self.loss_said = share;
            self.progress.note(&format!(
                "{name}: {:.1} % of the surface is open, or thinner than a voxel, and is lost: --sign offset keeps it",
                100.0 * share
            ));
        }
    }

    fn points_to_volume(&mut self, name: &str, cloud: PointCloud) -> Result<SparseVolume> {
        if self.mesh_sign.is_some() {
            bail!("points and no faces, but the frames before it are meshes: a capture is one or the other");
        }
        let (cloud, sides) = self.with_normals(name, cloud)?;
        if let Some(sign) = self.point_sign {
            let volume = ingest_points(&cloud, &self.points, sign);
            return volume.map_err(|error| self.with_advice(error, cloud.bounds()));
        }
        let (mut sign, evidence) = decide_point_sign(&cloud, self.points.sign);
        if self.points.sign == SignMode::Auto && sides.is_some_and(|sides| !sides.is_usable()) {
            sign = PointSign::Offset;
        }
        let volume = ingest_points(&cloud, &self.points, sign);
        let volume = volume.map_err(|error| self.with_advice(error, cloud.bounds()))?;
        self.point_sign = Some(sign);
        self.tell_shell(sign == PointSign::Offset);
        self.progress.note(&point_sign_sentence(sign, &evidence, self.points.sign));
        self.warn_if_tiny(name, cloud.bounds().map(|(low, high)| low.distance(high)));
        Ok(volume)
    }

    /// An error with the options to change; the unit first, where another one makes a frame of a usual size.
    fn with_advice(&self, error: IngestError, bounds: Option<(DVec3, DVec3)>) -> anyhow::Error {
        let is_too_large = matches!(error, IngestError::Fit(_));
        let advised = with_advice(error);
        match bounds.filter(|_| is_too_large).and_then(|(low, high)| unit_question(high - low, self.unit)) {
            Some(question) => anyhow!("{question} {advised}"),
            None => advised,
        }
    }

    /// The cloud with the normals to use, and what their sides rest on if they were estimated.
    fn with_normals(
        &mut self,
        name: &str,
        mut cloud: PointCloud,
    ) -> Result<(PointCloud, Option<SideEvidence>)> {
        let has_normals = cloud.normals.iter().any(|normal| normal.length_squared() > 0.0);
        let estimates = match self.normals {
            NormalsName::Estimate => true,
            NormalsName::Given => self.viewpoint_m.is_some() && !has_normals,
        };
        let is_first = !std::mem::replace(&mut self.sides_said, true);
        if !estimates {
            if is_first && self.viewpoint_m.is_some() {
                self.progress.note(&format!(
                    "{name}: --viewpoint is without effect, as the points have normals: --normals estimate makes new ones"
                ));
            }
            return Ok((cloud, None));
        }
        if let Some(viewpoint) = self.viewpoint_m {
            cloud.viewpoint = Some(viewpoint);
            cloud.scans.clear();
        }
        let (cloud, sides) = estimate_normals_seen_from(&cloud, Some(self.scan_origin_m))?;
        if is_first {
            self.progress.note(&sides_sentence(name, sides));
        }
        Ok((cloud, Some(sides)))
    }

    /// A volume on another grid is sampled anew, from its surface.
    fn volume_to_volume(&mut self, name: &str, volume: SparseVolume) -> Result<SparseVolume> {
        if *volume.grid() == self.mesh.grid {
            return Ok(volume);
        }
        let surface = memory::surface(&volume, SurfaceOptions::default());
        self.mesh_to_volume(name, &surface.with_context(|| name.to_owned())?)
    }

    /// A wrong unit that makes the surface small is no error, but leaves little of it.
    fn warn_if_tiny(&self, name: &str, diagonal_m: Option<f64>) {
        let Grid { voxel_size, edge, .. } = self.mesh.grid;
        let diagonal_m = diagonal_m.unwrap_or(0.0);
        if diagonal_m < voxel_size.metres() * edge.voxels() as f64 {
            let diagonal = Length::from_metres(diagonal_m);
            self.progress.note(&format!("{name}: only {diagonal} across, less than a block: check --units"));
        }
    }
}

impl DepthFusion {
    fn volume(&mut self, images: &[DepthImage], backend: &Backend) -> Result<SparseVolume> {
        let fuser = match self.fuser.take() {
            Some(fuser) => fuser,
            None => self.open(backend)?,
        };
        match self.fuser.insert(fuser) {
            Fuser::PerFrame(fusion) => {
                let volume = fusion.fuse(images, &self.settings).map_err(with_depth_advice);
                if let Some(why) = fusion.take_notice() {
                    backend::notify(&why);
                }
                volume
            }
            Fuser::Accumulate(accumulator) => {
                accumulator.integrate(images).map_err(with_depth_advice)?;
                Ok(accumulator.volume()?)
            }
        }
    }

    fn open(&self, backend: &Backend) -> Result<Fuser> {
        Ok(match self.mode {
            FusionName::PerFrame => Fuser::PerFrame(backend.fusion()?),
            FusionName::Accumulate => Fuser::Accumulate(backend.accumulator(self.settings)?),
        })
    }
}

/// What was decided about the sign, and why.
fn sign_sentence(decision: SignDecision, evidence: SignEvidence, mode: SignMode) -> String {
    let why = match mode {
        SignMode::Auto => format!("{:.0} % of the first frame looks closed", 100.0 * evidence.closed_share),
        SignMode::Closed | SignMode::Offset => "as --sign asks".to_owned(),
    };
    format!("{decision} ({why})")
}

/// What the sides of estimated normals rest on, and what to do where that is little.
fn sides_sentence(name: &str, sides: SideEvidence) -> String {
    let advice = match sides.basis {
        NormalSides::Guessed(_) => {
            ": points look scanned from the origin; --viewpoint X,Y,Z is another place"
        }
        NormalSides::Viewpoint => "",
        NormalSides::Outward if sides.guessed > WORTH_A_WORD => {
            ": give --viewpoint X,Y,Z, the scanner's place"
        }
        NormalSides::Outward => "",
    };
    format!("{name}: {sides}{advice}")
}

/// The same for points.
fn point_sign_sentence(sign: PointSign, evidence: &PointEvidence, mode: SignMode) -> String {
    match (mode, sign) {
        (SignMode::Auto, _) => format!("{sign} ({evidence})"),
        (_, PointSign::Oriented) => format!("{sign} (as --sign asks; {evidence})"),
        (_, PointSign::Offset) => format!("offset shell around the points (as --sign asks; {evidence})"),
    }
}

/// Asks for another unit, where a frame of such an extent, in metres, would be of a person's size with it.
fn unit_question(extent_m: DVec3, unit: Unit) -> Option<String> {
    /// Sizes of what is captured most often: from a bust to a person with raised arms.
    const USUAL_M: std::ops::RangeInclusive<f64> = 0.4..=3.0;
    let size = extent_m.max_element() / unit.metres();
    let usual = |other: &Unit| *other != unit && USUAL_M.contains(&(size * other.metres()));
    let other = [Unit::Centimetre, Unit::Millimetre, Unit::Inch].into_iter().find(usual)?;
    let [x, y, z] = extent_m
        .to_array()
        .map(|metres| if metres < 10.0 { format!("{metres:.1}") } else { format!("{metres:.0}") });
    Some(format!("the frame is {x} x {y} x {z} m: is it --units {other}?"))
}

/// Names the options to change.
fn with_advice(error: IngestError) -> anyhow::Error {
    match error {
        IngestError::Fit(error @ FitError::TooManyBlocks { .. }) => {
            let fits = Length::from_metres(error.voxel_that_fits_m());
            anyhow!("{error}: try --voxel {fits}, or check --units")
        }
        IngestError::Fit(error @ FitError::OutOfRange { .. }) => {
            anyhow!("{error}: move it with --origin, or check --units")
        }
        IngestError::TooSparse { voxel_that_fits_m, .. } => {
            let fits = Length::from_metres(voxel_that_fits_m);
            anyhow!("{error}: try --voxel {fits}, or --sign offset for the points themselves")
        }
        IngestError::NoNormals => anyhow!("{error}: try --normals estimate or --sign offset"),
        other => other.into(),
    }
}

fn with_depth_advice(error: FusionError) -> anyhow::Error {
    match error {
        FusionError::Fit(error) => {
            let fits = Length::from_metres(error.voxel_that_fits_m());
            anyhow!("{error}: try --voxel {fits}, or --max-depth to leave out what is far away")
        }
        other => other.into(),
    }
}
