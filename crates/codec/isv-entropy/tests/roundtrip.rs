//! What the encoder writes, the decoder reads: random symbols, every prefix, and the cost against the entropy.

use isv_entropy::{BitModel, IntegerModel, MAGNITUDE_LIMIT, RangeDecoder, RangeEncoder};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Symbol {
    Bit(usize, bool),
    Raw(u32, u32),
    Integer(i32),
}

fn symbol() -> impl Strategy<Value = Symbol> {
    let limit = MAGNITUDE_LIMIT as i32;
    prop_oneof![
        (0..3usize, prop::bool::weighted(0.02)).prop_map(|(model, bit)| Symbol::Bit(model, bit)),
        (0..32u32).prop_flat_map(
            |count| (0..1u64 << count, Just(count)).prop_map(|(v, c)| Symbol::Raw(v as u32, c))
        ),
        prop_oneof![-3..4, -limit..=limit, Just(limit), Just(-limit)].prop_map(Symbol::Integer),
    ]
}

fn encode(symbols: &[Symbol]) -> Vec<u8> {
    let (mut encoder, mut bits, mut integers) =
        (RangeEncoder::new(), [BitModel::default(); 3], IntegerModel::default());
    for symbol in symbols {
        match *symbol {
            Symbol::Bit(model, bit) => encoder.encode(&mut bits[model], bit),
            Symbol::Raw(value, count) => encoder.encode_raw(value, count),
            Symbol::Integer(value) => integers.encode(&mut encoder, value),
        }
    }
    encoder.finish()
}

/// The count of bits never falls, agrees with the bytes that come out in the end, and charges a raw bit one bit.
#[test]
fn bits_are_counted_as_they_are_written() {
    let (mut encoder, mut model) = (RangeEncoder::new(), IntegerModel::default());
    assert_eq!(encoder.bits().round(), 0.0);
    let mut before = encoder.bits();
    for i in 0..3000i32 {
        model.encode(&mut encoder, i % 7 - 3);
        assert!(encoder.bits() > before, "{i}");
        before = encoder.bits();
        encoder.encode_raw(5, 3);
        assert!((encoder.bits() - before - 3.0).abs() < 1e-6, "{i}");
        before = encoder.bits();
    }
    let bytes = encoder.finish().len() as f64;
    assert!((bytes - before / 8.0).abs() <= 4.0, "{bytes} bytes, {before} bits");
}

/// After each symbol the decoder has read as many bits as the encoder had written.
#[test]
fn bits_are_counted_alike_on_both_sides() {
    let symbol = |i: u32| (i.wrapping_mul(2_654_435_761) >> 20) as i32 % 40 - 20;
    let (mut encoder, mut model) = (RangeEncoder::new(), IntegerModel::default());
    let written: Vec<f64> = (0..2000)
        .map(|i| {
            model.encode(&mut encoder, symbol(i));
            encoder.bits()
        })
        .collect();
    let bytes = encoder.finish();
    let (mut decoder, mut model) = (RangeDecoder::new(&bytes), IntegerModel::default());
    assert_eq!(decoder.bits().round(), 0.0);
    for (i, bits) in (0..).zip(written) {
        assert_eq!(model.decode(&mut decoder), symbol(i));
        assert_eq!(decoder.bits(), bits, "symbol {i}");
    }
}

proptest! {
    #[test]
    fn decoder_returns_the_symbols(symbols in prop::collection::vec(symbol(), 0..400)) {
        let bytes = encode(&symbols);
        let (mut decoder, mut bits, mut integers) =
            (RangeDecoder::new(&bytes), [BitModel::default(); 3], IntegerModel::default());
        for symbol in symbols {
            match symbol {
                Symbol::Bit(model, bit) => prop_assert_eq!(decoder.decode(&mut bits[model]), bit),
                Symbol::Raw(value, count) => prop_assert_eq!(decoder.decode_raw(count), value),
                Symbol::Integer(value) => prop_assert_eq!(integers.decode(&mut decoder), value),
            }
        }
        prop_assert!(!decoder.overran());
    }

    #[test]
    fn any_bytes_decode_to_values_in_range(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
        let (mut decoder, mut model) = (RangeDecoder::new(&bytes), IntegerModel::default());
        for _ in 0..2000 {
            prop_assert!(model.decode(&mut decoder).unsigned_abs() <= MAGNITUDE_LIMIT);
        }
    }
}

#[test]
fn long_runs_of_carries_ripple_through() {
    // Certain zeros push `low` against the top of its range, which is where carries are born.
    let mut encoder = RangeEncoder::new();
    for i in 0..20_000u32 {
        encoder.encode_raw(u32::from(i % 977 != 0), 1);
    }
    let bytes = encoder.finish();
    let mut decoder = RangeDecoder::new(&bytes);
    assert!((0..20_000u32).all(|i| decoder.decode_raw(1) == u32::from(i % 977 != 0)));
}

#[test]
fn cost_is_close_to_the_entropy() {
    // One in 32 is a 1: 0.2006 bits a symbol.
    let ones = |i: u32| i.wrapping_mul(2_654_435_761) >> 27 == 0;
    let (mut encoder, mut model) = (RangeEncoder::new(), BitModel::default());
    let count = 200_000;
    (0..count).for_each(|i| encoder.encode(&mut model, ones(i)));
    let p = (0..count).filter(|i| ones(*i)).count() as f64 / f64::from(count);
    let entropy = -(p * p.log2() + (1.0 - p) * (1.0 - p).log2());
    let cost = encoder.finish().len() as f64 * 8.0 / f64::from(count);
    println!("{cost:.4} bits a symbol, entropy {entropy:.4}");
    assert!(cost < entropy * 1.04);
}

#[test]
fn nothing_costs_nothing() {
    assert_eq!(RangeEncoder::new().finish(), []);
}
