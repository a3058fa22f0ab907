//! What options leave open of a take, decided once for pieces of it that are encoded apart.

use super::{EncodeError, EncodeOptions, Job, VoxelChoice, Watch};
use crate::capture::{Capture, Content, ContentKind};
use crate::{Input, Observer, OpenDevice};
use isv_format::StreamHeader;
use isv_ingest::{MeshIngest, SignDecision, SignMode, decide_sign, turn_faces};
use isv_io::Geometry;
use std::ops::Range;
use std::sync::Arc;

/// Decisions that hold for all of a take.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Settled {
    /// Frames to encode, by their numbers in the capture.
    pub frames: Range<usize>,
    /// What the stream states for all frames, the place of colour among it.
    pub header: StreamHeader,
    /// What frames are.
    pub content: ContentKind,
    /// How inside is told from outside of meshes; `None` of what has no mesh.
    pub sign: Option<SignMode>,
    /// Quality that goes with a voxel size chosen by trial.
    pub quality: Option<f32>,
    /// Whether a frame can be read after one that cannot.
    pub frames_stand_alone: bool,
}

/// Decides what options leave open of a capture, as encoding it would. Meshes are looked at every so many
/// frames. One with an open part among them makes sheets of all, as it would where encoding came to it.
///
/// # Errors
/// See [`EncodeError`].
///
/// # Panics
/// If `every` is 0.
pub fn settle(
    input: &Input,
    options: &EncodeOptions,
    every: usize,
    observer: &Arc<dyn Observer>,
    watch: &mut dyn Watch,
) -> Result<Settled, EncodeError> {
    let open = || Ok::<_, EncodeError>(Capture::open(input, &options.hints(observer)?)?);
    let capture = open()?;
    capture.counted()?;
    let (frames, content) = (capture.range(options.frames)?, capture.content());
    let frames_stand_alone = capture.frames_stand_alone();
    let job = Job::prepare(capture, options, || Ok(OpenDevice::CPU), observer, watch)?;
    let header = *job.header();
    let is_by_trial = options.voxel == VoxelChoice::Auto;
    let quality = is_by_trial.then(|| job.settings().main.quality.to_quality());
    let ingest = options.fields.mesh_ingest(header.grid, options.profile_choice());
    let sign = match ingest.sign {
        SignMode::Auto | SignMode::Paper => {
            let numbers = frames.clone().step_by(every);
            let meshes = numbers.filter_map(|number| {
                let skips = options.skip_bad_frames && frames_stand_alone;
                let read = open().and_then(|capture| Ok(capture.read(number..number + 1)?.next()));
                match read {
                    Ok(frame) => {
                        frame.map(|frame| frame.map_err(EncodeError::from)).filter(|f| !skips || f.is_ok())
                    }
                    Err(error) => Some(Err(error)),
                }
            });
            sign_of(meshes, &ingest)?
        }
        given => Some(given),
    };
    Ok(Settled { frames, header, content, sign, quality, frames_stand_alone })
}

/// The sign of the meshes among frames: that of the first, or sheets if a later one has an open part.
fn sign_of(
    frames: impl Iterator<Item = Result<crate::capture::CapturedFrame, EncodeError>>,
    ingest: &MeshIngest,
) -> Result<Option<SignMode>, EncodeError> {
    let mut sign = None;
    for frame in frames {
        let Content::Geometry(Geometry::Mesh(mesh)) = frame?.content else { return Ok(None) };
        if mesh.triangles.is_empty() {
            continue;
        }
        let found = match decide_sign(&turn_faces(&mesh), ingest.sign).0 {
            SignDecision::Closed { .. } => SignMode::Closed,
            SignDecision::Offset => SignMode::Offset,
            SignDecision::Sheet => SignMode::Sheet,
        };
        if found == SignMode::Sheet || ingest.sign == SignMode::Paper {
            return Ok(Some(found));
        }
        sign = Some(found);
    }
    Ok(sign)
}
