//! What blocks that are not exact are shown as. A decoder may do as it likes there: nothing that is exact follows from them.
//!
//! A resilient frame's bytes are right whatever was lost. Its vectors lead to the frame before. If that frame is missing, they
//! are led on as far again, to the one before it, as if all had moved on evenly.

use super::{BlockMode, Vector};

/// Frames that a vector leads over at most: nothing moves evenly for longer.
const LONGEST_LEAD: u16 = 4;

/// Changes the modes of a frame that is predicted from a volume kept over a loss. `missing`: how many frames are, in between; after
/// none nothing changes.
pub(crate) fn lead_over_loss(modes: &mut [BlockMode], missing: u16) {
    let frames = missing.saturating_add(1).min(LONGEST_LEAD) as i16;
    for mode in modes.iter_mut().filter(|_| frames > 1) {
        if let Some(Vector(vector)) = mode.vector() {
            let vector = vector.map(|v| (v * frames).clamp(-Vector::LIMIT, Vector::LIMIT));
            *mode = BlockMode::New { vector: Vector(vector) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_lead_over_missing_frames_within_their_range() {
        let modes = [
            BlockMode::Spatial,
            BlockMode::New { vector: Vector([3, -5, 0]) },
            BlockMode::Merged { candidate: 1, vector: Vector([100, -128, 31]) },
        ];
        let led = |missing| {
            let mut modes = modes;
            lead_over_loss(&mut modes, missing);
            modes.map(BlockMode::vector)
        };
        let vectors = |a, b| [None, Some(Vector(a)), Some(Vector(b))];
        assert_eq!(led(0), modes.map(BlockMode::vector));
        assert_eq!(led(1), vectors([6, -10, 0], [128, -128, 62]));
        assert_eq!(led(3), vectors([12, -20, 0], [128, -128, 124]));
        assert_eq!(led(u16::MAX), led(3));
    }
}
