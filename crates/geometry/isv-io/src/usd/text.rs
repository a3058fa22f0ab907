//! USD files as text (`.usda`).

use super::layer::{Array, Attribute, Frame, Layer, Prim, TRACKS, Track, Value};
use std::fmt::Write as _;
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use tempfile::SpooledTempFile;

/// Bytes of a track that are kept in memory. More of them go to a temporary file.
const KEPT_BYTES: usize = 4 << 20;

/// A text file that is being written.
///
/// Text has all values of an attribute together. Until the end, each track is a temporary file beside the final one.
#[derive(Debug)]
pub(super) struct TextFile<W> {
    out: W,
    tracks: [Spool; TRACKS],
}

/// The arrays of a track as text.
#[derive(Debug)]
struct Spool {
    text: SpooledTempFile,
    /// Bytes of each array.
    lengths: Vec<u64>,
}

impl<W: Write> TextFile<W> {
    /// Starts a file. `path`: its final name.
    pub(super) fn new(out: W, path: &Path) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.map_or_else(|| PathBuf::from("."), Path::to_owned);
        let tracks = Track::ALL.map(|_| {
            let text = SpooledTempFile::new_in(KEPT_BYTES, folder.clone());
            Spool { text, lengths: Vec::new() }
        });
        Self { out, tracks }
    }

    pub(super) fn push(&mut self, frame: &Frame) -> io::Result<()> {
        for (spool, array) in self.tracks.iter_mut().zip(frame) {
            let text = array_text(array);
            spool.text.write_all(text.as_bytes())?;
            spool.lengths.push(text.len() as u64);
        }
        Ok(())
    }

    /// Writes the file. Returns it whole.
    pub(super) fn finish(mut self, layer: &Layer, times: &[f64]) -> io::Result<W> {
        self.tracks.iter_mut().try_for_each(|spool| spool.text.rewind())?;
        writeln!(self.out, "#usda 1.0\n(")?;
        for (name, value) in &layer.metadata {
            let name = if *name == "documentation" { "doc" } else { name };
            write!(self.out, "    {name} = ")?;
            self.value(value)?;
            writeln!(self.out)?;
        }
        writeln!(self.out, ")\n")?;
        self.prim(&layer.root, "", times)?;
        Ok(self.out)
    }

    fn prim(&mut self, prim: &Prim, indent: &str, times: &[f64]) -> io::Result<()> {
        writeln!(self.out, "{indent}def {} \"{}\"\n{indent}{{", prim.type_name, prim.name)?;
        let inner = format!("{indent}    ");
        for attribute in &prim.attributes {
            self.attribute(attribute, &inner, times)?;
        }
        for (at, child) in prim.children.iter().enumerate() {
            if at > 0 || !prim.attributes.is_empty() {
                writeln!(self.out)?;
            }
            self.prim(child, &inner, times)?;
        }
        writeln!(self.out, "{indent}}}")
    }

    fn attribute(&mut self, attribute: &Attribute, indent: &str, times: &[f64]) -> io::Result<()> {
        let Attribute { type_name, name, is_uniform, at_vertices, value } = attribute;
        let uniform = if *is_uniform { "uniform " } else { "" };
        write!(self.out, "{indent}{uniform}{type_name} {name}")?;
        let samples = match value {
            Value::Frames(track) if times.len() > 1 => Some(*track),
            value => {
                write!(self.out, " = ")?;
                self.value(value)?;
                None
            }
        };
        if *at_vertices {
            write!(self.out, " (\n{indent}    interpolation = \"vertex\"\n{indent})")?;
        }
        match samples {
            // Metadata is said of the attribute alone, beside its samples.
            Some(track) if *at_vertices => {
                write!(self.out, "\n{indent}{type_name} {name}")?;
                self.samples(track, indent, times)
            }
            Some(track) => self.samples(track, indent, times),
            None => writeln!(self.out),
        }
    }

    fn samples(&mut self, track: Track, indent: &str, times: &[f64]) -> io::Result<()> {
        writeln!(self.out, ".timeSamples = {{")?;
        for (frame, time) in times.iter().enumerate() {
            write!(self.out, "{indent}    {}: ", number(*time))?;
            self.frame(track, frame)?;
            writeln!(self.out, ",")?;
        }
        writeln!(self.out, "{indent}}}")
    }

    /// Writes the next array of a track.
    fn frame(&mut self, track: Track, frame: usize) -> io::Result<()> {
        let Spool { text, lengths } = &mut self.tracks[track as usize];
        io::copy(&mut text.take(lengths[frame]), &mut self.out)?;
        Ok(())
    }

    fn value(&mut self, value: &Value) -> io::Result<()> {
        match value {
            Value::Bool(value) => write!(self.out, "{}", u8::from(*value)),
            Value::Double(value) => write!(self.out, "{}", number(*value)),
            Value::Double3(values) => {
                let [x, y, z] = values.map(number);
                write!(self.out, "({x}, {y}, {z})")
            }
            Value::String(text) | Value::Token(text) => write!(self.out, "\"{text}\""),
            Value::TokenArray(names) => write!(self.out, "[\"{}\"]", names.join("\", \"")),
            Value::Frames(track) => self.frame(*track, 0),
        }
    }
}

fn array_text(array: &Array) -> String {
    let mut text = "[".to_owned();
    match array {
        Array::Integers(values) => {
            for (at, value) in values.iter().enumerate() {
                text.push_str(separator(at));
                _ = write!(text, "{value}");
            }
        }
        Array::Vectors(values) => {
            for (at, vector) in values.iter().enumerate() {
                let [x, y, z] = vector.map(number);
                text.push_str(separator(at));
                _ = write!(text, "({x}, {y}, {z})");
            }
        }
    }
    text.push(']');
    text
}

fn separator(at: usize) -> &'static str {
    if at == 0 { "" } else { ", " }
}

/// A number with the fewest digits that its type tells apart.
struct Number<T>(T);

fn number<T>(value: T) -> Number<T> {
    Number(value)
}

impl<T: Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp> std::fmt::Display for Number<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.into().abs();
        // Rust writes all zeros of a number without an exponent.
        match size == 0.0 || (1e-5..1e15).contains(&size) {
            true => write!(f, "{}", self.0),
            false => write!(f, "{:e}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_come_back() {
        let texts = [0.1f32, -2.0, 1e-7, 3.4e38, 0.0, 2e-5].map(|value| number(value).to_string());
        assert_eq!(texts, ["0.1", "-2", "1e-7", "3.4e38", "0", "0.00002"]);
        for value in [f32::MIN_POSITIVE, f32::MAX, 1.0 / 3.0, f32::from_bits(1)] {
            assert_eq!(number(value).to_string().parse::<f32>().unwrap(), value);
        }
        assert_eq!(number(1.0 / 3.0).to_string(), "0.3333333333333333");
    }
}
