//! The materials of a mesh while its file is read.

use crate::Malformation;
use isv_volume::{Appearance, Material, Rgb, linear_from_srgb};
use std::collections::HashMap;
use std::convert::Infallible;
use std::hash::Hash;

/// Most materials of a mesh: a face names its own in 16 bits.
const MAX_MATERIALS: usize = 1 << 16;

const WHITE: Rgb = [255; 3];

/// Refusal of a mesh with more materials.
pub(crate) const TOO_MANY_MATERIALS: Malformation = Malformation::TooManyMaterials { limit: MAX_MATERIALS };

/// Materials in the order of their first use, by what the file calls them.
#[derive(Debug)]
pub(crate) struct Materials<K, M = Material> {
    places: HashMap<K, u16>,
    list: Vec<M>,
}

impl<K: Eq + Hash, M> Materials<K, M> {
    pub(crate) fn new() -> Self {
        Self { places: HashMap::new(), list: Vec::new() }
    }

    /// Index of the material of a key, which is made at its first use; `None` if there are too many.
    pub(crate) fn index<E>(&mut self, key: K, make: impl FnOnce() -> Result<M, E>) -> Result<Option<u16>, E> {
        if let Some(place) = self.places.get(&key) {
            return Ok(Some(*place));
        }
        if self.list.len() == MAX_MATERIALS {
            return Ok(None);
        }
        let place = self.list.len() as u16;
        self.list.push(make()?);
        self.places.insert(key, place);
        Ok(Some(place))
    }

    /// The materials so far.
    pub(crate) fn list(&self) -> &[M] {
        &self.list
    }

    pub(crate) fn into_list(self) -> Vec<M> {
        self.list
    }
}

/// Takes the colours of vertices away where a texture shows. Programs that write both mean either of them whole, in formats that do not
/// say that they are multiplied.
pub(crate) fn prefer_textures(appearance: &mut Appearance, triangles: &[[u32; 3]]) {
    let Appearance { vertex_colours, texture_coordinates, face_materials, materials } = appearance;
    if vertex_colours.is_empty() {
        return;
    }
    for (face, (triangle, corners)) in triangles.iter().zip(texture_coordinates).enumerate() {
        let material = face_materials.get(face).copied().unwrap_or_default();
        if materials[usize::from(material)].texture.is_some() && !corners[0][0].is_nan() {
            triangle.iter().for_each(|vertex| vertex_colours[*vertex as usize] = WHITE);
        }
    }
    if vertex_colours.iter().all(|colour| *colour == WHITE) {
        vertex_colours.clear();
    }
}

/// Materials for the colours of faces, and the material of each. Where faces have more colours than there can be materials, the lower
/// three bits of each channel are rounded away.
pub(crate) fn of_face_colours(colours: &[Rgb]) -> (Vec<u16>, Vec<Material>) {
    let exact = palette(colours.iter().copied());
    exact.or_else(|| palette(colours.iter().map(|colour| colour.map(coarse)))).unwrap_or_default()
}

/// The nearest of 32 levels.
fn coarse(value: u8) -> u8 {
    (((u32::from(value) * 31 + 127) / 255) * 255 / 31) as u8
}

/// `None` if there are too many colours.
fn palette(colours: impl Iterator<Item = Rgb>) -> Option<(Vec<u16>, Vec<Material>)> {
    let mut materials = Materials::new();
    let material = |colour: Rgb| Material {
        base_colour: colour.map(|value| linear_from_srgb(f32::from(value) / 255.0)),
        ..Material::default()
    };
    let index = |colour| materials.index(colour, || Ok::<_, Infallible>(material(colour))).unwrap_or(None);
    let faces = colours.map(index).collect::<Option<Vec<u16>>>()?;
    Some((faces, materials.into_list()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_one_colour_share_a_material() {
        let (faces, materials) = of_face_colours(&[[255, 0, 0], [0, 7, 9], [255, 0, 0]]);
        assert_eq!((faces, materials.len()), (vec![0, 1, 0], 2));
        assert_eq!(materials[1].colour([0.0; 2]).map(|value| value.round() as u8), [0, 7, 9]);
    }

    #[test]
    fn more_colours_than_materials_become_coarser() {
        let colours: Vec<Rgb> = (0..70_000u32).map(|i| [i as u8, (i >> 8) as u8, (i >> 16) as u8]).collect();
        let (faces, materials) = of_face_colours(&colours);
        assert_eq!(faces.len(), colours.len());
        assert!(materials.len() <= 1 << 15);
        for (colour, face) in colours.iter().zip(faces) {
            let found = materials[usize::from(face)].colour([0.0; 2]);
            assert!((0..3).all(|i| (found[i] - f32::from(colour[i])).abs() < 6.0), "{colour:?} {found:?}");
        }
    }
}
