//! The range coder against the definition in `docs/spec/format.md`, 7.2 and 7.3, worked out in integers that have room to spare.

mod oracle;

use isv_entropy::{BitModel, IntegerModel, MAGNITUDE_LIMIT, RangeDecoder, RangeEncoder};
use oracle::{Decoder, Integer, Model};

/// Models of each kind that a script uses.
const MODELS: usize = 4;
/// Most symbols of a script.
const SYMBOLS: usize = 1 << 10;

/// A symbol to be coded.
#[derive(Clone, Copy, Debug)]
enum Symbol {
    /// A bit under one, two or three models: as many as are listed before the first that is missing.
    Bit([Option<usize>; 3]),
    /// Bits without a model; how many.
    Raw(u32),
    /// An integer under a model.
    Integer(usize),
}

/// All models, as the crate has them.
type Models = ([BitModel; MODELS], [IntegerModel; MODELS]);
/// Models and integers by definition.
type Definitions = ([Model; MODELS], [Integer; MODELS]);

/// Bytes: the length of a script (2), the script, and what is to be decoded. The script's symbols are decoded from those bytes, whatever
/// they are; then what was found is encoded and decoded again.
pub(crate) fn check(bytes: &[u8]) {
    let Some((length, rest)) = bytes.split_first_chunk() else { return };
    let (script, coded) = rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len()));
    let script = symbols(script);
    let values = decode(&script, coded);
    let mut encoder = RangeEncoder::new();
    let mut models = Models::default();
    for (symbol, value) in script.iter().zip(&values) {
        encode(&mut encoder, &mut models, *symbol, *value);
    }
    let written = encoder.finish();
    assert_eq!(decode(&script, &written), values, "what was written is read");
    let mut decoder = Decoder::new(&written);
    let mut definitions = Definitions::default();
    for symbol in &script {
        define(&mut decoder, &mut definitions, *symbol);
    }
    assert!(!decoder.overran(), "a writer leaves off at most four zeros");
}

/// Two bytes a symbol: what it is, and how often it comes.
fn symbols(script: &[u8]) -> Vec<Symbol> {
    let mut symbols = Vec::new();
    for pair in script.chunks_exact(2) {
        let which = |shift: u8| usize::from(pair[0] >> shift) % MODELS;
        let symbol = match pair[0] >> 6 {
            0 => Symbol::Bit([Some(which(0)), None, None]),
            // Each model once: a decision is learned by every model.
            1 => Symbol::Bit([Some(which(0)), Some((which(0) + 1) % MODELS), None]),
            2 if pair[0] & 32 != 0 => Symbol::Raw(u32::from(pair[0] % 32)),
            2 => Symbol::Bit([0, 1, 2].map(|n| Some((which(0) + n) % MODELS))),
            _ => Symbol::Integer(which(0)),
        };
        symbols.extend(std::iter::repeat_n(symbol, 1 + usize::from(pair[1])));
        symbols.truncate(SYMBOLS);
    }
    symbols
}

/// Decodes a script by the crate and by definition, and compares every value and every state.
fn decode(script: &[Symbol], coded: &[u8]) -> Vec<i64> {
    let mut decoder = RangeDecoder::new(coded);
    let mut by_definition = Decoder::new(coded);
    let mut models = Models::default();
    let mut definitions = Definitions::default();
    let mut values = Vec::new();
    for (number, symbol) in script.iter().enumerate() {
        let value = decode_one(&mut decoder, &mut models, *symbol);
        let expected = define(&mut by_definition, &mut definitions, *symbol);
        assert_eq!(value, expected, "symbol {number}, {symbol:?}");
        // Tells range and position.
        assert_eq!(decoder.bits(), by_definition.bits(), "state after symbol {number}, {symbol:?}");
        assert_eq!(decoder.overran(), by_definition.overran(), "overrun after symbol {number}");
        values.push(value);
    }
    let names = format!("{models:?}");
    assert_eq!(names, format!("({:?}, {:?})", definitions.0, definitions.1), "what the models have learned");
    values
}

fn decode_one(decoder: &mut RangeDecoder, (bits, integers): &mut Models, symbol: Symbol) -> i64 {
    match symbol {
        Symbol::Bit([Some(a), None, _]) => i64::from(decoder.decode(&mut bits[a])),
        Symbol::Bit([Some(a), Some(b), None]) => {
            let models = bits.get_disjoint_mut([a, b]).expect("two models");
            i64::from(decoder.decode_mixed(models))
        }
        Symbol::Bit([a, b, c]) => {
            let chosen = [a, b, c].map(|model| model.expect("three models"));
            i64::from(decoder.decode_mixed(bits.get_disjoint_mut(chosen).expect("three models")))
        }
        Symbol::Raw(count) => i64::from(decoder.decode_raw(count)),
        Symbol::Integer(model) => i64::from(integers[model].decode(decoder)),
    }
}

fn define(decoder: &mut Decoder, (bits, integers): &mut Definitions, symbol: Symbol) -> i64 {
    match symbol {
        Symbol::Bit(chosen) => {
            let chosen: Vec<usize> = chosen.into_iter().flatten().collect();
            decoder.decode_mixed(bits, &chosen)
        }
        Symbol::Raw(count) => decoder.decode_raw(count),
        Symbol::Integer(model) => integers[model].decode(decoder),
    }
}

fn encode(encoder: &mut RangeEncoder, (bits, integers): &mut Models, symbol: Symbol, value: i64) {
    match symbol {
        Symbol::Bit([Some(a), None, _]) => encoder.encode(&mut bits[a], value != 0),
        Symbol::Bit([Some(a), Some(b), None]) => {
            encoder.encode_mixed(bits.get_disjoint_mut([a, b]).expect("two models"), value != 0);
        }
        Symbol::Bit([a, b, c]) => {
            let chosen = [a, b, c].map(|model| model.expect("three models"));
            encoder.encode_mixed(bits.get_disjoint_mut(chosen).expect("three models"), value != 0);
        }
        Symbol::Raw(count) => encoder.encode_raw(value as u32, count),
        Symbol::Integer(model) => {
            assert!(value.unsigned_abs() <= u64::from(MAGNITUDE_LIMIT));
            integers[model].encode(encoder, value as i32);
        }
    }
}
