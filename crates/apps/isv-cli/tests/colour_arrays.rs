//! `isv decode --as volume` of streams with colour.

mod support;

use support::Workspace;

/// The shape that an array of NumPy states, and its data.
fn array(work: &Workspace, name: &str) -> (String, Vec<u8>) {
    let bytes = work.read(name);
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = String::from_utf8_lossy(&bytes[10..data]).into_owned();
    (header.split("'shape': ").nth(1).unwrap().trim_end().to_owned(), bytes[data..].to_vec())
}

fn floats(bytes: &[u8]) -> Vec<[f32; 3]> {
    let float = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    bytes.chunks_exact(12).map(|row| [float(&row[..4]), float(&row[4..8]), float(&row[8..])]).collect()
}

#[test]
fn colours_of_the_surface_lie_beside_the_arrays() {
    let work = Workspace::with_painted_balls(2);
    let encode = ["encode", "balls", "-o", "take.isv", "--voxel", "20mm", "--fps", "30"];
    work.isv(&[&encode[..], &["--colour-quality", "80"]].concat()).done();
    work.isv(&["decode", "take.isv", "-o", "arrays", "--as", "volume"]).done();
    let of = |name: &str| array(&work, &format!("arrays/frame_0001/{name}"));
    let [(shape, positions), (normals_shape, normals), (colours_shape, colours)] =
        ["colour_position.npy", "colour_normal.npy", "colour_rgb.npy"].map(of);
    assert_eq!((&shape, &shape), (&normals_shape, &colours_shape));
    let (positions, normals) = (floats(&positions), floats(&normals));
    assert!(positions.len() > 5_000 && shape.starts_with(&format!("({}, 3", positions.len())), "{shape}");
    assert_eq!((normals.len(), colours.len()), (positions.len(), 3 * positions.len()));
    let (mut error, mut straight) = (0.0, 0.0);
    for ((position, normal), colour) in positions.iter().zip(&normals).zip(colours.chunks_exact(3)) {
        let radius = position.iter().map(|p| p * p).sum::<f32>().sqrt();
        assert!((radius - 0.3).abs() < 0.02, "{position:?}");
        let outwards: f32 = (0..3).map(|axis| position[axis] * normal[axis] / radius).sum();
        assert!(outwards > 0.5, "{position:?}, {normal:?}");
        straight += outwards;
        let painted = |axis: usize| 128.0 + 100.0 * (9.0 * position[axis] + 0.2).sin();
        error += (0..3).map(|axis| (f32::from(colour[axis]) - painted(axis)).abs()).sum::<f32>();
    }
    let straight = straight / normals.len() as f32;
    assert!(straight > 0.95, "normals point outwards: {straight}");
    let error = error / colours.len() as f32;
    assert!(error < 4.0, "{error} of 255 on average");
    // Colours of another stream do not stay beside its volumes.
    std::fs::remove_file(work.path("take.isv")).unwrap();
    work.isv(&[&encode[..], &["--no-colour"]].concat()).done();
    work.isv(&["decode", "take.isv", "-o", "arrays", "--as", "volume"]).done();
    let names = work.names("arrays/frame_0001");
    assert!(names.iter().all(|name| !name.starts_with("colour")), "{names:?}");
}
