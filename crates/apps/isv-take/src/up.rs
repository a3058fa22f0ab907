//! The axis of coordinates that points up.

use glam::DMat3;

/// The axis that points up in an input, an output or a picture. Streams are Y up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Up {
    /// Y, as in most meshes and in glTF
    #[default]
    Y,
    /// Z, as in Blender, CAD, surveys and ROS
    Z,
    /// X
    X,
    /// Down is Y, as in the frame of a depth camera
    MinusY,
    /// Down is Z
    MinusZ,
    /// Down is X
    MinusX,
}

impl Up {
    /// All axes.
    pub const ALL: [Self; 6] = [Self::Y, Self::Z, Self::X, Self::MinusY, Self::MinusZ, Self::MinusX];

    /// The name on the command line, and in the address of the player's page.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
            Self::X => "x",
            Self::MinusY => "-y",
            Self::MinusZ => "-z",
            Self::MinusX => "-x",
        }
    }

    /// The rotation that takes coordinates with this axis up to coordinates with Y up; its transpose takes them back.
    ///
    /// Z up follows the convention of glTF exporters: (x, y, z) becomes (x, z, -y). Entries are 0, 1 and -1, so the turn is exact.
    #[must_use]
    pub fn to_y_up(self) -> DMat3 {
        let rows = match self {
            Self::Y => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Self::Z => [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
            Self::X => [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
            Self::MinusY => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
            Self::MinusZ => [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
            Self::MinusX => [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        };
        DMat3::from_cols_array_2d(&rows).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn each_axis_turns_to_y_and_nothing_is_mirrored() {
        let axes = [DVec3::Y, DVec3::Z, DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z, DVec3::NEG_X];
        for (up, axis) in Up::ALL.iter().zip(axes) {
            assert_eq!(up.to_y_up() * axis, DVec3::Y, "{up:?}");
            assert_eq!(up.to_y_up().determinant(), 1.0, "{up:?}");
        }
        assert_eq!(Up::Z.to_y_up() * DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 3.0, -2.0));
    }
}
