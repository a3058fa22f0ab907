//! A hand-held depth camera in a room. Prints what it measured: run with `--nocapture`. Every tenth frame is looked at, or
//! with `ISV_FRAMES=60` so many of all of them.

mod support;

use glam::{DVec2, DVec3, IVec3};
use isv_fusion::{Accumulator, FusionSettings, fuse};
use isv_io::DepthSequence;
use isv_metrics::{distances_to_surface, sample_surface};
use isv_spatial::Bvh;
use isv_testkit::capture;
use isv_volume::{DepthImage, TriangleMesh};
use std::collections::HashMap;
use support::{Coder, grid, mean};

/// Readings are thinned out to this many when distances from them are measured.
const READINGS: usize = 30_000;

/// How far a surface may be from every reading, in metres.
const FAR_M: f64 = 0.03;

/// All readings so far, by cubes of [`FAR_M`].
#[derive(Default)]
struct Readings {
    all: Vec<DVec3>,
    cubes: HashMap<[i32; 3], Vec<DVec3>>,
}

impl Readings {
    fn add(&mut self, image: &DepthImage) {
        let width = image.intrinsics().width as usize;
        for (pixel, depth) in image.depths_m().iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
            let at = DVec2::new((pixel % width) as f64, (pixel / width) as f64);
            let point = image.pose().to_world(image.intrinsics().unproject(at, f64::from(*depth)));
            self.all.push(point);
            let cube = self.cubes.entry((point / FAR_M).floor().as_ivec3().to_array()).or_default();
            // Later readings of a full cube tell nothing new.
            if cube.len() < 1000 {
                cube.push(point);
            }
        }
    }

    /// Share of the readings within 5 cm of a surface, and their mean distance in millimetres.
    fn covered(&self, mesh: &TriangleMesh) -> [f64; 2] {
        let points: Vec<DVec3> = self.all.iter().step_by(1 + self.all.len() / READINGS).copied().collect();
        let distances = distances_to_surface(&points, &Bvh::new(mesh));
        let near = distances.iter().filter(|d| **d <= 0.05).count();
        [near as f64 / distances.len() as f64, 1000.0 * mean(&distances)]
    }

    /// Share of a surface that is farther than [`FAR_M`] from every reading.
    fn invented(&self, mesh: &TriangleMesh) -> f64 {
        let samples = sample_surface(mesh, 0.02, 3);
        let far = samples.iter().filter(|sample| !self.any_near(sample.point)).count();
        far as f64 / samples.len() as f64
    }

    fn any_near(&self, point: DVec3) -> bool {
        let cube = (point / FAR_M).floor().as_ivec3();
        (0..27).any(|i| {
            let at = (cube + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)).to_array();
            self.cubes.get(&at).is_some_and(|cube| cube.iter().any(|p| p.distance(point) <= FAR_M))
        })
    }
}

/// The frames to look at.
fn room() -> Option<(DepthSequence, Vec<usize>)> {
    let sequence = DepthSequence::open(&capture("room_rgbd")?).unwrap();
    assert_eq!((sequence.frames(), sequence.cameras(), sequence.fps()), (60, 1, Some(30.0)));
    let every = std::env::var("ISV_FRAMES").ok().and_then(|n| n.parse().ok());
    Some((
        sequence,
        every.map_or_else(|| (0..60).step_by(10).collect(), |frames: usize| (0..frames).collect()),
    ))
}

fn check(name: &str, frame: usize, readings: &Readings, coded: &TriangleMesh, bytes: usize) {
    let ([covered, mean_mm], invented) = (readings.covered(coded), readings.invented(coded));
    let (pieces, triangles) = (support::pieces(coded), coded.triangles.len());
    let small: usize = pieces.iter().filter(|piece| **piece < 50).sum();
    println!(
        "{name} {frame}: {bytes} bytes; {covered:.4} of the readings within 5 cm, mean {mean_mm:.2} mm; {invented:.5} of the \
         surface beyond 3 cm of all readings; {} pieces, those below 50 triangles have {small} of {triangles}",
        pieces.len()
    );
    assert!(covered >= 0.95, "{name} {frame}: {covered}");
    assert!(invented <= 0.005, "{name} {frame}: {invented}");
    assert!(small * 100 < triangles, "{name} {frame}: {small} of {triangles} triangles in specks");
}

#[test]
fn each_frame_of_a_room() {
    let Some((sequence, frames)) = room() else { return };
    let mut coder = Coder::new(grid(0.01));
    for frame in frames {
        let images = sequence.read(frame).unwrap();
        let (coded, bytes) = coder.code(&fuse(&images, &FusionSettings::new(grid(0.01))).unwrap());
        let mut readings = Readings::default();
        readings.add(&images[0]);
        check("per frame", frame, &readings, &coded, bytes);
    }
}

#[test]
fn a_room_accumulated() {
    let Some((sequence, frames)) = room() else { return };
    let mut coder = Coder::new(grid(0.01));
    let mut accumulator = Accumulator::new(FusionSettings::new(grid(0.01)));
    let mut readings = Readings::default();
    for frame in frames {
        let images = sequence.read(frame).unwrap();
        accumulator.integrate(&images).unwrap();
        let (coded, bytes) = coder.code(&accumulator.volume());
        readings.add(&images[0]);
        check("accumulated", frame, &readings, &coded, bytes);
    }
}
