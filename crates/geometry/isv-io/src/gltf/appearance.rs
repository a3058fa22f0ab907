//! The colours of a pose: those of the parts that it shows, one after the other, as their triangles are.

use super::parts::Part;
use isv_volume::{Appearance, Material};

/// A part in a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Scaled to nothing.
    Hidden,
    /// Triangles as in the file.
    Front,
    /// Triangles turned over, by a transform that mirrors.
    Turned,
}

/// Puts the colours of parts together. `None` if they have none and there are no materials.
pub(super) fn assemble<'a>(
    parts: impl Iterator<Item = (&'a Part, Side)> + Clone,
    materials: &[Material],
) -> Option<Appearance> {
    let shown = parts.filter(|(part, side)| *side != Side::Hidden && !part.triangles.is_empty());
    let coloured = shown.clone().any(|(part, _)| !part.colours.is_empty());
    let textured = materials.iter().any(|material| material.texture.is_some());
    if !coloured && materials.is_empty() {
        return None;
    }
    let mut appearance = Appearance { materials: materials.to_vec(), ..Appearance::default() };
    for (part, side) in shown {
        if coloured {
            let end = appearance.vertex_colours.len() + part.positions.len();
            appearance.vertex_colours.extend(&part.colours);
            // Parts without colours are white beside others.
            appearance.vertex_colours.resize(end, [255; 3]);
        }
        if textured {
            appearance.texture_coordinates.extend(part.coordinates.iter().map(|[a, b, c]| match side {
                Side::Turned => [*a, *c, *b],
                _ => [*a, *b, *c],
            }));
        }
        if materials.len() > 1 {
            appearance.face_materials.extend(&part.materials);
        }
    }
    Some(appearance)
}
