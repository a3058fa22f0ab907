//! The frames to draw, in order, the box around all of them, and whether they have colours.

use super::Args;
use crate::capture;
use crate::interrupt;
use crate::progress::Progress;
use anyhow::{Result, bail};
use isv::raw::format::FrameRate;
use isv::raw::io::Geometry;
use isv::raw::take::FrameRange;
use isv::raw::take::Prefetch;
use isv::raw::take::Projection;
use isv::raw::take::Up;
use isv::raw::take::capture::{Capture, Frames, Hints, matching_ranges};
use isv::raw::volume::TriangleMesh;
use isv_render::Extent;
use isv_spatial::Bvh;
use std::ops::Range;
use std::path::PathBuf;

/// A frame to draw.
pub(super) struct Scene {
    pub(super) mesh: TriangleMesh,
    /// The surface that errors are measured against.
    pub(super) reference: Option<Bvh>,
}

/// Facts of all frames, found before the first is drawn.
#[derive(Clone, Copy)]
pub(super) struct Overview {
    pub(super) extent: Extent,
    /// Whether a frame has colours.
    pub(super) has_colours: bool,
}

impl Overview {
    /// The overview of one frame; none without triangles.
    fn new(mesh: &TriangleMesh) -> Option<Self> {
        Extent::new(mesh).map(|extent| Self { extent, has_colours: mesh.appearance.is_some() })
    }

    /// The overview of both.
    fn join(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        let extent = Extent::join(one.map(|one| one.extent), other.map(|other| other.extent))?;
        Some(Self { extent, has_colours: one.into_iter().chain(other).any(|frames| frames.has_colours) })
    }
}

/// Source of frames, before any is read.
pub(super) struct FrameSource {
    input: Capture,
    range: Range<usize>,
    reference: Option<(Capture, Range<usize>)>,
    /// Cameras whose images become textures, and their frames.
    projection: Option<(Projection, Range<usize>)>,
}

impl FrameSource {
    /// Opens the inputs. Without a range given, `moving` pictures are of all frames, still ones of the first.
    pub(super) fn open(args: &Args, moving: bool) -> Result<Self> {
        let input = args.capture()?;
        let asked =
            args.frames.or(args.frame.map(|frame| FrameRange { start: frame, end: frame.saturating_add(1) }));
        let all = asked.is_some() || moving;
        let Some(against) = &args.against else {
            if all && asked.is_none() {
                input.counted()?;
            }
            let range = input.range(asked.or((!all).then_some(FrameRange { start: 0, end: 1 })))?;
            let project = |rig: &PathBuf| -> Result<_> {
                let projection = Projection::open(rig, args.project_up.into())?;
                let frames = projection.frames_for(&input, &range)?;
                Ok((projection.turned(args.up.into()), frames))
            };
            let projection = args.project_from.as_ref().map(project).transpose()?;
            return Ok(Self { input, range, reference: None, projection });
        };
        let (frame_rate, animation) = (args.sampling_rate(), args.against_animation.clone());
        let hints = Hints { frame_rate, animation, ..capture::hints(args.against_units) };
        let reference = capture::open(against, &hints.with_origin(args.against_origin))?;
        // The same length is asked for even if only the first frames are drawn: they may not belong together otherwise.
        let ranges = matching_ranges(&reference, &input, asked)?;
        let [in_reference, range] =
            ranges.map(|range| if all { range } else { range.start..range.end.min(range.start + 1) });
        Ok(Self { input, range, reference: Some((reference, in_reference)), projection: None })
    }

    /// How many frames there are.
    pub(super) fn len(&self) -> usize {
        self.range.len()
    }

    /// The number of the first frame, in the reference if there is one.
    pub(super) fn first(&self) -> usize {
        self.reference.as_ref().map_or(self.range.start, |(_, range)| range.start)
    }

    /// Frames a second, where the input says.
    pub(super) fn frame_rate(&self) -> Option<FrameRate> {
        self.input.frame_rate()
    }

    /// Reads the frames, once for the overview of them and once more for whoever draws them, so that few are
    /// held at a time. Those of a pipe, which cannot be read again, are all held.
    pub(super) fn read(self, args: &Args) -> Result<(Overview, Scenes)> {
        let name = self.input.name().to_owned();
        let voxel_m = self.input.grid().map(|grid| grid.voxel_size.metres());
        let can_read_again = self.input.frames().is_some() && self.range.len() > 1;
        let mut meshes = turned(self.input.meshes(self.range.clone())?, args.up.into());
        let overview = if can_read_again {
            let overview = overview_of(meshes, self.range.len())?;
            meshes = turned(args.capture()?.meshes(self.range)?, args.up.into());
            overview
        } else {
            let held = Prefetch::new(meshes, interrupt::cancellation()).collect::<Result<Vec<_>, _>>()?;
            if interrupt::requested() {
                bail!("interrupted");
            }
            let overview = held.iter().map(Overview::new).fold(None, Overview::join);
            meshes = Box::new(held.into_iter().map(Ok));
            overview
        };
        let Some(mut overview) = overview else { bail!("{name}: no surface to draw") };
        if let Some((projection, frames)) = self.projection {
            overview.has_colours = true;
            meshes = Box::new(meshes.zip(frames).map(move |(mesh, frame)| {
                let mut mesh = mesh?;
                let detail_m = voxel_m.unwrap_or_else(|| typical_edge_m(&mesh));
                projection.paint(&mut mesh, frame, detail_m)?;
                Ok(mesh)
            }));
        }
        let Some((reference, range)) = self.reference else {
            return Ok((overview, ahead(meshes.map(|mesh| Ok(Scene { mesh: mesh?, reference: None })))));
        };
        let name = reference.name().to_owned();
        let pairs = meshes.zip(
            range.clone().zip(turned(reference.meshes(range)?, args.against_up.unwrap_or(args.up).into())),
        );
        let scenes = pairs.map(move |(mesh, (number, reference))| {
            let (mesh, reference) = (mesh?, reference?);
            // An empty stage shows no distances.
            if reference.triangles.is_empty() && !mesh.triangles.is_empty() {
                bail!("{name}: frame {number} has no surface to measure against");
            }
            let reference = (!reference.triangles.is_empty()).then(|| Bvh::new(&reference));
            Ok(Scene { mesh, reference })
        });
        Ok((overview, ahead(scenes)))
    }
}

/// Frames to draw, or what is wrong with them.
type Scenes = Box<dyn Iterator<Item = Result<Scene>> + Send>;

/// The next frame is read while one is drawn. When the user interrupts the program, this ends.
fn ahead(scenes: impl Iterator<Item = Result<Scene>> + Send + 'static) -> Scenes {
    Box::new(Prefetch::new(scenes, interrupt::cancellation()))
}

/// Meshes turned from an axis that points up to Y up.
fn turned(meshes: Frames<TriangleMesh>, up: Up) -> Frames<TriangleMesh> {
    if up == Up::Y {
        return meshes;
    }
    Box::new(meshes.map(move |mesh| match Geometry::Mesh(mesh?).turned(up.to_y_up()) {
        Geometry::Mesh(mesh) => Ok(mesh),
        Geometry::Points(_) => unreachable!("a turned mesh is a mesh"),
    }))
}

/// Length of an edge of a mesh whose triangles are all alike (m).
fn typical_edge_m(mesh: &TriangleMesh) -> f64 {
    (2.0 * mesh.area() / mesh.triangles.len().max(1) as f64).sqrt()
}

/// The overview of all meshes; none if they have no triangles.
fn overview_of(meshes: Frames<TriangleMesh>, count: usize) -> Result<Option<Overview>> {
    let progress = Progress::new(Some(count), "framing");
    let mut overview = None;
    for mesh in meshes {
        if interrupt::requested() {
            bail!("interrupted");
        }
        overview = Overview::join(overview, Overview::new(&mesh?));
        progress.step();
    }
    Ok(overview)
}
