//! The library as its users see it: every way in and out, and every wrong value an error.
#![cfg(feature = "encode")]

use isv::{
    AfterLoss, Block, Cancellation, ColourView, DecodeOptions, DepthView, EncodeOptions, Error, ErrorKind,
    Lod, Mesh, PartChanges, Points, Preset, Quantity, Reader, SurfaceParts, TimestampSource, Unit, Volume,
    Writer, take,
};
use std::io::Cursor;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A box of some metres along x, 0.4 m along y and z, whose lowest corner is at `x`.
fn cuboid(x: f32, length: f32) -> Mesh {
    let corner = |i: u32| {
        [
            x + if i & 1 == 0 { 0.0 } else { length },
            if i & 2 == 0 { 0.0 } else { 0.4 },
            if i & 4 == 0 { 0.0 } else { 0.4 },
        ]
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    Mesh { positions: (0..8).map(corner).collect(), triangles: triangles.collect(), ..Mesh::default() }
}

fn options() -> EncodeOptions {
    EncodeOptions::quality(60.0).voxel(20.mm())
}

/// A stream of boxes that move 1 cm a frame.
fn stream(options: &EncodeOptions, frames: usize) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), options).unwrap();
    for frame in 0..frames {
        writer.push_mesh(&cuboid(0.01 * frame as f32, 0.5)).unwrap();
    }
    let (bytes, report) = writer.into_inner().unwrap();
    assert_eq!((report.frames, report.bytes), (frames, bytes.len() as u64));
    bytes
}

fn reader(bytes: &[u8]) -> Reader {
    Reader::from_read("test", Cursor::new(bytes.to_vec()))
}

/// Smallest and largest corner (m).
fn bounds(positions: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let fold = |start: f32, pick: fn(f32, f32) -> f32| {
        positions.iter().fold([start; 3], |at, p| std::array::from_fn(|axis| pick(at[axis], p[axis])))
    };
    [fold(f32::MAX, f32::min), fold(f32::MIN, f32::max)]
}

#[track_caller]
fn assert_near(found: [[f32; 3]; 2], expected: [[f32; 3]; 2], tolerance: f32) {
    let pairs = found.as_flattened().iter().zip(expected.as_flattened());
    assert!(pairs.clone().all(|(a, b)| (a - b).abs() < tolerance), "{found:?}, not {expected:?}");
}

#[track_caller]
fn kind<T>(result: Result<T, Error>) -> ErrorKind {
    match result {
        Ok(_) => panic!("no error"),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            error.kind()
        }
    }
}

#[test]
fn meshes_come_back_where_they_were() {
    let bytes = stream(&options().fps(25), 5);
    let frames: Vec<_> = reader(&bytes).map(Result::unwrap).collect();
    assert_eq!(frames.len(), 5);
    for (number, frame) in frames.iter().enumerate() {
        let mesh = frame.mesh().unwrap();
        let x = 0.01 * number as f32;
        assert_near(bounds(&mesh.positions), [[x, 0.0, 0.0], [x + 0.5, 0.4, 0.4]], 0.01);
        assert_eq!((frame.number(), frame.timestamp()), (number, Duration::from_millis(40 * number as u64)));
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        let is_unit = |n: &[f32; 3]| (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-3;
        assert!(mesh.normals.iter().all(is_unit));
    }
}

/// A stream of coloured boxes: red at their lower end along x, blue at the other.
fn coloured_stream(options: &EncodeOptions, frames: usize) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), options).unwrap();
    for frame in 0..frames {
        let mut mesh = cuboid(0.01 * frame as f32, 0.5);
        mesh.colours = (0..8).map(|i| if i & 1 == 0 { [220, 30, 30] } else { [30, 30, 220] }).collect();
        writer.push_mesh(&mesh).unwrap();
    }
    writer.into_inner().unwrap().0
}

/// Asserts that vertices near both ends of a box have the colours of these.
#[track_caller]
fn assert_painted(mesh: &Mesh) {
    assert_eq!(mesh.colours.len(), mesh.positions.len());
    let [low, high] = bounds(&mesh.positions);
    for (position, [red, _, blue]) in mesh.positions.iter().zip(&mesh.colours) {
        let along = (position[0] - low[0]) / (high[0] - low[0]);
        if !(0.2..=0.8).contains(&along) {
            assert_eq!(red > blue, along < 0.5, "{position:?}: red {red}, blue {blue}");
        }
    }
}

#[test]
fn colours_come_back_unless_they_are_left_out() {
    let bytes = coloured_stream(&options(), 4);
    for frame in reader(&bytes) {
        assert_painted(&frame.unwrap().mesh().unwrap());
    }
    let plain = reader(&bytes).without_colour().next().unwrap().unwrap().mesh().unwrap();
    assert!(plain.colours.is_empty());
    let dropped = coloured_stream(&options().without_colour(), 4);
    assert!(dropped == stream(&options(), 4), "a stream without colour is as if there were none");
    let finer = coloured_stream(&options().colour_quality(90.0), 4);
    assert!(finer.len() > bytes.len());
    for quality in [-1.0, 100.5, f32::NAN] {
        assert_eq!(kind(options().colour_quality(quality).check()), ErrorKind::Options);
    }
    assert_eq!(kind(EncodeOptions::new().as_in_paper().colour_quality(50.0).check()), ErrorKind::Options);
}

/// Position, normal and colour of a corner of a triangle.
type Corner = ([f32; 3], [f32; 3], [u8; 3]);

fn corners(mesh: &Mesh) -> Vec<[Corner; 3]> {
    let corner = |v: u32| (mesh.positions[v as usize], mesh.normals[v as usize], mesh.colours[v as usize]);
    mesh.triangles.iter().map(|triangle| triangle.map(corner)).collect()
}

#[test]
fn parts_of_a_surface_change_where_something_moves() {
    // One box stands, another one 2 m away moves.
    let mut writer = Writer::new(Vec::new(), &options()).unwrap();
    for frame in 0..4 {
        let (mut mesh, moving) = (cuboid(0.0, 0.5), cuboid(2.0 + 0.01 * frame as f32, 0.5));
        mesh.triangles.extend(moving.triangles.iter().map(|triangle| triangle.map(|v| v + 8)));
        mesh.positions.extend(moving.positions);
        mesh.colours = mesh.positions.iter().map(|[x, ..]| [(80.0 * x) as u8, 90, 40]).collect();
        writer.push_mesh(&mesh).unwrap();
    }
    let bytes = writer.into_inner().unwrap().0;
    let mut surface = SurfaceParts::new();
    for frame in reader(&bytes) {
        let frame = frame.unwrap();
        let changes = surface.update(&frame).unwrap();
        let parts = surface.places().map(|place| surface.mesh(place, &frame).unwrap());
        let together: Vec<_> = parts.flat_map(|mesh| corners(&mesh)).collect();
        assert!(together == corners(&frame.mesh().unwrap()), "frame {}", frame.number());
        if frame.number() > 0 {
            // Of 4 blocks of 16 cm each.
            assert!(
                !changes.changed.is_empty() && changes.changed.iter().all(|[x, ..]| 0.16 * *x as f32 > 1.0)
            );
        }
        assert_eq!(surface.update(&frame).unwrap(), PartChanges::default());
    }
    assert_eq!(surface.mesh([1000, 0, 0], &reader(&bytes).next().unwrap().unwrap()), None);
}

/// With gradual refresh, a viewer that comes late has colours too.
#[test]
fn a_stream_can_be_entered_with_its_colours() {
    let options = options().refresh(isv::Refresh::Gradual).gop(4);
    let bytes = coloured_stream(&options, 10);
    let header = 48;
    // The first packet is lost.
    let second = 1 + header + bytes[header + 1..].windows(4).position(|four| four == b"ISVP").unwrap();
    let late = [&bytes[..header], &bytes[second..]].concat();
    let frames: Vec<_> = reader(&late).after_loss(AfterLoss::Hold).map(Result::unwrap).collect();
    assert!(frames.len() >= 5, "{} frames", frames.len());
    assert_painted(&frames[frames.len() - 1].mesh().unwrap());
}

#[test]
fn points_depth_and_fields_become_streams_too() {
    let corner = |i: usize, j: usize| [0.01 * i as f32, 0.01 * j as f32, 0.0];
    let positions: Vec<_> = (0..40 * 40).map(|k| corner(k % 40, k / 40)).collect();
    let normals = vec![[0.0, 0.0, 1.0]; positions.len()];
    let colours = vec![[200, 90, 20]; positions.len()];
    let points = Points { normals, positions, colours, viewpoint: None };
    let mut writer = Writer::new(Vec::new(), &options()).unwrap();
    writer.push_points(&points).unwrap();
    let (bytes, _) = writer.into_inner().unwrap();
    let mesh = reader(&bytes).next_frame().unwrap().unwrap().mesh().unwrap();
    assert_near(bounds(&mesh.positions), [[0.0, 0.0, 0.0], [0.39, 0.39, 0.0]], 0.05);
    let is_orange = |[r, g, b]: &[u8; 3]| r.abs_diff(200) < 9 && g.abs_diff(90) < 9 && b.abs_diff(20) < 9;
    // Beyond the rim of the sheet nothing was seen.
    let orange = mesh.colours.iter().filter(|colour| is_orange(colour)).count();
    assert!(
        orange * 10 > mesh.positions.len() * 9,
        "{orange} of {}: {:?}",
        mesh.positions.len(),
        mesh.colours
    );

    let view = DepthView {
        width: 64,
        height: 48,
        focal: [60.0, 60.0],
        principal: [31.5, 23.5],
        camera_to_world: [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]],
        depths_m: vec![1.0; 64 * 48],
    };
    // No voxel is chosen: it fits the pixels.
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new()).unwrap();
    writer.push_depth(std::slice::from_ref(&view)).unwrap();
    assert_eq!(kind(writer.push_depth(&[DepthView { depths_m: vec![1.0; 7], ..view }])), ErrorKind::Frame);
    let (bytes, report) = writer.into_inner().unwrap();
    assert!(report.voxel.metres() >= 0.01, "{}", report.voxel);
    let mesh = reader(&bytes).next_frame().unwrap().unwrap().mesh().unwrap();
    assert!(mesh.positions.iter().all(|p| (p[2] - 1.0).abs() < 0.02));
}

#[test]
fn colour_cameras_paint_what_depth_cameras_saw() {
    let camera_to_world = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
    let (width, height, focal, principal) = (64, 48, [60.0, 60.0], [31.5, 23.5]);
    let depth = DepthView { width, height, focal, principal, camera_to_world, depths_m: vec![1.0; 64 * 48] };
    let pixel = |k: u32| if k % width < 32 { [210, 40, 40] } else { [40, 40, 210] };
    let colours = (0..width * height).map(pixel).collect();
    let colour =
        ColourView { width, height, focal, principal, camera_to_world, colours, depth_view: Some(0) };
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new().voxel(20.mm())).unwrap();
    let short = ColourView { colours: vec![[0; 3]; 5], ..colour.clone() };
    let refused = writer.push_depth_and_colour(std::slice::from_ref(&depth), &[short]);
    assert_eq!(refused.unwrap_err().to_string(), "a colour view has 5 colours for 3072 pixels");
    writer.push_depth_and_colour(&[depth], &[colour]).unwrap();
    let (bytes, _) = writer.into_inner().unwrap();
    let mesh = reader(&bytes).next_frame().unwrap().unwrap().mesh().unwrap();
    assert_eq!(mesh.colours.len(), mesh.positions.len());
    for (position, [red, _, blue]) in mesh.positions.iter().zip(&mesh.colours) {
        if position[0].abs() > 0.05 {
            assert_eq!(red > blue, position[0] < 0.0, "{position:?}: red {red}, blue {blue}");
        }
    }
}

/// A field goes in, and comes back as it was where profile `paper` keeps all of it.
#[test]
fn a_field_comes_back_with_what_was_observed() {
    let distance = |voxel: usize| match (voxel % 8, voxel / 64) {
        (7, _) => f32::NAN,
        (_, z) => 0.02 * (z as f32 - 3.5),
    };
    let block = |x: i32| Block { coord: [x, 0, 0], distances_m: (0..512).map(distance).collect() };
    let volume = Volume { voxel_m: 0.02, edge: 8, truncation_voxels: 8, blocks: vec![block(0), block(1)] };
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new().full_band()).unwrap();
    writer.push_volume(&volume).unwrap();
    let (bytes, _) = writer.into_inner().unwrap();
    let found = reader(&bytes).next_frame().unwrap().unwrap().volume().unwrap();
    assert_eq!((found.voxel_m, found.edge, found.truncation_voxels), (0.02, 8, 8));
    let mut errors = Vec::new();
    for (block, expected) in found.blocks.iter().zip(&volume.blocks) {
        assert_eq!(block.coord, expected.coord);
        for (found, expected) in block.distances_m.iter().zip(&expected.distances_m) {
            assert_eq!(found.is_nan(), expected.is_nan());
            errors.extend((!found.is_nan()).then_some((found - expected).abs()));
        }
    }
    // Quantizer steps of the paper are 1 mm and 10 mm.
    let mean_m = errors.iter().sum::<f32>() / errors.len() as f32;
    assert!(mean_m < 0.005, "{mean_m}");
    let wrong = [
        Volume { edge: 5, ..volume.clone() },
        Volume { voxel_m: -1.0, ..volume.clone() },
        Volume { truncation_voxels: 99, ..volume.clone() },
        Volume { blocks: vec![block(0), block(0)], ..volume.clone() },
        Volume { blocks: vec![block(i32::MAX)], ..volume.clone() },
        Volume { blocks: vec![Block { coord: [0; 3], distances_m: vec![0.0; 3] }], ..volume },
    ];
    for volume in wrong {
        let mut writer = Writer::new(Vec::new(), &EncodeOptions::new()).unwrap();
        assert_eq!(kind(writer.push_volume(&volume)), ErrorKind::Frame);
    }
}

#[test]
fn wrong_options_are_errors_and_never_panic() {
    let wrong = [
        EncodeOptions::quality(-1.0),
        EncodeOptions::quality(f32::NAN),
        EncodeOptions::bitrate(0.mbps()),
        EncodeOptions::bitrate(f64::INFINITY.kbps()),
        EncodeOptions::max_error((-1).mm()),
        EncodeOptions::new().voxel(0.mm()),
        EncodeOptions::new().voxel(1e9.m()),
        EncodeOptions::new().voxel(f64::NAN.m()),
        EncodeOptions::new().fps(0),
        EncodeOptions::new().fps(f64::NAN),
        EncodeOptions::new().gop(0),
        EncodeOptions::new().origin([0.0, f64::NAN, 0.0]),
        EncodeOptions::new().two_passes(),
        EncodeOptions::new().shell_offset(0.0),
        EncodeOptions::new().shell_offset(f64::NAN),
        EncodeOptions::new().shell_offset(1e9),
        EncodeOptions::new().as_in_paper().preset(Preset::Archive),
        EncodeOptions::quality(50.0).as_in_paper(),
        #[expect(clippy::reversed_empty_ranges, reason = "it is wrong on purpose")]
        EncodeOptions::new().frames(5..3),
    ];
    for options in wrong {
        assert_eq!(kind(options.check()), ErrorKind::Options, "{options:?}");
        assert_eq!(kind(Writer::new(Vec::new(), &options)), ErrorKind::Options);
        assert_eq!(kind(isv::take::encode("no such folder", "out.isv", &options)), ErrorKind::Options);
    }
    for options in [EncodeOptions::bitrate(1.mbps()).two_passes(), EncodeOptions::new().voxel_by_trial()] {
        options.check().unwrap();
        assert_eq!(kind(Writer::new(Vec::new(), &options)), ErrorKind::Options, "they need the whole take");
    }
}

#[test]
fn a_frame_that_cannot_be_used_costs_itself_alone() {
    let mut writer = Writer::new(Vec::new(), &options()).unwrap();
    writer.push_mesh(&cuboid(0.0, 0.5)).unwrap();
    let broken = [
        Mesh { triangles: vec![[0, 1, 99]], ..cuboid(0.0, 0.5) },
        cuboid(f32::NAN, 0.5),
        cuboid(1e30, 0.5),
        cuboid(0.0, 1e7),
    ];
    for mesh in broken {
        assert_eq!(kind(writer.push_mesh(&mesh)), ErrorKind::Frame);
    }
    assert_eq!(
        kind(writer.push_points(&Points { positions: vec![[0.0; 3]], ..Points::default() })),
        ErrorKind::Frame
    );
    writer.push_mesh(&Mesh::default()).unwrap();
    writer.push_mesh(&cuboid(0.1, 0.5)).unwrap();
    let (bytes, report) = writer.into_inner().unwrap();
    assert_eq!((report.frames, report.empty), (3, 1));
    let triangles: Vec<_> =
        reader(&bytes).map(|frame| frame.unwrap().mesh().unwrap().triangles.len()).collect();
    assert!(triangles[0] > 0 && triangles[1] == 0 && triangles[2] > 0);
}

/// The first frame decides on colour and on when time begins, but not where it is refused.
#[test]
fn a_first_frame_that_cannot_be_used_decides_nothing() {
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new().gop(2)).unwrap();
    assert_eq!(
        kind(writer.push_mesh(&Mesh { triangles: vec![[0, 1, 99]], ..cuboid(0.0, 0.5) })),
        ErrorKind::Frame
    );
    let painted = Mesh { colours: vec![[200, 30, 30]; 8], ..cuboid(0.0, 0.5) };
    writer.push_mesh(&painted).unwrap();
    assert!(writer.push_mesh(&cuboid(f32::NAN, 0.5)).is_err());
    writer.push_mesh(&painted).unwrap();
    let (bytes, report) = writer.into_inner().unwrap();
    assert_eq!(report.voxel.metres(), 0.005);
    let frames: Vec<_> = reader(&bytes).map(Result::unwrap).collect();
    let times: Vec<u128> = frames.iter().map(|frame| frame.timestamp().as_millis()).collect();
    assert_eq!(times, [0, 33]);
    assert!(frames.iter().all(|frame| !frame.mesh().unwrap().colours.is_empty()));
}

#[test]
fn a_stream_without_a_frame_is_a_stream() {
    let (bytes, report) = Writer::new(Vec::new(), &options()).unwrap().into_inner().unwrap();
    assert_eq!(report.frames, 0);
    assert!(reader(&bytes).next_frame().unwrap().is_none());
}

#[test]
fn a_file_appears_whole_and_can_be_sought_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    let mut writer = Writer::create(&path, &options().gop(4)).unwrap();
    for frame in 0..10 {
        assert!(!path.exists());
        writer.push_mesh(&cuboid(0.01 * frame as f32, 0.5)).unwrap();
    }
    let report = writer.finish().unwrap();
    assert_eq!(report.bytes, path.metadata().unwrap().len());
    assert!((report.duration.as_secs_f64() - 10.0 / 30.0).abs() < 1e-6 && report.megabits_per_second() > 0.0);

    let mut reader = Reader::open(&path).unwrap();
    assert_eq!((reader.frames(), reader.voxel_m()), (Some(10), Some(0.02)));
    let all: Vec<_> = Reader::open(&path).unwrap().map(|frame| frame.unwrap().mesh().unwrap()).collect();
    for number in [6, 0, 9, 3] {
        reader.seek(number).unwrap();
        let frame = reader.next_frame().unwrap().unwrap();
        assert_eq!((frame.number(), frame.mesh().unwrap() == all[number]), (number, true));
    }
    assert_eq!(kind(reader.seek(10)), ErrorKind::Options);
    assert_eq!(reader.next_frame().unwrap().unwrap().number(), 4);

    let half = Reader::open(&path).unwrap().lod(Lod::Half).next_frame().unwrap().unwrap().mesh().unwrap();
    assert!(half.triangles.len() * 2 < all[0].triangles.len());
    assert_near(bounds(&half.positions), bounds(&all[0].positions), 0.03);
    // One that is not finished leaves nothing.
    drop(Writer::create(folder.path().join("other.isv"), &options()).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn readers_say_whether_frames_may_have_colour() {
    for (bytes, has_colour) in [(coloured_stream(&options(), 1), true), (stream(&options(), 1), false)] {
        assert_eq!(Reader::from_bytes("test", bytes.clone()).unwrap().has_colour(), Some(has_colour));
        let mut reader = reader(&bytes);
        assert_eq!(reader.has_colour(), None);
        reader.next_frame().unwrap();
        assert_eq!(reader.has_colour(), Some(has_colour));
    }
}

#[test]
fn coloured_frames_that_cannot_be_used_are_errors() {
    let coloured = Mesh { colours: vec![[9; 3]; 8], ..cuboid(0.0, 0.5) };
    let points = Points { positions: vec![[0.0; 3]; 8], colours: vec![[9; 3]; 8], ..Points::default() };
    let mut writer = Writer::new(Vec::new(), &options()).unwrap();
    writer.push_mesh(&coloured).unwrap();
    for mesh in [
        Mesh { triangles: vec![[0, 1, 99]], ..coloured.clone() },
        Mesh { positions: vec![[f32::NAN; 3]; 8], ..coloured.clone() },
        Mesh { colours: vec![[9; 3]; 3], ..coloured.clone() },
    ] {
        assert_eq!(kind(writer.push_mesh(&mesh)), ErrorKind::Frame);
        assert_eq!(kind(Writer::new(Vec::new(), &options()).unwrap().push_mesh(&mesh)), ErrorKind::Frame);
    }
    for points in [
        Points { positions: vec![[f32::NAN; 3]; 8], ..points.clone() },
        Points { colours: vec![[9; 3]; 3], ..points.clone() },
        Points { normals: vec![[0.0, 1.0, 0.0]; 3], ..points.clone() },
        // More than there are, with normals, so that none are estimated.
        Points { normals: vec![[0.0, 1.0, 0.0]; 8], colours: vec![[9; 3]; 9], ..points },
    ] {
        assert_eq!(kind(Writer::new(Vec::new(), &options()).unwrap().push_points(&points)), ErrorKind::Frame);
    }
}

/// A source that cannot be read.
struct Broken;

impl std::io::Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
        Err(std::io::Error::other("no disk"))
    }
}

#[test]
fn a_source_that_fails_is_no_damaged_stream() {
    assert_eq!(kind(Reader::from_read("test", Broken).next_frame()), ErrorKind::Input);
}

#[test]
fn bytes_and_seekable_sources_give_any_frame_by_the_shortest_way() {
    let bytes = stream(&options().gop(4), 10);
    let all: Vec<_> = reader(&bytes).map(|frame| frame.unwrap().mesh().unwrap()).collect();
    let readers: [fn(&[u8]) -> Reader; 2] = [
        |bytes| Reader::from_bytes("bytes", bytes.to_vec()).unwrap(),
        |bytes| Reader::from_seekable("archive", Cursor::new(bytes.to_vec())).unwrap(),
    ];
    for open in readers {
        let mut reader = open(&bytes);
        assert_eq!((reader.frames(), reader.fps()), (Some(10), Some(30.0)));
        for number in [7, 2, 3, 9, 0, 0, 8] {
            let frame = reader.frame(number).unwrap();
            assert_eq!(frame.number(), number);
            assert!(frame.mesh().unwrap() == all[number], "frame {number}");
        }
        // From the keyframe before a frame, or on from the frame that comes next.
        for (frame, begin) in [(7, 4), (6, 5), (9, 8)] {
            assert_eq!(reader.approach(frame).unwrap(), begin);
            assert_eq!(reader.next_frame().unwrap().unwrap().number(), begin);
        }
        assert_eq!(reader.approach(9).unwrap(), 9);
        assert_eq!(kind(reader.frame(10)), ErrorKind::Options);
        reader.seek(5).unwrap();
        assert_eq!(reader.by_ref().map(|frame| frame.unwrap().number()).collect::<Vec<_>>(), [5, 6, 7, 8, 9]);
        reader = open(&bytes);
        assert_eq!(reader.frame(9).unwrap().number(), 9);
        assert_eq!(reader.next_number(), Some(10));
        assert!(reader.next_frame().unwrap().is_none());
        reader.rewind().unwrap();
        assert_eq!(reader.next_frame().unwrap().unwrap().number(), 0);
        // What is held in place of a lost frame is known from the start on.
        let mut holding = open(&bytes).after_loss(AfterLoss::Hold);
        assert_eq!(holding.approach(6).unwrap(), 0);
        assert!(holding.frame(6).unwrap().mesh().unwrap() == all[6]);
    }
    assert_eq!(
        kind(Reader::from_bytes("text", b"no stream, but long enough for a header".to_vec())),
        ErrorKind::Stream
    );
    assert_eq!(kind(reader(&bytes).approach(1)), ErrorKind::Options);
    assert_eq!(kind(reader(&bytes).rewind()), ErrorKind::Options);
}

#[test]
fn two_readers_of_one_source_have_places_of_their_own() {
    let bytes = stream(&options().gop(4), 10);
    let mut reader = Reader::from_seekable("archive", Cursor::new(bytes)).unwrap();
    // The reader of the header and the index went before, each from the first byte.
    assert_eq!(reader.next_frame().unwrap().unwrap().number(), 0);
    assert_eq!(reader.frame(9).unwrap().number(), 9);
    assert_eq!(reader.frame(1).unwrap().number(), 1);
}

/// A stream of one frame, with the default options.
fn encoded(push: impl FnOnce(&mut Writer<Vec<u8>>) -> Result<(), Error>) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new()).unwrap();
    push(&mut writer).unwrap();
    writer.into_inner().unwrap().0
}

#[test]
fn frames_become_points_and_plain_arrays() {
    let frame = reader(&coloured_stream(&options(), 1)).next().unwrap().unwrap();
    let points = frame.points(500).unwrap();
    assert_eq!([points.positions.len(), points.normals.len(), points.colours.len()], [500; 3]);
    let spaced = frame.points_by_voxel().unwrap();
    // The box has 1.12 m2, which is 2800 squares of 20 mm.
    assert!((2500..3100).contains(&spaced.positions.len()), "{}", spaced.positions.len());
    let (mesh, plain) = (frame.mesh().unwrap(), frame.mesh_without_normals().unwrap());
    assert!(plain == Mesh { normals: Vec::new(), ..mesh });

    let (volume, arrays) = (frame.volume().unwrap(), frame.volume_arrays().unwrap());
    let coords: Vec<_> = volume.blocks.iter().map(|block| block.coord).collect();
    assert_eq!(arrays.coords, coords);
    let bits = |distances: &[f32]| distances.iter().map(|m| m.to_bits()).collect::<Vec<_>>();
    let distances: Vec<f32> = volume.blocks.iter().flat_map(|block| block.distances_m.clone()).collect();
    assert_eq!(bits(&arrays.distances_m), bits(&distances));

    // Both are the same frame to an encoder.
    let expected = encoded(|writer| writer.push_volume(&volume));
    assert!(encoded(|writer| writer.push_volume_arrays(&arrays)) == expected);
    let mut short = arrays.clone();
    short.distances_m.pop();
    let mut writer = Writer::new(Vec::new(), &EncodeOptions::new()).unwrap();
    assert_eq!(kind(writer.push_volume_arrays(&short)), ErrorKind::Frame);
}

#[test]
fn a_folder_is_encoded_into_any_sink() {
    let folder = folder_of_meshes(3);
    let (output, options) = (folder.path().join("take.isv"), options().units(Unit::Centimetre));
    take::encode(folder.path().join("*.obj"), &output, &options).unwrap();
    let (bytes, report) = take::encode_to(folder.path().join("*.obj"), Vec::new(), &options).unwrap();
    assert_eq!((report.frames, report.bytes), (3, bytes.len() as u64));
    assert!(bytes == std::fs::read(&output).unwrap());
}

#[test]
fn what_cannot_be_read_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.isv");
    assert_eq!(kind(Reader::open(&path)), ErrorKind::Input);
    assert_eq!(kind(Reader::open(folder.path())), ErrorKind::Input);
    std::fs::write(&path, b"no stream at all, but long enough to be one's header, is it not?").unwrap();
    assert_eq!(kind(Reader::open(&path)), ErrorKind::Stream);
    assert_eq!(kind(isv::take::encode(folder.path().join("none"), &path, &options())), ErrorKind::Input);
    assert_eq!(kind(Writer::create(folder.path().join("no/such/folder.isv"), &options())), ErrorKind::Output);
    let bytes = stream(&options(), 3);
    assert_eq!(kind(reader(&bytes).seek(1)), ErrorKind::Options);
    let mut small = reader(&bytes).memory_limit(1000);
    assert_eq!(kind(small.next_frame()), ErrorKind::Memory);
    assert!(small.next_frame().unwrap().is_none(), "nothing follows an error");
}

#[test]
fn losses_are_told_or_concealed() {
    let mut bytes = stream(&options().gop(3), 8);
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    let outcomes: Vec<_> = reader(&bytes).collect();
    assert_eq!(kind(outcomes.into_iter().next_back().unwrap()), ErrorKind::Stream);
    let heard = Arc::new(Mutex::new(Vec::new()));
    let events = Arc::clone(&heard);
    let concealing = reader(&bytes)
        .after_loss(AfterLoss::Hold)
        .on_event(move |event| events.lock().unwrap().push((event.to_string(), event.is_warning)));
    assert_eq!(concealing.map(Result::unwrap).count(), 8);
    let heard = heard.lock().unwrap();
    assert!(heard.iter().any(|(text, is_warning)| *is_warning && text.contains("lost")), "{heard:?}");
}

#[cfg(unix)]
#[test]
fn a_pipe_with_a_name_is_read_as_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.isv");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    let (bytes, to) = (stream(&options(), 3), path.clone());
    let writer = std::thread::spawn(move || std::fs::write(to, bytes).unwrap());
    let reader = Reader::open(&path).unwrap();
    assert_eq!(reader.frames(), None);
    assert_eq!(reader.map(|frame| frame.unwrap().number()).collect::<Vec<_>>(), [0, 1, 2]);
    writer.join().unwrap();
}

/// Frames that are held in place of lost ones are found by their numbers, also where the index does not have them.
#[test]
fn held_frames_can_be_sought() {
    let whole = stream(&options().gop(3), 9);
    let index = isv::raw::format::StreamIndex::load(&mut Cursor::new(&whole[..])).unwrap();
    let at = |frame: usize| index.frames[frame].at as usize;
    // Frame 4 is gone, and with it the index and the end.
    let cut = [&whole[..at(4)], &whole[at(5)..at(8) + 10]].concat();
    let open = || Reader::from_bytes("cut", cut.clone()).unwrap().after_loss(AfterLoss::Hold);
    let linear: Vec<usize> = open().map(|frame| frame.unwrap().number()).collect();
    assert_eq!(linear[..8], [0, 1, 2, 3, 4, 5, 6, 7]);
    for number in [7, 2, 4, 6] {
        let mut seeking = open();
        assert_eq!(seeking.frame(number).unwrap().number(), number);
        seeking.seek(number).unwrap();
        assert_eq!(seeking.next_frame().unwrap().unwrap().number(), number);
    }
    assert_eq!(kind(open().frame(100)), ErrorKind::Stream);
    // Before the first keyframe there is nothing to hold.
    let headless = [&whole[..at(0)], &whole[at(1)..]].concat();
    let mut headless = Reader::from_bytes("headless", headless).unwrap().after_loss(AfterLoss::Hold);
    let error = headless.frame(1).unwrap_err();
    assert!(error.to_string().contains("frame 1 is lost"), "{error}");
    assert_eq!(headless.frame(3).unwrap().number(), 3);
}

/// Writes meshes as OBJ files, in centimetres.
fn folder_of_meshes(frames: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for frame in 0..frames {
        let Mesh { positions, triangles, .. } = cuboid(0.01 * frame as f32, 0.5);
        let vertices =
            positions.iter().map(|p| p.map(|c| 100.0 * c)).map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let faces = triangles.iter().map(|t| t.map(|i| i + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n"));
        let text: String = vertices.chain(faces).collect();
        std::fs::write(folder.path().join(format!("frame_{frame:04}.obj")), text).unwrap();
    }
    folder
}

#[test]
fn a_folder_becomes_a_stream() {
    let folder = folder_of_meshes(6);
    let output = folder.path().join("take.isv");
    std::fs::write(folder.path().join("music.mp3"), "ID3").unwrap();
    let steps = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::new(Mutex::new(String::new()));
    let (seen, text) = (Arc::clone(&steps), Arc::clone(&heard));
    let options = options()
        .units(Unit::Centimetre)
        .frames(1..5)
        .timestamps(TimestampSource::Rate)
        .on_event(move |event| *text.lock().unwrap() += &event.text)
        .on_progress(move |done, total| seen.lock().unwrap().push((done, total)));
    let report = isv::take::encode(folder.path(), &output, &options).unwrap();
    assert!(heard.lock().unwrap().contains("not kept: sound (music.mp3)"), "{heard:?}");
    assert_eq!((report.frames, report.skipped, report.is_cancelled), (4, 0, false));
    assert_eq!(*steps.lock().unwrap(), (1..=4).map(|done| (done, Some(4))).collect::<Vec<_>>());
    let first = Reader::open(&output).unwrap().next_frame().unwrap().unwrap().mesh().unwrap();
    assert_near(bounds(&first.positions), [[0.01, 0.0, 0.0], [0.51, 0.4, 0.4]], 0.01);

    // The same frame by frame gives the same bytes.
    let mut writer = Writer::new(Vec::new(), &self::options()).unwrap();
    (1..5).for_each(|frame| writer.push_mesh(&cuboid(0.01 * frame as f32, 0.5)).unwrap());
    assert_eq!(writer.into_inner().unwrap().0, std::fs::read(&output).unwrap());

    let two = EncodeOptions::bitrate(300.kbps()).two_passes().voxel(20.mm()).units(Unit::Centimetre);
    let report = isv::take::encode(folder.path().join("*.obj"), &output, &two).unwrap();
    assert!(report.megabits_per_second() < 0.31, "{}", report.megabits_per_second());

    std::fs::write(folder.path().join("frame_0003.obj"), "v 1 2").unwrap();
    let strict = self::options().units(Unit::Centimetre);
    assert_eq!(kind(isv::take::encode(folder.path().join("*.obj"), &output, &strict)), ErrorKind::Frame);
    let skipping = self::options().units(Unit::Centimetre).skip_bad_frames(true);
    let report = isv::take::encode(folder.path().join("*.obj"), &output, &skipping).unwrap();
    assert_eq!((report.frames, report.skipped), (5, 1));
}

#[test]
fn a_cancelled_take_is_a_shorter_stream_or_none() {
    let folder = folder_of_meshes(40);
    let output = folder.path().join("take.isv");
    let cancellation = Cancellation::new();
    let request = cancellation.clone();
    let options =
        options().units(Unit::Centimetre).cancellation(&cancellation).on_progress(move |done, _| {
            if done == 3 {
                request.cancel();
            }
        });
    let report = isv::take::encode(folder.path(), &output, &options).unwrap();
    assert!(report.is_cancelled && (3..40).contains(&report.frames), "{}", report.frames);
    assert_eq!(Reader::open(&output).unwrap().map(Result::unwrap).count(), report.frames);
    std::fs::remove_file(&output).unwrap();
    assert_eq!(kind(isv::take::encode(folder.path(), &output, &options)), ErrorKind::Cancelled);
    assert!(!output.exists());
}

#[test]
fn times_are_kept() {
    let mut writer = Writer::new(Vec::new(), &options()).unwrap();
    let times = [5.0, 5.1, 7.0].map(Duration::from_secs_f64);
    times.iter().for_each(|time| writer.push_mesh_at(&cuboid(0.0, 0.5), *time).unwrap());
    assert_eq!(kind(writer.push_mesh_at(&cuboid(0.0, 0.5), Duration::MAX)), ErrorKind::Frame);
    let found: Vec<_> =
        reader(&writer.into_inner().unwrap().0).map(|frame| frame.unwrap().timestamp()).collect();
    assert_eq!(found, times.map(|time| time - times[0]));
}

#[test]
fn times_of_all_kinds_of_frames_are_kept() {
    let (start, step) = (Duration::from_secs(9), Duration::from_millis(70));
    type Push<'a> = &'a dyn Fn(&mut Writer<Vec<u8>>, Duration) -> Result<(), isv::Error>;
    let check = |name: &str, push: Push| {
        let mut writer = Writer::new(Vec::new(), &EncodeOptions::new().voxel(20.mm())).unwrap();
        for time in [start, start + step] {
            push(&mut writer, time).unwrap();
        }
        assert_eq!(kind(push(&mut writer, Duration::MAX)), ErrorKind::Frame, "{name}");
        let bytes = writer.into_inner().unwrap().0;
        let found: Vec<_> = reader(&bytes).map(|frame| frame.unwrap().timestamp()).collect();
        assert_eq!(found, [Duration::ZERO, step], "{name}");
    };
    let normals: Vec<_> = (0..500).map(|i| (i as f32 * 2.4).sin_cos()).map(|(x, z)| [x, 0.0, z]).collect();
    let positions =
        normals.iter().enumerate().map(|(i, [x, _, z])| [0.2 * x, 0.001 * i as f32, 0.2 * z]).collect();
    let points = Points { positions, normals, ..Points::default() };
    check("points", &|writer, time| writer.push_points_at(&points, time));
    let camera_to_world = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
    let (width, height, focal, principal) = (64, 48, [60.0, 60.0], [31.5, 23.5]);
    let views =
        [DepthView { width, height, focal, principal, camera_to_world, depths_m: vec![1.0; 64 * 48] }];
    check("depth", &|writer, time| writer.push_depth_at(&views, time));
    let colours = vec![[200, 40, 40]; 64 * 48];
    let colours =
        [ColourView { width, height, focal, principal, camera_to_world, colours, depth_view: Some(0) }];
    check("depth and colour", &|writer, time| writer.push_depth_and_colour_at(&views, &colours, time));
    let frame = reader(&stream(&options(), 1)).next_frame().unwrap().unwrap();
    let (volume, arrays) = (frame.volume().unwrap(), frame.volume_arrays().unwrap());
    check("volume", &|writer, time| writer.push_volume_at(&volume, time));
    check("arrays", &|writer, time| writer.push_volume_arrays_at(&arrays, time));
}

/// Files of a stream, one frame each, or one of all.
#[test]
fn streams_decode_to_files() {
    let work = tempfile::tempdir().unwrap();
    let path = |name: &str| work.path().join(name);
    std::fs::write(path("take.isv"), stream(&options(), 3)).unwrap();
    let frames = |folder: &str| {
        let names = path(folder).read_dir().unwrap().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    };
    let decode = |name: &str, options: &DecodeOptions| take::decode(path("take.isv"), path(name), options);

    let heard = Arc::new(Mutex::new(Vec::new()));
    let told = Arc::clone(&heard);
    let meshes =
        DecodeOptions::new().on_progress(move |done, total| told.lock().unwrap().push((done, total)));
    assert_eq!(decode("meshes", &meshes).unwrap().frames, 3);
    assert_eq!(frames("meshes"), ["frame_0000.ply", "frame_0001.ply", "frame_0002.ply"]);
    assert_eq!(*heard.lock().unwrap(), [(1, None), (2, None), (3, None)]);

    let few = DecodeOptions::new().frames(1..3).target_faces(20).format("obj");
    let report = decode("few", &few).unwrap();
    assert!(report.frames == 2 && report.simplify_error_m > 0.0);
    assert_eq!(frames("few"), ["frame_0001.obj", "frame_0002.obj"]);
    assert_eq!(decode("points", &DecodeOptions::new().point_count(100).format("xyz")).unwrap().frames, 3);
    let text = std::fs::read_to_string(path("points/frame_0000.xyz")).unwrap();
    assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 100);
    assert_eq!(decode("all.glb", &DecodeOptions::new().meshopt()).unwrap().frames, 3);
    assert_eq!(decode("fields", &DecodeOptions::new().fields()).unwrap().frames, 3);

    // What isv did not write stays.
    std::fs::create_dir(path("mine")).unwrap();
    std::fs::write(path("mine/frame_0000.ply"), "a capture").unwrap();
    assert_eq!(kind(decode("mine", &DecodeOptions::new())), ErrorKind::Options);
    assert_eq!(std::fs::read_to_string(path("mine/frame_0000.ply")).unwrap(), "a capture");
    // One file holds one mesh, and is not there if there are more.
    assert_eq!(kind(decode("one.ply", &DecodeOptions::new())), ErrorKind::Options);
    assert!(!path("one.ply").exists());
    for wrong in [
        DecodeOptions::new().format("usd"),
        DecodeOptions::new().format("npy").points(5.mm()),
        DecodeOptions::new().point_count(0),
        DecodeOptions::new().target_faces(0),
        DecodeOptions::new().fields().target_faces(9),
        DecodeOptions::new().fields().units(Unit::Inch),
        DecodeOptions::new().origin([0.0, f64::NAN, 0.0]),
        DecodeOptions::new().frames(2..2),
        DecodeOptions::new().frames(2..9),
        DecodeOptions::new().meshopt(),
    ] {
        assert_eq!(kind(decode("wrong", &wrong)), ErrorKind::Options, "{wrong:?}");
    }
    assert_eq!(kind(take::decode(path("none.isv"), path("wrong"), &DecodeOptions::new())), ErrorKind::Input);
    let cancelled = Cancellation::new();
    cancelled.cancel();
    let options = DecodeOptions::new().cancellation(&cancelled);
    assert_eq!(kind(decode("wrong", &options)), ErrorKind::Cancelled);
    assert!(!path("wrong").exists());
}
