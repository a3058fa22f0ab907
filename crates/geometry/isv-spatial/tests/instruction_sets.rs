//! Winding numbers are the same bit for bit with every instruction set that the machine has.

use isv_kernels::simd;
use isv_spatial::WindingNumber;
use isv_testkit::{Random, soup, sphere};

#[test]
fn winding_numbers() {
    for seed in 0..20 {
        let mesh = if seed % 2 == 0 { sphere(1.0, 4 + seed as u32) } else { soup(seed, 30 * seed as u32) };
        let winding = WindingNumber::new(&mesh);
        let mut random = Random::new(seed);
        let mut points: Vec<_> = (0..203).map(|_| random.point() * 1.5).collect();
        // Corners and places on edges, where solid angles are undefined.
        points.extend(mesh.vertices.iter().take(40));
        points.extend(mesh.triangles.iter().take(40).map(|face| {
            let [a, b, _] = face.map(|v| mesh.vertices[v as usize]);
            a.lerp(b, 0.5)
        }));
        let runs = simd::with_each(|| {
            winding.at_points(&points).into_iter().map(f64::to_bits).collect::<Vec<u64>>()
        });
        for (instructions, found) in &runs {
            assert!(*found == runs[0].1, "{instructions}, seed {seed}");
        }
    }
}
