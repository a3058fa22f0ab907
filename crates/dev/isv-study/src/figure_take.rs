//! A take of the procedural figure: animated, coded, measured and drawn without any input.

use crate::StudyError;
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, surface_rms_voxels};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, SignDecision, decide_sign, ingest_mesh};
use isv::raw::metrics::{CompareOptions, compare};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::take::encode::default_grid;
use isv::raw::take::stream::timed;
use isv::raw::volume::{Grid, SparseVolume, TriangleMesh, VoxelSize};
use isv_figure::{BOUNDS_M, figure_mesh};
use isv_render::{Camera, ErrorScale, Picture, Style, colour_bar, contact_sheet, render, render_errors};
use isv_spatial::Bvh;

/// Most frames that are measured and drawn.
const PICKS: usize = 4;

/// Width and height in pixels of each picture.
const PICTURE: [usize; 2] = [440, 390];

/// Distance (m) at which the colours of errors end.
const ERROR_RANGE_M: f64 = 0.002;

/// Edge of a voxel (m) that the figure itself is modelled with: not that it is coded with, as no capture would have such voxels.
const MODEL_VOXEL_M: f64 = 0.008;

/// Frames of the figure, as volumes to be coded.
#[derive(Debug)]
pub struct FigureTake {
    grid: Grid,
    volumes: Vec<SparseVolume>,
    /// Numbers of the frames that are measured and drawn.
    picks: Vec<usize>,
    /// Meshes of those frames.
    shown: Vec<TriangleMesh>,
}

/// A figure as coded by one codec.
#[derive(Clone, Debug)]
pub struct CodedFigure {
    /// The stream.
    pub bytes: Vec<u8>,
    /// Change of the field near the surface (mm), the mean over frames.
    pub surface_rms_mm: f64,
    /// Time for all frames (ms).
    pub encode_ms: f64,
}

/// What came back from the bytes.
#[derive(Clone, Debug)]
pub struct DecodedFigure {
    /// Meshes of the frames that are measured and drawn.
    pub shown: Vec<TriangleMesh>,
    /// Time for all frames (ms).
    pub decode_ms: f64,
}

impl FigureTake {
    /// Animates the figure at 30 frames a second and samples its distance field. `on_frame` is called for each frame.
    ///
    /// # Errors
    /// [`StudyError::Ingest`].
    pub fn new(frames: usize, mut on_frame: impl FnMut()) -> Result<Self, StudyError> {
        let (grid, picks) = (default_grid(), Self::picks_among(frames));
        let (mut volumes, mut shown) = (Vec::new(), Vec::new());
        let ingest = MeshIngest::new(grid);
        let model_voxel = VoxelSize::from_metres(MODEL_VOXEL_M).expect("8 mm is in range");
        let mut sign: Option<SignDecision> = None;
        for frame in 0..frames {
            let mesh = figure_mesh(frame as f64 / FrameRate::DEFAULT.per_second(), model_voxel);
            let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
            let volume = ingest_mesh(&mesh, &ingest, sign);
            volumes.push(volume.map_err(|cause| StudyError::Ingest { frame, cause })?);
            if picks.contains(&frame) {
                shown.push(mesh);
            }
            on_frame();
        }
        Ok(Self { grid, volumes, picks, shown })
    }

    /// Numbers of up to four of so many frames, from the first to the last, evenly spaced: those that are measured and drawn.
    #[must_use]
    pub fn picks_among(frames: usize) -> Vec<usize> {
        let count = PICKS.min(frames);
        (0..count).map(|i| i * (frames - 1) / (count - 1).max(1)).collect()
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.volumes.len()
    }

    /// Time that the frames take to show (s).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.volumes.len() as f64 / FrameRate::DEFAULT.per_second()
    }

    /// Numbers of the frames that are measured and drawn.
    #[must_use]
    pub fn picks(&self) -> &[usize] {
        &self.picks
    }

    /// Triangles of the first frame.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.shown.first().map_or(0, |mesh| mesh.triangles.len())
    }

    /// Codes all frames.
    ///
    /// # Errors
    /// [`StudyError::Format`].
    pub fn encode(
        &self,
        profile: Profile,
        settings: EncoderSettings,
        mut on_frame: impl FnMut(),
    ) -> Result<CodedFigure, StudyError> {
        let header = StreamHeader::new(profile, self.grid, FrameRate::DEFAULT);
        let mut encoder = Encoder::new(&header, settings);
        let mut writer = PacketWriter::new(Vec::new(), &header)?;
        let (mut surface_rms, mut encode_ms) = (0.0, 0.0);
        for (frame, volume) in self.volumes.iter().enumerate() {
            let (coded, ms) = timed(|| encoder.encode(volume));
            let timestamp_ns = FrameRate::DEFAULT.timestamp_ns(frame as u64);
            writer.write_frame(coded.keyframe, timestamp_ns, &coded.payload())?;
            let decoded = encoder.reconstruction().expect("a frame was just encoded");
            surface_rms += surface_rms_voxels(volume, decoded);
            encode_ms += ms;
            on_frame();
        }
        let voxel_mm = self.grid.voxel_size.metres() * 1e3;
        let surface_rms_mm = surface_rms / self.volumes.len() as f64 * voxel_mm;
        Ok(CodedFigure { bytes: writer.finish()?, surface_rms_mm, encode_ms })
    }

    /// Decodes a stream of the figure; every volume must have the hash of the encoder's.
    ///
    /// # Errors
    /// [`StudyError::Format`] and [`StudyError::Decode`].
    pub fn decode(&self, bytes: &[u8], mut on_frame: impl FnMut()) -> Result<DecodedFigure, StudyError> {
        let mut packets = PacketReader::new(bytes)?;
        let header = packets.header();
        let mut decoder = Decoder::new(header, Limits::default());
        let mut decoded = DecodedFigure { shown: Vec::new(), decode_ms: 0.0 };
        let mut frame = 0;
        while let Some(packet) = packets.next_frame()? {
            let (result, ms) = timed(|| decoder.decode_and_verify(&packet));
            let volume = result?.volume;
            if self.picks.contains(&frame) {
                decoded.shown.push(extract_surface(volume, &SurfaceOptions { normals: true }));
            }
            decoded.decode_ms += ms;
            frame += 1;
            on_frame();
        }
        Ok(decoded)
    }

    /// Distance (mm) between surfaces before and after, the mean over the frames that are measured.
    ///
    /// # Errors
    /// [`StudyError::Compare`].
    pub fn p2s_mean_mm(&self, decoded: &DecodedFigure) -> Result<f64, StudyError> {
        let mut sum_mm = 0.0;
        for ((original, decoded), frame) in self.shown.iter().zip(&decoded.shown).zip(&self.picks) {
            let error = compare(original, decoded, &CompareOptions::default());
            let error = error.map_err(|cause| StudyError::Compare { frame: *frame, cause })?;
            sum_mm += error.p2s_mean_mm.expect("both are surfaces");
        }
        Ok(sum_mm / self.shown.len() as f64)
    }

    /// Frames as they were, below them as they come back, and below that how far the two are apart.
    #[must_use]
    pub fn comparison(&self, decoded: &DecodedFigure) -> Picture {
        let camera = Camera::fitting(BOUNDS_M, PICTURE).from_direction(25.0, 5.0);
        let (style, scale) = (Style::default(), ErrorScale::new(ERROR_RANGE_M).expect("a length"));
        let mut pictures: Vec<_> =
            self.shown.iter().chain(&decoded.shown).map(|mesh| render(mesh, &camera, &style)).collect();
        for (original, decoded) in self.shown.iter().zip(&decoded.shown) {
            let original = Bvh::new(original);
            let distance = |point| original.distance(point);
            pictures.push(render_errors(decoded, &camera, &style, &scale, distance).picture);
        }
        let sheet = contact_sheet(&pictures, self.shown.len());
        sheet.above(&colour_bar(&scale, sheet.size()[0], style.background))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_spread_over_all_frames() {
        let picks = FigureTake::picks_among;
        assert_eq!(picks(24), [0, 7, 15, 23]);
        assert_eq!(picks(3), [0, 1, 2]);
        assert_eq!(picks(1), [0]);
        assert!(picks(0).is_empty());
    }
}
