//! Files of decoded frames.

use super::placement::Placed;
use super::product::Product;
use super::{DecodeEvent, DecodeOptionsError, DecodeTakeError, OutputFormat};
use crate::timeline::Timeline;
use crate::{Event, Observer};
use isv_format::FrameRate;
use isv_io::{
    Format, GlbAnimationWriter, GlbEncoding, Output, UsdEncoding, UsdWriter, check_frame_output,
    check_volume_output, is_pipe, write_glb_to, write_mesh_placed, write_obj_files, write_points_placed,
    write_vdb_placed, write_volume, write_volume_colours,
};
use isv_volume::TriangleMesh;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The files of decoded frames, in order.
pub(super) struct FrameFiles {
    path: PathBuf,
    format: OutputFormat,
    glb: GlbEncoding,
    placed: Placed,
    timeline: Timeline,
    rate: FrameRate,
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
    /// One GLB file of all frames.
    Animation(Box<GlbAnimationWriter>),
    /// One USD file of all frames, once there is one.
    Stage { encoding: UsdEncoding, writer: Option<Box<UsdWriter>> },
}

impl FrameFiles {
    /// A path with the extension of a format stands for a file, any other for a folder.
    pub(super) fn new(
        path: &Path,
        format: OutputFormat,
        glb: GlbEncoding,
        placed: Placed,
        rate: FrameRate,
    ) -> Result<Self, DecodeTakeError> {
        let is_file = is_pipe(path) || OutputFormat::of_path(path).is_some();
        if is_file && format == OutputFormat::Npy {
            return Err(DecodeOptionsError::ArraysInFile { name: path.display().to_string() }.into());
        }
        let place = match format {
            OutputFormat::Geometry(Format::Ply) if is_pipe(path) => Place::Pipe(Output::create(path)?),
            OutputFormat::Usd(encoding) if is_file => Place::Stage { encoding, writer: None },
            _ if is_file => Place::File(None),
            _ => Place::Folder { left: frames_in(path, format) },
        };
        let (path, timeline) = (path.to_owned(), Timeline::new(rate));
        Ok(Self { path, format, glb, placed, timeline, rate, place, taken: 0 })
    }

    /// Number of frames taken.
    pub(super) fn taken(&self) -> usize {
        self.taken
    }

    /// Whether what was taken is in a folder, even if more fails.
    pub(super) fn is_folder(&self) -> bool {
        matches!(self.place, Place::Folder { .. })
    }

    /// Takes the next frame. A folder is made for the first one, so that a stream that cannot be decoded leaves none.
    pub(super) fn take(
        &mut self,
        number: usize,
        timestamp_ns: u64,
        product: Product,
        observer: &dyn Observer,
    ) -> Result<(), DecodeTakeError> {
        let start_s = self.timeline.place(timestamp_ns);
        self.placed.tell_if_rounded(&product, observer);
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
                write_product(output, &product, self.format, self.glb, &self.placed)?;
                output.flush()?;
            }
            Place::Animation(animation) => push(animation, start_s, &product)?,
            Place::Stage { writer: Some(stage), .. } => stage.push(start_s, mesh_of(&product))?,
            Place::Stage { encoding, writer: None } => {
                let encoding = *encoding;
                self.check_free(&self.path)?;
                let mut stage = self.begin_stage(&self.path, encoding)?;
                stage.push(start_s, mesh_of(&product))?;
                self.place = Place::Stage { encoding, writer: Some(Box::new(stage)) };
            }
            Place::File(held) => match held.take() {
                None => *held = Some((start_s, product)),
                Some(first) => self.begin_animation([first, (start_s, product)])?,
            },
        }
        self.taken += 1;
        Ok(())
    }

    fn write_into_folder(&self, name: &str, product: &Product) -> Result<(), DecodeTakeError> {
        if self.taken == 0 && !self.path.is_dir() {
            let (folder, parent) = (self.path.clone(), self.path.parent());
            if let Some(parent) = parent.filter(|parent| !parent.as_os_str().is_empty() && !parent.exists()) {
                return Err(DecodeTakeError::NoParent { folder, parent: parent.to_owned() });
            }
            fs::create_dir(&folder).map_err(|cause| DecodeTakeError::NoFolder { folder, cause })?;
        }
        let path = self.path.join(name);
        self.check_free(&path)?;
        if let Product::Volume { volume, colours } = product
            && self.format == OutputFormat::Npy
        {
            write_volume(&path, volume)?;
            if !colours.is_empty() {
                write_volume_colours(&path, colours)?;
            }
            return Ok(());
        }
        self.write_file(&path, product)
    }

    /// Writes a file of one frame, or three of an OBJ mesh with a texture.
    fn write_file(&self, path: &Path, product: &Product) -> Result<(), DecodeTakeError> {
        if let (Product::Mesh(mesh), OutputFormat::Geometry(Format::Obj)) = (product, self.format)
            && mesh.appearance.as_ref().is_some_and(|appearance| !appearance.materials.is_empty())
        {
            return Ok(write_obj_files(path, mesh, &self.placed.placement)?);
        }
        if let OutputFormat::Usd(encoding) = self.format {
            let mut stage = self.begin_stage(path, encoding)?;
            stage.push(0.0, mesh_of(product))?;
            return Ok(stage.finish(0.0)?);
        }
        let mut file = Output::create(path)?;
        write_product(&mut file, product, self.format, self.glb, &self.placed)?;
        file.commit()?;
        Ok(())
    }

    /// Refuses to overwrite what isv did not write, in formats that can tell.
    fn check_free(&self, path: &Path) -> Result<(), DecodeTakeError> {
        match self.format {
            OutputFormat::Geometry(Format::Xyz) => return Ok(()),
            OutputFormat::Npy => check_volume_output(path)?,
            OutputFormat::Vdb | OutputFormat::Usd(_) | OutputFormat::Geometry(_) => check_frame_output(path)?,
        }
        Ok(())
    }

    fn begin_animation(&mut self, frames: [(f64, Product); 2]) -> Result<(), DecodeTakeError> {
        if self.format != OutputFormat::Geometry(Format::Glb) || is_pipe(&self.path) {
            return Err(DecodeTakeError::OneFrame { file: self.path.clone() });
        }
        self.check_free(&self.path)?;
        let translation = self.placed.placement.translation;
        let animation = GlbAnimationWriter::create(&self.path)?.with_encoding(self.glb);
        let mut animation = animation.moved_by(translation);
        for (start_s, frame) in frames {
            push(&mut animation, start_s, &frame)?;
        }
        self.place = Place::Animation(Box::new(animation));
        Ok(())
    }

    /// Starts a USD file.
    fn begin_stage(&self, path: &Path, encoding: UsdEncoding) -> Result<UsdWriter, DecodeTakeError> {
        Ok(UsdWriter::create(path, self.placed.usd_stage(self.rate), encoding)?)
    }

    /// Completes the output. Tells what the folder still has of frames from before: who reads it as a take reads them too.
    pub(super) fn finish(self, observer: &dyn Observer) -> Result<(), DecodeTakeError> {
        if let Place::File(Some(_)) = self.place {
            self.check_free(&self.path)?;
        }
        match self.place {
            Place::File(None) | Place::Stage { writer: None, .. } => {}
            Place::Folder { left } => {
                if let Some(first) = left.first() {
                    let (folder, frames, first) = (self.path, left.len(), first.clone());
                    observer.event(&Event::Decode(DecodeEvent::LeftOver { folder, frames, first }));
                }
            }
            Place::Pipe(output) => _ = output.commit()?,
            Place::Animation(animation) => animation.finish(self.timeline.end_s())?,
            Place::Stage { writer: Some(stage), .. } => stage.finish(self.timeline.end_s())?,
            Place::File(Some((_, ref product))) => self.write_file(&self.path, product)?,
        }
        Ok(())
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

fn push(animation: &mut GlbAnimationWriter, start_s: f64, product: &Product) -> Result<(), DecodeTakeError> {
    Ok(animation.push(start_s, mesh_of(product))?)
}

fn mesh_of(product: &Product) -> &TriangleMesh {
    match product {
        Product::Mesh(mesh) => mesh,
        Product::Points(_) | Product::Volume { .. } => unreachable!("the recipe allows meshes alone"),
    }
}

fn write_product(
    out: &mut impl Write,
    product: &Product,
    format: OutputFormat,
    glb: GlbEncoding,
    placed: &Placed,
) -> Result<(), DecodeTakeError> {
    let Placed { unit, placement, .. } = placed;
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
        (Product::Volume { volume, .. }, OutputFormat::Vdb) => {
            write_vdb_placed(out, volume, *unit, placement.translation)?;
        }
        _ => unreachable!("the recipe matched form and format"),
    }
    Ok(())
}
