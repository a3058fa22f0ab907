//! Colours of points: PCD, XYZ, LAS, LAZ, E57, and frames from a pipe.

use super::*;
use isv_io::FrameStream;
use isv_testfiles::{e57, lidar};

#[test]
fn packed_colours_of_pcd_keep_their_bits() {
    let header = |kind: &str, data: &str| {
        format!("FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F {kind}\nPOINTS 2\nDATA {data}\n")
    };
    // With alpha, the second one is a signalling NaN as a float.
    let bits = [0x0001_02ffu32, 0xffa0_0102];
    let rows: Vec<u8> =
        bits.iter().flat_map(|bits| [[0; 12].to_vec(), bits.to_le_bytes().to_vec()].concat()).collect();
    for kind in ["F", "U", "I"] {
        let file = [header(kind, "binary").as_bytes(), &rows].concat();
        assert_eq!(
            as_points(read(&[("a.pcd", &file)]).unwrap()).colours,
            [[1, 2, 255], [160, 1, 2]],
            "{kind}"
        );
    }
    for (kind, words) in [("U", ["66303", "4288676098"]), ("I", ["66303", "-6291198"])] {
        let file = format!("{}0 0 0 {}\n0 0 0 {}\n", header(kind, "ascii"), words[0], words[1]);
        assert_eq!(
            as_points(read(&[("a.pcd", file.as_bytes())]).unwrap()).colours,
            [[1, 2, 255], [160, 1, 2]]
        );
    }
    // As the Point Cloud Library prints it: 0x4a808080.
    let file = format!("{}0 0 0 4.2107520e+06\n0 0 0 0\n", header("F", "ascii"));
    assert_eq!(as_points(read(&[("a.pcd", file.as_bytes())]).unwrap()).colours, [[128; 3], [0; 3]]);
}

#[test]
fn pcd_may_have_a_field_a_channel() {
    let text = "FIELDS x y z r g b\nSIZE 4 4 4 1 1 1\nTYPE F F F U U U\nPOINTS 1\nDATA ascii\n1 2 3 7 8 9\n";
    assert_eq!(as_points(read(&[("a.pcd", text.as_bytes())]).unwrap()).colours, [[7, 8, 9]]);
    let organised =
        "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nWIDTH 1\nHEIGHT 2\nDATA ascii\nnan 0 0 1\n1 2 3 255\n";
    assert_eq!(as_points(read(&[("a.pcd", organised.as_bytes())]).unwrap()).colours, [BLUE]);
}

#[test]
fn columns_of_xyz_are_colours_by_name_or_by_their_numbers() {
    let colours = |text: &str| as_points(read(&[("a.xyz", text.as_bytes())]).unwrap()).colours;
    assert_eq!(colours("1 2 3 255 0 0\n1 2 3 0 255 0\n"), [RED, GREEN]);
    assert_eq!(colours("1 2 3 0.5 255 0 0\n1 2 3 .7 0 255 0\n"), [RED, GREEN]);
    assert_eq!(colours("1 2 3 255 0 0 0.5\n1 2 3 0 255 0 700\n"), [RED, GREEN], "behind the colour");
    assert_eq!(colours("1 2 3 255 0 255 0\n"), [[0, 255, 0]], "before it, where either may be");
    assert_eq!(colours("//X,Y,Z,Rf,Gf,Bf\n1,2,3,1,0,0.5\n1,2,3,0,1,0\n"), [[255, 0, 128], GREEN]);
    assert_eq!(colours("x y z red green blue\n1 2 3 1 0 0\n"), [[1, 0, 0]], "whole numbers are bytes");
    assert_eq!(colours("1 2 3 255 0.5 0\n"), [[0u8; 3]; 0], "who knows");
    assert_eq!(colours("1 2 3 0 0 1\n"), [[0u8; 3]; 0], "a normal");
    assert_eq!(colours("1 2 3 300 0 1\n"), [[0u8; 3]; 0]);
    assert_eq!(colours("1 2 3\n"), [[0u8; 3]; 0]);
}

#[test]
fn colours_of_las_have_16_bits_or_8() {
    for format in [2, 3, 5, 7, 8, 10] {
        let plain = lidar::file(format, false, 0, 20);
        let read_plain = as_points(read(&[("a.las", &plain)]).unwrap());
        let wide = read_plain.colours;
        assert_eq!(wide.len(), read_plain.positions.len(), "format {format}: withheld ones are dropped");
        for items in lidar::item_versions(format, 0) {
            for chunk in [7, 1000] {
                let packed = lidar::compressed(&plain, items.clone(), chunk);
                assert_eq!(as_points(read(&[("a.laz", &packed)]).unwrap()).colours, wide, "format {format}");
            }
        }
        let (offset, record) = (u32::from_le_bytes(*plain[96..].first_chunk().unwrap()) as usize, 20);
        let bytes = u16::from_le_bytes(*plain[105..].first_chunk().unwrap()) as usize;
        let at = [(2, 20), (3, 28), (5, 28), (7, 30), (8, 30), (10, 30)]
            .iter()
            .find(|at| at.0 == format)
            .unwrap()
            .1;
        let with = |colour: [u16; 3]| {
            let mut file = plain.clone();
            for point in 0..record {
                let place = offset + point * bytes + at;
                let colour: Vec<u8> = colour.iter().flat_map(|value| value.to_le_bytes()).collect();
                file[place..place + 6].copy_from_slice(&colour);
            }
            as_points(read(&[("a.las", &file)]).unwrap()).colours.first().copied()
        };
        assert_eq!(with([65535, 257, 0]), Some([255, 1, 0]));
        assert_eq!(with([255, 1, 0]), Some([255, 1, 0]), "some writers put 8 bits there");
        assert_eq!(with([0; 3]), None, "others leave them out");
    }
    for format in [0, 1, 4, 6, 9] {
        assert!(as_points(read(&[("a.las", &lidar::file(format, false, 0, 5))]).unwrap()).colours.is_empty());
    }
}

#[test]
fn frames_of_a_pipe_keep_colours_if_they_are_asked_for() {
    let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n1 2 3 255 0 0\n";
    let pipe = format!("{file}{file}");
    for (colours, expected) in [(Colours::Keep, vec![RED]), (Colours::Drop, vec![])] {
        let frames = FrameStream::new(pipe.as_bytes(), Unit::Metre).unwrap().with_colours(colours);
        let found: Vec<_> = frames.map(|frame| as_points(frame.unwrap().1).colours).collect();
        assert_eq!(found, [expected.clone(), expected]);
    }
    let archive = isv_testfiles::tar::archive([("0.ply", file.as_bytes())]);
    let mut frames = FrameStream::new(&archive[..], Unit::Metre).unwrap().with_colours(Colours::Keep);
    assert_eq!(as_points(frames.next().unwrap().unwrap().1).colours, [RED]);
}

#[test]
fn colours_of_e57_have_the_range_of_their_type() {
    let coloured = as_points(read(&[("a.e57", &e57::file(vec![e57::of_all_types()]))]).unwrap());
    assert_eq!(coloured.colours.len(), coloured.positions.len());
    // Points of a scan without colours are white beside others.
    let both = e57::file(vec![e57::cartesian(None), e57::of_all_types()]);
    let both = as_points(read(&[("a.e57", &both)]).unwrap());
    let first = both.positions.len() - coloured.positions.len();
    assert!(both.colours[..first].iter().all(|colour| *colour == WHITE));
    assert_eq!(both.colours[first..], coloured.colours);
    let none = as_points(read(&[("a.e57", &e57::file(vec![e57::cartesian(None)]))]).unwrap());
    assert!(none.colours.is_empty());
}
