//! `isv render`: pictures of frames.

mod frame_source;

use crate::capture;
use crate::cli_enums::{BackgroundName, Look, PictureFormatName, ShadeName, UpName};
use crate::count;
use crate::failure::usage;
use crate::interrupt;
use crate::origin;
use crate::output::{Output, is_pipe, is_same_file, say};
use crate::progress::Progress;
use anyhow::{Result, bail};
use frame_source::{FrameSource, Overview};
use isv::raw::format::FrameRate;
use isv::raw::io::{Unit, check_file_name, check_overwriting};
use isv::raw::take::FrameRange;
use isv::raw::take::Length;
use isv::raw::take::capture::{Capture, Hints};
use isv_render::{
    Camera, ErrorScale, Extent, PictureFile, PictureFormat, PictureRate, RenderSetup, SeenErrors, Style, View,
};
use std::num::NonZero;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Edge in pixels of a picture that stands alone, of one in an animation, and of one in a contact sheet.
const DEFAULT_SIZES: [usize; 3] = [1024, 512, 384];

/// Largest edge in pixels that can be asked for: a drawing takes up to 75 bytes a pixel while it is made, 5 GB here.
const MAX_SIZE: u64 = 8192;

/// Most pixels of all pictures that are held together: 1 GiB as RGBA.
const MAX_PIXELS: usize = 1 << 28;

/// Most pictures of a turn.
const MAX_TURN: u64 = 36_000;

/// Draw frames in colour, by normal or by error: a picture, a contact sheet or an animation
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A folder, a pattern, a mesh file or an .isv file
    input: PathBuf,
    /// Picture to write: .png, or .gif or .apng for an animation; - for stdout
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Kind of file [default: that of the output's name, png for stdout]
    #[arg(help_heading = "Pictures", long, value_enum)]
    format: Option<PictureFormatName>,
    /// Draw this frame, counted from 0
    ///
    /// Without it and --frames, an animation has all frames and a still the first.
    #[arg(help_heading = "Pictures", long, value_name = "N", conflicts_with = "frames")]
    frame: Option<usize>,
    /// Draw frames A to B-1; a .png becomes a contact sheet
    #[arg(help_heading = "Pictures", long, value_name = "A..B")]
    frames: Option<FrameRange>,
    /// Draw N pictures from all around
    ///
    /// They are of one frame or, with --frames, of frames that go by during the turn.
    #[arg(help_heading = "Pictures", long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_TURN))]
    turntable: Option<u64>,
    /// Columns of a contact sheet [default: about as many as rows]
    #[arg(help_heading = "Pictures", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    columns: Option<NonZero<usize>>,
    /// Edge of each drawing in pixels [default: 1024]
    ///
    /// In an animation the default is 512, in a contact sheet 384.
    #[arg(help_heading = "Pictures", long, value_name = "PIXELS", value_parser = clap::value_parser!(u64).range(1..=MAX_SIZE))]
    size: Option<u64>,
    /// Turn of the camera about the up axis: 0 looks from +z, 90 from +x
    ///
    /// Without --yaw and --pitch, a surface that is open and faces one side, as one from a depth camera, is seen from that
    /// side. All others are seen from +z. In pictures of normals, backs of faces are grey: the inside of an open surface,
    /// or faces that are turned inside out.
    #[arg(help_heading = "Camera and look", long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = degrees)]
    yaw: Option<f64>,
    /// Height of the camera above the horizon
    #[arg(help_heading = "Camera and look", long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = degrees)]
    pitch: Option<f64>,
    /// Axis of the input that points up; -y for depth cameras
    #[arg(
        help_heading = "Coordinates of the input",
        long,
        value_enum,
        default_value = "y",
        allow_hyphen_values = true
    )]
    up: UpName,
    /// Look of the surface [default: colour if the input has colours, else normals]
    ///
    /// Frames without colours are grey in soft light where others have them. With --against, colours show errors.
    #[arg(help_heading = "Camera and look", long, value_enum)]
    shade: Option<ShadeName>,
    /// What lies behind the surface
    #[arg(help_heading = "Camera and look", long, value_enum, default_value = "light")]
    background: BackgroundName,
    /// Colour by distance to the surface of this input, frame by frame
    #[arg(help_heading = "Comparison", long, value_name = "REFERENCE")]
    against: Option<PathBuf>,
    /// Distance at which the colours of --against end, with a unit
    #[arg(
        help_heading = "Comparison",
        long,
        value_name = "LENGTH",
        default_value = "2mm",
        requires = "against",
        allow_hyphen_values = true
    )]
    range: Length,
    /// Texture the surface from the calibrated colour images of this rig
    ///
    /// A folder with rig.json, camera.json or depth.txt. Where no camera saw the surface it keeps the colour of the input, and is grey if
    /// that has none. The rig has as many frames as the input, or as are drawn.
    #[arg(help_heading = "Camera and look", long, value_name = "RIG", conflicts_with = "against")]
    project_from: Option<PathBuf>,
    /// Axis of the rig that points up in the input: what isv encode was told
    #[arg(
        help_heading = "Camera and look",
        long,
        value_enum,
        default_value = "y",
        requires = "project_from",
        allow_hyphen_values = true
    )]
    project_up: UpName,
    /// Write the number of each frame under its picture
    ///
    /// With --against its errors too.
    #[arg(help_heading = "Camera and look", long)]
    captions: bool,
    /// Pictures a second of an animation [default: the input's, else 30]
    ///
    /// An animated file is sampled at this rate.
    #[arg(help_heading = "Pictures", long)]
    fps: Option<FrameRate>,
    /// Animation of a glTF file, by name or number from 0
    ///
    /// Without it, the first that moves anything plays.
    #[arg(help_heading = "Pictures", long, value_name = "NAME")]
    animation: Option<String>,
    /// Unit of the input's coordinates: m, dm, cm, mm, in, ft or us-ft
    ///
    /// Streams know theirs.
    #[arg(help_heading = "Coordinates of the input", long, default_value_t = Unit::Metre)]
    units: Unit,
    /// Unit of the coordinates of --against
    #[arg(help_heading = "Comparison", long, default_value_t = Unit::Metre, requires = "against")]
    against_units: Unit,
    /// Animation of --against, by name or number from 0
    ///
    /// Without it, the first that moves anything plays.
    #[arg(help_heading = "Comparison", long, value_name = "NAME", requires = "against")]
    against_animation: Option<String>,
    /// Place of the meshes of --against that is the input's origin
    ///
    /// In their unit: what isv encode was told.
    #[arg(
        help_heading = "Comparison",
        long,
        value_name = "X,Y,Z",
        value_parser = origin::parse,
        requires = "against",
        allow_hyphen_values = true
    )]
    against_origin: Option<[f64; 3]>,
    /// Axis of --against that points up [default: that of the input]
    #[arg(help_heading = "Comparison", long, value_enum, requires = "against", allow_hyphen_values = true)]
    against_up: Option<UpName>,
}

/// An angle on the command line.
fn degrees(text: &str) -> Result<f64, String> {
    let angle = text.parse::<f64>().ok().filter(|angle| angle.is_finite());
    angle.ok_or_else(|| "an angle is a number of degrees, such as 30 or -12.5".to_owned())
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let format = picture_format(args.format.map(Into::into), &args.output)?;
    if args.columns.is_some() && format.is_moving() {
        return Err(usage(format!("--columns is for contact sheets, which {format} files are not")));
    }
    let inputs = [Some(&args.input), args.against.as_ref()];
    let is_output = |input: &PathBuf| !is_pipe(&args.output) && is_same_file(input, &args.output);
    if inputs.into_iter().flatten().any(is_output) {
        return Err(usage(format!("{}: the pictures would replace what they are of", args.output.display())));
    }
    if PictureFormat::of_path(&args.output).is_none() {
        check_file_name(&args.output, &format!("a name such as x.{format}"))?;
    }
    check_overwriting(&args.output, "is no picture", |start| {
        start.starts_with(b"\x89PNG") || start.starts_with(b"GIF8")
    })?;
    let source = FrameSource::open(args, format.is_moving() && args.turntable.is_none())?;
    // From here on somebody looks whether Ctrl-C came.
    interrupt::listen()?;
    let shots = args.shots(source.len());
    let size = args.picture_size(format, &shots)?;
    let rate = args.picture_rate(format, source.frame_rate())?;
    let first = source.first();
    let mut output = Output::create(&args.output)?;
    let (overview, scenes) = source.read(args)?;
    let view = args.view(&overview.extent);
    let setup = args.setup(&overview, view, size);
    let mut file = PictureFile::new(format, &mut output, setup.size(), shots.pictures, rate)?;
    let progress = Progress::new(Some(shots.pictures), "drawing");
    let mut seen = Vec::new();
    for (frame, scene) in scenes.enumerate() {
        let scene = scene?;
        for shot in shots.of_frame(frame).take_while(|_| !interrupt::requested()) {
            let distance = scene.reference.as_ref().map(|reference| |point| reference.distance(point));
            let yaw = view.yaw_degrees + shots.turn(shot);
            let (picture, errors) = setup.draw(&scene.mesh, distance, first + frame, yaw);
            file.push(if format.is_moving() { setup.with_legend(picture) } else { picture })?;
            seen.extend(errors);
            progress.step();
        }
    }
    if interrupt::requested() {
        bail!("interrupted: {} was not written", args.output.display());
    }
    file.finish(|pictures| setup.still(pictures, args.columns.map(NonZero::get)))?;
    output.commit()?;
    drop(progress);
    report_errors(&seen);
    Ok(())
}

/// The format asked for, or that of the output's name. A .png file may also be an animated PNG, if asked for.
fn picture_format(asked: Option<PictureFormat>, output: &Path) -> Result<PictureFormat> {
    let name = output.display();
    match (asked, PictureFormat::of_path(output)) {
        (Some(PictureFormat::Apng), Some(PictureFormat::Png)) => Ok(PictureFormat::Apng),
        (Some(asked), Some(named)) if asked != named => {
            Err(usage(format!("--format {asked} does not fit the output's name, {name}")))
        }
        (Some(format), _) | (None, Some(format)) => Ok(format),
        (None, None) if is_pipe(output) => Ok(PictureFormat::Png),
        (None, None) => Err(usage(format!(
            "{name}: pictures are .png, .gif or .apng files: use such a name, or --format"
        ))),
    }
}

/// Which pictures there are: of which frame each is, and from where it is taken.
struct Shots {
    frames: usize,
    pictures: usize,
    /// Degrees from picture to picture.
    step: f64,
}

impl Shots {
    /// The pictures of a frame. All frames together take one turn, or have a picture each.
    fn of_frame(&self, frame: usize) -> Range<usize> {
        let first = |frame: usize| (frame * self.pictures).div_ceil(self.frames);
        first(frame)..first(frame + 1)
    }

    /// Degrees that the camera has turned before a picture.
    fn turn(&self, picture: usize) -> f64 {
        self.step * picture as f64
    }
}

impl Args {
    /// Opens the input.
    fn capture(&self) -> Result<Capture> {
        let (frame_rate, animation) = (self.sampling_rate(), self.animation.clone());
        let hints = Hints { frame_rate, animation, ..capture::colour_hints(self.units) };
        Ok(capture::open(&self.input, &hints)?)
    }

    fn sampling_rate(&self) -> FrameRate {
        self.fps.unwrap_or(FrameRate::DEFAULT)
    }

    fn shots(&self, frames: usize) -> Shots {
        match self.turntable {
            Some(n) => Shots { frames, pictures: n as usize, step: 360.0 / n as f64 },
            None => Shots { frames, pictures: frames, step: 0.0 },
        }
    }

    /// From where the first picture is taken: as asked, or from the side that the surface faces.
    fn view(&self, extent: &Extent) -> View {
        match (self.yaw, self.pitch) {
            (None, None) => extent.opening_view(),
            (yaw, pitch) => View { yaw_degrees: yaw.unwrap_or(0.0), pitch_degrees: pitch.unwrap_or(0.0) },
        }
    }

    /// Edge of each drawing, once it is sure that those held at the same time fit into memory.
    fn picture_size(&self, format: PictureFormat, shots: &Shots) -> Result<usize> {
        let (held, kind) = match self.turntable.is_some() || self.frames.is_some() {
            _ if format.is_moving() => (1, 1),
            false => (1, 0),
            true => (shots.pictures, 2),
        };
        let size = self.size.map_or(DEFAULT_SIZES[kind], |size| size as usize);
        match held.checked_mul(size * size) {
            Some(pixels) if pixels <= MAX_PIXELS => Ok(size),
            _ => Err(usage(format!(
                "{held} pictures of {size} x {size} pixels are too many for one file: take fewer or a smaller --size"
            ))),
        }
    }

    /// How fast pictures follow each other, if the format can say so.
    fn picture_rate(&self, format: PictureFormat, of_input: Option<FrameRate>) -> Result<PictureRate> {
        let rate = self.fps.or(of_input).unwrap_or(FrameRate::DEFAULT);
        let rate = PictureRate { pictures: rate.numerator, seconds: rate.denominator };
        if format == PictureFormat::Gif && !rate.fits_gif() {
            return Err(usage(format!(
                "a GIF plays at most {} pictures a second: take a lower --fps, or an .apng file",
                PictureRate::FASTEST_GIF
            )));
        }
        Ok(rate)
    }

    fn setup(&self, overview: &Overview, view: View, size: usize) -> RenderSetup {
        let View { yaw_degrees, pitch_degrees } = view;
        let Look { shading, normals } =
            self.shade.map_or_else(|| Look::of_sequence(overview.has_colours), Into::into);
        let camera =
            Camera::fitting(overview.extent.bounds, [size, size]).from_direction(yaw_degrees, pitch_degrees);
        RenderSetup {
            camera: Camera { orbits: self.turntable.is_some(), ..camera },
            style: Style { background: self.background.into(), shading, normals },
            scale: self.against.as_ref().and_then(|_| ErrorScale::new(self.range.metres())),
            captions: self.captions,
        }
    }
}

/// Says what the errors of all pictures are.
fn report_errors(seen: &[SeenErrors]) {
    let Some(max_m) = seen.iter().map(|errors| errors.max_m).reduce(f64::max) else { return };
    let mean_m = seen.iter().map(|errors| errors.mean_m).sum::<f64>() / seen.len() as f64;
    say(format_args!("errors of the surface that is seen: {}", SeenErrors { mean_m, max_m }));
}
