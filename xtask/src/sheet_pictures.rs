//! Pictures of open surfaces as single sheets, before and after coding: borders, folds, junctions and layers that face one another.

use anyhow::{Context, Result};
use glam::DVec3;
use isv::raw::encode::{Encoder, EncoderSettings};
use isv::raw::format::{FrameRate, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, Reach, decide_sign, ingest_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use isv_render::{Background, Camera, Picture, Style, contact_sheet, render, text_line};
use std::fs::File;
use std::path::Path;

/// Edge of a voxel (m), and of a picture (pixels).
const VOXEL_M: f64 = 0.01;
const SIZE: usize = 300;

/// Draws each surface as it is, and below as it is decoded at the default quality, into `sheets.png`.
pub(crate) fn run(images: &Path) -> Result<()> {
    let scenes =
        [("borders", borders()), ("a fold", fold()), ("a junction", junction()), ("layers", layers())];
    let (mut sources, mut decoded) = (Vec::new(), Vec::new());
    for (name, mesh) in &scenes {
        let surface = code(mesh)?;
        let share = 100.0 * surface.area() / mesh.area();
        println!("{name}: {share:.1} % of the area");
        let camera = Camera::fitting(mesh.bounds().context("a scene has vertices")?, [SIZE; 2]);
        let camera = camera.from_direction(35.0, 30.0);
        let draw = |mesh: &TriangleMesh, caption: &str| -> Picture {
            let picture = render(mesh, &camera, &Style::default());
            picture.above(&text_line(caption, SIZE, Background::Light))
        };
        sources.push(draw(mesh, name));
        decoded.push(draw(&surface, &format!("decoded, {share:.1} % of the area")));
    }
    sources.extend(decoded);
    let path = images.join("sheets.png");
    let file = File::create(&path).with_context(|| format!("{}: cannot write", path.display()))?;
    Ok(contact_sheet(&sources, scenes.len()).write_png(file)?)
}

/// Codes a mesh as a keyframe and decodes it.
fn code(mesh: &TriangleMesh) -> Result<TriangleMesh> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(VOXEL_M)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let ingest = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
    let volume = ingest_mesh(mesh, &ingest, decide_sign(mesh, ingest.sign).0)?;
    let header = StreamHeader::newest(Profile::Main, grid, FrameRate::DEFAULT);
    let mut encoder = Encoder::new(&header, EncoderSettings::default());
    encoder.encode(&volume);
    let decoded = encoder.reconstruction().context("a frame was coded")?;
    Ok(extract_surface(decoded, &SurfaceOptions::default()))
}

/// A grid of `n` x `n` squares on a surface given over the unit square.
fn patch(n: u32, at: impl Fn(f64, f64) -> DVec3) -> TriangleMesh {
    let places = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n))));
    let square = |k: u32| {
        let a = k / n * (n + 1) + k % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    TriangleMesh {
        vertices: places.map(|(u, v)| at(u, v)).collect(),
        normals: Vec::new(),
        triangles: (0..n * n).flat_map(square).collect(),
        appearance: None,
    }
}

/// Both meshes as one.
fn together(mut a: TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let first = a.vertices.len() as u32;
    a.vertices.extend(&b.vertices);
    a.triangles.extend(b.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
    a
}

/// A waving leaf with a lobed border and a hole.
fn borders() -> TriangleMesh {
    let turn = std::f64::consts::TAU;
    patch(96, |u, v| {
        let (angle, share) = (turn * u, 0.25 + 0.75 * v);
        let radius = 0.3 * share * (1.0 + 0.15 * v * (7.0 * angle).sin());
        DVec3::new(radius * angle.cos(), 0.04 * (2.0 * angle).sin() * share, radius * angle.sin())
    })
}

/// Cloth in three layers, 2 and 4 voxels apart.
fn fold() -> TriangleMesh {
    let (length, gaps) = (0.4, [2.0 * VOXEL_M, 4.0 * VOXEL_M]);
    patch(120, |u, v| {
        // Straight, half a circle, straight back, half a circle, straight.
        let arcs = gaps.map(|gap| std::f64::consts::FRAC_PI_2 * gap);
        let mut way = u * (3.0 * length + arcs[0] + arcs[1]);
        let (mut x, mut y) = (way.min(length), 0.0);
        way -= length;
        let mut base = 0.0;
        for (gap, (arc, sign)) in gaps.into_iter().zip(arcs.into_iter().zip([1.0, -1.0])) {
            if way <= 0.0 {
                break;
            }
            let (end, angle) = (if sign > 0.0 { length } else { 0.0 }, way.min(arc) / gap * 2.0);
            x = end + sign * 0.5 * gap * angle.sin();
            y = base + 0.5 * gap * (1.0 - angle.cos());
            base += gap;
            way -= arc;
            if way > 0.0 {
                (x, y) = (end - sign * way.min(length), base);
                way -= length;
            }
        }
        DVec3::new(x, y, 0.4 * v)
    })
}

/// A wall that stands on a floor.
fn junction() -> TriangleMesh {
    let floor = patch(40, |u, v| DVec3::new(u - 0.5, 0.0, v - 0.5) * 0.6);
    together(floor, &patch(40, |u, v| DVec3::new(0.6 * (u - 0.5), 0.3 * v, 0.0)))
}

/// Layers that face one another, 6, 4 and 3 voxels apart.
fn layers() -> TriangleMesh {
    let mut height = 0.0;
    let mut all = TriangleMesh::default();
    for (layer, gap) in [6.0, 4.0, 3.0, 0.0].into_iter().enumerate() {
        let side = if layer % 2 == 0 { 1.0 } else { -1.0 };
        let sheet = patch(40, |u, v| {
            DVec3::new(
                side * (u - 0.5) * 0.5,
                height + 0.03 * (6.0 * u * side + 3.0 * v).sin() * 0.3,
                (v - 0.5) * 0.5,
            )
        });
        all = together(all, &sheet);
        height += gap * VOXEL_M;
    }
    all
}
