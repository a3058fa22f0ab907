//! Every kernel gives the same bits with every instruction set that the machine has.

use isv_kernels::block8::Block;
use isv_kernels::dct::{BlockTransform, ReducedTransform};
use isv_kernels::deblock::{FaceFilter, smooth_face};
use isv_kernels::extrapolation::{CodedNeighbours, extrapolate};
use isv_kernels::quant::{Quantizer, StepSize};
use isv_kernels::signs::inside;
use isv_kernels::simd::{self, vectorized};
use isv_kernels::surface_fit::SurfaceFit;
use isv_kernels::warp::{MotionVector, StitchedReference};
use isv_kernels::window::{ROW, ROWS, WindowRows};
use isv_volume::{BlockEdge, Truncation};
use proptest::collection::vec;
use proptest::prelude::*;

const EDGES: [BlockEdge; 3] = [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16];

/// Asserts that the work has one result, whatever compiles it. `with_each` begins with the scalar code.
fn assert_same<R: PartialEq + std::fmt::Debug>(work: impl FnMut() -> R) {
    let results = simd::with_each(work);
    for (instructions, result) in &results[1..] {
        assert!(*result == results[0].1, "{instructions}: {result:?}, scalar: {:?}", results[0].1);
    }
}

/// Samples of one block, mostly as a distance field has them: within the truncation, of which many at its ends.
fn samples(count: usize) -> impl Strategy<Value = Vec<i16>> {
    let sample = prop_oneof![6 => -2048i16..=2048, 1 => Just(2048i16), 1 => Just(-2048i16), 1 => Just(0i16)];
    vec(sample, count)
}

fn block() -> impl Strategy<Value = Block> {
    samples(512).prop_map(|samples| samples.try_into().expect("512 samples"))
}

fn transform(edge: BlockEdge) -> BlockTransform {
    BlockTransform::new(edge, Truncation::DEFAULT)
}

#[test]
fn there_is_more_than_one_instruction_set_to_compare() {
    let names: Vec<_> = simd::with_each(simd::in_use).into_iter().map(|(name, _)| name.to_string()).collect();
    println!("{}", names.join(", "));
    let vectors = cfg!(any(target_arch = "x86_64", target_arch = "aarch64"));
    assert!(names[0] == "scalar" && (!vectors || names.len() > 1), "{names:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn forward_dct(values in vec(-4096i16..=4096, 4096)) {
        for edge in EDGES {
            assert_same(|| {
                let mut block = values[..edge.block_voxels()].to_vec();
                transform(edge).forward(&mut block);
                block
            });
        }
    }

    /// Any coefficients, those that saturate too, and few of them, as streams have.
    #[test]
    fn inverse_dct(values in vec(any::<i16>(), 4096), used in 1usize..4096) {
        for edge in EDGES {
            let mut coefficients = values[..edge.block_voxels()].to_vec();
            coefficients.iter_mut().skip(used).for_each(|c| *c = 0);
            assert_same(|| {
                let mut block = coefficients.clone();
                transform(edge).inverse(&mut block);
                block
            });
            for reduction in 0..=ReducedTransform::MAX_REDUCTION {
                let reduced = ReducedTransform::new(transform(edge), reduction);
                assert_same(|| {
                    let mut block = coefficients[..reduced.side().pow(3)].to_vec();
                    reduced.inverse(&mut block);
                    block
                });
            }
        }
    }

    #[test]
    fn dequantization(levels in vec(any::<i32>(), 512), step in StepSize::RANGE, exponent in -6i32..=3) {
        let quantizer = Quantizer::new(StepSize::new(step).expect("a step in range"), exponent);
        assert_same(|| {
            vectorized(
                #[inline(always)]
                || {
                    let mut out = [0; 512];
                    for i in 0..512 {
                        out[i] = quantizer.dequantize(levels[i]);
                    }
                    out
                },
            )
        });
    }

    #[test]
    fn translation_in_a_window(values in samples(ROW * ROWS), first in 0usize..8, quarters in prop::array::uniform3(0u8..4)) {
        let mut window = WindowRows { first, ..WindowRows::default() };
        window.samples.as_flattened_mut().copy_from_slice(&values);
        assert_same(|| {
            let mut out = [0; 512];
            window.translate(quarters, &mut out);
            out
        });
    }

    #[test]
    fn warp(values in samples(512), moves in prop::array::uniform3(-12i8..=12), turns in prop::array::uniform3(-32i8..=32)) {
        for (edge, reduction) in EDGES.into_iter().flat_map(|edge| (0..=edge.log2()).map(move |r| (edge, r))).take(8) {
            if reduction > ReducedTransform::MAX_REDUCTION {
                continue;
            }
            let mut stitched = StitchedReference::reduced(edge, reduction);
            let voxels = stitched.block_side().pow(3);
            for slot in 0..27 {
                let block: Vec<i16> = (0..voxels).map(|v| values[(v * 7 + slot * 31) % 512]).collect();
                stitched.put_block(slot, &block);
            }
            for rotation in [[0; 3], turns] {
                assert_same(|| {
                    let mut out = vec![0; voxels];
                    stitched.warp(MotionVector { translation: moves, rotation }, &mut out);
                    out
                });
            }
        }
    }

    #[test]
    fn deblocking(blocks in [block(), block()], strength in 0..=FaceFilter::MAX_STRENGTH, limit: u8, axis in 0usize..3) {
        let truncation = Truncation::DEFAULT;
        let filter = FaceFilter::new(strength, limit, truncation).expect("a strength in range");
        assert_same(|| {
            let [mut lower, mut upper] = blocks;
            let changed = smooth_face(axis, &mut lower, &mut upper, filter);
            (changed, lower, upper)
        });
    }

    #[test]
    fn extrapolation(blocks in vec(block(), 3), there in 1u32..1 << 27) {
        let mut neighbours: CodedNeighbours = [None; 27];
        for slot in (0..27).filter(|slot| *slot == 12 || there >> slot & 1 != 0) {
            neighbours[slot] = Some(&blocks[slot % 3]);
        }
        assert_same(|| {
            let mut out = [0; 512];
            (extrapolate(&neighbours, 2048, &mut out), out)
        });
    }

    #[test]
    fn signs(block in vec(any::<i16>(), 512)) {
        let block: Block = block.try_into().expect("512 samples");
        assert_same(|| inside(&block));
    }

    #[test]
    fn surface_fit(blocks in vec(vec(any::<i16>(), 512), 2), near in vec(samples(512), 2), there in 1u32..1 << 27) {
        for blocks in [blocks, near] {
            assert_same(|| {
                let mut fit = SurfaceFit::new();
                for slot in (0..27).filter(|slot| *slot != 13 && there >> slot & 1 != 0) {
                    fit.add_neighbour([slot % 3 - 1, slot / 3 % 3 - 1, slot / 9 - 1], &blocks[slot as usize % 2]);
                }
                let mut out = [0; 512];
                (fit.predict(1024, &mut out), out)
            });
        }
    }
}
