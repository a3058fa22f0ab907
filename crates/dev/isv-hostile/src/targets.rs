//! The targets by name.

use crate::mutators::{self, Change, Mutator};
use crate::readers::{
    ingest, play_animation, read_arrays, read_camera, read_dense, read_depth_image, read_geometry,
    read_image, read_lists, read_materials, read_pipe, read_rig, read_scans,
};
use crate::{colour, container, differential, encoder, library, live, loss, mp4, range_decoder, stream};

/// A fuzz target.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name, which its folders of inputs have, too.
    pub name: &'static str,
    /// Does what it does with bytes; panics where something does not hold.
    pub run: fn(&[u8]),
    /// Changes an input so that more of it is read. Without one, bytes are changed anywhere.
    pub mutator: Option<Mutator>,
}

impl Target {
    const fn new(name: &'static str, run: fn(&[u8])) -> Self {
        Self { name, run, mutator: None }
    }

    const fn with(name: &'static str, run: fn(&[u8]), mutator: Mutator) -> Self {
        Self { name, run, mutator: Some(mutator) }
    }

    /// Changes an input to at most so many bytes, as a number says; `change` does so with bytes of no known form.
    #[must_use]
    pub fn mutate(&self, bytes: &[u8], most: usize, seed: u32, change: &mut Change<'_>) -> Vec<u8> {
        let mut changed = match self.mutator {
            Some(mutator) => mutator(bytes, most, seed, change),
            None => change(bytes, most),
        };
        changed.truncate(most);
        changed
    }
}

/// A target by its name.
///
/// # Panics
/// If there is none of this name.
#[must_use]
pub fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|target| target.name == name).expect("one of the targets")
}

/// All targets, by name.
pub const TARGETS: &[Target] = &[
    Target::new("animation", play_animation),
    Target::new("arrays", read_arrays),
    Target::new("camera_json", read_camera),
    Target::new("colour", colour::decode),
    Target::new("container", container::read),
    Target::new("dense", read_dense),
    Target::new("depth_exr", |bytes| read_depth_image("depth/0.exr", bytes)),
    Target::new("depth_png", |bytes| read_depth_image("depth/0.png", bytes)),
    Target::with("differential", differential::compare, mutators::any),
    Target::new("e57", read_scans),
    Target::new("encoder", encoder::round_trip),
    Target::new("glb", |bytes| read_geometry("frame.glb", bytes)),
    Target::new("gltf", |bytes| read_geometry("frame.gltf", bytes)),
    Target::new("image", read_image),
    Target::new("ingest", ingest),
    Target::new("las", |bytes| read_geometry("frame.las", bytes)),
    Target::new("laz", |bytes| read_geometry("frame.laz", bytes)),
    Target::new("library", library::call_library),
    Target::new("live", live::read_packets),
    Target::with("loss", loss::lose, mutators::any),
    Target::new("mp4", mp4::read),
    Target::new("obj", |bytes| {
        read_geometry("frame.obj", bytes);
        read_materials(bytes);
    }),
    Target::new("off", |bytes| read_geometry("frame.off", bytes)),
    Target::with("packet", stream::decode, mutators::payload),
    Target::new("pcd", |bytes| read_geometry("frame.pcd", bytes)),
    Target::new("pipe", read_pipe),
    Target::new("ply", |bytes| read_geometry("frame.ply", bytes)),
    Target::new("range_decoder", range_decoder::check),
    Target::new("range_header", live::read_range),
    Target::new("rig", read_rig),
    Target::new("sound", mp4::hear),
    Target::new("stl", |bytes| read_geometry("frame.stl", bytes)),
    Target::new("stream", stream::decode),
    Target::with("syntax", stream::decode, mutators::syntax),
    Target::new("tum", read_lists),
    Target::new("xyz", |bytes| read_geometry("frame.xyz", bytes)),
];
