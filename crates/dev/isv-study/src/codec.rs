//! The codecs of a study and the points at which they are measured.

use isv::raw::encode::{MotionMode, Preset};
use isv::raw::format::Prediction;
use isv::raw::volume::{Grid, TriangleMesh};
use isv_baseline::{Draco, Gltfpack, TextureVideo, Tmc2, Tmc13, Vdmc};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A codec under study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// isv, profile `paper`, with one kind of prediction, or the best for each frame.
    Paper(MotionMode),
    /// isv, profile `main`, under a preset.
    Main(Preset),
    /// Tang et al. 2018: blocks as in isv, a trained transform, every frame alone.
    Tang(Training),
    /// Google Draco on each frame's mesh, first simplified to a share of its faces, in percent.
    Draco {
        /// 100 for the mesh as it is.
        faces_percent: u8,
    },
    /// Draco on each frame's mesh with its texture coordinates, first simplified to a share of its faces in percent, and the textures
    /// as H.264 video.
    DracoVideo {
        /// 100 for the mesh as it is.
        faces_percent: u8,
    },
    /// meshoptimizer's gltfpack on each frame's mesh, first simplified to a share of its faces, in percent.
    Gltfpack {
        /// 100 for the mesh as it is.
        faces_percent: u8,
    },
    /// MPEG's G-PCC (TMC13) on the voxels that each frame's surface passes through.
    Tmc13(PointGeometry),
    /// MPEG's V-PCC (TMC2) on such voxels of the whole take.
    Tmc2,
    /// MPEG's V-DMC on the meshes of the whole take.
    Vdmc,
}

/// How G-PCC codes geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointGeometry {
    /// Voxels, without loss.
    Octree,
    /// Triangles in nodes of an octree.
    Trisoup,
}

/// What a trained transform was trained on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Training {
    /// The take itself: the best that a trained transform can do.
    Scene,
    /// Other takes.
    CrossScene,
}

/// Settings of a codec that give one rate and one error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatingPoint {
    /// The paper's knobs: K, and the quantizer steps in metres.
    Steps {
        /// Coefficients coded of each block.
        coefficients: u16,
        /// Step of the DC coefficient, in metres.
        dc_step_m: f64,
        /// Step of all others, in metres.
        ac_step_m: f64,
    },
    /// One step for all coefficients, in metres.
    Step {
        /// It.
        step_m: f64,
    },
    /// K and one step for all coefficients, in metres.
    UniformStep {
        /// Coefficients coded of each block.
        coefficients: u16,
        /// Step of all coefficients, in metres.
        step_m: f64,
    },
    /// Bits of a quantized coordinate; the longest side of the bounding box spans `2^bits - 1` steps.
    PositionBits(u8),
    /// Bits of a coordinate as of [`Self::PositionBits`], and the quality of the video beside it.
    BitsAndVideo {
        /// Bits of a quantized coordinate.
        bits: u8,
        /// x264's constant rate factor.
        crf: u8,
    },
    /// Voxels in nodes of triangles.
    Nodes {
        /// Bits of a voxel's coordinate, as of [`Self::PositionBits`].
        bits: u8,
        /// Edge of a node is `2^size_log2` voxels.
        size_log2: u8,
    },
    /// A rate of MPEG's common test conditions.
    TestRate {
        /// Bits of a coordinate of what the codec is given.
        bits: u8,
        /// Number of the rate: 1 is the coarsest.
        rate: u8,
    },
}

/// What operating points are in proportion to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Edge of a voxel in metres.
    pub voxel_m: f64,
    /// Longest side of the first frame's bounding box, in metres.
    pub extent_m: f64,
}

impl Scale {
    /// By the first frame of a take, and the grid of the codecs of volumes.
    #[must_use]
    pub fn new(first: &TriangleMesh, grid: &Grid) -> Self {
        let extent_m = first.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
        Self { voxel_m: grid.voxel_size.metres(), extent_m }
    }

    /// Bits beyond those that make a step of the bounding box a voxel, 4 to `most`.
    fn bits(&self, beyond: i32, most: i32) -> u8 {
        let voxel_bits = (self.extent_m / self.voxel_m).max(1.0).log2().round() as i32;
        (voxel_bits + beyond).clamp(4, most) as u8
    }
}

/// A name that no codec has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no codec is called {0:?}; there are {names}", names = Codec::ALL.map(|codec| codec.to_string()).join(", "))]
pub struct UnknownCodec(String);

/// K of all points: what the paper retains on people.
const COEFFICIENTS: u16 = 64;

/// Points at which each codec is measured.
const POINTS: usize = 5;

/// AC steps of the paper's profile in voxels, fine to coarse. The paper's 10 mm at 5 mm voxels is the third.
const AC_STEPS_VOXELS: [f64; POINTS] = [0.5, 1.0, 2.0, 4.0, 8.0];

/// DC step over AC step: the paper's 1 mm to 10 mm.
const DC_SHARE: f64 = 0.1;

/// Steps of the trained transform in voxels. It has no DC coefficient to protect: one step serves all.
const UNIFORM_STEPS_VOXELS: [f64; POINTS] = [0.5, 1.0, 2.0, 4.0, 8.0];

/// Steps of profile `main` in voxels; 1.8 is the encoder's default.
const MAIN_STEPS_VOXELS: [f64; POINTS] = [0.75, 1.15, 1.8, 2.9, 4.5];

/// Draco's bits beyond those that make its step a voxel: a mesh needs finer positions than a volume needs voxels.
const BITS_BEYOND_A_VOXEL: [i32; POINTS] = [3, 2, 1, 0, -1];

/// Constant rate factors of textures as video, beside the bits of positions.
const TEXTURE_CRF: [u8; POINTS] = [18, 23, 28, 33, 38];

/// Bits of voxels beyond those that make them isv's: as MPEG's test conditions have 10 bits for people.
const POINT_BITS_BEYOND_A_VOXEL: i32 = 2;

/// Nodes of trisoup: bits beyond those of [`POINT_BITS_BEYOND_A_VOXEL`], and the edge of a node in voxels as a power of two.
const NODES: [(i32, u8); POINTS] = [(1, 2), (1, 3), (1, 4), (0, 4), (0, 5)];

/// Most bits of the coordinates of points.
const MOST_POINT_BITS: i32 = 16;

/// TMC13's quantization parameters of colours with nodes of 4, 8, 16 and 32 voxels.
const COLOUR_QP_OF_NODES: [u8; 4] = [22, 28, 34, 40];

/// TMC13's quantization parameters of colours with an octree of all bits, and of one to four bits less.
const COLOUR_QP_OF_BITS: [u8; POINTS] = [22, 34, 40, 46, 51];

impl Codec {
    /// All of them, in the order of legends and tables.
    pub const ALL: [Self; 23] = [
        Self::Paper(MotionMode::Fixed(Prediction::None)),
        Self::Paper(MotionMode::Fixed(Prediction::ZeroMotion)),
        Self::Paper(MotionMode::Fixed(Prediction::ThreeDof)),
        Self::Paper(MotionMode::Fixed(Prediction::SixDof)),
        Self::Paper(MotionMode::Auto),
        Self::Main(Preset::Realtime),
        Self::Main(Preset::Balanced),
        Self::Main(Preset::Archive),
        Self::Tang(Training::Scene),
        Self::Tang(Training::CrossScene),
        Self::Draco { faces_percent: 100 },
        Self::Draco { faces_percent: 50 },
        Self::Draco { faces_percent: 25 },
        Self::Draco { faces_percent: 10 },
        Self::Draco { faces_percent: 5 },
        Self::DracoVideo { faces_percent: 100 },
        Self::DracoVideo { faces_percent: 25 },
        Self::Gltfpack { faces_percent: 100 },
        Self::Gltfpack { faces_percent: 25 },
        Self::Tmc13(PointGeometry::Octree),
        Self::Tmc13(PointGeometry::Trisoup),
        Self::Tmc2,
        Self::Vdmc,
    ];

    /// Programs of others that it runs: all are needed.
    #[must_use]
    pub fn programs(self) -> &'static [&'static str] {
        match self {
            Self::Paper(_) | Self::Main(_) | Self::Tang(_) => &[],
            Self::Draco { .. } => &Draco::PROGRAMS,
            Self::DracoVideo { .. } => {
                const { &[Draco::PROGRAMS[0], Draco::PROGRAMS[1], TextureVideo::PROGRAM] }
            }
            Self::Gltfpack { .. } => &[Gltfpack::PROGRAM],
            Self::Tmc13(_) => &[Tmc13::PROGRAM],
            Self::Tmc2 => &Tmc2::PROGRAMS,
            Self::Vdmc => &Vdmc::PROGRAMS,
        }
    }

    /// Whether it is isv, in either profile.
    #[must_use]
    pub fn is_isv(self) -> bool {
        matches!(self, Self::Paper(_) | Self::Main(_))
    }

    /// What it is, in a line.
    #[must_use]
    pub fn description(self) -> String {
        match self {
            Self::Main(preset) => format!("isv, profile main, preset {preset}"),
            Self::Paper(MotionMode::Fixed(Prediction::None)) => {
                "isv, profile paper: every frame alone".to_owned()
            }
            Self::Paper(MotionMode::Fixed(Prediction::ZeroMotion)) => {
                "isv, profile paper: difference to the frame before".to_owned()
            }
            Self::Paper(MotionMode::Fixed(Prediction::ThreeDof)) => {
                "isv, profile paper: each block translated".to_owned()
            }
            Self::Paper(MotionMode::Fixed(Prediction::SixDof)) => {
                "isv, profile paper: each block translated and rotated".to_owned()
            }
            Self::Paper(MotionMode::Auto) => {
                "isv, profile paper: the prediction that takes the fewest bytes, a frame".to_owned()
            }
            Self::Tang(Training::Scene) => {
                "Tang et al. 2018, transform trained on this very take; every frame alone; the transform is not counted"
                    .to_owned()
            }
            Self::Tang(Training::CrossScene) => {
                "Tang et al. 2018, transform trained on other takes; every frame alone; the transform is not counted".to_owned()
            }
            Self::Draco { faces_percent: 100 } => "Google Draco, every frame alone".to_owned(),
            Self::Draco { faces_percent } => {
                format!("quadric simplification to {faces_percent} % of the faces, then Draco, every frame alone")
            }
            Self::DracoVideo { faces_percent: 100 } => {
                "Google Draco with texture coordinates, every frame alone, and textures as H.264 video (x264)".to_owned()
            }
            Self::DracoVideo { faces_percent } => {
                format!(
                    "quadric simplification to {faces_percent} % of the faces, then Draco with texture coordinates, every \
                     frame alone, and textures as H.264 video (x264)"
                )
            }
            Self::Gltfpack { faces_percent: 100 } => {
                "meshoptimizer's gltfpack (KHR_mesh_quantization and meshopt compression), then gzip, every frame alone"
                    .to_owned()
            }
            Self::Gltfpack { faces_percent } => {
                format!("quadric simplification to {faces_percent} % of the faces, then gltfpack and gzip, every frame alone")
            }
            Self::Tmc13(PointGeometry::Octree) => {
                "MPEG G-PCC (TMC13), octree: the voxels that the surface passes through, coded without loss, and their colours by RAHT, every frame alone"
                    .to_owned()
            }
            Self::Tmc13(PointGeometry::Trisoup) => {
                "MPEG G-PCC (TMC13), trisoup: the voxels that the surface passes through as triangles in nodes, and their colours by RAHT, every frame alone"
                    .to_owned()
            }
            Self::Tmc2 => {
                "MPEG V-PCC (TMC2), random access: the voxels that the surface passes through, and their colours, as HEVC video, whole takes".to_owned()
            }
            Self::Vdmc => "MPEG V-DMC, all intra: a base mesh and displacements as HEVC video, whole takes".to_owned(),
        }
    }

    /// The points at which it is measured, fine to coarse: `count` of five, evenly spread; fewer where some are the same.
    #[must_use]
    pub fn points(self, scale: Scale, count: usize) -> Vec<OperatingPoint> {
        let count = count.clamp(1, POINTS);
        let picked = |i: usize| {
            if count == 1 { POINTS / 2 } else { (i * (POINTS - 1) + (count - 1) / 2) / (count - 1) }
        };
        let mut points: Vec<_> = (0..count).map(|i| self.point(scale, picked(i))).collect();
        // At the ends of a codec's range, several may be the same.
        points.dedup();
        points
    }

    /// Quantization parameter of TMC13 for the colours at one of its points. Finer geometry has finer colours, as in MPEG's test
    /// conditions of lossy geometry.
    pub(crate) fn colour_qp(scale: Scale, point: OperatingPoint) -> u8 {
        match point {
            OperatingPoint::Nodes { size_log2, .. } => COLOUR_QP_OF_NODES[usize::from(size_log2) - 2],
            OperatingPoint::PositionBits(bits) => {
                let finest = scale.bits(BITS_BEYOND_A_VOXEL[0], MOST_POINT_BITS);
                COLOUR_QP_OF_BITS[usize::from(finest.saturating_sub(bits)).min(POINTS - 1)]
            }
            _ => COLOUR_QP_OF_BITS[0],
        }
    }

    fn point(self, scale: Scale, i: usize) -> OperatingPoint {
        match self {
            Self::Paper(_) => {
                let ac_step_m = AC_STEPS_VOXELS[i] * scale.voxel_m;
                OperatingPoint::Steps {
                    coefficients: COEFFICIENTS,
                    dc_step_m: DC_SHARE * ac_step_m,
                    ac_step_m,
                }
            }
            Self::Main(_) => OperatingPoint::Step { step_m: MAIN_STEPS_VOXELS[i] * scale.voxel_m },
            Self::Tang(_) => OperatingPoint::UniformStep {
                coefficients: COEFFICIENTS,
                step_m: UNIFORM_STEPS_VOXELS[i] * scale.voxel_m,
            },
            Self::Draco { .. } => OperatingPoint::PositionBits(scale.bits(BITS_BEYOND_A_VOXEL[i], 20)),
            Self::DracoVideo { .. } => OperatingPoint::BitsAndVideo {
                bits: scale.bits(BITS_BEYOND_A_VOXEL[i], 20),
                crf: TEXTURE_CRF[i],
            },
            Self::Gltfpack { .. } => OperatingPoint::PositionBits(scale.bits(BITS_BEYOND_A_VOXEL[i], 16)),
            Self::Tmc13(PointGeometry::Octree) => {
                OperatingPoint::PositionBits(scale.bits(BITS_BEYOND_A_VOXEL[i], MOST_POINT_BITS))
            }
            Self::Tmc13(PointGeometry::Trisoup) => {
                let (beyond, size_log2) = NODES[i];
                let bits = scale.bits(POINT_BITS_BEYOND_A_VOXEL + beyond, MOST_POINT_BITS);
                OperatingPoint::Nodes { bits, size_log2 }
            }
            Self::Tmc2 => OperatingPoint::TestRate {
                bits: scale.bits(POINT_BITS_BEYOND_A_VOXEL, 12),
                rate: Tmc2::RATES[i],
            },
            Self::Vdmc => OperatingPoint::TestRate { bits: Vdmc::POSITION_BITS, rate: Vdmc::RATES[i] },
        }
    }
}

impl fmt::Display for Codec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Main(preset) => write!(f, "main-{preset}"),
            Self::Paper(MotionMode::Fixed(Prediction::None)) => f.write_str("paper-intra"),
            Self::Paper(MotionMode::Fixed(Prediction::ZeroMotion)) => f.write_str("paper-zero"),
            Self::Paper(MotionMode::Fixed(Prediction::ThreeDof)) => f.write_str("paper-3dof"),
            Self::Paper(MotionMode::Fixed(Prediction::SixDof)) => f.write_str("paper-6dof"),
            Self::Paper(MotionMode::Auto) => f.write_str("paper-auto"),
            Self::Tang(Training::Scene) => f.write_str("tang-scene"),
            Self::Tang(Training::CrossScene) => f.write_str("tang-cross"),
            Self::Draco { faces_percent: 100 } => f.write_str("draco"),
            Self::Draco { faces_percent } => write!(f, "draco-{faces_percent}"),
            Self::DracoVideo { faces_percent: 100 } => f.write_str("draco-video"),
            Self::DracoVideo { faces_percent } => write!(f, "draco-video-{faces_percent}"),
            Self::Gltfpack { faces_percent: 100 } => f.write_str("gltfpack"),
            Self::Gltfpack { faces_percent } => write!(f, "gltfpack-{faces_percent}"),
            Self::Tmc13(PointGeometry::Octree) => f.write_str("tmc13-octree"),
            Self::Tmc13(PointGeometry::Trisoup) => f.write_str("tmc13-trisoup"),
            Self::Tmc2 => f.write_str("tmc2"),
            Self::Vdmc => f.write_str("vdmc"),
        }
    }
}

impl FromStr for Codec {
    type Err = UnknownCodec;

    fn from_str(name: &str) -> Result<Self, UnknownCodec> {
        let found = Self::ALL.into_iter().find(|codec| codec.to_string() == name);
        found.ok_or_else(|| UnknownCodec(name.to_owned()))
    }
}

/// Writes the point as in file names: `k64-ac10mm`, `k64-step20mm`, `10-bit`.
impl fmt::Display for OperatingPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = |metres: f64| (metres * 1e6).round() / 1e3;
        match *self {
            Self::Steps { coefficients, ac_step_m, .. } => write!(f, "k{coefficients}-ac{}mm", mm(ac_step_m)),
            Self::Step { step_m } => write!(f, "step{}mm", mm(step_m)),
            Self::UniformStep { coefficients, step_m } => write!(f, "k{coefficients}-step{}mm", mm(step_m)),
            Self::PositionBits(bits) => write!(f, "{bits}-bit"),
            Self::BitsAndVideo { bits, crf } => write!(f, "{bits}-bit-crf{crf}"),
            Self::Nodes { bits, size_log2 } => write!(f, "{bits}-bit-node{}", 1u32 << size_log2),
            Self::TestRate { bits, rate } => write!(f, "{bits}-bit-r{rate}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERSON: Scale = Scale { voxel_m: 0.005, extent_m: 1.8 };

    #[test]
    fn names_are_read_as_they_are_written() {
        for codec in Codec::ALL {
            assert_eq!(codec.to_string().parse(), Ok(codec));
        }
        let error = "draco-30".parse::<Codec>().unwrap_err().to_string();
        assert!(error.contains("\"draco-30\"") && error.contains("draco-25, draco-10"), "{error}");
    }

    #[test]
    fn points_run_from_fine_to_coarse() {
        let names = |codec: &str, count| {
            let points = codec.parse::<Codec>().unwrap().points(PERSON, count);
            points.iter().map(OperatingPoint::to_string).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(names("paper-3dof", 5), "k64-ac2.5mm k64-ac5mm k64-ac10mm k64-ac20mm k64-ac40mm");
        assert_eq!(names("paper-3dof", 1), "k64-ac10mm");
        assert_eq!(names("tang-scene", 2), "k64-step2.5mm k64-step40mm");
        assert_eq!(names("draco", 3), "11-bit 9-bit 7-bit");
        assert_eq!(names("tmc13-octree", 3), "11-bit 9-bit 7-bit");
        let qps = |codec: &str| {
            let points = codec.parse::<Codec>().unwrap().points(PERSON, 5);
            points.into_iter().map(|point| Codec::colour_qp(PERSON, point)).collect::<Vec<_>>()
        };
        assert_eq!(qps("tmc13-octree"), [22, 34, 40, 46, 51]);
        assert_eq!(qps("tmc13-trisoup"), [22, 28, 34, 34, 40]);
        let nodes = "11-bit-node4 11-bit-node8 11-bit-node16 10-bit-node16 10-bit-node32";
        assert_eq!(names("tmc13-trisoup", 5), nodes);
        assert_eq!(names("tmc2", 3), "10-bit-r5 10-bit-r3 10-bit-r1");
        assert_eq!(names("draco-25", 9), "11-bit 10-bit 9-bit 8-bit 7-bit");
        let coarse = Scale { voxel_m: 2.0, extent_m: 1.8 };
        assert_eq!(Codec::Draco { faces_percent: 100 }.points(coarse, 5), [OperatingPoint::PositionBits(4)]);
    }

    #[test]
    fn the_papers_own_point_is_among_them() {
        let points = Codec::ALL[2].points(PERSON, 5);
        let OperatingPoint::Steps { coefficients: 64, dc_step_m, ac_step_m } = points[2] else { panic!() };
        assert!((dc_step_m - 0.001).abs() < 1e-12 && (ac_step_m - 0.01).abs() < 1e-12);
    }
}
