//! The second version of LASzip's code for times, which is read only to get to what comes after it.
//!
//! `laz` has it as well, but calls itself for each switch from one sequence of times to another. A damaged
//! file has a hundred thousand switches in a row. That is more than any stack holds, and cannot be caught.

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;
use std::io::{self, ErrorKind, Read};

/// Times interleaved by a scanner, of which a point's is one.
const SEQUENCES: usize = 4;

/// Most switches for a point. A writer switches once, to the sequence that the time belongs to.
const MOST_SWITCHES: usize = SEQUENCES;

/// Symbols of a time in a sequence whose times change. Those below this one are that multiple of the last
/// difference, those up to `LEAST_MULTIPLE` negative multiples.
const MOST_MULTIPLE: i32 = 500;
const LEAST_MULTIPLE: i32 = MOST_MULTIPLE + 10;
/// The time is that of the point before.
const UNCHANGED: i32 = LEAST_MULTIPLE + 1;
/// The time starts a sequence. Symbols above are switches.
const STARTS: i32 = UNCHANGED + 1;
const SYMBOLS: u32 = STARTS as u32 + SEQUENCES as u32;

/// Symbols of a time in a sequence whose last times were equal.
const STILL_DIFFERS: i32 = 1;
const STILL_STARTS: i32 = 2;
const STILL_SYMBOLS: u32 = STILL_STARTS as u32 + SEQUENCES as u32;

/// Times in a row that are far from what was expected, after which their difference is expected.
const MOST_SURPRISES: u32 = 3;

/// Follows the differences of times; the times themselves, which nothing depends on, are not made.
pub(super) struct GpsTimes {
    follow: ArithmeticModel,
    follow_still: ArithmeticModel,
    differences: IntegerDecompressor,
    /// The sequence of the last time, and the one that was started last.
    current: usize,
    newest: usize,
    sequences: [Sequence; SEQUENCES],
}

#[derive(Clone, Copy, Default)]
struct Sequence {
    difference: i32,
    surprises: u32,
}

impl Default for GpsTimes {
    fn default() -> Self {
        Self {
            follow: ArithmeticModelBuilder::new(SYMBOLS).build(),
            follow_still: ArithmeticModelBuilder::new(STILL_SYMBOLS).build(),
            differences: IntegerDecompressorBuilder::new().bits(32).contexts(9).build_initialized(),
            current: 0,
            newest: 0,
            sequences: [Sequence::default(); SEQUENCES],
        }
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimes {
    fn size_of_field(&self) -> usize {
        size_of::<f64>()
    }

    fn decompress_first(&mut self, source: &mut R, first_point: &mut [u8]) -> io::Result<()> {
        source.read_exact(first_point)
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, _: &mut [u8]) -> io::Result<()> {
        for _ in 0..=MOST_SWITCHES {
            let switch = if self.sequences[self.current].difference == 0 {
                self.follow_still(decoder)?
            } else {
                self.follow(decoder)?
            };
            let Some(switch) = switch else { return Ok(()) };
            self.current = (self.current + switch) % SEQUENCES;
        }
        Err(io::Error::new(ErrorKind::InvalidData, "its times switch from sequence to sequence without end"))
    }
}

impl GpsTimes {
    /// Takes a time of a sequence whose last ones were equal; or tells how many sequences further it belongs.
    fn follow_still<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Option<usize>> {
        match decoder.decode_symbol(&mut self.follow_still)? as i32 {
            0 => {}
            STILL_DIFFERS => {
                let difference = self.differences.decompress(decoder, 0, 0)?;
                self.sequences[self.current] = Sequence { difference, surprises: 0 };
            }
            STILL_STARTS => self.start(decoder)?,
            switch => return Ok(Some((switch - STILL_STARTS) as usize)),
        }
        Ok(None)
    }

    /// Follows a sequence whose times change.
    fn follow<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Option<usize>> {
        let last = self.sequences[self.current].difference;
        let symbol = decoder.decode_symbol(&mut self.follow)? as i32;
        // What is expected, the context for what it is missed by, and whether it is a surprise.
        let (multiple, context, surprise) = match symbol {
            0 => (0, 7, true),
            1 => (1, 1, false),
            2..10 => (symbol, 2, false),
            10..MOST_MULTIPLE => (symbol, 3, false),
            MOST_MULTIPLE => (symbol, 4, true),
            ..LEAST_MULTIPLE => (MOST_MULTIPLE - symbol, 5, false),
            LEAST_MULTIPLE => (MOST_MULTIPLE - symbol, 6, true),
            UNCHANGED => return Ok(None),
            STARTS => return self.start(decoder).map(|()| None),
            switch => return Ok(Some((switch - STARTS) as usize)),
        };
        let difference = self.differences.decompress(decoder, last.wrapping_mul(multiple), context)?;
        let sequence = &mut self.sequences[self.current];
        if surprise {
            sequence.surprises += 1;
            if sequence.surprises > MOST_SURPRISES {
                *sequence = Sequence { difference, surprises: 0 };
            }
        } else if symbol == 1 {
            sequence.surprises = 0;
        }
        Ok(None)
    }

    /// Takes a time that is far from all others.
    fn start<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<()> {
        // Its upper half is coded as a difference, which none of those that follow depends on.
        self.differences.decompress(decoder, 0, 8)?;
        decoder.read_int()?;
        self.newest = (self.newest + 1) % SEQUENCES;
        self.current = self.newest;
        self.sequences[self.current] = Sequence::default();
        Ok(())
    }
}
