//! Where decoded frames go.

use super::product::{OutputFormat, Product};
use super::target_frame::TargetFrame;
use crate::failure::usage;
use crate::interrupt;
use crate::output::{Output, check_frame_output, check_volume_output, frames_in_words, is_pipe, say};
use crate::terms::GlbName;
use crate::words;
use anyhow::{Context, Result, anyhow, bail};
use isv::raw::format::FrameRate;
use isv::raw::io::{
    Format, GlbAnimationWriter, GlbEncoding, write_glb_to, write_mesh_placed, write_points_placed,
    write_vdb_placed, write_volume,
};
use isv::raw::take::timeline::Timeline;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Takes frames in order.
pub(super) struct Sink {
    path: PathBuf,
    format: OutputFormat,
    glb: GlbEncoding,
    target_frame: TargetFrame,
    timeline: Timeline,
    place: Place,
    taken: usize,
}

enum Place {
    /// A folder of one file (or, for arrays, one folder) a frame, with those that it had before and that none of these replaced.
    Folder { left: BTreeSet<String> },
    /// Standard output, for frames of a format that can follow each other.
    Pipe(Output),
    /// A file. Its frame, which is shown at some time in seconds, is kept until it is sure that there is no other.
    File(Option<(f64, Product)>),
    /// One file of all frames.
    Animation(Box<GlbAnimationWriter>),
}

impl Sink {
    /// A path with the extension of a format stands for a file, any other for a folder.
    pub(super) fn new(
        path: &Path,
        format: OutputFormat,
        target_frame: TargetFrame,
        rate: FrameRate,
    ) -> Result<Self> {
        let is_file = is_pipe(path) || OutputFormat::of_path(path).is_some();
        if is_file && format == OutputFormat::Npy {
            return Err(usage(format!(
                "{}: a volume as NumPy arrays is several files: name a folder",
                path.display()
            )));
        }
        let place = match format {
            OutputFormat::Geometry(Format::Ply) if is_pipe(path) => Place::Pipe(Output::create(path)?),
            _ if is_file => Place::File(None),
            _ => Place::Folder { left: frames_in(path, format) },
        };
        let (path, glb, timeline) = (path.to_owned(), GlbEncoding::Plain, Timeline::new(rate));
        Ok(Self { path, format, glb, target_frame, timeline, place, taken: 0 })
    }

    /// Encodes GLB files as asked for, or else plainly.
    pub(super) fn with_glb(mut self, name: Option<GlbName>) -> Self {
        self.glb = name.map(GlbEncoding::from).unwrap_or_default();
        self
    }

    /// Takes the next frame. A folder is made for the first one, so that a stream that cannot be decoded leaves none.
    pub(super) fn take(&mut self, number: usize, timestamp_ns: u64, product: Product) -> Result<()> {
        let start_s = self.timeline.place(timestamp_ns);
        self.target_frame.say_if_rounded(&product);
        let name = match self.format {
            OutputFormat::Npy => format!("frame_{number:04}"),
            format => format!("frame_{number:04}.{format}"),
        };
        match &mut self.place {
            Place::Folder { left } => {
                left.remove(&name);
                self.write_into_folder(&name, &product)?;
            }
            Place::Pipe(output) => {
                write_product(output, &product, self.format, self.glb, &self.target_frame)?;
                output.flush()?;
            }
            Place::Animation(animation) => push(animation, start_s, &product)?,
            Place::File(held) => match held.take() {
                None => *held = Some((start_s, product)),
                Some(first) => self.begin_animation([first, (start_s, product)])?,
            },
        }
        self.taken += 1;
        Ok(())
    }

    fn write_into_folder(&self, name: &str, product: &Product) -> Result<()> {
        if self.taken == 0 && !self.path.is_dir() {
            let path = self.path.display();
            let parent = self.path.parent().filter(|parent| !parent.as_os_str().is_empty());
            if let Some(parent) = parent.filter(|parent| !parent.exists()) {
                bail!("{path}: cannot make this folder: there is no {}", parent.display());
            }
            fs::create_dir(&self.path).with_context(|| format!("{path}: cannot make this folder"))?;
        }
        let path = self.path.join(name);
        self.check_free(&path)?;
        if let Product::Volume(volume) = product
            && self.format == OutputFormat::Npy
        {
            return Ok(write_volume(&path, volume)?);
        }
        let mut file = Output::create(&path)?;
        write_product(&mut file, product, self.format, self.glb, &self.target_frame)?;
        file.commit()?;
        Ok(())
    }

    /// Refuses to overwrite what isv did not write, in formats that can tell.
    fn check_free(&self, path: &Path) -> Result<()> {
        match self.format {
            OutputFormat::Geometry(Format::Xyz) => Ok(()),
            OutputFormat::Npy => check_volume_output(path),
            OutputFormat::Vdb | OutputFormat::Geometry(_) => check_frame_output(path),
        }
    }

    fn begin_animation(&mut self, frames: [(f64, Product); 2]) -> Result<()> {
        let path = self.path.display();
        if self.format != OutputFormat::Geometry(Format::Glb) || is_pipe(&self.path) {
            bail!(
                "{path}: takes one frame, but there are more: name a folder, or one frame as in --frames 0..1"
            );
        }
        self.check_free(&self.path)?;
        let translation = self.target_frame.placement.translation;
        let animation = GlbAnimationWriter::create(&self.path)?.with_encoding(self.glb);
        let mut animation = animation.moved_by(translation);
        for (start_s, frame) in frames {
            push(&mut animation, start_s, &frame)?;
        }
        self.place = Place::Animation(Box::new(animation));
        Ok(())
    }

    /// Completes the output; returns how many frames were written in all. Says what the folder still has of frames from before: who
    /// reads it as a take reads them too.
    pub(super) fn finish(self) -> Result<usize> {
        if self.taken == 0 {
            match interrupt::requested() {
                true => bail!("interrupted before the first frame"),
                false => bail!("no frames in this stream"),
            }
        }
        if let Place::File(Some(_)) = self.place {
            self.check_free(&self.path)?;
        }
        match self.place {
            Place::File(None) => {}
            Place::Folder { left } => {
                if let Some(first) = left.first() {
                    let (path, count) = (self.path.display(), frames_in_words(left.len()));
                    say(format_args!("{path}: {count} from before are left in it, from {first} on"));
                }
            }
            Place::Pipe(output) => _ = output.commit()?,
            Place::Animation(animation) => animation.finish(self.timeline.end_s())?,
            Place::File(Some((_, product))) => {
                let mut output = Output::create(&self.path)?;
                write_product(&mut output, &product, self.format, self.glb, &self.target_frame)?;
                output.commit()?;
            }
        }
        Ok(self.taken)
    }

    /// Adds to an error what has been written in spite of it.
    pub(super) fn account_for(&self, error: anyhow::Error) -> anyhow::Error {
        if !matches!(self.place, Place::Folder { .. }) || self.taken == 0 {
            return error;
        }
        let before = frames_in_words(self.taken);
        let error = words::error(&error).0;
        anyhow!("{error}: {before} before this went to {}", self.path.display())
    }
}

/// The names of what looks like a frame of a format in a folder, if there is one.
fn frames_in(folder: &Path, format: OutputFormat) -> BTreeSet<String> {
    let is_frame = |name: &str| {
        let Some(number) = name.strip_prefix("frame_") else { return false };
        let number = if format == OutputFormat::Npy {
            Some(number)
        } else {
            number.strip_suffix(&format!(".{format}"))
        };
        number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    names.filter(|name| is_frame(name)).collect()
}

fn push(animation: &mut GlbAnimationWriter, start_s: f64, product: &Product) -> Result<()> {
    match product {
        Product::Mesh(mesh) => Ok(animation.push(start_s, mesh)?),
        Product::Points(_) | Product::Volume(_) => unreachable!("the recipe allows GLB for meshes alone"),
    }
}

fn write_product(
    out: &mut impl Write,
    product: &Product,
    format: OutputFormat,
    glb: GlbEncoding,
    target_frame: &TargetFrame,
) -> Result<()> {
    let TargetFrame { unit, placement, .. } = target_frame;
    match (product, format) {
        (Product::Mesh(mesh), OutputFormat::Geometry(Format::Glb)) => {
            write_glb_to(out, mesh, glb, placement)?;
        }
        (Product::Mesh(mesh), OutputFormat::Geometry(format)) => {
            write_mesh_placed(out, mesh, format, placement)?;
        }
        (Product::Points(points), OutputFormat::Geometry(format)) => {
            write_points_placed(out, points, format, placement)?;
        }
        (Product::Volume(volume), OutputFormat::Vdb) => {
            write_vdb_placed(out, volume, *unit, placement.translation)?;
        }
        _ => unreachable!("the recipe matched form and format"),
    }
    Ok(())
}
