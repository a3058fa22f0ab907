//! Textures of a take as H.264 video, coded by ffmpeg's libx264: what volumetric video on the web ships beside Draco meshes.

use crate::ToolError;
use crate::bench::{Bench, ToolRun};
use crate::tools::{Identity, Tool, ToolVersion, Tools};
use isv_format::FrameRate;
use isv_volume::{Image, Rgb};
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::PathBuf;
use std::time::Duration;

/// What the program says of itself.
const IDENTITY: Identity =
    Identity { name: "ffmpeg", arguments: &["-version"], mark: "ffmpeg version ", tested: "5.1" };

/// A program still running after this hangs: a second of video takes seconds.
const TIME_LIMIT: Duration = Duration::from_secs(3600);

/// Pictures as they are given to ffmpeg: `width * height` pixels of red, green and blue, frame after frame.
const PICTURES: &str = "pictures.rgb";

/// The video: H.264 in Annex B form, without a container.
const VIDEO: &str = "texture.h264";

/// Filter options by which the conversion between RGB and YCbCr rounds rightly.
const EXACT: &str = "flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp";

/// `ffmpeg` with libx264.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureVideo {
    tool: Tool,
}

/// Settings of a video.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VideoSettings {
    /// x264's constant rate factor, 0 to 51; a larger one gives a smaller and worse video.
    pub crf: u8,
    /// Most frames from a keyframe to the next; x264 sets more keyframes where pictures change as a whole.
    pub gop: u32,
    /// Frames a second.
    pub frame_rate: FrameRate,
}

impl TextureVideo {
    /// Name of the program.
    pub const PROGRAM: &str = IDENTITY.name;

    /// The program, if it is there.
    ///
    /// # Errors
    /// [`ToolError::Version`] for another program of this name.
    pub fn find(tools: &Tools) -> Result<Option<Self>, ToolError> {
        Ok(tools.identify(&IDENTITY, TIME_LIMIT)?.map(|tool| Self { tool }))
    }

    /// Version of the program.
    #[must_use]
    pub fn version(&self) -> &ToolVersion {
        &self.tool.version
    }

    /// Begins a video.
    ///
    /// # Errors
    /// [`ToolError::Temporary`] without room for its pictures.
    pub fn begin(&self, settings: VideoSettings) -> Result<TextureEncoding, ToolError> {
        let bench = Bench::new()?;
        let pictures = BufWriter::new(File::create(bench.path(PICTURES))?);
        Ok(TextureEncoding { codec: self.clone(), settings, bench, pictures, size: None, frames: 0 })
    }

    /// Decodes the video of a take to pictures.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn decode(&self, coded: &CodedTextures) -> Result<ToolRun<TexturePictures>, ToolError> {
        let size = coded.size;
        let bench = Bench::new()?;
        std::fs::write(bench.path(VIDEO), &coded.video)?;
        let run = bench.run(&self.tool.path, &decoder_arguments(size), self.tool.limit)?;
        let pictures = BufReader::new(bench.open(&self.tool.path, PICTURES)?);
        Ok(run.with(TexturePictures { program: self.tool.path.clone(), size, pictures, _bench: bench }))
    }

    /// Command line of the decoder for pictures of a size.
    #[must_use]
    pub fn decoder_command(&self, size: [u32; 2]) -> String {
        crate::bench::command_line(&self.tool.path, &decoder_arguments(size))
    }
}

/// A video whose pictures are collected in a temporary file, to be coded at the end.
pub struct TextureEncoding {
    codec: TextureVideo,
    settings: VideoSettings,
    bench: Bench,
    pictures: BufWriter<File>,
    /// Width and height of the first picture, in pixels.
    size: Option<[u32; 2]>,
    frames: usize,
}

impl TextureEncoding {
    /// Adds a picture.
    ///
    /// # Errors
    /// [`ToolError::PictureSize`] if it has another size than the first one, [`ToolError::Temporary`] without room for it.
    pub fn push(&mut self, picture: &Image) -> Result<(), ToolError> {
        let size = [picture.width(), picture.height()];
        let expected = *self.size.get_or_insert(size);
        if size != expected {
            return Err(ToolError::PictureSize { size, expected });
        }
        self.pictures.write_all(picture.pixels().as_flattened())?;
        self.frames += 1;
        Ok(())
    }

    /// Codes all pictures.
    ///
    /// # Errors
    /// See [`ToolError`]; a video without pictures is one that ffmpeg did not write.
    pub fn finish(self) -> Result<ToolRun<CodedTextures>, ToolError> {
        let Self { codec, settings, bench, mut pictures, size, .. } = self;
        pictures.flush()?;
        let size = size.unwrap_or([1, 1]);
        let run = bench.run(&codec.tool.path, &encoder_arguments(size, settings), codec.tool.limit)?;
        let video = bench.read(&codec.tool.path, VIDEO)?;
        Ok(run.with(CodedTextures { video, size }))
    }
}

/// A video of textures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CodedTextures {
    /// H.264 in Annex B form.
    pub video: Vec<u8>,
    /// Width and height of its pictures in pixels.
    pub size: [u32; 2],
}

/// Decoded pictures, read one after the other.
pub struct TexturePictures {
    program: PathBuf,
    size: [u32; 2],
    pictures: BufReader<File>,
    /// The folder in which they lie.
    _bench: Bench,
}

impl TexturePictures {
    /// The next picture.
    ///
    /// # Errors
    /// [`ToolError::Temporary`] where the pictures end.
    pub fn next_picture(&mut self) -> Result<Image, ToolError> {
        let [width, height] = self.size;
        let mut pixels: Vec<Rgb> = vec![[0; 3]; width as usize * height as usize];
        self.pictures.read_exact(pixels.as_flattened_mut())?;
        let kind = || ToolError::Kind { program: self.program.clone(), expected: "a picture" };
        Image::new(width, height, pixels).ok_or_else(kind)
    }
}

/// Colours become BT.709 of limited range, with half of the colour differences each way, which is what browsers decode.
fn encoder_arguments([width, height]: [u32; 2], settings: VideoSettings) -> Vec<String> {
    let VideoSettings { crf, gop, frame_rate } = settings;
    let filter = format!("pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv:{EXACT}");
    let text = format!(
        "-nostdin -hide_banner -loglevel error -f rawvideo -pixel_format rgb24 -video_size {width}x{height} \
         -framerate {} -i {PICTURES} -vf {filter} -pix_fmt yuv420p -c:v libx264 -preset slow -crf {crf} -g {gop} \
         -f h264 {VIDEO}",
        frame_rate.per_second()
    );
    text.split(' ').map(str::to_owned).collect()
}

fn decoder_arguments([width, height]: [u32; 2]) -> Vec<String> {
    let filter =
        format!("scale=in_color_matrix=bt709:in_range=tv:{EXACT},format=rgb24,crop={width}:{height}:0:0");
    let text = format!(
        "-nostdin -hide_banner -loglevel error -i {VIDEO} -vf {filter} -fps_mode passthrough -pix_fmt rgb24 \
         -f rawvideo {PICTURES}"
    );
    text.split(' ').map(str::to_owned).collect()
}
