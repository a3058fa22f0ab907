//! Shaders without a GPU, and volumes on one.

use super::*;
use isv_io::{Unit, read_mesh};
use isv_testkit::{Need, capture, skip};
use isv_volume::{BlockCoord, BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelMask, VoxelSize};
use naga::back::{hlsl, msl, spv};
use naga::front::wgsl;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Bytes of a segment: 1024 blocks.
const SEGMENT_BYTES: u64 = 1 << 20;

/// The GPU that tests run on, software or not, with segments of a few blocks so that pools are split. Where there is none the
/// test is [skipped](skip). Tests share it, and what it has compiled: [`gpu_alone`] is for those that lose it or count its memory.
pub(crate) fn gpu_for_tests() -> Option<Gpu> {
    gpu_with_segments(SEGMENT_BYTES)
}

/// [`gpu_for_tests`] with segments of so many bytes.
pub(crate) fn gpu_with_segments(binding_bytes: u64) -> Option<Gpu> {
    static SHARED: Mutex<BTreeMap<u64, Gpu>> = Mutex::new(BTreeMap::new());
    let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(gpu) = shared.get(&binding_bytes) {
        return Some(gpu.clone());
    }
    let gpu = open(binding_bytes)?;
    shared.insert(binding_bytes, gpu.clone());
    Some(gpu)
}

/// [`gpu_for_tests`], but for one test alone.
pub(crate) fn gpu_alone() -> Option<Gpu> {
    open(SEGMENT_BYTES)
}

fn open(binding_bytes: u64) -> Option<Gpu> {
    let choice = GpuChoice { software: true, binding_bytes, ..GpuChoice::default() };
    match Gpu::open(&choice) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            skip(Need::Gpu, error);
            None
        }
    }
}

pub(crate) fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

/// A volume of so many blocks of noise, every 5th with a mask.
pub(crate) fn noise(blocks: usize, seed: u32) -> SparseVolume {
    let side = (blocks as f64).cbrt().ceil() as i32;
    let coord = |i: i32| BlockCoord::from([i % side - side / 2, i / side % side - 3, i / side / side - side]);
    let mut coords: Vec<_> = (0..blocks as i32).map(coord).collect();
    coords.sort_unstable_by_key(|coord| coord.morton());
    let random = |i: u32| (i ^ seed).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(2_246_822_519);
    let samples = (0..blocks as u32 * 512).map(|i| (random(i) % 4001) as i16 - 2000).collect();
    let words: [u64; 8] = std::array::from_fn(|z| 0x1357_9bdf_0246_8ace_u64.rotate_left(7 * z as u32));
    let masks = (0..blocks as u32).step_by(5).map(|block| (block, VoxelMask::from_words(&words)));
    SparseVolume::from_parts(grid(), coords, samples, masks.collect())
}

/// A frame of a capture, if there is one.
pub(crate) fn captured_mesh(name: &str) -> Option<TriangleMesh> {
    let path = capture(&format!("{name}/frame_0000.ply"))?;
    Some(read_mesh(&path, Unit::Metre).unwrap())
}

#[test]
fn all_shaders_are_valid() {
    for (shader, entries) in SHADERS {
        let module = wgsl::parse_str(&shader.source(17));
        let module = module
            .unwrap_or_else(|error| panic!("{}: {}", shader.name, error.emit_to_string(&shader.source(17))));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let valid = validator.validate(&module);
        assert!(valid.is_ok(), "{}: {:?}", shader.name, valid.err());
        let found: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(&found, entries, "{}", shader.name);
        for entry in &module.entry_points {
            let threads: u32 = entry.workgroup_size.iter().product();
            assert!(threads <= adapter::THREADS, "{}, {}: {threads} threads", shader.name, entry.name);
        }
    }
}

/// By Vulkan, Metal and DX12: what wgpu does when a kernel is compiled, but for the driver.
#[test]
fn all_shaders_are_translated_for_every_interface() {
    for (shader, _) in SHADERS {
        let module = wgsl::parse_str(&shader.source(17)).unwrap();
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).unwrap();
        let spirv = spv::write_vec(&module, &info, &spv::Options::default(), None).unwrap();
        let options = hlsl::PipelineOptions::default();
        let (mut direct, hlsl_options) = (String::new(), hlsl::Options::default());
        hlsl::Writer::new(&mut direct, &hlsl_options, &options).write(&module, &info, None).unwrap();
        let options = (msl::Options::default(), msl::PipelineOptions::default());
        let (metal, _) = msl::write_string(&module, &info, &options.0, &options.1).unwrap();
        assert!(!spirv.is_empty() && !direct.is_empty() && !metal.is_empty(), "{}", shader.name);
    }
}

#[test]
fn volumes_come_back_as_they_were() {
    let Some(gpu) = gpu_alone() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    // A segment holds 1024 blocks: these take one, two and three, and grow the pool twice.
    let volumes = [noise(0, 1), noise(700, 2), noise(1500, 3), noise(40, 4)];
    let uploaded = volumes.each_ref().map(|volume| GpuVolume::upload(&store, volume).unwrap());
    for (volume, uploaded) in volumes.iter().zip(&uploaded) {
        assert!(uploaded.download().unwrap() == *volume);
    }
    // Slots are used again.
    let before = gpu.memory().peak;
    drop(uploaded);
    for volume in &volumes {
        let again = GpuVolume::upload(&store, volume).unwrap();
        assert!(again.download().unwrap() == *volume);
    }
    assert_eq!(gpu.memory().peak, before);
}

/// So that they are copied back in few pieces.
#[test]
fn slots_are_taken_in_order() {
    let Some(gpu) = gpu_for_tests() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    let mut pool = store.pool();
    for _ in 0..2 {
        let slots = pool.take(900).unwrap();
        assert!(slots.iter().copied().eq(0..900));
        pool.give_back(&slots);
    }
}

#[test]
fn too_many_blocks_are_an_error() {
    let Some(gpu) = gpu_for_tests() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    let error = GpuVolume::upload(&store, &noise(4097, 1)).unwrap_err();
    assert!(matches!(error, GpuError::TooLarge { what: "samples", .. }), "{error}");
    // What fits still does.
    let volume = noise(4096, 1);
    assert!(GpuVolume::upload(&store, &volume).unwrap().download().unwrap() == volume);
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(gpu) = gpu_alone() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    let volume = GpuVolume::upload(&store, &noise(50, 1)).unwrap();
    gpu.lose();
    assert!(matches!(volume.download(), Err(GpuError::Lost(_))));
    assert!(matches!(GpuVolume::upload(&store, &noise(50, 1)), Err(GpuError::Lost(_))));
}

#[test]
fn an_unknown_gpu_is_an_error() {
    let choice = GpuChoice { name: Some("no card has this name".to_owned()), ..GpuChoice::default() };
    assert!(matches!(Gpu::open(&choice), Err(GpuError::NoAdapter(_))));
}
