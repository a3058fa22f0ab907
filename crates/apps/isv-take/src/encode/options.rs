//! What a user may choose of encoding, and what holds where nothing is chosen.

use super::coding::ColourCoding;
use super::describe::MetadataOptions;
use super::error::{OptionName, OptionsError};
use super::groups::Groups;
use super::timestamps::TimestampSource;
use super::volumes::{DepthFusion, VolumeMaker};
use crate::capture::{Capture, Hints, default_voxel_size};
use crate::{BitRate, FrameRange, Length, MemoryLimit, Observer, OpenDevice, Up};
use glam::DVec3;
use isv_encode::colour::{ColourEncoder, ColourSettings};
use isv_encode::{
    Band, Bitrate, ColourShare, EncoderSettings, FrameQuality, MainSettings, MotionMode, Preset, RateTarget,
    Refresh, Tools,
};
use isv_format::{ColourLayers, FrameRate, MaskCoding, PaperParameters, Prediction, Profile, StreamHeader};
use isv_fusion::FusionSettings;
use isv_ingest::{DEFAULT_BLOCK_LIMIT, FaceTurner, MeshIngest, PointIngest, Reach, SignMode};
use isv_io::{Colours, DenseOptions, InvalidPoints, Unit};
use isv_kernels::quant::{STEP_FRACTION_BITS, StepSize};
use isv_volume::{BlockEdge, CODES_PER_VOXEL, Grid, Truncation, VoxelSize};
use std::num::NonZero;
use std::sync::Arc;

/// Quality where no target is given.
pub(super) const DEFAULT_QUALITY: f32 = 50.0;
/// Frames from a keyframe to the next.
const DEFAULT_GOP: NonZero<u32> = NonZero::new(30).expect("30 is not 0");
/// Half the thickness of a shell (voxels).
pub const DEFAULT_OFFSET_VOXELS: f64 = 1.5;
/// Share of a frame's surface that may be lost without a word.
pub(super) const WORTH_A_WARNING: f64 = 0.005;

/// Voxels of 5 mm in blocks of 8, truncated at 8 voxels.
#[must_use]
pub fn default_grid() -> Grid {
    Grid { voxel_size: default_voxel_size(), edge: BlockEdge::E8, truncation: Truncation::DEFAULT }
}

/// A set of the codec's tools.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProfileChoice {
    /// The codec as the paper describes it.
    Paper,
    /// The tools that compress best.
    Main,
}

/// A voxel size, or how it is found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum VoxelChoice {
    /// What fits: volumes keep their own, meshes get 5 mm, points and depth images what their spacing and noise allow.
    #[default]
    Fit,
    /// This one.
    Edge(Length),
    /// For meshes, the one of a few that serves the target best, by trial; else what fits.
    Auto,
}

/// Normals of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// Normals of the points, if they have any.
    #[default]
    Given,
    /// Planes through neighbouring points, turned to where the scanner was if that is known, or else outward.
    Estimate,
}

/// What a frame of depth images stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FusionMode {
    /// A frame is what its cameras saw: things move.
    #[default]
    PerFrame,
    /// A frame is all that was seen so far: the camera moves and the scene stands still.
    Accumulate,
}

/// Options of profile `paper`. `None` is the profile's default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PaperOptions {
    /// Prediction of frames between keyframes; 3dof where it is not given.
    pub motion: Option<MotionMode>,
    /// Transform coefficients coded of each block; 64.
    pub coefficients: Option<u16>,
    /// Quantizer step of a block's mean; 1 mm.
    pub dc_step: Option<Length>,
    /// Quantizer step of all other coefficients; 10 mm.
    pub ac_step: Option<Length>,
}

/// Options of profile `main`. `None` is the profile's default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MainOptions {
    /// Quality, 0 to 100; 50 where no target is given.
    pub quality: Option<f32>,
    /// Bits a second, every byte counted.
    pub bitrate: Option<BitRate>,
    /// RMS distance of each frame's surface from what was captured as a volume, at most.
    pub max_error: Option<Length>,
    /// Passes over the input to meet a bit rate, 1 or 2; 1.
    pub passes: Option<u8>,
    /// Work to take on; balanced.
    pub preset: Option<Preset>,
    /// Recovery of decoders from losses; at keyframes.
    pub refresh: Option<Refresh>,
    /// Coding of unobserved voxels; by cells, with the full band by voxels.
    pub masks: Option<MaskCoding>,
    /// Tools to use; all of the preset's.
    pub tools: Option<Tools>,
}

/// Options of colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColourOptions {
    /// Whether colour is left out.
    pub is_dropped: bool,
    /// Whether the stream has a place for colour though its first frame may have none.
    pub is_expected: bool,
    /// Quality of colour, 0 to 100; with a bit rate what the rate gives, else 50.
    pub quality: Option<f32>,
}

impl ColourOptions {
    /// Refuses numbers out of range.
    fn check(&self) -> Result<(), OptionsError> {
        match self.quality.is_none_or(|quality| (0.0..=100.0).contains(&quality)) {
            true => Ok(()),
            false => {
                let (option, what) = (OptionName::ColourQuality, "a number from 0 to 100");
                Err(OptionsError::Range { option, what })
            }
        }
    }

    /// The first of these options that was given and that profile `paper` has no use for.
    fn first_given(&self) -> Option<OptionName> {
        self.quality.map(|_| OptionName::ColourQuality)
    }
}

/// How captures become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOptions {
    /// How to tell inside from outside.
    pub sign: SignMode,
    /// Half the thickness of the shell around a surface without inside (voxels).
    pub offset_voxels: f64,
    /// Normals of points.
    pub normals: Normals,
    /// Place that points were seen from, in the capture's unit and coordinates.
    pub viewpoint: Option<[f64; 3]>,
    /// What a frame of depth images stands for.
    pub fusion: FusionMode,
    /// Depth up to which readings count; `None` for all.
    pub max_depth: Option<Length>,
    /// Most blocks of a frame.
    pub max_blocks: usize,
}

impl Default for FieldOptions {
    fn default() -> Self {
        Self {
            sign: SignMode::Auto,
            offset_voxels: DEFAULT_OFFSET_VOXELS,
            normals: Normals::default(),
            viewpoint: None,
            fusion: FusionMode::default(),
            max_depth: None,
            max_blocks: DEFAULT_BLOCK_LIMIT,
        }
    }
}

impl FieldOptions {
    /// Settings by which meshes become volumes on a grid, of the whole band. Profile `paper` chooses the sign as the paper does.
    #[must_use]
    pub fn mesh_ingest(&self, grid: Grid, profile: ProfileChoice) -> MeshIngest {
        let Self { sign, offset_voxels, max_blocks, .. } = *self;
        let sign = match (sign, profile) {
            (SignMode::Auto, ProfileChoice::Paper) => SignMode::Paper,
            (sign, _) => sign,
        };
        MeshIngest { sign, offset_voxels, max_blocks, ..MeshIngest::new(grid) }
    }

    /// How points become volumes on a grid.
    #[must_use]
    pub fn point_ingest(&self, grid: Grid) -> PointIngest {
        let Self { sign, offset_voxels, max_blocks, .. } = *self;
        PointIngest { grid, sign, offset_voxels, max_blocks }
    }

    /// Depth up to which readings count (m); infinite unless it was given.
    #[must_use]
    pub fn max_depth_m(&self) -> f64 {
        self.max_depth.map_or(f64::INFINITY, Length::metres)
    }
}

/// Everything that a user may choose of encoding. `None` leaves the choice to the capture, then to the default.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodeOptions {
    /// Frames to encode; `None` for all.
    pub frames: Option<FrameRange>,
    /// Unit of the capture's coordinates.
    pub unit: Unit,
    /// Place of meshes and points, in their unit, that becomes the origin.
    pub origin: Option<[f64; 3]>,
    /// Axis of the capture that points up.
    pub up: Up,
    /// Treatment of points that are nowhere.
    pub invalid_points: InvalidPoints,
    /// Whether frames of one shape may be of different scales.
    pub mixed_scales: bool,
    /// How dense fields are read.
    pub dense: DenseOptions,
    /// How captures become volumes.
    pub fields: FieldOptions,
    /// Set of tools; main, but for the whole band.
    pub profile: Option<ProfileChoice>,
    /// Frame rate; the capture's, else 30 a second.
    pub frame_rate: Option<FrameRate>,
    /// Name or number, counted from 0, of the animation of a glTF file; the first that moves anything.
    pub animation: Option<String>,
    /// Voxel size.
    pub voxel: VoxelChoice,
    /// Edge of a block (voxels); the volumes' own, else 8.
    pub block: Option<u32>,
    /// Distance from the surface up to which distances are kept (voxels); the volumes' own, else 8.
    pub truncation: Option<u32>,
    /// Part of the volume to code; near the surface in profile `main`, all of it in profile `paper`.
    pub band: Option<Band>,
    /// Options of profile `paper`.
    pub paper: PaperOptions,
    /// Options of profile `main`.
    pub main: MainOptions,
    /// Options of colour, which profile `main` codes where the capture has any.
    pub colour: ColourOptions,
    /// What the stream says of itself.
    pub metadata: MetadataOptions,
    /// Most frames from a keyframe to the next.
    pub gop: NonZero<u32>,
    /// Whether every `gop` frames begin a group of pictures that is coded by itself. The groups of a capture
    /// are then the same bytes, however many of them are coded at once.
    pub fixed_gop: bool,
    /// Frame of the capture at which the stream's time begins; the first frame that is coded.
    pub time_origin: Option<usize>,
    /// Whether frames carry a hash of the decoded volume.
    pub checksums: bool,
    /// What packets are stamped with.
    pub timestamps: TimestampSource,
    /// Whether frames that cannot be used are left out.
    pub skip_bad_frames: bool,
    /// Whether stages take turns, so that the time of one is not also that of another.
    pub takes_turns: bool,
    /// Whether the change of each frame's surface is measured.
    pub measures_change: bool,
    /// Memory that decoders are known to have.
    pub memory: MemoryLimit,
}

impl Default for EncodeOptions {
    fn default() -> Self {
        Self {
            frames: None,
            unit: Unit::Metre,
            origin: None,
            up: Up::Y,
            invalid_points: InvalidPoints::Refuse,
            mixed_scales: false,
            dense: DenseOptions::default(),
            fields: FieldOptions::default(),
            profile: None,
            frame_rate: None,
            animation: None,
            voxel: VoxelChoice::Fit,
            block: None,
            truncation: None,
            band: None,
            paper: PaperOptions::default(),
            main: MainOptions::default(),
            colour: ColourOptions::default(),
            metadata: MetadataOptions::default(),
            gop: DEFAULT_GOP,
            fixed_gop: false,
            time_origin: None,
            checksums: false,
            timestamps: TimestampSource::Source,
            skip_bad_frames: false,
            takes_turns: false,
            measures_change: false,
            memory: MemoryLimit::default(),
        }
    }
}

impl EncodeOptions {
    /// What is said of the capture.
    ///
    /// # Errors
    /// [`OptionsError`] for a voxel size or truncation out of range.
    pub fn hints(&self, observer: &Arc<dyn Observer>) -> Result<Hints, OptionsError> {
        let usual = Hints::in_unit(self.unit, self.memory, Arc::clone(observer)).with_origin(self.origin);
        Ok(Hints {
            voxel_size: self.voxel_size()?,
            truncation: self.truncation()?,
            frame_rate: self.frame_rate.unwrap_or(usual.frame_rate),
            animation: self.animation.clone(),
            invalid_points: self.invalid_points,
            mixed_scales: self.mixed_scales,
            up: self.up,
            dense: self.dense,
            colours: match (self.colour.is_dropped, self.profile_choice()) {
                (false, ProfileChoice::Main) => Colours::Keep,
                _ => Colours::Drop,
            },
            ..usual
        })
    }

    /// The header, every field checked. `grid` and `frame_rate`: those of the capture, if it has any, for what was not chosen.
    ///
    /// # Errors
    /// See [`OptionsError`].
    pub fn header(
        &self,
        grid: Option<Grid>,
        frame_rate: Option<FrameRate>,
    ) -> Result<StreamHeader, OptionsError> {
        if self.frame_rate.is_some_and(|rate| rate.numerator == 0 || rate.denominator == 0) {
            return Err(OptionsError::Range { option: OptionName::FrameRate, what: "a number above 0" });
        }
        if self.fields.max_depth.is_some_and(|depth| depth.metres().is_nan() || depth.metres() <= 0.0) {
            return Err(OptionsError::Range { option: OptionName::MaxDepth, what: "a length above 0" });
        }
        self.metadata.check()?;
        self.check_groups()?;
        let grid = self.grid(grid)?;
        let offset = self.fields.offset_voxels;
        let truncation = grid.truncation.voxels();
        if !(offset > 0.0 && offset <= f64::from(truncation)) {
            return Err(OptionsError::Offset { asked: offset, truncation });
        }
        let profile = self.profile(&grid)?;
        let frame_rate = self.frame_rate.or(frame_rate).unwrap_or(FrameRate::DEFAULT);
        Ok(match (self.main.masks, self.band) {
            (Some(masks), _) => StreamHeader::new(profile, grid, frame_rate).with_mask_coding(masks),
            // Cells hide observed voxels too where no drawn cell has them.
            (None, Some(Band::Full)) => StreamHeader::new(profile, grid, frame_rate),
            (None, _) => StreamHeader::newest(profile, grid, frame_rate),
        })
    }

    /// Refuses groups that are coded by themselves where something is to go from one to the next.
    fn check_groups(&self) -> Result<(), OptionsError> {
        let carried = [
            (self.main.refresh == Some(Refresh::Gradual), "gradual refresh"),
            (self.fields.fusion == FusionMode::Accumulate, "depth that accumulates"),
            (self.main.bitrate.is_some() && self.main.passes != Some(2), "a bit rate met in one pass"),
        ];
        match carried.into_iter().find(|(is_asked, _)| self.fixed_gop && *is_asked) {
            Some((_, what)) => Err(OptionsError::Carries(what)),
            None => Ok(()),
        }
    }

    /// Groups of pictures that are coded by themselves, of a stream that begins with a frame.
    pub(super) fn groups(&self, first: usize) -> Groups {
        Groups::new(self.fixed_gop.then_some(self.gop), first)
    }

    /// The profile asked for, or the default: main, but for the whole band, of which it has no place for the unobserved voxels.
    #[must_use]
    pub fn profile_choice(&self) -> ProfileChoice {
        let wants_main = self.main.first_given().is_some() || self.voxel == VoxelChoice::Auto;
        self.profile.unwrap_or(match self.band {
            Some(Band::Full) if !wants_main => ProfileChoice::Paper,
            _ => ProfileChoice::Main,
        })
    }

    /// Whether the capture may choose the voxel size: nobody has, or asked for that.
    #[must_use]
    pub fn voxel_is_open(&self, capture: &Capture) -> bool {
        capture.grid().is_none() && !matches!(self.voxel, VoxelChoice::Edge(_))
    }

    /// The profile with its parameters on a grid; an option of the other one is refused.
    ///
    /// # Errors
    /// See [`OptionsError`].
    pub fn profile(&self, grid: &Grid) -> Result<Profile, OptionsError> {
        self.main.check()?;
        self.colour.check()?;
        let choice = self.profile_choice();
        if self.voxel == VoxelChoice::Auto && choice == ProfileChoice::Paper {
            return Err(OptionsError::AutoVoxelInPaper);
        }
        match choice {
            ProfileChoice::Paper => match self.main.first_given().or(self.colour.first_given()) {
                None => Ok(Profile::Paper(self.paper.parameters(grid)?)),
                Some(option) => Err(OptionsError::NotInPaper(option)),
            },
            ProfileChoice::Main => match self.paper.first_given() {
                None => Ok(Profile::Main),
                Some(option) => Err(OptionsError::NotInMain { option, chosen: self.profile.is_some() }),
            },
        }
    }

    /// The encoder's settings for a stream.
    #[must_use]
    pub fn encoder_settings(&self, header: &StreamHeader) -> EncoderSettings {
        EncoderSettings {
            motion: self.paper.motion.unwrap_or(MotionMode::Fixed(Prediction::ThreeDof)),
            gop: self.gop.get(),
            checksums: self.checksums,
            main: MainSettings { target: self.target(header), ..self.main.settings(self.band) },
            ..EncoderSettings::default()
        }
    }

    /// Target of the steps of a stream's frames.
    fn target(&self, header: &StreamHeader) -> RateTarget {
        let voxel_m = header.grid.voxel_size.metres();
        match (self.main.bitrate, self.main.max_error) {
            (Some(rate), _) if self.main.passes != Some(2) => RateTarget::Bitrate(Bitrate {
                colour: self.colour_share(header),
                ..Bitrate::new(rate.bits_per_second(), header.frame_rate.per_second())
            }),
            (_, Some(error)) => RateTarget::MaxError(error.metres() / voxel_m),
            _ => RateTarget::Constant,
        }
    }

    /// Colour that a bit rate pays for.
    pub(super) fn colour_share(&self, header: &StreamHeader) -> ColourShare {
        match (header.colour_layers.is_some(), self.colour.quality) {
            (false, _) => ColourShare::None,
            (true, Some(_)) => ColourShare::Fixed,
            (true, None) => ColourShare::Joint,
        }
    }

    /// Makes what turns captured frames into volumes on a grid, as far from the surface as is coded.
    pub(super) fn volume_maker(
        &self,
        header: &StreamHeader,
        device: OpenDevice,
        first: usize,
        observer: &Arc<dyn Observer>,
    ) -> VolumeMaker {
        let (profile, fields, grid) = (self.profile_choice(), &self.fields, header.grid);
        let colour_spacing_m = self
            .colour_settings(header)
            .map(|settings| f64::from(settings.spacing) * grid.voxel_size.metres());
        let origin_m = DVec3::from(self.origin.unwrap_or_default()) * self.unit.metres();
        // As captures turn their points.
        let turned = |place: DVec3| self.up.to_y_up() * place;
        let reach = match (profile, self.band) {
            (ProfileChoice::Main, None | Some(Band::Surface)) => Reach::Surface,
            _ => Reach::Band,
        };
        let (max_depth_m, max_blocks) = (fields.max_depth_m(), fields.max_blocks);
        let settings = FusionSettings { max_depth_m, max_blocks, ..FusionSettings::new(grid) };
        VolumeMaker {
            device,
            groups: self.groups(first),
            mesh: MeshIngest { reach, ..fields.mesh_ingest(grid, profile) },
            mesh_ingester: None,
            mesh_sign: None,
            face_turner: FaceTurner::default(),
            turning_said: false,
            loss_said: WORTH_A_WARNING / 2.0,
            loss_seen: 0.0,
            points: fields.point_ingest(grid),
            point_sign: None,
            normals: fields.normals,
            unit: self.unit,
            viewpoint_m: fields
                .viewpoint
                .map(|place| turned(DVec3::from(place) * self.unit.metres() - origin_m)),
            scan_origin_m: turned(-origin_m),
            sides_said: false,
            sign_said: false,
            depth: DepthFusion { mode: fields.fusion, settings, fuser: None, colours: None },
            band: match profile {
                ProfileChoice::Main => Band::Full,
                ProfileChoice::Paper => self.band.unwrap_or(Band::Full),
            },
            extended: profile == ProfileChoice::Main,
            memory: self.memory,
            observer: Arc::clone(observer),
            surface: Arc::default(),
            colour_spacing_m,
            lacks_room_for_colour: colour_spacing_m.is_none()
                && !self.colour.is_dropped
                && profile == ProfileChoice::Main,
            colours: Vec::new(),
            colours_stand: false,
        }
    }

    /// The layers of colour that a stream gets if its capture has colours.
    pub(super) fn colour_layers(&self, header: &StreamHeader) -> ColourLayers {
        match (self.colour.is_dropped, header.profile) {
            (false, Profile::Main) => ColourLayers::HalfVoxels,
            _ => ColourLayers::None,
        }
    }

    /// The coder of colour, for streams that have any. `scale`: a factor on its steps.
    pub(super) fn colour_encoder(&self, header: &StreamHeader, scale: f64) -> Option<ColourCoding> {
        let is_gradual = self.main.refresh == Some(Refresh::Gradual);
        self.colour_settings(header).map(|settings| ColourCoding {
            encoder: ColourEncoder::new(settings.scaled(scale as f32)),
            is_gradual,
            blocks: None,
        })
    }

    fn colour_settings(&self, header: &StreamHeader) -> Option<ColourSettings> {
        header.colour_layers.is_some().then(|| {
            let quality = self.colour.quality.unwrap_or(DEFAULT_QUALITY);
            let settings = ColourSettings::of_quality(quality, header.colour_layers.count())
                .with_preset(self.main.preset.unwrap_or(Preset::Balanced));
            // Viewers enter between keyframes, and have all colours one cycle later.
            let cycle = (self.main.refresh == Some(Refresh::Gradual)).then_some(self.gop.get());
            ColourSettings { checksums: self.checksums, cycle, ..settings }
        })
    }

    fn voxel_size(&self) -> Result<Option<VoxelSize>, OptionsError> {
        match self.voxel {
            VoxelChoice::Edge(edge) => VoxelSize::from_metres(edge.metres())
                .map(Some)
                .map_err(|error| OptionsError::Voxel(edge, error)),
            VoxelChoice::Fit | VoxelChoice::Auto => Ok(None),
        }
    }

    fn truncation(&self) -> Result<Option<Truncation>, OptionsError> {
        self.truncation.map(Truncation::from_voxels).transpose().map_err(OptionsError::Truncation)
    }

    /// The grid: what was asked for, else what the capture has, else the defaults.
    fn grid(&self, captured: Option<Grid>) -> Result<Grid, OptionsError> {
        let default = captured.unwrap_or(default_grid());
        Ok(Grid {
            voxel_size: self.voxel_size()?.unwrap_or(default.voxel_size),
            edge: self.edge(default.edge)?,
            truncation: self.truncation()?.unwrap_or(default.truncation),
        })
    }

    /// The edge of a block: what was asked for, else `default`; in profile `main` always 8.
    fn edge(&self, default: BlockEdge) -> Result<BlockEdge, OptionsError> {
        match (self.profile_choice(), self.block) {
            (ProfileChoice::Main, None | Some(8)) => Ok(BlockEdge::E8),
            (ProfileChoice::Main, Some(edge)) => {
                Err(OptionsError::BlockInMain { edge, chosen: self.profile.is_some() })
            }
            (ProfileChoice::Paper, None) => Ok(default),
            (ProfileChoice::Paper, Some(edge)) => BlockEdge::from_voxels(edge).map_err(OptionsError::Block),
        }
    }
}

impl MainOptions {
    /// Refuses options that contradict each other, and numbers out of range.
    fn check(&self) -> Result<(), OptionsError> {
        let given: Vec<_> =
            self.targets().into_iter().filter_map(|(given, name)| given.then_some(name)).collect();
        if let [first, second, ..] = given[..] {
            return Err(OptionsError::Conflict(first, second));
        }
        if self.passes.is_some() && self.bitrate.is_none() {
            return Err(OptionsError::Needs(OptionName::Passes, OptionName::Bitrate));
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        let ranges = [
            (
                OptionName::Quality,
                self.quality.is_none_or(|q| (0.0..=100.0).contains(&q)),
                "a number from 0 to 100",
            ),
            (
                OptionName::Bitrate,
                self.bitrate.is_none_or(|r| positive(r.bits_per_second())),
                "a rate above 0",
            ),
            (OptionName::MaxError, self.max_error.is_none_or(|e| positive(e.metres())), "a length above 0"),
            (OptionName::Passes, self.passes.is_none_or(|passes| (1..=2).contains(&passes)), "1 or 2"),
        ];
        match ranges.into_iter().find(|(_, fits, _)| !fits) {
            Some((option, _, what)) => Err(OptionsError::Range { option, what }),
            None => Ok(()),
        }
    }

    /// The first of these options that was given.
    fn first_given(&self) -> Option<OptionName> {
        let others = [
            (self.passes.is_some(), OptionName::Passes),
            (self.preset.is_some(), OptionName::Preset),
            (self.refresh.is_some(), OptionName::Refresh),
            (self.masks.is_some(), OptionName::Masks),
            (self.tools.is_some(), OptionName::Without),
        ];
        self.targets().into_iter().chain(others).find_map(|(given, name)| given.then_some(name))
    }

    /// The rate (bits a second) to be met by coding everything more than once, if it is to be.
    pub(super) fn two_pass_rate(&self) -> Option<f64> {
        self.bitrate.filter(|_| self.passes == Some(2)).map(BitRate::bits_per_second)
    }

    /// The rate that was asked for, and the most bits that a stream of so many seconds may have to meet it.
    #[must_use]
    pub fn most_bits(&self, seconds: f64) -> Option<(BitRate, f64)> {
        // What comes in one pass may fill the buffer of a second. The one step of all is found to a percent.
        let allowed = if self.passes == Some(2) { 1.02 * seconds } else { 1.01 * (seconds + 1.0) };
        self.bitrate.map(|rate| (rate, rate.bits_per_second() * allowed))
    }

    fn settings(&self, band: Option<Band>) -> MainSettings {
        MainSettings {
            quality: FrameQuality::of_quality(self.quality.unwrap_or(DEFAULT_QUALITY)),
            band: band.unwrap_or(Band::Surface),
            tools: self.tools.unwrap_or(Tools::ALL),
            refresh: self.refresh.unwrap_or(Refresh::Keyframes),
            ..self.preset.unwrap_or(Preset::Balanced).settings()
        }
    }

    fn targets(&self) -> [(bool, OptionName); 3] {
        [
            (self.quality.is_some(), OptionName::Quality),
            (self.bitrate.is_some(), OptionName::Bitrate),
            (self.max_error.is_some(), OptionName::MaxError),
        ]
    }
}

impl PaperOptions {
    const DEFAULT_COEFFICIENTS: u16 = 64;
    const DEFAULT_DC_STEP_M: f64 = 0.001;
    const DEFAULT_AC_STEP_M: f64 = 0.01;

    fn parameters(&self, grid: &Grid) -> Result<PaperParameters, OptionsError> {
        let step = |asked: Option<Length>, default_m: f64, option| {
            let length = asked.unwrap_or(Length::from_metres(default_m));
            step(option, length, grid.voxel_size)
        };
        Ok(PaperParameters {
            coefficients: self.coefficients(grid.edge)?,
            dc_step: step(self.dc_step, Self::DEFAULT_DC_STEP_M, OptionName::DcStep)?,
            ac_step: step(self.ac_step, Self::DEFAULT_AC_STEP_M, OptionName::AcStep)?,
        })
    }

    /// The first of these options that was given.
    fn first_given(&self) -> Option<OptionName> {
        let options = [
            (self.motion.is_some(), OptionName::Motion),
            (self.coefficients.is_some(), OptionName::Coefficients),
            (self.dc_step.is_some(), OptionName::DcStep),
            (self.ac_step.is_some(), OptionName::AcStep),
        ];
        options.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    fn coefficients(&self, edge: BlockEdge) -> Result<u16, OptionsError> {
        let (asked, most) = (self.coefficients.unwrap_or(Self::DEFAULT_COEFFICIENTS), edge.block_voxels());
        match (1..=most).contains(&usize::from(asked)) {
            true => Ok(asked),
            false => Err(OptionsError::Coefficients { asked, edge, most }),
        }
    }
}

/// A quantizer step as a stream states it: in sixteenths of a code.
fn step(option: OptionName, asked: Length, voxel: VoxelSize) -> Result<u32, OptionsError> {
    let per_metre = f64::from(CODES_PER_VOXEL << STEP_FRACTION_BITS) / voxel.metres();
    let step = (asked.metres() * per_metre).round();
    let ends = [*StepSize::RANGE.start(), *StepSize::RANGE.end()].map(f64::from);
    if (ends[0]..=ends[1]).contains(&step) {
        return Ok(step as u32);
    }
    let [least, most] = ends.map(|step| Length::from_metres(step / per_metre));
    Err(OptionsError::Step { option, asked, voxel: Length::from_metres(voxel.metres()), least, most })
}
