//! Dense fields as NumPy files, on the command line.

mod support;

use support::Workspace;

const EXTENTS: [usize; 3] = [24, 20, 16];

/// A file of `float32` in truncation distances of 8 cm, of a ball with a radius of 12 cm; the axes by name, slowest first.
fn ball(axes: &str) -> Vec<u8> {
    let order = axes.bytes().map(|axis| usize::from(axis - b'x')).collect::<Vec<_>>();
    let shape: Vec<usize> = order.iter().map(|axis| EXTENTS[*axis]).collect();
    let mut data = Vec::new();
    for i in 0..shape[0] {
        for j in 0..shape[1] {
            for k in 0..shape[2] {
                let mut at = [0.0; 3];
                order.iter().zip([i, j, k]).for_each(|(axis, c)| at[*axis] = c as f64 + 0.5);
                let centre = [13.0, 10.2, 7.7];
                let squares = at.iter().zip(centre).map(|(c, centre)| (c - centre).powi(2));
                let distance = (squares.sum::<f64>().sqrt() - 6.0) / 4.0;
                data.extend((distance.clamp(-1.0, 1.0) as f32).to_le_bytes());
            }
        }
    }
    array(&format!("({}, {}, {})", shape[0], shape[1], shape[2]), &data)
}

fn array(shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

#[test]
fn a_field_is_encoded_in_either_order_of_axes() {
    let work = Workspace::new();
    work.write("zyx.npy", ball("zyx"));
    work.write("xyz.npy", ball("xyz"));
    let encode = |input: &str, more: &[&str]| {
        work.isv(&[&["encode", input, "-o", "take.isv", "--voxel", "2cm"], more].concat()).done().stderr()
    };
    let said = encode("zyx.npy", &[]);
    assert!(said.contains("a value of 1 is taken as 0.08") && said.contains("--tsdf-scale"), "{said}");
    let stream = work.read("take.isv");
    encode("xyz.npy", &["--axes", "xyz"]);
    assert!(stream == work.read("take.isv"));
    let said = encode("zyx.npy", &["--axes", "zyx", "--tsdf-scale", "8cm", "--sample-at", "centre"]);
    assert!(!said.contains("--tsdf-scale") && stream == work.read("take.isv"), "{said}");
    encode("zyx.npy", &["--sample-at", "corner"]);
    assert!(stream != work.read("take.isv"));
    // The place of the ball, 26 x 20.4 x 15.4 cm, in the mesh that is decoded.
    encode("zyx.npy", &[]);
    work.isv(&["decode", "take.isv", "-o", "mesh.obj"]).done();
    let text = String::from_utf8(work.read("mesh.obj")).unwrap();
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for line in text.lines().filter(|line| line.starts_with("v ")) {
        for (bounds, number) in bounds.iter_mut().zip(line[2..].split_whitespace()) {
            let c: f64 = number.parse().unwrap();
            *bounds = [bounds[0].min(c), bounds[1].max(c)];
        }
    }
    for ([low, high], centre) in bounds.into_iter().zip([0.26, 0.204, 0.154]) {
        assert!((low - centre + 0.12).abs() < 0.004 && (high - centre - 0.12).abs() < 0.004, "{bounds:?}");
    }
}

#[test]
fn flags_of_fields_have_no_effect_elsewhere_and_say_so() {
    let work = Workspace::with_figure(1);
    let said = work.isv(&[&support::ENCODE[..], &["--axes", "xyz"]].concat()).done().stderr();
    assert!(said.contains("without effect") && said.contains("--axes"), "{said}");
}

#[test]
fn what_is_no_field_is_refused() {
    let work = Workspace::new();
    work.write("points.npy", array("(4, 3)", &[0; 48]));
    work.isv(&["encode", "points.npy", "-o", "take.isv"])
        .fails(1, &["points.npy", "shape (4, 3) is not a dense field", "points belong in a .ply"]);
    work.write("bad.npz", b"PK");
    work.isv(&["encode", "bad.npz", "-o", "take.isv"]).fails(1, &["bad.npz", "not an archive"]);
}
