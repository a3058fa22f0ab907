//! Real captures with textures.

use super::*;
use isv_io::Animation;
use isv_testkit::capture;
use std::sync::Arc;

#[test]
fn frames_of_a_capture_have_their_textures() {
    let Some(folder) = capture("liam_textured") else { return };
    for frame in [0, 15] {
        let path = folder.join(format!("frame_{frame:04}.glb"));
        let mesh = as_mesh(read_geometry_as(&path, &KEEP).unwrap());
        let appearance = appearance(&mesh);
        let [material] = &appearance.materials[..] else {
            panic!("{} materials", appearance.materials.len())
        };
        let image = material.texture.as_ref().unwrap();
        assert_eq!((image.width(), image.height()), (1024, 1024));
        assert_eq!(appearance.texture_coordinates.len(), mesh.triangles.len());
        assert!(
            appearance
                .texture_coordinates
                .as_flattened()
                .as_flattened()
                .iter()
                .all(|value| value.is_finite())
        );
        // A person is neither black nor white nor of one colour.
        let colours: Vec<_> =
            (0..mesh.triangles.len()).map(|face| colour(&mesh, face, [1.0 / 3.0; 3])).collect();
        let mean = |channel: usize| {
            colours.iter().map(|colour| f64::from(colour[channel])).sum::<f64>() / colours.len() as f64
        };
        assert!((20.0..200.0).contains(&mean(0)), "{}", mean(0));
        assert!(colours.iter().any(|colour| colour[0] > colour[2] + 30), "skin");
    }
}

#[test]
fn poses_of_a_figure_share_one_appearance() {
    let Some(path) = capture("soldier/soldier.glb") else { return };
    let animation = Animation::open_with(&path, &KEEP).unwrap();
    let poses = [0.0, 0.1, 0.2].map(|seconds| animation.mesh_at(seconds).unwrap());
    let look = poses[0].appearance.as_ref().unwrap();
    assert!(poses.iter().all(|pose| Arc::ptr_eq(pose.appearance.as_ref().unwrap(), look)));
    assert_eq!(look.materials.len(), 2);
    let images: Vec<_> = look.materials.iter().map(|material| material.texture.as_ref().unwrap()).collect();
    assert!(Arc::ptr_eq(images[0], images[1]), "both materials name one image");
    assert!(look.materials.iter().all(|material| material.base_colour == [0.8; 3]));
    assert_ne!(poses[0].vertices, poses[2].vertices);
}
