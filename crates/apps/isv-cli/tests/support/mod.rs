//! Running the program on small inputs of its own.
#![allow(dead_code, reason = "each test program uses a part")]

use isv::raw::io::{Format, write_mesh};
use isv::raw::volume::{Appearance, TriangleMesh, VoxelSize};
use isv_figure::{figure_mesh, painted_figure_mesh};
use isv_testkit::sphere;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use tempfile::TempDir;

/// A folder that goes away with its tests' results.
pub(crate) struct Workspace {
    folder: TempDir,
}

impl Workspace {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// With a folder `frames` of the figure, coarse but moving.
    pub(crate) fn with_figure(frames: usize) -> Self {
        let workspace = Self::new();
        fs::create_dir(workspace.path("frames")).unwrap();
        for frame in 0..frames {
            let mesh = figure_mesh(frame as f64 / 10.0, VoxelSize::from_metres(0.03).unwrap());
            let path = workspace.path(&format!("frames/frame_{frame}.ply"));
            write_mesh(&path, &mesh, Format::Ply).unwrap();
        }
        workspace
    }

    /// With a folder `frames` of the figure in colour, coarse but moving.
    pub(crate) fn with_painted_figure(frames: usize) -> Self {
        let workspace = Self::new();
        fs::create_dir(workspace.path("frames")).unwrap();
        for frame in 0..frames {
            let mesh = painted_figure_mesh(frame as f64 / 10.0, VoxelSize::from_metres(0.02).unwrap());
            let path = workspace.path(&format!("frames/frame_{frame}.ply"));
            write_mesh(&path, &mesh, Format::Ply).unwrap();
        }
        workspace
    }

    /// With `take.isv`, the figure at voxels of 20 mm; returns its bytes too. A keyframe every three frames.
    pub(crate) fn with_stream(frames: usize) -> (Self, Vec<u8>) {
        let workspace = Self::with_figure(frames);
        workspace.isv(&ENCODE).done();
        let bytes = workspace.read("take.isv");
        (workspace, bytes)
    }

    /// With a folder `balls` of a ball that turns its colours.
    pub(crate) fn with_painted_balls(frames: usize) -> Self {
        let work = Self::new();
        fs::create_dir(work.path("balls")).unwrap();
        for frame in 0..frames {
            let mut mesh: TriangleMesh = sphere(0.3, 40);
            let colour = |at: &f64| (128.0 + 100.0 * (9.0 * at + 0.2 * frame as f64).sin()) as u8;
            let vertex_colours = mesh.vertices.iter().map(|v| v.to_array().each_ref().map(colour)).collect();
            mesh.appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
            write_mesh(&work.path(&format!("balls/{frame}.ply")), &mesh, Format::Ply).unwrap();
        }
        work
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    /// Names in a folder, hidden ones included, in order.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs `isv` in this folder.
    pub(crate) fn isv(&self, args: &[&str]) -> Run {
        self.isv_with_input(args, &[])
    }

    /// Runs `isv` in this folder with bytes on standard input.
    pub(crate) fn isv_with_input(&self, args: &[&str], input: &[u8]) -> Run {
        let mut child = self.command(args).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_vec();
        // On a thread, and without minding a child that stops reading: both pipes may fill up.
        let feeder = std::thread::spawn(move || drop(stdin.write_all(&input)));
        let output = child.wait_with_output().unwrap();
        feeder.join().unwrap();
        Run { args: args.join(" "), output }
    }

    /// `isv` in this folder, all its channels piped.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isv"));
        command.args(args).current_dir(self.folder.path());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }
}

/// How [`Workspace::with_stream`] encodes.
pub(crate) const ENCODE: [&str; 8] =
    ["encode", "frames", "-o", "take.isv", "--voxel", "20mm", "--gop=3", "--checksums"];

/// A WAV file: a click of 10 ms every 100 ms, at 44.1 kHz in two channels of 16 bits.
pub(crate) fn waveform(seconds: f64) -> Vec<u8> {
    let rate = 44_100u32;
    let frames = (seconds * f64::from(rate)).round() as u32;
    let mut numbers = Vec::new();
    for frame in 0..frames {
        let is_click = frame % (rate / 10) < rate / 100;
        let value = if is_click { (f64::from(frame) * 0.3).sin() * 20_000.0 } else { 0.0 };
        numbers.extend([(value as i16).to_le_bytes(); 2].concat());
    }
    let size = numbers.len() as u32;
    let format = [&16u32.to_le_bytes()[..], &1u16.to_le_bytes(), &2u16.to_le_bytes(), &rate.to_le_bytes()];
    let format = [&format.concat()[..], &(rate * 4).to_le_bytes(), &4u16.to_le_bytes(), &16u16.to_le_bytes()];
    [
        b"RIFF",
        &(size + 36).to_le_bytes()[..],
        b"WAVEfmt ",
        &format.concat(),
        b"data",
        &size.to_le_bytes(),
        &numbers,
    ]
    .concat()
}

/// What a run left behind.
pub(crate) struct Run {
    args: String,
    output: Output,
}

impl Run {
    pub(crate) fn status(&self) -> Option<i32> {
        self.output.status.code()
    }

    pub(crate) fn stdout(&self) -> &[u8] {
        &self.output.stdout
    }

    pub(crate) fn stderr(&self) -> String {
        String::from_utf8(self.output.stderr.clone()).unwrap()
    }

    /// The run must have succeeded.
    #[track_caller]
    pub(crate) fn done(self) -> Self {
        assert_eq!(self.status(), Some(0), "isv {}: {}", self.args, self.stderr());
        self
    }

    /// JSON on standard output of a run that succeeded.
    #[track_caller]
    pub(crate) fn json(self) -> serde_json::Value {
        serde_json::from_slice(self.done().stdout()).unwrap()
    }

    /// The run must have failed with this status and one sentence, which holds all of `parts`.
    #[track_caller]
    pub(crate) fn fails(&self, status: i32, parts: &[&str]) {
        let stderr = self.stderr();
        assert_eq!(self.status(), Some(status), "isv {}: {stderr}", self.args);
        assert!(stderr.starts_with("isv: ") && stderr.ends_with('\n'), "{stderr:?}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert!(self.stdout().is_empty());
        for part in parts {
            assert!(stderr.contains(part), "`{part}` is not in: {stderr}");
        }
    }
}
