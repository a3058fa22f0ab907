//! The library as its users call it: any options, any frames, in any order.

use isv::{
    AfterLoss, Block, ColourView, DepthView, EncodeOptions, Length, Lod, Mesh, Points, Preset, Quantity,
    Reader, Refresh, SignMode, TimestampSource, Volume, Writer,
};
use std::io::Cursor;
use std::time::Duration;

/// Most blocks of a frame.
const MAX_BLOCKS: usize = 300;
/// Most frames of a stream.
const MAX_FRAMES: usize = 4;

/// Numbers from bytes; zeros behind their end.
struct Script<'a>(&'a [u8]);

impl Script<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    /// A number as callers give them: mostly small, sometimes none.
    fn number(&mut self) -> f64 {
        match self.byte() {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -f64::from(self.byte()),
            3 => f64::from(self.byte()) * 1e12,
            other => f64::from(other) / 16.0,
        }
    }

    fn place(&mut self) -> [f32; 3] {
        [(); 3].map(|()| f32::from(self.byte() as i8) / 200.0)
    }

    fn list<T>(&mut self, mut item: impl FnMut(&mut Self) -> T) -> Vec<T> {
        let count = self.byte() % 24;
        (0..count).map(|_| item(self)).collect()
    }
}

/// Encodes what the bytes say, and decodes it: nothing panics, and the frames that were taken come back.
pub(crate) fn call_library(bytes: &[u8]) {
    let mut script = Script(bytes);
    let options = options(&mut script);
    let checked = options.check();
    let Ok(mut writer) = Writer::new(Vec::new(), &options) else { return };
    checked.expect("a writer takes options that are right");
    let mut taken = 0;
    for _ in 0..MAX_FRAMES {
        let pushed = match script.byte() % 8 {
            0 => break,
            1 | 2 => writer.push_mesh(&mesh(&mut script)),
            3 => writer.push_points(&points(&mut script)),
            4 => {
                let view = depth(&mut script);
                let colours = match script.byte() % 2 {
                    0 => Vec::new(),
                    _ => vec![colours_of(&view, &mut script)],
                };
                writer.push_depth_and_colour(&[view], &colours)
            }
            5 => writer.push_volume(&volume(&mut script)),
            6 => writer.push_mesh_at(&mesh(&mut script), time(&mut script)),
            _ => writer.push_points_at(&points(&mut script), time(&mut script)),
        };
        taken += usize::from(pushed.is_ok());
    }
    let (stream, report) = writer.into_inner().expect("memory takes all bytes");
    assert_eq!((report.frames, report.bytes), (taken, stream.len() as u64));
    let (lod, after_loss) = match script.byte() % 3 {
        0 => (Lod::Full, AfterLoss::Stop),
        1 => (Lod::Half, AfterLoss::Stop),
        _ => (Lod::Full, AfterLoss::Hold),
    };
    let reader = Reader::from_read("stream", Cursor::new(stream));
    let mut frames = 0;
    for frame in reader.lod(lod).after_loss(after_loss) {
        // Voxels of half the resolution may be too large.
        let Ok(frame) = frame else { return assert!(lod == Lod::Half) };
        frame.mesh().expect("a small frame has room");
        let _ = frame.volume();
        frames += 1;
    }
    assert!(frames == taken);
}

fn options(script: &mut Script) -> EncodeOptions {
    let mut options = match script.byte() % 4 {
        0 => EncodeOptions::new(),
        1 => EncodeOptions::quality(script.number() as f32),
        2 => EncodeOptions::bitrate(script.number().kbps()),
        _ => EncodeOptions::max_error(script.number().mm()),
    };
    options = options.max_blocks(MAX_BLOCKS).voxel(Length::from_metres(0.02));
    for _ in 0..script.byte() % 4 {
        options = match script.byte() % 14 {
            0 => options.voxel(script.number().cm()),
            1 => options.fps(script.number()),
            2 => options.gop(u32::from(script.byte())),
            3 => options.full_band(),
            4 => options.as_in_paper(),
            5 => options.checksums(true),
            6 => options.preset([Preset::Realtime, Preset::Balanced][usize::from(script.byte() % 2)]),
            7 => options.refresh(Refresh::Gradual),
            8 => options.sign(
                [SignMode::Auto, SignMode::Closed, SignMode::Offset, SignMode::Sheet]
                    [usize::from(script.byte() % 4)],
            ),
            9 => options.shell_offset(script.number()),
            10 => options.estimate_normals().viewpoint([script.number(), 0.0, 0.0]),
            11 => options.max_depth(script.number().m()),
            12 => options.accumulate_depth(),
            _ => options.timestamps(TimestampSource::Rate).two_passes(),
        };
    }
    options
}

fn time(script: &mut Script) -> Duration {
    Duration::from_nanos(u64::from(script.byte()) << 40)
}

fn mesh(script: &mut Script) -> Mesh {
    let positions = script.list(Script::place);
    let count = positions.len().max(1) as u8;
    let triangles = script.list(|script| [(); 3].map(|()| u32::from(script.byte() % (count + 1))));
    Mesh { positions, triangles, ..Mesh::default() }
}

fn points(script: &mut Script) -> Points {
    let positions = script.list(Script::place);
    let normals = if script.byte().is_multiple_of(2) { Vec::new() } else { script.list(Script::place) };
    let viewpoint = script.byte().is_multiple_of(3).then(|| script.place());
    let colours = if script.byte().is_multiple_of(2) { Vec::new() } else { script.list(colour) };
    Points { positions, normals, colours, viewpoint }
}

fn colour(script: &mut Script) -> [u8; 3] {
    [(); 3].map(|()| script.byte())
}

fn depth(script: &mut Script) -> DepthView {
    let mut camera_to_world = [[0.0; 4]; 4];
    for axis in 0..4 {
        camera_to_world[axis][axis] = if script.byte() == 7 { script.number() } else { 1.0 };
    }
    let depths_m =
        (0..48 - u32::from(script.byte() == 9)).map(|_| f32::from(script.byte()) / 100.0).collect();
    let (focal, principal) = ([8.0, if script.byte() == 5 { script.number() } else { 8.0 }], [3.5, 2.5]);
    DepthView { width: 8, height: 6, focal, principal, camera_to_world, depths_m }
}

/// A colour view from where a depth view is, or with a lens of its own.
fn colours_of(view: &DepthView, script: &mut Script) -> ColourView {
    let DepthView { width, height, principal, camera_to_world, .. } = *view;
    let focal = [view.focal[0], if script.byte() == 5 { script.number() } else { view.focal[1] }];
    let colours = (0..48 - u32::from(script.byte() == 9)).map(|_| colour(script)).collect();
    let depth_view = script.byte().is_multiple_of(2).then(|| usize::from(script.byte() % 3));
    ColourView { width, height, focal, principal, camera_to_world, colours, depth_view }
}

fn volume(script: &mut Script) -> Volume {
    let distance = |script: &mut Script| match script.byte() {
        0 => f32::NAN,
        other => (f32::from(other) - 128.0) / 1000.0,
    };
    let block = |script: &mut Script| {
        let coord = script.place().map(|c| (200.0 * c) as i32 % 3);
        let first: Vec<f32> = (0..64).map(|_| distance(script)).collect();
        let voxels = 512 - usize::from(script.byte() == 3);
        Block { coord, distances_m: (0..voxels).map(|voxel| first[voxel % 64]).collect() }
    };
    let (voxel_m, truncation_voxels) = (f64::from(script.byte() % 5) / 100.0, u32::from(script.byte() % 20));
    Volume { voxel_m, edge: 8, truncation_voxels, blocks: script.list(block) }
}
