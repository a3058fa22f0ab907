//! The codec of Tang et al. through its bytes, and under bytes that no encoder makes.

use isv_baseline::{BlockBasis, BlockMoments, TangDecoder, TangEncoder, TangError, TangSettings};
use isv_decode::Limits;
use isv_kernels::quant::StepSize;
use isv_testkit::ball;
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use proptest::prelude::*;
use std::sync::LazyLock;

const LIMITS: Limits = Limits { frame_voxels: 1 << 22, voxels_per_byte: usize::MAX };

fn settings(edge: BlockEdge, coefficients: usize, sixteenths: u32) -> TangSettings {
    let grid =
        Grid { voxel_size: VoxelSize::from_metres(0.005).unwrap(), edge, truncation: Truncation::DEFAULT };
    TangSettings { grid, coefficients, step: StepSize::new(sixteenths).unwrap() }
}

fn klt(grid: Grid) -> BlockBasis {
    let mut moments = BlockMoments::new(&grid).unwrap();
    moments.add(&ball(grid, 0.0));
    moments.klt().unwrap()
}

fn largest_error(a: &SparseVolume, b: &SparseVolume) -> i16 {
    a.samples().zip(b.samples()).map(|(a, b)| (a - b).abs()).max().unwrap()
}

#[test]
fn the_decoder_has_the_encoders_reconstruction() {
    for (edge, coefficients, step) in
        [(BlockEdge::E8, 48, 2048), (BlockEdge::E4, 10, 500), (BlockEdge::E8, 1, 1 << 20)]
    {
        let settings = settings(edge, coefficients, step);
        let basis = klt(settings.grid);
        let mut encoder = TangEncoder::new(&basis, settings);
        let mut decoder = TangDecoder::new(&basis, settings, LIMITS);
        for t in [0.0, 1.0, 2.0] {
            let volume = ball(settings.grid, t);
            let frame = encoder.encode(&volume);
            let decoded = decoder.decode(&frame.bytes).unwrap();
            assert_eq!(decoded, encoder.reconstruction().unwrap());
            assert_eq!(decoded.coords(), volume.coords());
            assert_eq!(decoded.unobserved_masks(), volume.unobserved_masks());
            assert!((1..40).contains(&frame.bytes_headers()), "{} bytes of headers", frame.bytes_headers());
            assert!(frame.bytes_occupancy > 0 && frame.bytes_masks > 0 && frame.bytes_coefficients > 0);
        }
    }
}

#[test]
fn all_coefficients_and_a_fine_step_reproduce_the_volume() {
    let settings = settings(BlockEdge::E8, 512, 4);
    let basis = klt(settings.grid);
    let volume = ball(settings.grid, 5.0);
    let frame = TangEncoder::new(&basis, settings).encode(&volume);
    let decoded = TangDecoder::new(&basis, settings, LIMITS).decode(&frame.bytes).unwrap();
    let error = largest_error(&volume, &decoded);
    assert!(error <= 1, "{error} codes");
}

#[test]
fn a_finer_step_costs_more_and_errs_less() {
    let basis = klt(settings(BlockEdge::E8, 48, 16).grid);
    let volume = ball(settings(BlockEdge::E8, 48, 16).grid, 0.0);
    let squared = |step| {
        let settings = settings(BlockEdge::E8, 48, step);
        let mut encoder = TangEncoder::new(&basis, settings);
        let bytes = encoder.encode(&volume).bytes.len();
        let decoded = encoder.reconstruction().unwrap();
        let decoded = decoded.samples();
        let errors = volume.samples().zip(decoded).map(|(a, b)| f64::from(a - b).powi(2));
        (bytes, errors.sum::<f64>())
    };
    let points = [256, 1024, 4096, 16384].map(squared);
    assert!(points.windows(2).all(|w| w[0].0 > w[1].0 && w[0].1 < w[1].1), "{points:?}");
}

#[test]
fn a_volume_without_blocks_is_a_frame_too() {
    let settings = settings(BlockEdge::E8, 48, 2048);
    let basis = BlockBasis::dct(BlockEdge::E8);
    let empty = SparseVolume::empty(settings.grid);
    let frame = TangEncoder::new(&basis, settings).encode(&empty);
    assert_eq!(TangDecoder::new(&basis, settings, LIMITS).decode(&frame.bytes).unwrap(), empty);
}

#[test]
fn threads_do_not_change_the_bytes() {
    let settings = settings(BlockEdge::E8, 48, 1024);
    let (basis, volume) = (klt(settings.grid), ball(settings.grid, 1.0));
    let frames = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| TangEncoder::new(&basis, settings).encode(&volume))
    });
    assert_eq!(frames[0], frames[1]);
}

#[test]
fn more_blocks_than_allowed_are_refused() {
    let settings = settings(BlockEdge::E8, 48, 2048);
    let basis = BlockBasis::dct(BlockEdge::E8);
    let frame = TangEncoder::new(&basis, settings).encode(&ball(settings.grid, 0.0));
    let mut decoder =
        TangDecoder::new(&basis, settings, Limits { frame_voxels: 512 * 10, ..Limits::default() });
    assert!(matches!(decoder.decode(&frame.bytes), Err(TangError::TooManyBlocks { limit: 10, .. })));
}

/// A decoder and a frame for it.
static CODED: LazyLock<(TangDecoder, Vec<u8>)> = LazyLock::new(|| {
    let settings = settings(BlockEdge::E8, 20, 4096);
    let basis = BlockBasis::dct(BlockEdge::E8);
    let frame = TangEncoder::new(&basis, settings).encode(&ball(settings.grid, 0.0));
    (TangDecoder::new(&basis, settings, LIMITS), frame.bytes)
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Whatever the bytes, a volume within the limits or an error; after an error the decoder still takes the true frame.
    #[test]
    fn bytes_from_anywhere_never_panic(
        random in prop::collection::vec(any::<u8>(), 0..400),
        cut in any::<prop::sample::Index>(),
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 1..4),
    ) {
        let (decoder, bytes) = &*CODED;
        let mut flipped = bytes.clone();
        for (at, bit) in flips {
            *at.get_mut(&mut flipped) ^= 1 << bit;
        }
        let short = &bytes[..cut.index(bytes.len())];
        prop_assert!(decoder.clone().decode(short).is_err(), "a cut frame");
        for hostile in [&random, &flipped] {
            let mut decoder = decoder.clone();
            match decoder.decode(hostile) {
                Ok(volume) => prop_assert!(volume.sample_count() <= LIMITS.frame_voxels),
                Err(_) => prop_assert!(decoder.decode(bytes).is_ok(), "as it was before"),
            }
        }
    }
}
