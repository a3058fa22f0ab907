//! A take of the procedural figure: animated, coded, measured and drawn without any input.

use crate::StudyError;
use isv::raw::decode::colour::{ColourFrame, surface_colours};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings};
use isv::raw::encode::{Encoder, EncoderSettings, surface_rms_voxels};
use isv::raw::format::{ColourLayers, FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, SignDecision, decide_sign, ingest_mesh, mesh_colours};
use isv::raw::metrics::{ColourError, CompareOptions, colour_summary, compare, compare_colours};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::take::encode::default_grid;
use isv::raw::take::stream::timed;
use isv::raw::take::{add_tile_texture, texture_tiles};
use isv::raw::volume::{Appearance, ColourSample, Grid, SparseVolume, TriangleMesh, VoxelSize};
use isv_figure::{BOUNDS_M, FigurePaint, figure_mesh, head_m, lit_colour};
use isv_render::{
    Camera, ErrorScale, Picture, Shading, Style, colour_bar, contact_sheet, render, render_errors, text_line,
};
use isv_spatial::Bvh;
use std::sync::Arc;

/// Most frames that are measured and drawn.
const PICKS: usize = 3;

/// Width and height in pixels of each picture.
const PICTURE: [usize; 2] = [304, 316];

/// Half the edge (m) of the box around the head that the close-up shows.
const CLOSE_UP_M: f64 = 0.125;

/// Direction of the camera: degrees about the up axis, and above the horizon.
const VIEW: [f64; 2] = [25.0, 5.0];

/// Distance (m) at which the colours of errors end.
const ERROR_RANGE_M: f64 = 0.002;

/// Edge of a voxel (m) that the figure itself is modelled with: not that it is coded with, as no capture would have such voxels.
const MODEL_VOXEL_M: f64 = 0.008;

/// Layers of samples of colour in streams that have any: the default of `isv encode`.
const COLOUR_LAYERS: ColourLayers = ColourLayers::HalfVoxels;

/// The figure as a capture, frame after frame.
#[derive(Debug)]
pub struct FigureTake {
    grid: Grid,
    frames: usize,
    /// Frames that were animated.
    animated: usize,
    /// How its inside is told from its outside, by the first frame.
    sign: Option<SignDecision>,
    /// Numbers of the frames that are measured and drawn.
    picks: Vec<usize>,
    /// Meshes of those of them that were animated.
    shown: Vec<TriangleMesh>,
}

/// A frame of the figure, ready to be coded.
#[derive(Debug)]
pub struct FigureFrame {
    volume: SparseVolume,
    /// Colours as captured, a quarter of a voxel apart.
    colours: Vec<ColourSample>,
}

/// Codes the frames of a figure into a stream.
pub struct FigureCoder {
    header: StreamHeader,
    encoder: Encoder,
    /// The coder of colour and its settings, in streams with colour.
    colour: Option<(ColourEncoder, ColourSettings)>,
    writer: PacketWriter<Vec<u8>>,
    frames: usize,
    bytes_colour: usize,
    surface_rms_voxels: f64,
    encode_ms: f64,
}

/// A figure as coded by one codec.
#[derive(Clone, Debug)]
pub struct CodedFigure {
    /// The stream.
    pub bytes: Vec<u8>,
    /// Bytes of these that are colour.
    pub bytes_colour: usize,
    /// Change of the field near the surface (mm), the mean over frames.
    pub surface_rms_mm: f64,
    /// Time for all frames (ms), colour included.
    pub encode_ms: f64,
}

/// What came back from the bytes.
#[derive(Clone, Debug)]
pub struct DecodedFigure {
    /// Meshes of the frames that are measured and drawn, with a texture where the stream has colour.
    pub shown: Vec<TriangleMesh>,
    /// Meshes of these frames with a colour at each vertex, for files.
    pub meshes: Vec<TriangleMesh>,
    /// Time for all frames (ms), colour included.
    pub decode_ms: f64,
}

impl FigureTake {
    /// A take of so many frames, 30 a second.
    #[must_use]
    pub fn new(frames: usize) -> Self {
        let picks = Self::picks_among(frames);
        Self { grid: default_grid(), frames, animated: 0, sign: None, picks, shown: Vec::new() }
    }

    /// Animates the next frame: samples its distance field, and its colours as a camera would. `None` after the last.
    ///
    /// # Errors
    /// [`StudyError::Ingest`].
    pub fn animate(&mut self) -> Result<Option<FigureFrame>, StudyError> {
        let frame = self.animated;
        if frame == self.frames {
            return Ok(None);
        }
        let mesh = textured_figure(time_s(frame));
        let ingest = MeshIngest::new(self.grid);
        let sign = *self.sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
        let volume =
            ingest_mesh(&mesh, &ingest, sign).map_err(|cause| StudyError::Ingest { frame, cause })?;
        let spacing_m = f64::from(ColourSettings::default().spacing) * self.grid.voxel_size.metres();
        let colours = mesh_colours(&mesh, spacing_m);
        if self.picks.contains(&frame) {
            self.shown.push(mesh);
        }
        self.animated += 1;
        Ok(Some(FigureFrame { volume, colours }))
    }

    /// Numbers of up to three of so many frames, from the first to the last, evenly spaced: those that are measured and drawn.
    #[must_use]
    pub fn picks_among(frames: usize) -> Vec<usize> {
        let count = PICKS.min(frames);
        (0..count).map(|i| i * (frames - 1) / (count - 1).max(1)).collect()
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Time that the frames take to show (s).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        time_s(self.frames)
    }

    /// Numbers of the frames that are measured and drawn.
    #[must_use]
    pub fn picks(&self) -> &[usize] {
        &self.picks
    }

    /// Triangles of the first frame, once it was animated.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.shown.first().map_or(0, |mesh| mesh.triangles.len())
    }

    /// Decodes a stream of the figure; every volume, and every frame's colour, must have the hash of the encoder's.
    ///
    /// # Errors
    /// [`StudyError::Format`] and [`StudyError::Decode`].
    pub fn decode(&self, bytes: &[u8], mut on_frame: impl FnMut()) -> Result<DecodedFigure, StudyError> {
        let mut packets = PacketReader::new(bytes)?;
        let header = packets.header();
        let mut decoder = Decoder::new(header, Limits::default());
        decoder.keep_colour(true);
        let mut decoded = DecodedFigure { shown: Vec::new(), meshes: Vec::new(), decode_ms: 0.0 };
        let mut frame = 0;
        while let Some(packet) = packets.next_frame()? {
            let (result, ms) = timed(|| decoder.decode_and_verify(&packet).map(|_| ()));
            result?;
            if self.picks.contains(&frame) {
                let volume = decoder.volume().expect("a frame was decoded");
                let [textured, coloured] = surfaces(volume, decoder.colour());
                decoded.shown.push(textured);
                decoded.meshes.push(coloured);
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

    /// Difference of colours before and after, the mean over the frames that are measured; without figures where the
    /// stream has no colour.
    ///
    /// # Errors
    /// [`StudyError::Compare`].
    pub fn colour_error(&self, decoded: &DecodedFigure) -> Result<ColourError, StudyError> {
        let measured = self.shown.iter().zip(&decoded.shown).zip(&self.picks);
        let measured = measured.map(|((original, decoded), frame)| {
            let error = compare_colours(original, decoded, &CompareOptions::default());
            error.map_err(|cause| StudyError::Compare { frame: *frame, cause })
        });
        Ok(colour_summary(&measured.collect::<Result<Vec<_>, _>>()?))
    }

    /// Rows of pictures: frames as captured and as decoded, in their colours without light, and how far the surfaces are apart. Each
    /// row ends with a close-up of the head.
    #[must_use]
    pub fn comparison(&self, decoded: &DecodedFigure) -> Picture {
        let (plain, scale) = (Style::default(), ErrorScale::new(ERROR_RANGE_M).expect("a length"));
        let unlit = Style { shading: Shading::Colour, ..plain };
        let surfaces: Vec<Bvh> = self.shown.iter().map(Bvh::new).collect();
        let errors = |index: usize, camera: &Camera| {
            let distance = |point| surfaces[index].distance(point);
            render_errors(&decoded.shown[index], camera, &plain, &scale, distance).picture
        };
        let rows = [
            self.row("as captured", |index, camera| render(&self.shown[index], camera, &unlit)),
            self.row("decoded", |index, camera| render(&decoded.shown[index], camera, &unlit)),
            self.row("distance of the decoded surface from the captured one", errors),
        ];
        let sheet = rows.into_iter().reduce(|above, below| above.above(&below)).expect("three rows");
        sheet.above(&colour_bar(&scale, sheet.size()[0], plain.background))
    }

    /// Pictures of all frames that are shown and a close-up of the last of them, under a caption.
    fn row(&self, caption: &str, draw: impl Fn(usize, &Camera) -> Picture) -> Picture {
        let view = |bounds| Camera::fitting(bounds, PICTURE).from_direction(VIEW[0], VIEW[1]);
        let bounds = self.shown.iter().filter_map(TriangleMesh::bounds);
        let bounds = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or(BOUNDS_M);
        let mut pictures: Vec<_> = (0..self.shown.len()).map(|index| draw(index, &view(bounds))).collect();
        if let (Some(last), Some(frame)) = (self.shown.len().checked_sub(1), self.picks.last()) {
            let head = head_m(time_s(*frame));
            pictures.push(draw(last, &view((head - CLOSE_UP_M, head + CLOSE_UP_M))));
        }
        let sheet = contact_sheet(&pictures, pictures.len());
        text_line(caption, sheet.size()[0], Style::default().background).above(&sheet)
    }
}

impl FigureCoder {
    /// Begins a stream of a figure. `colour`: how its colour is coded, if it is.
    ///
    /// # Errors
    /// [`StudyError::Format`].
    pub fn new(
        take: &FigureTake,
        profile: Profile,
        settings: EncoderSettings,
        colour: Option<ColourSettings>,
    ) -> Result<Self, StudyError> {
        let layers = if colour.is_some() { COLOUR_LAYERS } else { ColourLayers::None };
        let header = StreamHeader::newest(profile, take.grid, FrameRate::DEFAULT).with_colour(layers);
        let colour = colour.map(|settings| ColourSettings { layers: layers.count(), ..settings });
        Ok(Self {
            header,
            encoder: Encoder::new(&header, settings),
            colour: colour.map(|settings| (ColourEncoder::new(settings), settings)),
            writer: PacketWriter::new(Vec::new(), &header)?,
            frames: 0,
            bytes_colour: 0,
            surface_rms_voxels: 0.0,
            encode_ms: 0.0,
        })
    }

    /// Codes the next frame.
    ///
    /// # Errors
    /// [`StudyError::Format`].
    pub fn encode(&mut self, frame: &FigureFrame) -> Result<(), StudyError> {
        let (coded, ms) = timed(|| self.encoder.encode(&frame.volume));
        self.encode_ms += ms;
        let decoded = self.encoder.reconstruction().expect("a frame was just encoded");
        self.surface_rms_voxels += surface_rms_voxels(&frame.volume, decoded);
        let colour = self.colour.as_mut().map(|(encoder, settings)| {
            // A sparser choice of the colours, for settings that ask for fewer.
            let thinner = (settings.spacing / ColourSettings::default().spacing).powi(2).round().max(1.0);
            let seen: Vec<ColourSample> = frame.colours.iter().step_by(thinner as usize).copied().collect();
            timed(|| encoder.encode(decoded, &seen, coded.keyframe))
        });
        let (part, ms) = colour.map_or((None, 0.0), |(colour, ms)| (Some(colour.bytes), ms));
        self.encode_ms += ms;
        self.bytes_colour += part.as_ref().map_or(0, Vec::len);
        let timestamp_ns = FrameRate::DEFAULT.timestamp_ns(self.frames as u64);
        self.writer.write_coloured_frame(coded.keyframe, timestamp_ns, &coded.payload(), part.as_deref())?;
        self.frames += 1;
        Ok(())
    }

    /// Ends the stream.
    ///
    /// # Errors
    /// [`StudyError::Format`].
    pub fn finish(self) -> Result<CodedFigure, StudyError> {
        let voxel_mm = self.header.grid.voxel_size.metres() * 1e3;
        Ok(CodedFigure {
            bytes: self.writer.finish()?,
            bytes_colour: self.bytes_colour,
            surface_rms_mm: self.surface_rms_voxels / self.frames as f64 * voxel_mm,
            encode_ms: self.encode_ms,
        })
    }
}

/// The time of a frame (s).
fn time_s(frame: usize) -> f64 {
    frame as f64 / FrameRate::DEFAULT.per_second()
}

/// The figure as a capture has it: a mesh with a texture, in the light of its stage.
fn textured_figure(time_s: f64) -> TriangleMesh {
    let voxel = VoxelSize::from_metres(MODEL_VOXEL_M).expect("8 mm is in range");
    let mut mesh = figure_mesh(time_s, voxel);
    let paint = FigurePaint::at(time_s);
    let (light, triangles) = (paint.light(&mesh), mesh.triangles.clone());
    texture_tiles(&mut mesh, |texels| {
        let points: Vec<_> = texels.iter().map(|texel| texel.point).collect();
        let lit = texels.iter().zip(paint.colours(&points)).map(|(texel, colour)| {
            let corners = triangles[texel.face].iter().zip(texel.weights);
            lit_colour(colour, corners.map(|(vertex, weight)| light[*vertex as usize] * weight).sum())
        });
        lit.collect()
    });
    mesh
}

/// The surface of a decoded frame, with a texture and with a colour at each vertex; with neither if it has no colour.
fn surfaces(volume: &SparseVolume, colour: Option<&Arc<ColourFrame>>) -> [TriangleMesh; 2] {
    let mut textured = extract_surface(volume, &SurfaceOptions { normals: true });
    let mut coloured = textured.clone();
    if let Some(colour) = colour {
        add_tile_texture(&mut textured, colour, volume.grid());
        let vertex_colours = surface_colours(colour, volume.grid(), &coloured.vertices);
        coloured.appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
    }
    [textured, coloured]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_spread_over_all_frames() {
        let picks = FigureTake::picks_among;
        assert_eq!(picks(24), [0, 11, 23]);
        assert_eq!(picks(3), [0, 1, 2]);
        assert_eq!(picks(1), [0]);
        assert!(picks(0).is_empty());
    }
}
