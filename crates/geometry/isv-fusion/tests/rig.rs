//! A virtual rig of eight depth cameras around a captured human. Prints what it measured: run with `--nocapture`.

mod support;

use glam::{DVec2, DVec3};
use isv_fusion::{FusionSettings, fuse};
use isv_metrics::{SurfaceSample, distances_to_surface, sample_surface};
use isv_spatial::Bvh;
use isv_testkit::{camera_ring, capture, render_depth};
use isv_volume::{DepthImage, Intrinsics, TriangleMesh};
use support::{Coder, grid, mean, pieces};

/// A common depth camera: 640 x 576 pixels, 65 by 60 degrees.
const LENS: Intrinsics =
    Intrinsics { width: 640, height: 576, focal: DVec2::splat(504.0), principal: DVec2::new(319.5, 287.5) };

/// Whether a camera saw a point of the surface. The depth at the point's pixel must be the point's to 5 mm (a
/// pixel covers about 4 mm). The ray must meet the surface at 10 degrees or more.
fn saw(image: &DepthImage, sample: &SurfaceSample) -> bool {
    let at = image.pose().to_camera(sample.point);
    let pixel = image.intrinsics().project(at).round();
    let slant = (image.pose().centre - sample.point).normalize().dot(sample.normal).abs();
    let inside = pixel.min_element() >= 0.0 && pixel.x < 640.0 && pixel.y < 576.0;
    inside
        && slant > 10f64.to_radians().sin()
        && image.depth_m(pixel.x as u32, pixel.y as u32).is_some_and(|z| (f64::from(z) - at.z).abs() < 0.005)
}

/// Mean distance from seen points of the source to a mesh, and from the mesh to the source, in millimetres.
fn errors_mm(seen: &[DVec3], source: &Bvh, mesh: &TriangleMesh) -> [f64; 2] {
    let back: Vec<DVec3> = sample_surface(mesh, 0.005, 2).iter().map(|s| s.point).collect();
    [distances_to_surface(seen, &Bvh::new(mesh)), distances_to_surface(&back, source)]
        .map(|d| 1000.0 * mean(&d))
}

#[test]
fn eight_cameras_around_dancer() {
    let mut coder = Coder::new(grid(0.005));
    for frame in [0, 1, 2] {
        let Some(path) = capture(&format!("dancer/frame_{frame:04}.ply")) else { return };
        let mesh = isv_io::read_mesh(&path, isv_io::Unit::Metre).unwrap();
        let poses = camera_ring(mesh.bounds().unwrap(), &LENS);
        let images = poses.map(|pose| render_depth(&mesh, &LENS, &pose));
        let samples = sample_surface(&mesh, 0.005, 1);
        let seen: Vec<DVec3> =
            samples.iter().filter(|s| images.iter().any(|i| saw(i, s))).map(|s| s.point).collect();

        let volume = fuse(&images, &FusionSettings::new(grid(0.005))).unwrap();
        let fused = support::surface(&volume);
        let (coded, bytes) = coder.code(&volume);
        let source = Bvh::new(&mesh);
        let (before, after) = (errors_mm(&seen, &source, &fused), errors_mm(&seen, &source, &coded));
        let ends = distances_to_surface(&coded.vertices, &source);
        let largest = ends.iter().copied().fold(0.0, f64::max) * 1000.0;
        let sizes = pieces(&coded);
        println!(
            "dancer {frame}: {:.3} of the source seen; {} blocks, {} with masks, {bytes} bytes; source to mesh and back \
             {before:.3?} mm before coding, {after:.3?} after, largest {largest:.1} mm back; {} pieces of {:?} triangles",
            seen.len() as f64 / samples.len() as f64,
            volume.block_count(),
            volume.unobserved_masks().len(),
            sizes.len(),
            &sizes[..sizes.len().min(4)],
        );
        assert!(after[0] <= 1.2 && after[1] <= 1.2, "{after:.3?} mm");
        assert!(before[0] <= 0.6 && before[1] <= 0.5, "{before:.3?} mm");
        assert!(largest < 20.0, "{largest} mm");
        // What coding leaves beside the surface's rims is a few single triangles.
        let specks: usize = sizes[1..].iter().sum();
        assert!(specks * 1000 < sizes[0], "{sizes:?}");
    }
}
