//! The test model of MPEG's V-DMC, run as programs the way its test conditions run them.

use crate::bench::{Bench, GREY_PIXEL, ToolRun, command_line};
use crate::tools::{Identity, ToolVersion, Tools, folder_above};
use crate::{Lattice, ToolError};
use isv_io::{Format, write_mesh};
use isv_volume::TriangleMesh;
use std::path::PathBuf;
use std::time::Duration;

/// What the encoder says of itself.
const IDENTITY: Identity =
    Identity { name: "encode", arguments: &["--help"], mark: "MPEG VMESH version ", tested: "4.0" };

/// A program still running after this hangs: a frame takes minutes.
const TIME_LIMIT: Duration = Duration::from_secs(4 * 3600);

/// A file by which the folder of configurations is known; the video encoder of displacements reads it.
const CONFIGURATION: &str = "hm/displacements-ai.cfg";

/// Settings of a rate.
struct Rate {
    /// Share of the triangles that the base mesh keeps.
    target: f64,
    /// Quantization parameters of displacements.
    lifting_qp: &'static str,
    /// Bits of the base mesh's positions.
    base_bits: u8,
}

/// `encode` and `decode`, built from the public source, with its folder `cfg`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vdmc {
    encoder: PathBuf,
    decoder: PathBuf,
    configurations: PathBuf,
    version: ToolVersion,
    limit: Duration,
}

impl Vdmc {
    /// Names of the programs.
    pub const PROGRAMS: [&str; 2] = [IDENTITY.name, "decode"];

    /// Bits of the positions that the encoder is given, which are not rounded.
    pub const POSITION_BITS: u8 = 12;

    /// Rates of the common test conditions, fine to coarse.
    pub const RATES: [u8; 5] = [5, 4, 3, 2, 1];

    /// The programs, if both are there.
    ///
    /// # Errors
    /// [`ToolError::Version`] for other programs of these names, [`ToolError::Configuration`] if the folder `cfg` of the source
    /// is not beside them or above.
    pub fn find(tools: &Tools) -> Result<Option<Self>, ToolError> {
        let [Some(encoder), Some(decoder)] = Self::PROGRAMS.map(|name| tools.find(name)) else {
            return Ok(None);
        };
        let version = ToolVersion::ask(&encoder, &IDENTITY)?;
        let configurations = folder_above(&encoder, CONFIGURATION)?;
        Ok(Some(Self { encoder, decoder, configurations, version, limit: tools.limit(TIME_LIMIT) }))
    }

    /// Version of the encoder.
    #[must_use]
    pub fn version(&self) -> &ToolVersion {
        &self.version
    }

    /// The lattice on which meshes of a take are handed over, by the box around them all.
    #[must_use]
    pub fn lattice(bounds: (glam::DVec3, glam::DVec3)) -> Lattice {
        Lattice::spanning(bounds, Self::POSITION_BITS)
    }

    /// Encodes the meshes of a whole take, without normals and colours, in the all-intra condition at a rate of
    /// [`Self::RATES`]. The encoder always makes and codes texture coordinates: they have few bits, as nobody reads them.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn encode(
        &self,
        frames: &[TriangleMesh],
        lattice: &Lattice,
        rate: u8,
    ) -> Result<ToolRun<Vec<u8>>, ToolError> {
        let bench = Bench::new()?;
        for (frame, mesh) in frames.iter().enumerate() {
            mesh.validate()?;
            let vertices = mesh.vertices.iter().map(|v| (*v - lattice.origin) / lattice.step_m).collect();
            let on_lattice = TriangleMesh {
                vertices,
                normals: Vec::new(),
                triangles: mesh.triangles.clone(),
                appearance: None,
            };
            write_mesh(&bench.path(&format!("mesh_{frame:04}.obj")), &on_lattice, Format::Obj)?;
        }
        // The encoder reads a texture even if it is told to code none.
        std::fs::write(bench.path("texture.png"), GREY_PIXEL)?;
        let run = bench.run(&self.encoder, &self.encoder_arguments(frames.len(), rate), self.limit)?;
        let bytes = bench.read(&self.encoder, "take.vmesh")?;
        let cfg = self.configurations.display().to_string();
        let run = ToolRun { command: run.command.replace(&cfg, "CFG"), ..run };
        Ok(run.with(bytes))
    }

    /// Decodes what [`Self::encode`] made, a number of frames, back to metres.
    ///
    /// # Errors
    /// See [`ToolError`].
    pub fn decode(
        &self,
        bytes: &[u8],
        lattice: &Lattice,
        frames: usize,
    ) -> Result<ToolRun<Vec<TriangleMesh>>, ToolError> {
        let bench = Bench::new()?;
        std::fs::write(bench.path("take.vmesh"), bytes)?;
        let run = bench.run(&self.decoder, &decoder_arguments(), self.limit)?;
        let decoded = |frame| {
            let mut mesh = bench.read_mesh(&self.decoder, &format!("decoded_{frame:04}.obj"))?;
            mesh.vertices.iter_mut().for_each(|v| *v = lattice.origin + *v * lattice.step_m);
            mesh.normals.clear();
            mesh.appearance = None;
            Ok(mesh)
        };
        let meshes = (0..frames).map(decoded).collect::<Result<_, ToolError>>()?;
        Ok(run.with(meshes))
    }

    /// Command line of the decoder.
    #[must_use]
    pub fn decoder_command(&self) -> String {
        command_line(&self.decoder, &decoder_arguments())
    }

    fn encoder_arguments(&self, frames: usize, rate: u8) -> Vec<String> {
        let cfg = self.configurations.display();
        let Rate { target, lifting_qp, base_bits } = settings_of(rate);
        let largest = (1u32 << Self::POSITION_BITS) - 1;
        vec![
            "--srcMesh=mesh_%04d.obj".to_owned(),
            "--srcTex=texture.png".to_owned(),
            "--compressed=take.vmesh".to_owned(),
            "--startFrameIndex=0".to_owned(),
            format!("--frameCount={frames}"),
            format!("--positionBitDepth={}", Self::POSITION_BITS),
            "--texCoordBitDepth=12".to_owned(),
            "--minPosition=0,0,0".to_owned(),
            format!("--maxPosition={largest},{largest},{largest}"),
            "--checksum=0".to_owned(),
            format!("--target={target}"),
            format!("--liftingQP={lifting_qp}"),
            format!("--baseMeshPositionBitDepth={base_bits}"),
            "--baseMeshTexCoordBitDepth=2".to_owned(),
            "--ai_subdivIt=3".to_owned(),
            "--ai_sdeform=1".to_owned(),
            "--ai_unifyVertices=1".to_owned(),
            "--ai_deformNormalThres=0.8660254".to_owned(),
            "--ai_smoothMethod=1".to_owned(),
            "--encodeDisplacements=2".to_owned(),
            format!("--geometryVideoEncoderConfig={cfg}/{CONFIGURATION}"),
            format!("--textureVideoEncoderConfig={cfg}/hm/texture-ai.cfg"),
            "--encodeTextureVideo=0".to_owned(),
        ]
    }
}

fn decoder_arguments() -> [String; 4] {
    // Without the name of a texture the decoder fails once it has written the mesh.
    ["--compressed=take.vmesh", "--decMesh=decoded_%04d.obj", "--decTex=decoded_%04d.png", "--checksum=0"]
        .map(str::to_owned)
}

/// What the test conditions set for the capture of a dancer at each rate.
fn settings_of(rate: u8) -> Rate {
    let (target, lifting_qp, base_bits) = match rate {
        1 => (0.03, "32,44,44", 10),
        2 => (0.03, "31,43,43", 10),
        3 => (0.06, "22,34,34", 10),
        4 => (0.12, "24,36,36", 12),
        _ => (0.12, "22,34,34", 11),
    };
    Rate { target, lifting_qp, base_bits }
}
