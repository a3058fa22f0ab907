//! Readings of a texture are those of the colour itself, wherever charts end and however small the picture.

use super::atlas::Place;
use super::charts::Chart;
use super::*;
use glam::DVec3;
use isv_decode::colour::surface_colours;
use isv_decode::colour::{ColourCells, ColourShape};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{Random, ball};
use isv_volume::{BlockEdge, SparseVolume, Truncation, VoxelSize};
use std::collections::BTreeMap;

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// Colour that changes smoothly with the place, in samples at half voxels.
fn painted(volume: &SparseVolume) -> ColourFrame {
    let cells = ColourCells::new(volume);
    let depths = vec![1; cells.coords().len()];
    let shape = ColourShape::new(cells, depths, volume);
    let mut layers = shape.layers();
    for (block, coord) in shape.cells().coords().to_vec().into_iter().enumerate() {
        for depth in 0..2u8 {
            let samples = shape.block_samples(block, depth);
            let places = cell_places(&shape, block);
            for (number, sample) in layers[usize::from(depth)][samples].iter_mut().enumerate() {
                let (cell, inner) = (number >> (3 * depth), number & ((1 << (3 * depth)) - 1));
                if shape.parts(block, cell, depth) >> inner & 1 == 0 {
                    continue;
                }
                let half = [inner & 1, inner >> 1 & 1, inner >> 2].map(|h| f64::from(h as u32) * 0.5 + 0.25);
                let half = if depth == 0 { [0.5; 3] } else { half };
                let place = [0, 1, 2]
                    .map(|axis| f64::from(coord.to_array()[axis]) * 8.0 + places[cell][axis] + half[axis]);
                *sample = colour_at(place);
            }
        }
    }
    ColourFrame { shape, layers }
}

/// Voxels of the cells of a block.
fn cell_places(shape: &ColourShape, block: usize) -> Vec<[f64; 3]> {
    let cells = &shape.cells().blocks()[block];
    let voxel = |place: usize| {
        let along =
            |axis: usize| (0..3).map(|bit| (place >> (3 * bit + axis) & 1) << bit).sum::<usize>() as f64;
        [along(0), along(1), along(2)]
    };
    (0..512).filter(|place| cells.cell(*place).is_some()).map(voxel).collect()
}

fn colour_at([x, y, z]: [f64; 3]) -> [i16; 4] {
    let luma = 128.0 + 70.0 * (0.35 * x).sin() + 40.0 * (0.3 * y + 0.2 * z).cos();
    let [y, cb, cr] =
        [luma, 40.0 * (0.2 * z).sin(), 30.0 * (0.25 * y).cos()].map(|value| (64.0 * value) as i16);
    [y, cb, cr, 1]
}

fn mesh_of(volume: &SparseVolume) -> TriangleMesh {
    extract_surface(volume, &SurfaceOptions { normals: true })
}

fn baked(side: u32, volumes: &[SparseVolume]) -> Vec<TriangleMesh> {
    let mut baker = TextureBaker::new(TextureSide::from_texels(side).unwrap());
    let bake = |volume| {
        let mut mesh = mesh_of(volume);
        baker.bake(&mut mesh, &painted(volume), &grid()).unwrap();
        mesh
    };
    volumes.iter().map(bake).collect()
}

fn appearance(mesh: &TriangleMesh) -> &Appearance {
    mesh.appearance.as_deref().unwrap()
}

/// A point of each face.
fn inside(mesh: &TriangleMesh) -> Vec<(usize, [f64; 3])> {
    let mut random = Random::new(7);
    let point = |face| {
        let (mut u, mut v) = (random.signed().abs(), random.signed().abs());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        (face, [1.0 - u - v, u, v])
    };
    (0..mesh.triangles.len()).map(point).collect()
}

/// Points on the edges at which the texture is cut, each seen from both sides.
fn at_seams(mesh: &TriangleMesh) -> Vec<(usize, [f64; 3])> {
    let mut edges: BTreeMap<[u32; 2], Vec<(usize, usize)>> = BTreeMap::new();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        for first in 0..3 {
            let mut edge = [triangle[first], triangle[(first + 1) % 3]];
            edge.sort_unstable();
            edges.entry(edge).or_default().push((face, first));
        }
    }
    let coordinates = &appearance(mesh).texture_coordinates;
    let is_cut = |sides: &&Vec<(usize, usize)>| {
        // The other face has the same edge the other way round.
        sides.len() == 2
            && coordinates[sides[0].0][sides[0].1] != coordinates[sides[1].0][(sides[1].1 + 1) % 3]
    };
    let points = |sides: &Vec<(usize, usize)>| {
        let of_side = |(face, first): (usize, usize), part: f64| {
            let mut weights = [0.0; 3];
            (weights[first], weights[(first + 1) % 3]) = (part, 1.0 - part);
            (face, weights)
        };
        [of_side(sides[0], 0.3), of_side(sides[1], 0.7)]
    };
    edges.values().filter(is_cut).flat_map(points).collect()
}

/// Differences of colours read from a texture and from samples, at points of faces.
fn differences(
    mesh: &TriangleMesh,
    texture: &Material,
    colour: &ColourFrame,
    at: &[(usize, [f64; 3])],
) -> Vec<f64> {
    let (mut points, mut read) = (Vec::new(), Vec::new());
    for (face, weights) in at.iter().copied() {
        let corners = mesh.corners(face);
        points.push((0..3).map(|c| corners[c] * weights[c]).sum::<DVec3>());
        let of = appearance(mesh).texture_coordinates[face];
        let at = [0, 1].map(|axis| (0..3).map(|c| of[c][axis] * weights[c] as f32).sum());
        read.push(texture.colour(at));
    }
    let colours = surface_colours(colour, &grid(), &points);
    let apart = |(read, colour): (&[f32; 3], &[u8; 3])| {
        (0..3).map(|c| f64::from(read[c] - f32::from(colour[c])).abs()).fold(0.0, f64::max)
    };
    read.iter().zip(&colours).map(apart).collect()
}

/// A texture at half the size, as mip maps are made.
fn halved(material: &Material) -> Material {
    let image = material.texture.as_ref().unwrap();
    let (width, height) = (image.width() / 2, image.height() / 2);
    let pixel = |n: u32| {
        let (x, y) = (n % width * 2, n / width * 2);
        let at = |x: u32, y: u32| image.pixels()[(y * image.width() + x) as usize];
        let four = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
        [0, 1, 2].map(|c| (four.iter().map(|texel| u32::from(texel[c])).sum::<u32>().div_ceil(4)) as u8)
    };
    let image = Image::new(width, height, (0..width * height).map(pixel).collect());
    Material { texture: image.map(Arc::new), ..material.clone() }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[test]
fn texels_are_the_colour_of_their_place_and_seams_do_not_show() {
    let volume = ball(grid(), 0.0);
    let colour = painted(&volume);
    let mesh = &baked(1024, std::slice::from_ref(&volume))[0];
    assert_eq!(appearance(mesh).validate(mesh.vertices.len(), mesh.triangles.len()), Ok(()));
    let mut texture = appearance(mesh).materials[0].clone();
    let places = [inside(mesh), at_seams(mesh)];
    assert!(10 * places[1].len() > places[0].len());
    // A texel is an eighth of a voxel at first, then a quarter and a half.
    for (mean_bound, bound) in [(0.6, 2.0), (0.9, 3.5), (1.5, 6.0)] {
        for (what, at) in ["inside", "at seams"].iter().zip(&places) {
            let found = differences(mesh, &texture, &colour, at);
            let [mean, largest] = [mean(&found), largest(&found)];
            println!("{what}: mean {mean:.2}, largest {largest:.2} of 255");
            assert!(mean < mean_bound && largest < bound, "{what}: mean {mean:.2}, largest {largest:.2}");
        }
        texture = halved(&texture);
    }
    // With a texel for each of half as many again, what is beside a chart does show: the test can tell.
    texture = halved(&halved(&texture));
    let found = differences(mesh, &texture, &colour, &places[1]);
    assert!(largest(&found) > 20.0, "{}", largest(&found));
}

#[test]
fn neighbours_in_the_texture_do_not_show() {
    let volume = ball(grid(), 0.0);
    let colour = painted(&volume);
    let mesh = mesh_of(&volume);
    let charts = cut(&mesh, 0.005, |_| false);
    let mut atlas = Atlas::new(512);
    let places = atlas.place(&charts).unwrap();
    let mut owners = vec![usize::MAX; 512 * 512];
    let normals = mesh.angle_weighted_normals();
    let surface = Surface { mesh: &mesh, normals: &normals, colour: &colour, grid: &grid() };
    for (number, (chart, place)) in charts.iter().zip(&places).enumerate() {
        for y in 0..place.size[1] {
            for x in 0..place.size[0] {
                let owner = &mut owners[((place.at[1] + y) * 512 + place.at[0] + x) as usize];
                assert_eq!(*owner, usize::MAX, "texels of two charts");
                *owner = number;
            }
        }
        let patch = Patch::new(chart, place, atlas.density(), &surface);
        let padding = f64::from(atlas.padding());
        for corner in patch.corners.iter().flatten() {
            for axis in 0..2 {
                let end = f64::from(place.size[axis]) - padding;
                assert!(
                    (padding - 1e-6..=end + 1e-6).contains(&corner[axis]),
                    "{corner:?} of {:?}",
                    place.size
                );
            }
        }
        assert!(place.at.iter().chain(&place.size).all(|texels| texels % atlas.padding() == 0));
    }
}

#[test]
fn every_face_is_in_one_chart_and_none_covers_another() {
    let mesh = mesh_of(&ball(grid(), 0.0));
    let charts = cut(&mesh, 0.005, |_| false);
    let mut faces: Vec<u32> = charts.iter().flat_map(|chart| chart.faces.iter().copied()).collect();
    faces.sort_unstable();
    assert_eq!(faces, (0..mesh.triangles.len() as u32).collect::<Vec<_>>());
    println!("{} charts of {} faces", charts.len(), faces.len());
    assert!(12 * charts.len() < faces.len());
    // Two sheets of one face each, one behind the other, joined at a corner.
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 0.005;
    let folded = TriangleMesh {
        vertices: vec![
            at(1.0, 1.0, 1.0),
            at(4.0, 1.0, 1.0),
            at(1.0, 4.0, 1.0),
            at(4.0, 1.0, 2.0),
            at(1.0, 4.0, 2.0),
        ],
        triangles: vec![[0, 1, 2], [0, 3, 4]],
        ..TriangleMesh::default()
    };
    assert_eq!(cut(&folded, 0.005, |_| false).len(), 2);
}

#[test]
fn charts_keep_their_places() {
    let volumes: Vec<_> = [0.0, 0.1, 0.2, 0.3].map(|t| ball(grid(), t)).into();
    let charts_of = |volume: &SparseVolume, atlas: &Atlas| cut(&mesh_of(volume), 0.005, |key| atlas.has(key));
    let mut atlas = Atlas::new(1024);
    let mut before: BTreeMap<_, Place> = BTreeMap::new();
    for (frame, volume) in volumes.iter().enumerate() {
        let charts = charts_of(volume, &atlas);
        let places = atlas.place(&charts).unwrap();
        let area = |place: &Place| u64::from(place.size[0]) * u64::from(place.size[1]);
        let all: u64 = places.iter().map(area).sum();
        let kept = charts
            .iter()
            .zip(&places)
            .filter(|(chart, place)| before.get(&(chart.key, place.at)).is_some_and(|other| other == *place));
        let kept: u64 = kept.map(|(_, place)| area(place)).sum();
        println!("frame {frame}: {kept} of {all} texels stay where they were");
        assert!(frame == 0 || 10 * kept > 7 * all, "{kept} of {all}");
        before = charts.iter().zip(&places).map(|(chart, place)| ((chart.key, place.at), *place)).collect();
    }
    // A surface that stands still is laid out as it was.
    let again = atlas.place(&charts_of(&volumes[3], &atlas)).unwrap();
    let held: Vec<Place> = again.to_vec();
    assert!(held.iter().all(|place| before.values().any(|other| other == place)));
}

#[test]
fn what_does_not_fit_is_coarser_and_then_refused() {
    let volume = ball(grid(), 0.0);
    let charts = cut(&mesh_of(&volume), 0.005, |_| false);
    let mut densities = Vec::new();
    for side in [4096, 1024, 512, 256, 128] {
        let mut atlas = Atlas::new(side);
        atlas.place(&charts).unwrap();
        densities.push(atlas.density());
        assert_eq!(atlas.padding() == 4, atlas.density() >= 1.5, "{side}");
    }
    assert!(densities.is_sorted_by(|a, b| a >= b) && densities[0] > 4.0 * densities[4], "{densities:?}");
    let many: Vec<Chart> = (0..40).flat_map(|_| charts.clone()).collect();
    let refused = Atlas::new(64).place(&many).unwrap_err();
    assert_eq!(refused, TextureTooSmall { patches: many.len(), side: 64 });
}

#[test]
fn a_mesh_beside_its_surface_has_the_colour_that_is_near() {
    let volume = ball(grid(), 0.0);
    let colour = painted(&volume);
    let mut mesh = mesh_of(&volume);
    let normals = std::mem::take(&mut mesh.normals);
    let vertices = mesh.vertices.clone();
    // Two and a half voxels off, where no samples are.
    mesh.vertices.iter_mut().zip(&normals).for_each(|(vertex, normal)| *vertex += 0.0125 * *normal);
    let mut baker = TextureBaker::new(TextureSide::from_texels(1024).unwrap());
    baker.bake(&mut mesh, &colour, &grid()).unwrap();
    let on = surface_colours(&colour, &grid(), &vertices);
    let off = surface_colours(&colour, &grid(), &mesh.vertices);
    let of_vertex = |(a, b): (&[u8; 3], &[u8; 3])| (0..3).map(|c| a[c].abs_diff(b[c])).max().map(f64::from);
    let of_vertices: Vec<f64> = on.iter().zip(&off).filter_map(of_vertex).collect();
    assert!(mean(&of_vertices) < 3.0, "{}", mean(&of_vertices));
    let material = &appearance(&mesh).materials[0];
    let mut apart: Vec<f64> = Vec::new();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let read = material.colour(appearance(&mesh).texture_coordinates[face][0]);
        let wanted = on[triangle[0] as usize];
        apart.push((0..3).map(|c| f64::from(read[c] - f32::from(wanted[c])).abs()).fold(0.0, f64::max));
    }
    println!("mean and largest: {:.2}, {:.2}", mean(&apart), largest(&apart));
    assert!(mean(&apart) < 3.0);
}

#[test]
fn nothing_gives_an_empty_texture() {
    let mut baker = TextureBaker::new(TextureSide::from_texels(64).unwrap());
    let mut mesh = TriangleMesh::default();
    baker.bake(&mut mesh, &ColourFrame::default(), &grid()).unwrap();
    assert!(appearance(&mesh).texture_coordinates.is_empty());
    assert_eq!(TextureSide::from_texels(63), None);
    assert_eq!(TextureSide::from_texels(8193), None);
}
