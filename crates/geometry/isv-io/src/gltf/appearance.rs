//! The colours of a pose: those of the parts that it shows, one after the other, as their triangles are.

use super::looks::{DecodedImages, Palette};
use super::parts::Part;
use crate::error::Flaw;
use isv_volume::Appearance;
use std::collections::HashMap;

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

/// Puts the colours of parts together, with the images that they show. `None` if they have none and there are no materials. Images that
/// are known are not decoded again.
pub(super) fn assemble<'a>(
    parts: impl Iterator<Item = (&'a Part, Side)> + Clone,
    palette: &Palette,
    known: &DecodedImages,
) -> Result<Option<(Appearance, DecodedImages)>, Flaw> {
    let shown = parts.filter(|(part, side)| *side != Side::Hidden && !part.triangles.is_empty());
    let coloured = shown.clone().any(|(part, _)| !part.colours.is_empty());
    if !coloured && palette.is_empty() {
        return Ok(None);
    }
    let (used, face_materials) = match palette.is_empty() {
        true => Default::default(),
        false => used_materials(shown.clone().flat_map(|(part, _)| &part.materials)),
    };
    let (materials, images) = palette.materials(&used, known)?;
    let textured = materials.iter().any(|material| material.texture.is_some());
    let mut appearance = Appearance { materials, ..Appearance::default() };
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
    }
    if appearance.materials.len() > 1 {
        appearance.face_materials = face_materials;
    }
    Ok(Some((appearance, images)))
}

/// The materials of triangles in the order of their first use, and the place of each triangle's among them.
fn used_materials<'a>(faces: impl Iterator<Item = &'a u16>) -> (Vec<u16>, Vec<u16>) {
    let (mut used, mut places) = (Vec::new(), HashMap::new());
    let place = |material: &u16| {
        *places.entry(*material).or_insert_with(|| {
            used.push(*material);
            (used.len() - 1) as u16
        })
    };
    let faces = faces.map(place).collect();
    (used, faces)
}
