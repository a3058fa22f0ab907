//! Where decoded frames go.

use super::product::{OutputFormat, Product};
use crate::interrupt;
use crate::output::{Output, frames_in_words, is_pipe};
use anyhow::{Context, Result, anyhow, bail};
use isv::io::{Format, GlbAnimationWriter, write_mesh_to, write_points_to, write_vdb_to, write_volume};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Takes frames in order.
pub(super) struct Sink {
    path: PathBuf,
    format: OutputFormat,
    frames_a_second: f64,
    place: Place,
    taken: usize,
}

enum Place {
    /// A folder of one file (or, for arrays, one folder) a frame.
    Folder,
    /// Standard output, for frames of a format that can follow each other.
    Pipe(Output),
    /// A file. Its frame is kept until it is sure that there is no other.
    File(Option<Product>),
    /// One file of all frames.
    Animation(Box<GlbAnimationWriter>),
}

impl Sink {
    /// A path with the extension of a format stands for a file, any other for a folder.
    pub(super) fn new(path: &Path, format: OutputFormat, frames_a_second: f64) -> Result<Self> {
        let is_file = is_pipe(path) || (OutputFormat::of_path(path).is_some() && !path.is_dir());
        if is_file && format == OutputFormat::Npy {
            bail!("{}: a volume as NumPy arrays is several files: name a folder", path.display());
        }
        let place = match format {
            OutputFormat::Geometry(Format::Ply) if is_pipe(path) => Place::Pipe(Output::create(path)?),
            _ if is_file => Place::File(None),
            _ => Place::Folder,
        };
        Ok(Self { path: path.to_owned(), format, frames_a_second, place, taken: 0 })
    }

    /// Takes the next frame. A folder is made for the first one, so that a stream that cannot be decoded leaves none.
    pub(super) fn take(&mut self, number: usize, product: Product) -> Result<()> {
        match &mut self.place {
            Place::Folder => self.take_into_folder(number, &product)?,
            Place::Pipe(output) => {
                write_product(output, &product, self.format)?;
                output.flush()?;
            }
            Place::Animation(animation) => push(animation, &product)?,
            Place::File(held) => match held.take() {
                None => *held = Some(product),
                Some(first) => self.begin_animation([&first, &product])?,
            },
        }
        self.taken += 1;
        Ok(())
    }

    fn take_into_folder(&self, number: usize, product: &Product) -> Result<()> {
        if self.taken == 0 && !self.path.is_dir() {
            std::fs::create_dir(&self.path)
                .with_context(|| format!("{}: cannot make this folder", self.path.display()))?;
        }
        let name = format!("frame_{number:04}");
        if let Product::Volume(volume) = product
            && self.format == OutputFormat::Npy
        {
            return Ok(write_volume(&self.path.join(name), volume)?);
        }
        let mut file = Output::create(&self.path.join(format!("{name}.{}", self.format)))?;
        write_product(&mut file, product, self.format)?;
        file.commit()?;
        Ok(())
    }

    fn begin_animation(&mut self, frames: [&Product; 2]) -> Result<()> {
        let path = self.path.display();
        if self.format != OutputFormat::Geometry(Format::Glb) || is_pipe(&self.path) {
            bail!(
                "{path}: takes one frame, but there are more: name a folder, or one frame as in --frames 0..1"
            );
        }
        let mut animation = GlbAnimationWriter::create(&self.path, self.frames_a_second)?;
        for frame in frames {
            push(&mut animation, frame)?;
        }
        self.place = Place::Animation(Box::new(animation));
        Ok(())
    }

    /// Completes the output; returns how many frames were written in all.
    pub(super) fn finish(self) -> Result<usize> {
        if self.taken == 0 {
            match interrupt::requested() {
                true => bail!("interrupted before the first frame"),
                false => bail!("no frames in this stream"),
            }
        }
        match self.place {
            Place::Folder | Place::File(None) => {}
            Place::Pipe(output) => _ = output.commit()?,
            Place::Animation(animation) => animation.finish()?,
            Place::File(Some(product)) => {
                let mut output = Output::create(&self.path)?;
                write_product(&mut output, &product, self.format)?;
                output.commit()?;
            }
        }
        Ok(self.taken)
    }

    /// Adds to an error what has been written in spite of it.
    pub(super) fn account_for(&self, error: anyhow::Error) -> anyhow::Error {
        if !matches!(self.place, Place::Folder) || self.taken == 0 {
            return error;
        }
        let before = frames_in_words(self.taken);
        anyhow!("{error:#}: {before} before this went to {}", self.path.display())
    }
}

fn push(animation: &mut GlbAnimationWriter, product: &Product) -> Result<()> {
    match product {
        Product::Mesh(mesh) => Ok(animation.push(mesh)?),
        Product::Points(_) | Product::Volume(_) => unreachable!("the recipe allows GLB for meshes alone"),
    }
}

fn write_product(out: &mut impl Write, product: &Product, format: OutputFormat) -> Result<()> {
    match (product, format) {
        (Product::Mesh(mesh), OutputFormat::Geometry(format)) => write_mesh_to(out, mesh, format)?,
        (Product::Points(points), OutputFormat::Geometry(format)) => write_points_to(out, points, format)?,
        (Product::Volume(volume), OutputFormat::Vdb) => write_vdb_to(out, volume)?,
        _ => unreachable!("the recipe matched form and format"),
    }
    Ok(())
}
