//! The container of binary USD files ("crate"), version 0.8.0: values as they come, and tables of them at the end.

use super::integers::{compress, compress_integers};
use super::layer::Array;
use crate::own::COMMENT;
use std::io::{self, Seek, SeekFrom, Write};

const IDENTIFIER: &[u8; 8] = b"PXR-USDC";
const VERSION: [u8; 3] = [0, 8, 0];
/// Length of the header: identifier, version, place of the table of contents, reserved bytes.
const HEADER_BYTES: usize = 88;
/// Place of the offset of the table of contents.
const CONTENTS_AT: u64 = 16;
/// Integers in an array from which on it is compressed: readers expect shorter ones as they are.
const FEWEST_COMPRESSED: usize = 16;
/// End of a set of fields.
const END_OF_SET: u32 = u32::MAX;

/// Types of values, by their numbers in the file.
#[derive(Clone, Copy, Debug)]
enum Type {
    Bool = 1,
    Int = 3,
    Double = 9,
    String = 10,
    Token = 11,
    Vec3d = 23,
    Vec3f = 24,
    TokenVector = 41,
    Specifier = 42,
    Variability = 44,
    TimeSamples = 46,
    DoubleVector = 48,
}

/// A value as tables name it: its type, and the value itself if it is short, else its place in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rep(u64);

impl Rep {
    const ARRAY: u64 = 1 << 63;
    const INLINED: u64 = 1 << 62;
    const COMPRESSED: u64 = 1 << 61;
    /// Specifier of a prim that the file defines: `def`.
    pub(super) const DEF: Self = Self::inlined(Type::Specifier, 0);
    /// Variability of an attribute that cannot change over time: `uniform`.
    pub(super) const UNIFORM: Self = Self::inlined(Type::Variability, 1);

    /// Names a value in the file.
    const fn at(offset: u64, kind: Type) -> Self {
        Self((kind as u64) << 48 | offset)
    }

    const fn inlined(kind: Type, value: u32) -> Self {
        Self(Self::INLINED | (kind as u64) << 48 | value as u64)
    }

    const fn with(self, flag: u64) -> Self {
        Self(self.0 | flag)
    }

    pub(super) const fn boolean(value: bool) -> Self {
        Self::inlined(Type::Bool, value as u32)
    }
}

/// Kind of a spec (a thing with fields), by its number in the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum SpecKind {
    Attribute = 1,
    Prim = 6,
    /// The file itself.
    Root = 7,
}

/// A row of the table of specs.
#[derive(Debug)]
struct Spec {
    kind: SpecKind,
    /// Number of ancestors.
    depth: usize,
    /// Last part of the path.
    name: u32,
    /// Start among the sets of fields.
    fields: usize,
}

/// A binary file that is being written.
///
/// Values are appended as they come. Tables are kept until the end.
#[derive(Debug)]
pub(super) struct CrateFile<W> {
    out: W,
    at: u64,
    tokens: Vec<&'static str>,
    /// Strings, as tokens.
    strings: Vec<u32>,
    fields: Vec<(u32, Rep)>,
    /// Numbers of fields, each set with its end behind it.
    sets: Vec<u32>,
    specs: Vec<Spec>,
}

impl<W: Write + Seek> CrateFile<W> {
    /// Starts a file.
    pub(super) fn new(mut out: W) -> io::Result<Self> {
        // An output without places, such as a pipe, is refused now and not when all is written.
        out.seek(SeekFrom::Start(0))?;
        let mut file = Self {
            out,
            at: 0,
            // A property's name counts below 0 in the table of paths, so none may have number 0.
            tokens: vec![""],
            strings: Vec::new(),
            fields: Vec::new(),
            sets: Vec::new(),
            specs: Vec::new(),
        };
        file.append(&header(0))?;
        // Readers pass over this text: they go where the tables say. It tells isv that it may replace the file.
        file.append(COMMENT.as_bytes())?;
        Ok(file)
    }

    pub(super) fn array(&mut self, array: &Array) -> io::Result<Rep> {
        let (kind, count) = match array {
            Array::Integers(values) => (Type::Int, values.len()),
            Array::Vectors(values) => (Type::Vec3f, values.len()),
        };
        if count == 0 {
            return Ok(Rep::at(0, kind).with(Rep::ARRAY));
        }
        let rep = Rep::at(self.align()?, kind).with(Rep::ARRAY);
        self.count(count)?;
        match array {
            Array::Integers(values) => {
                if count >= FEWEST_COMPRESSED
                    && let Some(packed) = compress_integers(values)
                {
                    self.sized(&packed)?;
                    return Ok(rep.with(Rep::COMPRESSED));
                }
                self.append(&little_endian(values, |value| value.to_le_bytes()))?;
            }
            Array::Vectors(values) => {
                self.append(&little_endian(values.as_flattened(), |value| value.to_le_bytes()))?;
            }
        }
        Ok(rep)
    }

    pub(super) fn double(&mut self, value: f64) -> io::Result<Rep> {
        let offset = self.align()?;
        self.append(&value.to_le_bytes())?;
        Ok(Rep::at(offset, Type::Double))
    }

    pub(super) fn double3(&mut self, values: [f64; 3]) -> io::Result<Rep> {
        let offset = self.align()?;
        self.append(&little_endian(&values, |value| value.to_le_bytes()))?;
        Ok(Rep::at(offset, Type::Vec3d))
    }

    pub(super) fn string(&mut self, value: &'static str) -> Rep {
        let token = self.token_number(value);
        Rep::inlined(Type::String, number(&mut self.strings, token))
    }

    pub(super) fn token(&mut self, value: &'static str) -> Rep {
        Rep::inlined(Type::Token, self.token_number(value))
    }

    /// Writes the value of an attribute of type `token[]`.
    pub(super) fn token_array(&mut self, values: &[&'static str]) -> io::Result<Rep> {
        Ok(self.token_list(values, Type::Token)?.with(Rep::ARRAY))
    }

    /// Writes the names of a prim's children or properties.
    pub(super) fn names(&mut self, names: &[&'static str]) -> io::Result<Rep> {
        self.token_list(names, Type::TokenVector)
    }

    fn token_list(&mut self, values: &[&'static str], kind: Type) -> io::Result<Rep> {
        let numbers: Vec<u32> = values.iter().map(|value| self.token_number(value)).collect();
        let offset = self.align()?;
        self.count(numbers.len())?;
        self.append(&little_endian(&numbers, |value| value.to_le_bytes()))?;
        Ok(Rep::at(offset, kind))
    }

    /// Writes times, which [time samples](Self::samples) share.
    pub(super) fn times(&mut self, times: &[f64]) -> io::Result<Rep> {
        let offset = self.align()?;
        self.count(times.len())?;
        self.append(&little_endian(times, |value| value.to_le_bytes()))?;
        Ok(Rep::at(offset, Type::DoubleVector))
    }

    /// Writes which values an attribute has at which times.
    pub(super) fn samples(&mut self, times: Rep, values: &[Rep]) -> io::Result<Rep> {
        let offset = self.align()?;
        // Places are relative to where they are. What they lead to follows at once.
        let next = 8u64.to_le_bytes();
        self.append(&next)?;
        self.append(&times.0.to_le_bytes())?;
        self.append(&next)?;
        self.count(values.len())?;
        self.append(&little_endian(values, |rep| rep.0.to_le_bytes()))?;
        Ok(Rep::at(offset, Type::TimeSamples))
    }

    /// Adds a spec. Specs come in the order of a walk through the tree, parents first. `depth`: number of ancestors.
    pub(super) fn spec(
        &mut self,
        kind: SpecKind,
        depth: usize,
        name: &'static str,
        fields: &[(&'static str, Rep)],
    ) {
        let name = self.token_number(name);
        let start = self.sets.len();
        for (field, rep) in fields {
            let field = (self.token_number(field), *rep);
            let field = number(&mut self.fields, field);
            self.sets.push(field);
        }
        self.sets.push(END_OF_SET);
        self.specs.push(Spec { kind, depth, name, fields: start });
    }

    /// Writes the tables and where they are. Returns the whole file.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.align()?;
        let sections = [
            self.section("TOKENS", Self::write_tokens)?,
            self.section("STRINGS", Self::write_strings)?,
            self.section("FIELDS", Self::write_fields)?,
            self.section("FIELDSETS", Self::write_sets)?,
            self.section("PATHS", Self::write_paths)?,
            self.section("SPECS", Self::write_specs)?,
        ];
        let contents_at = self.at;
        self.count(sections.len())?;
        self.append(sections.as_flattened())?;
        self.out.seek(SeekFrom::Start(CONTENTS_AT))?;
        self.out.write_all(&contents_at.to_le_bytes())?;
        Ok(self.out)
    }

    /// Writes a table. Returns its row in the table of contents: its name, start and length.
    fn section(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut Self) -> io::Result<()>,
    ) -> io::Result<[u8; 32]> {
        let start = self.at;
        write(self)?;
        let mut row = [0; 32];
        row[..name.len()].copy_from_slice(name.as_bytes());
        row[16..24].copy_from_slice(&start.to_le_bytes());
        row[24..].copy_from_slice(&(self.at - start).to_le_bytes());
        Ok(row)
    }

    fn write_tokens(&mut self) -> io::Result<()> {
        let text: Vec<u8> = self.tokens.iter().flat_map(|token| token.bytes().chain([0])).collect();
        self.count(self.tokens.len())?;
        self.count(text.len())?;
        self.sized(&compressed(&text)?)
    }

    fn write_strings(&mut self) -> io::Result<()> {
        self.count(self.strings.len())?;
        let strings = little_endian(&self.strings, |value| value.to_le_bytes());
        self.append(&strings)
    }

    fn write_fields(&mut self) -> io::Result<()> {
        self.count(self.fields.len())?;
        let names: Vec<u32> = self.fields.iter().map(|(name, _)| *name).collect();
        self.integers(&names)?;
        let reps = little_endian(&self.fields, |(_, rep)| rep.0.to_le_bytes());
        self.sized(&compressed(&reps)?)
    }

    fn write_sets(&mut self) -> io::Result<()> {
        self.count(self.sets.len())?;
        let sets = std::mem::take(&mut self.sets);
        self.integers(&sets)
    }

    fn write_paths(&mut self) -> io::Result<()> {
        let (names, jumps): (Vec<i32>, Vec<i32>) = paths(&self.specs).into_iter().unzip();
        // Number of paths, and of those that are not empty.
        self.count(names.len())?;
        self.count(names.len())?;
        let numbers: Vec<u32> = (0..names.len() as u32).collect();
        self.integers(&numbers)?;
        self.signed_integers(&names)?;
        self.signed_integers(&jumps)
    }

    fn write_specs(&mut self) -> io::Result<()> {
        self.count(self.specs.len())?;
        let column = |value: fn((usize, &Spec)) -> usize| -> Vec<u32> {
            self.specs.iter().enumerate().map(|row| value(row) as u32).collect()
        };
        let columns =
            [column(|(row, _)| row), column(|(_, spec)| spec.fields), column(|(_, spec)| spec.kind as usize)];
        columns.iter().try_for_each(|column| self.integers(column))
    }

    fn integers(&mut self, values: &[u32]) -> io::Result<()> {
        let values: Vec<i32> = values.iter().map(|value| value.cast_signed()).collect();
        self.signed_integers(&values)
    }

    fn signed_integers(&mut self, values: &[i32]) -> io::Result<()> {
        self.sized(&compress_integers(values).ok_or_else(too_large)?)
    }

    fn token_number(&mut self, token: &'static str) -> u32 {
        number(&mut self.tokens, token)
    }

    /// Appends bytes behind their number.
    fn sized(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.count(bytes.len())?;
        self.append(bytes)
    }

    fn count(&mut self, count: usize) -> io::Result<()> {
        self.append(&(count as u64).to_le_bytes())
    }

    /// Goes on at a multiple of 8 bytes, where readers can use arrays in place. Returns it.
    fn align(&mut self) -> io::Result<u64> {
        let missing = self.at.next_multiple_of(8) - self.at;
        self.append(&[0; 8][..missing as usize])?;
        Ok(self.at)
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

fn header(contents_at: u64) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    header[..8].copy_from_slice(IDENTIFIER);
    header[8..][..VERSION.len()].copy_from_slice(&VERSION);
    header[CONTENTS_AT as usize..][..8].copy_from_slice(&contents_at.to_le_bytes());
    header
}

/// Returns for each path its last part, below 0 for attributes, and where its sibling is.
///
/// | jump | below it | after that |
/// |---|---|---|
/// | -2 | | |
/// | -1 | a child, which follows | |
/// | 0 | | a sibling, which follows |
/// | more | a child, which follows | a sibling, so many paths farther |
fn paths(specs: &[Spec]) -> Vec<(i32, i32)> {
    let path = |(at, spec): (usize, &Spec)| {
        let later = &specs[at + 1..];
        let has_child = later.first().is_some_and(|next| next.depth > spec.depth);
        let after = later.iter().position(|next| next.depth <= spec.depth);
        let sibling = after.filter(|after| later[*after].depth == spec.depth);
        let jump = match (has_child, sibling) {
            (false, None) => -2,
            (true, None) => -1,
            (false, Some(_)) => 0,
            (true, Some(after)) => after as i32 + 1,
        };
        let name = spec.name as i32;
        (if matches!(spec.kind, SpecKind::Attribute) { -name } else { name }, jump)
    };
    specs.iter().enumerate().map(path).collect()
}

/// Finds a value in a table, or adds it. Returns its number.
fn number<T: PartialEq>(table: &mut Vec<T>, value: T) -> u32 {
    let found = table.iter().position(|known| *known == value);
    let number = found.unwrap_or_else(|| {
        table.push(value);
        table.len() - 1
    });
    number as u32
}

fn little_endian<T, const N: usize>(values: &[T], bytes: impl Fn(&T) -> [u8; N]) -> Vec<u8> {
    let mut all = Vec::with_capacity(N * values.len());
    values.iter().for_each(|value| all.extend(bytes(value)));
    all
}

fn compressed(bytes: &[u8]) -> io::Result<Vec<u8>> {
    compress(bytes).ok_or_else(too_large)
}

fn too_large() -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, "a table is too large for a USD file")
}
