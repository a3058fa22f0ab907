//! What is decided and found while a take is encoded.

use super::EncodeError;
use crate::Length;
use crate::capture::Remark;
use isv_ingest::{PointEvidence, PointSign, SideEvidence, SignDecision, SignEvidence, SignMode};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

/// A decision or a finding. Its text is a sentence for people, without the names of flags.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum EncodeEvent {
    /// A thing about the capture.
    Capture {
        /// Name of the input.
        name: String,
        /// The thing.
        remark: Remark,
    },
    /// A frame on a pipe comes after one whose name follows its own.
    OutOfOrder {
        /// Name of the frame's file.
        path: PathBuf,
        /// Name of the file before.
        after: PathBuf,
    },
    /// The voxel size that fits points or depth images.
    VoxelFits {
        /// The size.
        voxel: Length,
        /// What it follows from, behind "as".
        why: String,
    },
    /// The voxel size that serves the target best, by trial.
    VoxelChosen {
        /// The size.
        voxel: Length,
        /// Mean error to be expected (mm).
        error_mm: f64,
        /// Rate to be expected (Mbps).
        mbps: f64,
        /// Sample frames that it was tried on.
        samples: usize,
        /// The smallest and the largest size tried.
        tried: [Length; 2],
    },
    /// How meshes' inside is told from outside.
    Sign {
        /// What was decided.
        decision: SignDecision,
        /// What was seen of the first frame.
        evidence: SignEvidence,
        /// What was asked for.
        mode: SignMode,
    },
    /// How points' inside is told from outside.
    PointSign {
        /// What was decided.
        decision: PointSign,
        /// What was seen of the first frame.
        evidence: PointEvidence,
        /// What was asked for.
        mode: SignMode,
    },
    /// What the sides of estimated normals rest on.
    Sides {
        /// Name of the frame.
        name: String,
        /// The evidence.
        sides: SideEvidence,
    },
    /// A viewpoint was given for points that have normals.
    ViewpointUnused {
        /// Name of the frame.
        name: String,
    },
    /// Faces disagreed on which side is outside, and were made to agree.
    FacesTurned {
        /// Name of the frame.
        name: String,
    },
    /// An open surface has fewer faces than blocks of 8 x 8 x 8 voxels.
    LargeFaces {
        /// Name of the frame.
        name: String,
        /// Triangles of the frame.
        faces: usize,
        /// Blocks of its volume.
        blocks: usize,
    },
    /// A frame has an open part, and frames before had none.
    OpenPart {
        /// Name of the frame.
        name: String,
        /// Share of the surface in open parts.
        share: f64,
    },
    /// A part of a frame's surface cannot be kept.
    SurfaceLost {
        /// Name of the frame.
        name: String,
        /// Share of the surface.
        share: f64,
        /// Whether open parts are kept as single sheets.
        has_sheets: bool,
    },
    /// A frame is smaller than a block.
    Tiny {
        /// Name of the frame.
        name: String,
        /// Diagonal of its bounding box.
        diagonal: Length,
    },
    /// A frame has no surface.
    NoSurface {
        /// Name of the frame.
        name: String,
    },
    /// Coding has left nothing of a frame's surface.
    NothingLeft {
        /// Number of the frame.
        frame: usize,
    },
    /// A frame has colours that are not coded, as the first one had none.
    ColourComesLater {
        /// Name of the frame.
        name: String,
    },
    /// A frame was left out.
    Skipped {
        /// What was wrong with it.
        why: Arc<EncodeError>,
    },
    /// A frame could not be brought within the error asked for.
    ErrorMissed {
        /// Number of the frame.
        frame: usize,
        /// Error that it has.
        error: Length,
        /// Error asked for.
        bound: Length,
    },
}

impl EncodeEvent {
    /// Whether the result may not be what its user wants.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        match self {
            Self::VoxelFits { .. }
            | Self::VoxelChosen { .. }
            | Self::Sign { .. }
            | Self::OpenPart { .. }
            | Self::LargeFaces { .. }
            | Self::PointSign { .. } => false,
            Self::Sides { sides, .. } => !sides.is_usable(),
            Self::Capture { remark, .. } => !matches!(
                remark,
                Remark::Note(_)
                    | Remark::Animations { .. }
                    | Remark::StillAtFirst { .. }
                    | Remark::Undistorted
                    | Remark::TimeUnit { .. }
            ),
            _ => true,
        }
    }
}

impl fmt::Display for EncodeEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capture { name, remark } => write!(f, "{name}: {remark}"),
            Self::OutOfOrder { path, after } => write!(
                f,
                "standard input: {} comes after {}: frames are taken as they come, not by name (tar has --sort=name)",
                path.display(),
                after.display()
            ),
            Self::VoxelFits { voxel, why } => write!(f, "voxels of {voxel}, as {why}"),
            Self::VoxelChosen { voxel, error_mm, mbps, samples, tried: [least, most] } => write!(
                f,
                "voxels of {voxel}: about {error_mm:.2} mm at {mbps:.2} Mbps of geometry by {samples} sample frames, the best of {least} \
                 to {most}"
            ),
            Self::Sign { decision: SignDecision::Sheet, evidence, mode: SignMode::Auto } => {
                let open = 100.0 * evidence.open_share;
                write!(f, "{} ({open:.0} % of the first frame is in open parts)", SignDecision::Sheet)
            }
            Self::Sign { decision, evidence, mode: SignMode::Auto | SignMode::Paper } => {
                let closed = 100.0 * evidence.closed_share;
                write!(f, "{decision} ({closed:.0} % of the first frame looks closed)")
            }
            Self::Sign { decision, .. } => write!(f, "{decision} (as asked for)"),
            Self::PointSign { decision, evidence, mode } => match (mode, decision) {
                (SignMode::Auto | SignMode::Paper, _) => write!(f, "{decision} ({evidence})"),
                (_, PointSign::Oriented) => write!(f, "{decision} (as asked for; {evidence})"),
                (SignMode::Sheet, PointSign::Offset) => {
                    write!(f, "offset shell around the points: sheets are of meshes alone ({evidence})")
                }
                (_, PointSign::Offset) => {
                    write!(f, "offset shell around the points (as asked for; {evidence})")
                }
            },
            Self::Sides { name, sides } => write!(f, "{name}: {sides}"),
            Self::ViewpointUnused { name } => {
                write!(f, "{name}: the viewpoint is without effect, as the points have normals")
            }
            Self::FacesTurned { name } => {
                write!(f, "{name}: faces disagree on which side is outside, and are made to agree")
            }
            Self::LargeFaces { name, faces, blocks } => write!(
                f,
                "{name}: {faces} triangles in {blocks} blocks of voxels: a codec of meshes, such as Draco, takes fewer bytes for large, flat triangles"
            ),
            Self::OpenPart { name, share } => write!(
                f,
                "{name}: {:.1} % of the surface is in open parts, which are single sheets from here on",
                100.0 * share
            ),
            Self::SurfaceLost { name, share, has_sheets } => {
                let what = if *has_sheets { "" } else { "open, or " };
                write!(
                    f,
                    "{name}: {:.1} % of the surface is {what}thinner than a voxel, and is lost",
                    100.0 * share
                )
            }
            Self::Tiny { name, diagonal } => {
                write!(f, "{name}: only {diagonal} across, less than a block")
            }
            Self::NoSurface { name } => write!(f, "{name}: no surface in this frame"),
            Self::NothingLeft { frame } => write!(
                f,
                "frame {frame}: nothing of its surface is left: smaller voxels or a higher quality keep it"
            ),
            Self::ColourComesLater { name } => write!(
                f,
                "{name}: its colours are not kept, as the first frame has none; --expect-colour makes room for them"
            ),
            Self::Skipped { why } => write!(f, "skipped: {why}"),
            Self::ErrorMissed { frame, error, bound } => write!(
                f,
                "frame {frame}: {error} from what was captured even with the finest step, not {bound}"
            ),
        }
    }
}
