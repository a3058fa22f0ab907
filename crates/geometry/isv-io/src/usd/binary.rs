//! Binary USD files (`.usdc`): a scene and its frames in the container.

use super::crate_file::{CrateFile, Rep, SpecKind};
use super::layer::{Attribute, Frame, Layer, Prim, TRACKS, Track, Value};
use std::io::{self, Seek, Write};

/// A binary file that is being written.
///
/// Frames are written as they come. An array that is that of the last frame is not written again.
#[derive(Debug)]
pub(super) struct BinaryFile<W> {
    file: CrateFile<W>,
    /// Arrays of each track, in the order of the frames.
    arrays: [Vec<Rep>; TRACKS],
    last: Option<Frame>,
}

impl<W: Write + Seek> BinaryFile<W> {
    pub(super) fn new(out: W) -> io::Result<Self> {
        Ok(Self { file: CrateFile::new(out)?, arrays: Default::default(), last: None })
    }

    pub(super) fn push(&mut self, frame: Frame) -> io::Result<()> {
        for (track, array) in frame.iter().enumerate() {
            let reps = &mut self.arrays[track];
            let same = self.last.as_ref().filter(|last| last[track] == *array).and_then(|_| reps.last());
            let rep = match same {
                Some(rep) => *rep,
                None => self.file.array(array)?,
            };
            reps.push(rep);
        }
        self.last = Some(frame);
        Ok(())
    }

    /// Writes all but the frames. Returns the whole file.
    pub(super) fn finish(mut self, layer: &Layer, times: &[f64]) -> io::Result<W> {
        let times = self.file.times(times)?;
        let mut fields = Vec::new();
        for (name, value) in &layer.metadata {
            fields.push((*name, self.value(value, times)?));
        }
        fields.push(("primChildren", self.file.names(&[layer.root.name])?));
        self.file.spec(SpecKind::Root, 0, "", &fields);
        self.prim(&layer.root, 1, times)?;
        self.file.finish()
    }

    fn prim(&mut self, prim: &Prim, depth: usize, times: Rep) -> io::Result<()> {
        let mut fields = vec![("specifier", Rep::DEF), ("typeName", self.file.token(prim.type_name))];
        let properties: Vec<&str> = prim.attributes.iter().map(|attribute| attribute.name).collect();
        let children: Vec<&str> = prim.children.iter().map(|child| child.name).collect();
        for (field, names) in [("properties", properties), ("primChildren", children)] {
            if !names.is_empty() {
                fields.push((field, self.file.names(&names)?));
            }
        }
        self.file.spec(SpecKind::Prim, depth, prim.name, &fields);
        for attribute in &prim.attributes {
            self.attribute(attribute, depth + 1, times)?;
        }
        prim.children.iter().try_for_each(|child| self.prim(child, depth + 1, times))
    }

    fn attribute(&mut self, attribute: &Attribute, depth: usize, times: Rep) -> io::Result<()> {
        let mut fields = vec![("typeName", self.file.token(attribute.type_name))];
        if attribute.is_uniform {
            fields.push(("variability", Rep::UNIFORM));
        }
        if attribute.at_vertices {
            fields.push(("interpolation", self.file.token("vertex")));
        }
        let is_over_time =
            matches!(attribute.value, Value::Frames(track) if self.arrays[track as usize].len() > 1);
        let name = if is_over_time { "timeSamples" } else { "default" };
        fields.push((name, self.value(&attribute.value, times)?));
        self.file.spec(SpecKind::Attribute, depth, attribute.name, &fields);
        Ok(())
    }

    fn value(&mut self, value: &Value, times: Rep) -> io::Result<Rep> {
        match value {
            Value::Bool(value) => Ok(Rep::boolean(*value)),
            Value::Double(value) => self.file.double(*value),
            Value::Double3(values) => self.file.double3(*values),
            Value::String(value) => Ok(self.file.string(value)),
            Value::Token(value) => Ok(self.file.token(value)),
            Value::TokenArray(values) => self.file.token_array(values),
            Value::Frames(track) => self.frames(*track, times),
        }
    }

    /// Returns the only array of a track, or its arrays over time.
    fn frames(&mut self, track: Track, times: Rep) -> io::Result<Rep> {
        match &self.arrays[track as usize][..] {
            [only] => Ok(*only),
            arrays => self.file.samples(times, arrays),
        }
    }
}
