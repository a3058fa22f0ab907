//! Captured frames to volumes: the part of encoding before the codec.

use super::groups::Groups;
use super::options::{FusionMode, Normals, WORTH_A_WARNING};
use super::{EncodeError, EncodeEvent, FrameError};
use crate::capture::{CapturedFrame, Content};
use crate::device::{self, IngestFault, Integrator};
use crate::stream::timed;
use crate::{DeviceError, DistancesError, Event, Length, MemoryLimit, Observer, OpenDevice, with_distances};
use glam::DVec3;
use isv_encode::Band;
use isv_fusion::{FusionError, FusionSettings};
use isv_ingest::{
    ColourMemory, FaceTurner, IngestError, MeshIngest, PointIngest, PointSign, SideEvidence, SignDecision,
    SignMode, decide_point_sign, decide_sign, estimate_normals_seen_from, ingest_points, level_weights,
    lost_surface_share, mesh_colours, point_colours, view_colours,
};
use isv_io::{Geometry, Unit};
use isv_surface::{SurfaceOptions, surface_band};
use isv_volume::{ColourSample, ColourView, DepthImage, Grid, PointCloud, SparseVolume, TriangleMesh};
use std::borrow::Cow;
use std::mem::{replace, take};
use std::sync::{Arc, OnceLock};
use std::time::SystemTime;

/// Samples of colour along the edge of a voxel where frames add up: somewhat more than one a place that is remembered.
const ACCUMULATED_SAMPLES: f64 = 3.0;

/// Name of the decision for a shell.
const OFFSET: &str = "offset";

/// A frame ready to be encoded.
pub(super) struct IngestedFrame {
    /// Number in the capture.
    pub(super) number: usize,
    /// When it had been read.
    pub(super) read: SystemTime,
    /// Time of [`CapturedFrame`], in nanoseconds.
    pub(super) timestamp_ns: Option<u64>,
    pub(super) volume: SparseVolume,
    /// Colours near its surface; empty if it has none or nobody wants any.
    pub(super) colours: Vec<ColourSample>,
    /// Whether these have hardly changed since they were last coded.
    pub(super) colours_stand: bool,
    /// Whether any of it lies inside.
    pub(super) has_surface: bool,
    /// Blocks that ingest made, before any were left out: those of the truncation band, or as many as are near the surface.
    pub(super) blocks_band: usize,
    pub(super) ingest_ms: f64,
}

/// Makes volumes; what is decided on the first frame holds for all, or for all of its group where groups are coded by themselves.
pub(super) struct VolumeMaker {
    pub(super) device: OpenDevice,
    pub(super) groups: Groups,
    pub(super) mesh: MeshIngest,
    /// Opened for the first mesh.
    pub(super) mesh_ingester: Option<device::MeshIngest>,
    pub(super) mesh_sign: Option<SignDecision>,
    pub(super) face_turner: FaceTurner,
    /// Whether it was said that faces disagree.
    pub(super) turning_said: bool,
    /// Share of a frame's surface up to half of what is worth a warning.
    pub(super) loss_said: f64,
    /// Share of the surface lost when a closed take was last looked at for open parts.
    pub(super) loss_seen: f64,
    pub(super) points: PointIngest,
    pub(super) point_sign: Option<PointSign>,
    pub(super) normals: Normals,
    /// Unit of the input's coordinates.
    pub(super) unit: Unit,
    /// Place that points were seen from, in metres, if the user gives it.
    pub(super) viewpoint_m: Option<DVec3>,
    /// The origin of the input's coordinates, in metres, where scanners often stand.
    pub(super) scan_origin_m: DVec3,
    /// Whether a word was said on the sides of normals.
    pub(super) sides_said: bool,
    /// Whether it was said how inside is told from outside.
    pub(super) sign_said: bool,
    pub(super) depth: DepthFusion,
    pub(super) band: Band,
    /// Whether decoders extend the frames: profile `main`.
    pub(super) extended: bool,
    pub(super) memory: MemoryLimit,
    pub(super) observer: Arc<dyn Observer>,
    pub(super) surface: Arc<OnceLock<SurfaceDecision>>,
    /// Distance between the colours that are sampled on meshes (m); nothing if no colours are wanted.
    pub(super) colour_spacing_m: Option<f64>,
    /// Whether colours would be wanted, but the stream has no room for them. Not set any more once that was said of a frame.
    pub(super) lacks_room_for_colour: bool,
    /// Colours sampled on the current frame.
    pub(super) colours: Vec<ColourSample>,
    /// Whether these have hardly changed.
    pub(super) colours_stand: bool,
}

/// What was decided on the first frame with a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceDecision {
    /// How inside is told from outside: `closed`, `sheet`, `oriented` (points) or `offset`.
    pub(super) sign: &'static str,
    /// Thickness of the shell around surfaces without inside (mm), if one was made.
    pub(super) shell_mm: Option<f64>,
}

/// What becomes of depth images.
pub(super) struct DepthFusion {
    pub(super) mode: FusionMode,
    pub(super) settings: FusionSettings,
    /// Opened for the first images.
    pub(super) fuser: Option<Fuser>,
    /// Colours seen so far, where frames are all that was seen so far.
    pub(super) colours: Option<ColourMemory>,
}

/// Fusion of depth images, frame by frame or over all frames.
pub(super) enum Fuser {
    /// Each frame's make that frame's volume.
    PerFrame(device::Fuser),
    /// Each frame's extend the volume of all frames before.
    Accumulate(Integrator),
}

impl VolumeMaker {
    /// The volume of a frame that had been read at a time.
    pub(super) fn ingest(
        &mut self,
        frame: CapturedFrame,
        read: SystemTime,
    ) -> Result<IngestedFrame, EncodeError> {
        let has_colour = frame.has_colour();
        let CapturedFrame { number, name, timestamp_ns, content, colour, views } = frame;
        if has_colour && take(&mut self.lacks_room_for_colour) {
            self.tell(EncodeEvent::ColourComesLater { name: name.clone() });
        }
        if self.groups.enter(number) {
            self.forget();
        }
        let stream_grid = match &content {
            Content::Volume(volume) | Content::Decoded(volume) => *volume.grid(),
            Content::Geometry(_) | Content::Depth(_) => self.mesh.grid,
        };
        let mut surface = None;
        let (volume, mut ingest_ms) = timed(|| match content {
            Content::Geometry(geometry) if geometry.is_empty() => Ok(SparseVolume::empty(self.mesh.grid)),
            Content::Geometry(Geometry::Mesh(mesh)) => {
                let mesh = self.with_faces_turned(&name, mesh)?;
                self.mesh_to_volume(&name, surface.insert(mesh))
            }
            Content::Geometry(Geometry::Points(cloud)) => self.points_to_volume(&name, cloud),
            Content::Depth(images) => self.depth_to_volume(&name, &images, &views),
            Content::Volume(volume) => self.volume_to_volume(&name, volume),
            Content::Decoded(volume) if *volume.grid() == self.mesh.grid => self.redistanced(&name, &volume),
            Content::Decoded(volume) => self.volume_to_volume(&name, volume),
        });
        let (mut colours, colours_stand) = (take(&mut self.colours), take(&mut self.colours_stand));
        if let (Some(colour), Some(_)) = (colour, self.colour_spacing_m) {
            colours = colour.to_samples(&stream_grid);
        }
        let volume = volume?;
        let blocks_band = volume.block_count();
        let volume = match self.band {
            Band::Full => volume,
            Band::Surface => surface_band(&volume),
        };
        // Of what was seen once it is near the surface alone: no block is where nothing was seen on both sides.
        let has_surface = volume.samples().any(|sample| sample < 0);
        if !has_surface {
            self.tell(EncodeEvent::NoSurface { name: name.clone() });
        }
        let fits = self.memory.check_frame(&volume, self.extended);
        fits.map_err(|cause| FrameError::Memory { name, cause })?;
        // Samples of colour take far more memory than the volume: they are taken once it is known to be no larger than it may be.
        if let (Some(mesh), Some(spacing_m)) = (&surface, self.colour_spacing_m) {
            let sampled_ms;
            (colours, sampled_ms) = timed(|| mesh_colours(mesh, spacing_m));
            ingest_ms += sampled_ms;
        }
        Ok(IngestedFrame {
            number,
            read,
            timestamp_ns,
            volume,
            colours,
            colours_stand,
            has_surface,
            blocks_band,
            ingest_ms,
        })
    }

    /// Forgets the frames before, of which the next ones must know nothing.
    fn forget(&mut self) {
        self.mesh_ingester = None;
        self.mesh_sign = None;
        self.face_turner = FaceTurner::default();
        self.loss_seen = 0.0;
        self.point_sign = None;
        self.colours.clear();
    }

    fn ingest_error(&self, name: &str, cause: IngestError, bounds: Option<(DVec3, DVec3)>) -> FrameError {
        let extent_m = bounds.map(|(low, high)| (high - low).to_array());
        FrameError::Ingest { name: name.to_owned(), cause, extent_m, unit: self.unit }
    }

    fn tell(&self, event: EncodeEvent) {
        self.observer.event(&Event::Encode(event));
    }

    /// A mesh whose faces look the same way, as far as that can be found.
    fn with_faces_turned(&mut self, name: &str, mesh: TriangleMesh) -> Result<TriangleMesh, FrameError> {
        if self.point_sign.is_some() {
            return Err(FrameError::MeshAmongPoints { name: name.to_owned() });
        }
        if self.mesh.sign == SignMode::Offset {
            return Ok(mesh);
        }
        let turned = match self.face_turner.turn(&mesh) {
            Cow::Borrowed(_) => None,
            Cow::Owned(turned) => Some(turned),
        };
        if turned.is_some() && !replace(&mut self.turning_said, true) {
            self.tell(EncodeEvent::FacesTurned { name: name.to_owned() });
        }
        Ok(turned.unwrap_or(mesh))
    }

    fn mesh_to_volume(&mut self, name: &str, mesh: &TriangleMesh) -> Result<SparseVolume, FrameError> {
        let (sign, evidence) = match self.mesh_sign {
            Some(sign) => (sign, None),
            None => {
                let (sign, evidence) = decide_sign(mesh, self.mesh.sign);
                (sign, Some(evidence))
            }
        };
        let ingester = match self.mesh_ingester.take() {
            Some(ingester) => ingester,
            None => {
                let opened = self.device.mesh_ingest(self.mesh, &self.observer);
                opened.map_err(|cause| FrameError::Device { name: name.to_owned(), cause })?
            }
        };
        self.mesh_ingester = Some(ingester);
        let volume = self.mesh_to_volume_as(name, mesh, sign)?;
        self.mesh_sign = Some(sign);
        if let Some(evidence) = evidence
            && !replace(&mut self.sign_said, true)
        {
            self.keep_decision(match sign {
                SignDecision::Closed { .. } => "closed",
                SignDecision::Sheet => "sheet",
                SignDecision::Offset => OFFSET,
            });
            self.tell(EncodeEvent::Sign { decision: sign, evidence, mode: self.mesh.sign });
            let (faces, blocks) = (mesh.triangles.len(), volume.block_count());
            if sign == SignDecision::Sheet && faces < blocks {
                self.tell(EncodeEvent::LargeFaces { name: name.to_owned(), faces, blocks });
            }
            self.warn_if_tiny(name, mesh.bounds().map(|(low, high)| low.distance(high)));
        }
        let share = lost_surface_share(mesh, &volume, sign);
        // An open part that comes later makes sheets of the rest of the take: what was closed stays as it was.
        if let (SignDecision::Closed { .. }, SignMode::Auto) = (sign, self.mesh.sign)
            && share > self.loss_seen + WORTH_A_WARNING
        {
            self.loss_seen = share;
            let (now, evidence) = decide_sign(mesh, self.mesh.sign);
            if now == SignDecision::Sheet {
                self.mesh_sign = Some(now);
                self.tell(EncodeEvent::OpenPart { name: name.to_owned(), share: evidence.open_share });
                return self.mesh_to_volume_as(name, mesh, now);
            }
        }
        if share > 2.0 * self.loss_said {
            self.loss_said = share;
            let has_sheets = sign == SignDecision::Sheet;
            self.tell(EncodeEvent::SurfaceLost { name: name.to_owned(), share, has_sheets });
        }
        Ok(volume)
    }

    /// The volume of a mesh, with the ingester that was opened.
    fn mesh_to_volume_as(
        &mut self,
        name: &str,
        mesh: &TriangleMesh,
        sign: SignDecision,
    ) -> Result<SparseVolume, FrameError> {
        let ingester = self.mesh_ingester.as_mut().expect("opened for the first mesh");
        ingester.ingest(mesh, sign).map_err(|error| match error {
            IngestFault::Ingest(cause) => self.ingest_error(name, cause, mesh.bounds()),
            IngestFault::Device(cause) => FrameError::Device { name: name.to_owned(), cause },
        })
    }

    /// Keeps what was decided on the first frame, which holds for all.
    fn keep_decision(&self, sign: &'static str) {
        let thickness_mm = 2e3 * self.mesh.offset_voxels * self.mesh.grid.voxel_size.metres();
        let shell_mm = (sign == OFFSET).then(|| (thickness_mm * 1e3).round() / 1e3);
        let _ = self.surface.set(SurfaceDecision { sign, shell_mm });
    }

    fn points_to_volume(&mut self, name: &str, cloud: PointCloud) -> Result<SparseVolume, FrameError> {
        if self.mesh_sign.is_some() {
            return Err(FrameError::PointsAmongMeshes { name: name.to_owned() });
        }
        cloud.validate().map_err(|cause| self.ingest_error(name, cause.into(), None))?;
        let (cloud, sides) = self.with_normals(name, cloud)?;
        if self.colour_spacing_m.is_some() {
            self.colours = point_colours(&cloud);
        }
        if let Some(sign) = self.point_sign {
            let volume = ingest_points(&cloud, &self.points, sign);
            return volume.map_err(|cause| self.ingest_error(name, cause, cloud.bounds()));
        }
        let (mut sign, evidence) = decide_point_sign(&cloud, self.points.sign);
        if self.points.sign == SignMode::Auto && sides.is_some_and(|sides| !sides.is_usable()) {
            sign = PointSign::Offset;
        }
        let volume = ingest_points(&cloud, &self.points, sign);
        let volume = volume.map_err(|cause| self.ingest_error(name, cause, cloud.bounds()))?;
        self.point_sign = Some(sign);
        if !replace(&mut self.sign_said, true) {
            self.keep_decision(match sign {
                PointSign::Oriented => "oriented",
                PointSign::Offset => OFFSET,
            });
            self.tell(EncodeEvent::PointSign { decision: sign, evidence, mode: self.points.sign });
            self.warn_if_tiny(name, cloud.bounds().map(|(low, high)| low.distance(high)));
        }
        Ok(volume)
    }

    /// The cloud with the normals to use, and what their sides rest on if they were estimated.
    fn with_normals(
        &mut self,
        name: &str,
        mut cloud: PointCloud,
    ) -> Result<(PointCloud, Option<SideEvidence>), FrameError> {
        let has_normals = cloud.normals.iter().any(|normal| normal.length_squared() > 0.0);
        let estimates = match self.normals {
            Normals::Estimate => true,
            Normals::Given => self.viewpoint_m.is_some() && !has_normals,
        };
        let is_first = !replace(&mut self.sides_said, true);
        if !estimates {
            if is_first && self.viewpoint_m.is_some() {
                self.tell(EncodeEvent::ViewpointUnused { name: name.to_owned() });
            }
            return Ok((cloud, None));
        }
        if let Some(viewpoint) = self.viewpoint_m {
            cloud.viewpoint = Some(viewpoint);
            cloud.scans.clear();
        }
        let estimated = estimate_normals_seen_from(&cloud, Some(self.scan_origin_m));
        let (cloud, sides) = estimated.map_err(|error| self.ingest_error(name, error, cloud.bounds()))?;
        if is_first {
            self.tell(EncodeEvent::Sides { name: name.to_owned(), sides });
        }
        Ok((cloud, Some(sides)))
    }

    /// The volume of depth images, and the colours that cameras beside them see of its surface.
    fn depth_to_volume(
        &mut self,
        name: &str,
        images: &[DepthImage],
        views: &[ColourView],
    ) -> Result<SparseVolume, FrameError> {
        let volume = self.depth.volume(name, images, &self.device, &self.observer)?;
        let Some(spacing_m) = self.colour_spacing_m else { return Ok(volume) };
        let voxel_m = volume.grid().voxel_size.metres();
        let spacing_m = match self.depth.mode {
            FusionMode::PerFrame => spacing_m,
            FusionMode::Accumulate => voxel_m / ACCUMULATED_SAMPLES,
        };
        let seen = match views.is_empty() {
            true => Vec::new(),
            false => {
                let surface = self.memory.surface(&volume, SurfaceOptions { normals: true });
                let surface = surface.map_err(|cause| FrameError::Memory { name: name.to_owned(), cause })?;
                view_colours(&surface, views, images, voxel_m, spacing_m)
            }
        };
        self.colours = match self.depth.mode {
            FusionMode::PerFrame => level_weights(seen),
            FusionMode::Accumulate => {
                let memory = self.depth.colours.get_or_insert_with(|| ColourMemory::new(voxel_m));
                memory.add(&seen, &volume);
                self.colours_stand = !memory.has_changed();
                memory.samples()
            }
        };
        Ok(volume)
    }

    /// A volume on another grid is sampled anew, from its surface.
    fn volume_to_volume(&mut self, name: &str, volume: SparseVolume) -> Result<SparseVolume, FrameError> {
        if *volume.grid() == self.mesh.grid {
            return Ok(volume);
        }
        let surface = self.memory.surface(&volume, SurfaceOptions::default());
        let surface = surface.map_err(|cause| FrameError::Memory { name: name.to_owned(), cause })?;
        self.mesh_to_volume(name, &surface)
    }

    fn redistanced(&self, name: &str, volume: &SparseVolume) -> Result<SparseVolume, FrameError> {
        with_distances(volume, self.memory).map_err(|error| match error {
            DistancesError::Memory(cause) => FrameError::Memory { name: name.to_owned(), cause },
            DistancesError::Ingest(cause) => self.ingest_error(name, cause, None),
        })
    }

    /// A wrong unit that makes the surface small is no error, but leaves little of it.
    fn warn_if_tiny(&self, name: &str, diagonal_m: Option<f64>) {
        let Grid { voxel_size, edge, .. } = self.mesh.grid;
        let diagonal_m = diagonal_m.unwrap_or(0.0);
        if diagonal_m < voxel_size.metres() * edge.voxels() as f64 {
            let diagonal = Length::from_metres(diagonal_m);
            self.tell(EncodeEvent::Tiny { name: name.to_owned(), diagonal });
        }
    }
}

impl DepthFusion {
    fn volume(
        &mut self,
        name: &str,
        images: &[DepthImage],
        device: &OpenDevice,
        observer: &Arc<dyn Observer>,
    ) -> Result<SparseVolume, FrameError> {
        let fusion_error = |cause: FusionError| FrameError::Fusion { name: name.to_owned(), cause };
        let fuser = match self.fuser.take() {
            Some(fuser) => fuser,
            None => {
                let opened = self.open(device, observer);
                opened.map_err(|cause| FrameError::Device { name: name.to_owned(), cause })?
            }
        };
        match self.fuser.insert(fuser) {
            Fuser::PerFrame(fuser) => fuser.fuse(images, &self.settings).map_err(fusion_error),
            Fuser::Accumulate(integrator) => {
                integrator.integrate(images).map_err(fusion_error)?;
                integrator.volume().map_err(fusion_error)
            }
        }
    }

    fn open(&self, device: &OpenDevice, observer: &Arc<dyn Observer>) -> Result<Fuser, DeviceError> {
        Ok(match self.mode {
            FusionMode::PerFrame => Fuser::PerFrame(device.fuser(observer)?),
            FusionMode::Accumulate => Fuser::Accumulate(device.integrator(self.settings, observer)?),
        })
    }
}
