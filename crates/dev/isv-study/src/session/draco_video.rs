//! Draco's meshes with their texture coordinates, and the textures as H.264 video: what is shipped on the web.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, WholeTake, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::{Appearance, Image, Material, TriangleMesh};
use isv_baseline::{
    CodedTextures, Draco, ProgramRun, TextureEncoding, TexturePictures, TextureVideo, ToolRun, VideoSettings,
    simplify_textured,
};
use std::sync::Arc;

/// Bits of texture coordinates: Draco's default, a texel in textures of 1024.
const COORDINATE_BITS: u8 = 10;

pub(crate) struct DracoVideoEncoding {
    draco: Draco,
    video: TextureVideo,
    faces_percent: u8,
    bits: u8,
    first_frame: usize,
    textures: TextureEncoding,
    meshes: Vec<Vec<u8>>,
    /// The material of each frame, without its texture.
    materials: Vec<Material>,
    encode_ms: f64,
}

impl DracoVideoEncoding {
    pub(crate) fn new(
        draco: &Draco,
        video: &TextureVideo,
        faces_percent: u8,
        bits: u8,
        settings: VideoSettings,
        first_frame: usize,
    ) -> Result<Self, StudyError> {
        Ok(Self {
            draco: draco.clone(),
            video: video.clone(),
            faces_percent,
            bits,
            first_frame,
            textures: video.begin(settings)?,
            meshes: Vec::new(),
            materials: Vec::new(),
            encode_ms: 0.0,
        })
    }
}

/// The material and the texture of a mesh; none unless it has exactly one texture, and coordinates for it.
fn texture_of(mesh: &TriangleMesh) -> Option<(&Material, &Arc<Image>)> {
    let appearance = mesh.appearance.as_ref().filter(|a| !a.texture_coordinates.is_empty())?;
    let mut textured = appearance.materials.iter().filter_map(|m| Some((m, m.texture.as_ref()?)));
    let (material, texture) = textured.next()?;
    textured.all(|(_, other)| Arc::ptr_eq(texture, other)).then_some((material, texture))
}

impl Encoding for DracoVideoEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let frame = self.first_frame + self.meshes.len();
        let (material, texture) = texture_of(mesh).ok_or(StudyError::NoTexture { frame })?;
        self.textures.push(texture).map_err(|cause| StudyError::Tool { frame, cause })?;
        self.materials.push(Material { texture: None, ..material.clone() });
        let (mesh, prepare_ms) = timed(|| match self.faces_percent {
            100 => Ok(mesh.clone()),
            percent => simplify_textured(mesh, f64::from(percent) / 100.0)
                .map_err(|cause| StudyError::Simplify { frame, cause }),
        });
        let run = self.draco.encode_textured(&mesh?, self.bits, COORDINATE_BITS);
        let ProgramRun { output, ms, peak_memory_bytes } =
            run.map_err(|cause| StudyError::Draco { frame, cause })?;
        let bytes = output.len() as u64;
        self.meshes.push(output);
        self.encode_ms += ms;
        Ok(EncodedFrame::by_program(bytes, prepare_ms, ms, peak_memory_bytes))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let ToolRun { output: textures, ms, peak_memory_bytes, command } = self.textures.finish()?;
        let encoding = WholeTake {
            encode_ms: self.encode_ms,
            colour_ms: Some(ms),
            memory: Memory::OfAProgram(peak_memory_bytes),
        };
        Ok(Box::new(DracoVideoStream {
            draco: self.draco,
            codec: self.video,
            bits: self.bits,
            first_frame: self.first_frame,
            meshes: self.meshes,
            materials: self.materials,
            textures,
            command,
            encoding,
        }))
    }
}

/// One Draco file a frame, and one video.
struct DracoVideoStream {
    draco: Draco,
    codec: TextureVideo,
    bits: u8,
    first_frame: usize,
    meshes: Vec<Vec<u8>>,
    materials: Vec<Material>,
    textures: CodedTextures,
    /// How the video was coded.
    command: String,
    encoding: WholeTake,
}

impl Stream for DracoVideoStream {
    fn bytes(&self) -> u64 {
        self.meshes.iter().map(|mesh| mesh.len() as u64).sum::<u64>() + self.bytes_colour()
    }

    /// The video. Texture coordinates count as geometry: Draco does not tell them apart.
    fn bytes_colour(&self) -> u64 {
        self.textures.video.len() as u64
    }

    fn kinds(&self) -> Option<BytesByKind> {
        None
    }

    fn whole_take(&self) -> Option<WholeTake> {
        Some(self.encoding)
    }

    fn programs(&self) -> Vec<ProgramUse> {
        let of_draco = Draco::commands_textured(self.bits, COORDINATE_BITS).map(|command| ProgramUse {
            version: String::new(),
            command,
            note: None,
        });
        let version = self.codec.version();
        let of_video =
            [self.command.clone(), self.codec.decoder_command(self.textures.size)].map(|command| {
                ProgramUse {
                    version: version.version.clone(),
                    command,
                    note: version.note(TextureVideo::PROGRAM),
                }
            });
        of_draco.into_iter().chain(of_video).collect()
    }

    fn decode(
        &self,
        colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let mut pictures = match colour {
            true => Some(self.codec.decode(&self.textures)?.output),
            false => None,
        };
        Ok(Box::new((self.first_frame..).zip(self.meshes.iter().zip(&self.materials)).map(
            move |(frame, (bytes, material))| {
                let run = self.draco.decode_textured(bytes);
                let ProgramRun { output: mut mesh, ms, peak_memory_bytes } =
                    run.map_err(|cause| StudyError::Draco { frame, cause })?;
                let picture = pictures.as_mut().map(TexturePictures::next_picture).transpose();
                let texture = picture.map_err(|cause| StudyError::Tool { frame, cause })?.map(Arc::new);
                if let (Some(appearance), Some(texture)) = (&mut mesh.appearance, texture) {
                    let materials = vec![Material { texture: Some(texture), ..material.clone() }];
                    *appearance = Arc::new(Appearance { materials, ..Appearance::clone(appearance) });
                }
                Ok(DecodedFrame {
                    shape: Geometry::Mesh(mesh),
                    ms,
                    memory: Memory::OfAProgram(peak_memory_bytes),
                })
            },
        )))
    }
}
