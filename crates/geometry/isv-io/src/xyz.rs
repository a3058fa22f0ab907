//! XYZ, points as text. The format has no document; what is read is this:
//!
//! - A point a line. `#` and `//` start comments; empty lines mean nothing.
//! - A first line of names may be behind `#` or `//`, as CloudCompare writes it.
//! - Blanks, tabs, commas and semicolons separate values, any run of them once. A decimal comma is refused where it can be
//!   told from one that separates: where blanks separate values as well.
//! - The first lines may be the number of points, which must then be right, and the names of the columns, in either order.
//! - With names, columns `x y z` are the position and `nx ny nz`, or `normal_x normal_y normal_z`, the normal, in
//!   either case.
//! - Without names, the first three columns are the position. The last three of six are the normal if they
//!   have length 1, within 2 %, or are all 0. That must hold in each of the first 100 lines, and they must
//!   not be all 0 in every one.
//! - Colours, if they are asked for: columns `r g b`, `red green blue` or `Rf Gf Bf`. Without names, they are
//!   the last three of six or seven, if these are no normal, else the fourth to the sixth of seven. In each of
//!   the first 100 lines they must be whole numbers from 0 to 255, not all of them below 2.
//! - All other columns, such as intensity, are ignored. All lines have as many as the first.

use crate::cloud_builder::CloudBuilder;
use crate::error::{Flaw, Malformation, quote};
use crate::placement::Placement;
use crate::raw_colours::Scale;
use crate::text::{self, parse_float, parse_word};
use glam::DVec3;
use isv_volume::PointCloud;
use std::io::{self, Write};

/// Lines that decide whether columns are normals.
const LINES_ASKED: usize = 100;

/// How far the length of a normal as written may be from 1.
const LENGTH_TOLERANCE: f64 = 0.02;

/// Most columns that are looked at; real files stay below twenty.
const MAX_COLUMNS: usize = 1024;

/// Values of a point: the position, the normal and the colour.
const SLOTS: usize = 9;
const COLOUR: usize = 6;

/// Which columns are the position, the normal and the colour.
struct Columns {
    slots: [Option<usize>; SLOTS],
    /// Values a line; not known before the first one of a file with neither names nor points.
    count: usize,
}

/// Parses a file in memory, with its colours if they are asked for.
pub(crate) fn parse(bytes: &[u8], keeps_colours: bool) -> Result<PointCloud, Flaw> {
    let bytes = &text::decode(bytes);
    let mut lines = lines(bytes).peekable();
    let mut promised = None;
    let mut named = None;
    while let Some(&(at, first)) = lines.peek() {
        let words: Vec<_> = words(first).take(MAX_COLUMNS + 1).collect();
        if let ([word], None) = (&words[..], promised) {
            promised = Some(count(word).map_err(|why| Flaw::at_line(at, why))?);
        } else if named.is_none() && words.first().is_some_and(|word| number(word).is_err()) {
            named = Some(Columns::named(&words).map_err(|why| Flaw::at_line(at, why))?);
        } else {
            break;
        }
        lines.next();
    }
    // Names in a comment do not stop a file: they may be a sentence.
    let named = named.or_else(|| Columns::in_comments(bytes, lines.peek().map(|(_, line)| *line)));
    let says_points = promised.is_some() || named.is_some();
    let mut columns = named.unwrap_or_else(|| Columns::guessed(lines.clone().map(|(_, line)| line)));
    if !keeps_colours {
        columns.slots[COLOUR..].fill(None);
    }
    let scale = columns.slots[COLOUR].map(|_| Scale::ByteOrUnit);
    let mut cloud = CloudBuilder::new(columns.slots[3].is_some(), 0).with_colours(scale);
    let mut found = 0;
    let mut last = 1;
    for (at, line) in lines {
        let [x, y, z, nx, ny, nz, colour @ ..] =
            columns.values(line).map_err(|why| Flaw::at_line(at, why))?;
        cloud.push(DVec3::new(x, y, z), DVec3::new(nx, ny, nz));
        cloud.push_colour(colour);
        (found, last) = (found + 1, at);
    }
    match promised {
        Some(said) if said != found => Err(Flaw::at_line(last, Malformation::PointCount { said, found })),
        _ if found == 0 && !says_points => {
            Err(Flaw::at_line(last, Malformation::EndsBefore { what: "first point" }))
        }
        _ => Ok(cloud.finish(None)),
    }
}

impl Columns {
    fn named(names: &[&[u8]]) -> Result<Self, Malformation> {
        if names.len() > MAX_COLUMNS {
            return Err(Malformation::HeaderSize { limit: MAX_COLUMNS });
        }
        let find = |wanted: &str| names.iter().position(|name| name.eq_ignore_ascii_case(wanted.as_bytes()));
        let mut slots = ["x", "y", "z", "nx", "ny", "nz", "r", "g", "b"].map(find);
        let more = ["normal_x", "normal_y", "normal_z", "red", "green", "blue"];
        for (slot, name) in slots[3..].iter_mut().zip(more) {
            *slot = slot.or_else(|| find(name));
        }
        for (slot, name) in slots[COLOUR..].iter_mut().zip(["rf", "gf", "bf"]) {
            *slot = slot.or_else(|| find(name));
        }
        if slots[..3].contains(&None) {
            return Err(Malformation::Missing { what: "columns named x, y and z" });
        }
        for three in [3..COLOUR, COLOUR..SLOTS] {
            if slots[three.clone()].contains(&None) {
                slots[three].fill(None);
            }
        }
        Ok(Self { slots, count: names.len() })
    }

    /// The columns that a comment before the first point names, if they are as many as the point has.
    fn in_comments(bytes: &[u8], point: Option<&[u8]>) -> Option<Self> {
        let count = words(point?).count();
        let is_point = |line: &[u8]| {
            words(line).next().is_some_and(|word| number(word).is_ok() && words(line).count() > 1)
        };
        let before = text::lines(bytes).map(<[u8]>::trim_ascii).take_while(|line| !is_point(line));
        let comments = before.filter_map(|line| line.strip_prefix(b"//").or_else(|| line.strip_prefix(b"#")));
        comments
            .filter_map(|line| {
                let marks = |b: &u8| matches!(b, b'#' | b'/') || b.is_ascii_whitespace();
                let at = line.iter().position(|b| !marks(b))?;
                let names: Vec<_> = words(&line[at..]).take(MAX_COLUMNS + 1).collect();
                Self::named(&names).ok().filter(|columns| columns.count == count)
            })
            .last()
    }

    /// Columns without names, from what the first lines hold.
    fn guessed<'a>(lines: impl Iterator<Item = &'a [u8]> + Clone) -> Self {
        let count = lines.clone().next().map_or(3, |line| words(line).count().max(3));
        let from_third = |slot: usize, column: usize| {
            let mut slots = [Some(0), Some(1), Some(2), None, None, None, None, None, None];
            (0..3).for_each(|i| slots[slot + i] = Some(column + i));
            Self { slots, count }
        };
        let lines = lines.take(LINES_ASKED);
        let six = from_third(3, 3);
        let lengths = lines.clone().map(|line| match six.values(line) {
            Ok([_, _, _, nx, ny, nz, ..]) => DVec3::new(nx, ny, nz).length(),
            Err(_) => f64::NAN,
        });
        let is_unit = |length: f64| (length - 1.0).abs() <= LENGTH_TOLERANCE;
        if count == 6 && lengths.clone().all(|l| l == 0.0 || is_unit(l)) && lengths.clone().any(is_unit) {
            return six;
        }
        let is_byte = |value: &f64| (0.0..=255.0).contains(value) && value.fract() == 0.0;
        let is_coloured = |columns: &Self| {
            let colours = lines.clone().map(|line| match columns.values(line) {
                Ok([_, _, _, _, _, _, colour @ ..]) => colour,
                Err(_) => [f64::NAN; 3],
            });
            colours.clone().flatten().all(|value| is_byte(&value))
                && colours.flatten().any(|value| value > 1.0)
        };
        // A seventh value, an intensity, comes before the colour or behind it.
        let candidates = (6..=7).contains(&count).then(|| [count - 3, 3]).into_iter().flatten();
        if let Some(coloured) = candidates.map(|column| from_third(COLOUR, column)).find(is_coloured) {
            return coloured;
        }
        Self { slots: [Some(0), Some(1), Some(2), None, None, None, None, None, None], count }
    }

    /// The position, the normal and the colour of a line.
    fn values(&self, line: &[u8]) -> Result<[f64; SLOTS], Malformation> {
        let mut values = [0.0; SLOTS];
        let mut found = 0;
        if let Some(word) = decimal_comma(line) {
            return Err(Malformation::Number { text: quote(word) });
        }
        for word in words(line) {
            if let Some(slot) = self.slots.iter().position(|slot| *slot == Some(found)) {
                values[slot] = number(word)?;
            }
            found += 1;
        }
        if found == self.count {
            Ok(values)
        } else {
            Err(Malformation::LineLength { too_many: found > self.count })
        }
    }
}

/// The lines that say something, without their comments, and their numbers from 1.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> + Clone {
    let told = |line: &'_ [u8]| {
        let line = text::without_comment(line);
        let comment = (0..line.len()).find(|at| line[*at..].starts_with(b"//"));
        comment.unwrap_or(line.len())
    };
    let lines = text::lines(bytes).enumerate();
    lines
        .map(move |(at, line)| (at + 1, &line[..told(line)]))
        .filter(|(_, line)| words(line).next().is_some())
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|b| b.is_ascii_whitespace() || matches!(b, b',' | b';')).filter(|word| !word.is_empty())
}

/// Word with a comma inside, in a line in which blanks or semicolons separate words too. Most likely it is a
/// number as some countries write it.
fn decimal_comma(line: &[u8]) -> Option<&[u8]> {
    let separates = |b: &u8| b.is_ascii_whitespace() || *b == b';';
    let mut by_blanks = line.split(separates).filter(|word| !word.is_empty());
    let has_comma =
        |word: &&[u8]| word.windows(3).any(|around| around[1] == b',' && around[2].is_ascii_digit());
    if by_blanks.clone().count() > 1 { by_blanks.find(has_comma) } else { None }
}

fn number(word: &[u8]) -> Result<f64, Malformation> {
    parse_float(word).ok_or_else(|| Malformation::Number { text: quote(word) })
}

fn count(word: &[u8]) -> Result<u64, Malformation> {
    parse_word(word).ok_or_else(|| Malformation::Number { text: quote(word) })
}

/// Writes points, `x y z` or `x y z nx ny nz` a line, with as many digits as identify each number. Colours follow as `r g b`, 0 to 255,
/// and a comment names the columns then.
pub(crate) fn write(mut out: impl Write, points: &PointCloud, placement: &Placement) -> io::Result<()> {
    if !points.colours.is_empty() {
        writeln!(out, "# x y z{} r g b", if points.normals.is_empty() { "" } else { " nx ny nz" })?;
    }
    for (index, position) in points.positions.iter().enumerate() {
        let DVec3 { x, y, z } = placement.place(*position);
        write!(out, "{x} {y} {z}")?;
        if let Some(DVec3 { x, y, z }) = points.normals.get(index) {
            write!(out, " {x} {y} {z}")?;
        }
        if let Some([red, green, blue]) = points.colours.get(index) {
            write!(out, " {red} {green} {blue}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
