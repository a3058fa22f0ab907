//! Sheets that end anywhere keep their surface, wherever they lie on the grid.

use isv::{EncodeOptions, Mesh, Points, Quantity, Reader, Writer};

/// Area of triangles.
fn area(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> f64 {
    let at = |corner: u32| positions[corner as usize].map(f64::from);
    let of_triangle = |[a, b, c]: [u32; 3]| {
        let (a, b, c) = (at(a), at(b), at(c));
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        0.5 * cross.iter().map(|c| c * c).sum::<f64>().sqrt()
    };
    triangles.iter().map(|triangle| of_triangle(*triangle)).sum()
}

/// Area of what becomes of a frame at voxels of 1 cm.
fn coded(quality: f32, push: impl FnOnce(&mut Writer<Vec<u8>>)) -> f64 {
    let options = EncodeOptions::quality(quality).voxel(10.mm());
    let mut writer = Writer::new(Vec::new(), &options).unwrap();
    push(&mut writer);
    let (bytes, _) = writer.into_inner().unwrap();
    let mut reader = Reader::from_bytes("coded", bytes).unwrap();
    let mesh = reader.next_frame().unwrap().unwrap().mesh().unwrap();
    area(&mesh.positions, &mesh.triangles)
}

#[test]
fn squares_near_voxel_centres_beside_a_block_keep_their_area() {
    // Voxel centres lie at 0.5, and blocks of 8 begin at 0.
    for height in [0.45, 0.495, 0.505, 0.51, 0.55, 1.505, 7.49, 7.505] {
        for quality in [50.0, 80.0] {
            let z = 0.01 * height;
            let positions =
                vec![[-0.047, -0.043, z], [0.053, -0.043, z], [0.053, 0.057, z], [-0.047, 0.057, z]];
            let mesh = Mesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
            let area = coded(quality, |writer| writer.push_mesh(&mesh).unwrap()) / 0.01;
            println!("{height} at {quality}: {area:.3}");
            assert!((0.9..1.1).contains(&area), "{height} at {quality}: {area}");
        }
    }
}

#[test]
fn few_points_near_voxel_centres_beside_a_block_keep_their_area() {
    for height in [0.51f32, 1.51, 7.49] {
        let place = |number: usize| {
            let [i, j] = [number / 8, number % 8].map(|at| 0.005 * (at as f32 - 3.5));
            [0.003 + i, 0.002 + j, 0.01 * height]
        };
        let points = Points {
            positions: (0..64).map(place).collect(),
            normals: vec![[0.0, 0.0, 1.0]; 64],
            ..Points::default()
        };
        let area = coded(80.0, |writer| writer.push_points(&points).unwrap()) / 0.035f64.powi(2);
        println!("{height}: {area:.3}");
        assert!((1.0..3.0).contains(&area), "{height}: {area}");
    }
}
