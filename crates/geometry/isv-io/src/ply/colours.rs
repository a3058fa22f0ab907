//! Colours of PLY: of vertices and faces, and texture coordinates of vertices or of the corners of faces.
//!
//! Names are those that MeshLab, Blender and others write; PLY itself has none. Texture coordinates go up, as in OBJ.

use super::header::{Element, Kind, Scalar};
use crate::error::Flaw;
use crate::linked::Linked;
use crate::materials::{Materials, TOO_MANY_MATERIALS, of_face_colours, prefer_textures};
use crate::raw_colours::{RawColours, Scale};
use isv_volume::{Appearance, Material};

/// Names of red, green and blue, the likeliest first.
const COLOURS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];

/// Names of texture coordinates of vertices.
const COORDINATES: [[&str; 2]; 4] =
    [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// The number of a texture coordinate that a corner does not have, and of a texture that a face does not have.
const NONE: u32 = u32::MAX;

/// The scalar properties of the first set of names that an element has all of.
fn find<const N: usize>(element: &Element, sets: &[[&str; N]]) -> Option<[usize; N]> {
    let scalar =
        |name: &str| element.find(name).filter(|i| matches!(element.properties[*i].kind, Kind::Scalar(_)));
    let mut found = sets.iter().map(|names| names.map(scalar));
    found.find_map(|columns| {
        columns.iter().all(Option::is_some).then(|| columns.map(Option::unwrap_or_default))
    })
}

/// The columns of an element's colours, and their scale.
pub(super) fn find_colours(element: &Element) -> Option<([usize; 3], Scale)> {
    let columns = find(element, &COLOURS)?;
    let scale = match element.properties[columns[0]].kind {
        Kind::Scalar(Scalar::U16) => Scale::Short,
        Kind::Scalar(Scalar::F32 | Scalar::F64) => Scale::Unit,
        _ => Scale::Byte,
    };
    Some((columns, scale))
}

/// The columns of the vertices' texture coordinates.
pub(super) fn find_coordinates(element: &Element) -> Option<[usize; 2]> {
    find(element, &COORDINATES)
}

/// Colours of the faces so far.
#[derive(Debug, Default)]
pub(super) struct FaceColours {
    /// Property of a row with the texture coordinates of its corners.
    coordinate_list: Option<usize>,
    /// Property of a row with the number of its texture.
    texture: Option<usize>,
    colour: Option<[usize; 3]>,
    /// Values of the current row.
    row_coordinates: Vec<f32>,
    row_texture: u32,
    row_colour: [f64; 3],
    /// Texture coordinates of all corners that have one.
    coordinates: Vec<[f32; 2]>,
    /// Number of each triangle's texture.
    textures: Vec<u32>,
    colours: Option<RawColours>,
    /// Triangles that have their colour.
    painted: usize,
}

impl FaceColours {
    /// Looks for the properties of an element.
    pub(super) fn new(element: &Element) -> Self {
        let list = element.find("texcoord");
        let number = element.find("texnumber");
        let colours = find_colours(element);
        Self {
            coordinate_list: list.filter(|i| matches!(element.properties[*i].kind, Kind::List { .. })),
            texture: number.filter(|i| matches!(element.properties[*i].kind, Kind::Scalar(_))),
            colour: colours.map(|(columns, _)| columns),
            colours: colours.map(|(_, scale)| RawColours::new(scale, 0)),
            ..Self::default()
        }
    }

    /// Whether a property is looked at.
    pub(super) fn wants(&self, property: usize) -> bool {
        [self.coordinate_list, self.texture].contains(&Some(property))
            || self.colour.is_some_and(|columns| columns.contains(&property))
    }

    /// Takes a value of the current row.
    pub(super) fn value(&mut self, property: usize, value: f64) {
        if self.coordinate_list == Some(property) {
            self.row_coordinates.push(value as f32);
        } else if self.texture == Some(property) {
            self.row_texture = if value >= 0.0 { value as u32 } else { NONE };
        } else if let Some(channel) =
            self.colour.and_then(|columns| columns.iter().position(|column| *column == property))
        {
            self.row_colour[channel] = value;
        }
    }

    /// Whether corners have texture coordinates of their own.
    pub(super) fn has_coordinates(&self) -> bool {
        self.coordinate_list.is_some()
    }

    /// Numbers of the texture coordinates of the current row's corners, of which there are `corners`.
    pub(super) fn numbers(&mut self, corners: usize, numbers: &mut Vec<u32>) {
        numbers.clear();
        if self.row_coordinates.len() != 2 * corners {
            numbers.resize(corners, NONE);
            return;
        }
        for coordinate in self.row_coordinates.as_chunks().0 {
            numbers.push(u32::try_from(self.coordinates.len()).unwrap_or(NONE));
            self.coordinates.push(*coordinate);
        }
    }

    /// Ends a row, whose triangles are those up to a count.
    pub(super) fn end_row(&mut self, triangles: usize) {
        if self.texture.is_some() {
            self.textures.resize(triangles, self.row_texture);
        }
        if let Some(colours) = &mut self.colours {
            (self.painted..triangles).for_each(|_| colours.push(self.row_colour));
        }
        self.painted = triangles;
        self.row_coordinates.clear();
        self.row_texture = 0;
    }
}

/// Everything that a file says of the colours of a mesh.
pub(super) struct Colours<'a> {
    /// Names of the textures.
    pub(super) textures: &'a [String],
    pub(super) of_vertices: Option<RawColours>,
    /// Texture coordinates of vertices, if they have any.
    pub(super) coordinates: Option<Vec<[f32; 2]>>,
    pub(super) of_faces: FaceColours,
}

impl Colours<'_> {
    /// The appearance of triangles whose corners have the texture coordinates of these numbers, if the faces number them. Triangles of
    /// strips come last, and have none. `None` for a file that says nothing of colours.
    pub(super) fn finish(
        self,
        triangles: &[[u32; 3]],
        corners: &[[u32; 3]],
        linked: &mut Linked,
    ) -> Result<Option<Appearance>, Flaw> {
        let vertex_colours = self.of_vertices.map(RawColours::finish).unwrap_or_default();
        let FaceColours { coordinates, textures, colours: face_colours, .. } = self.of_faces;
        let found = |list: &[[f32; 2]], names: &[u32; 3]| {
            let found = names.map(|name| list.get(name as usize));
            match found {
                // Up in the file, down in an image.
                [Some(a), Some(b), Some(c)] => [a, b, c].map(|[u, v]| [*u, 1.0 - *v]),
                _ => [[f32::NAN; 2]; 3],
            }
        };
        let mut texture_coordinates: Vec<_> = match &self.coordinates {
            _ if self.textures.is_empty() => Vec::new(),
            _ if !coordinates.is_empty() => {
                corners.iter().map(|corners| found(&coordinates, corners)).collect()
            }
            Some(coordinates) => triangles.iter().map(|triangle| found(coordinates, triangle)).collect(),
            None => Vec::new(),
        };
        if !texture_coordinates.is_empty() {
            texture_coordinates.resize(triangles.len(), [[f32::NAN; 2]; 3]);
            let numbers = (0..triangles.len()).map(|face| textures.get(face).copied().unwrap_or(0));
            let (face_materials, materials) = load_textures(numbers, self.textures, linked)?;
            let mut appearance =
                Appearance { vertex_colours, texture_coordinates, face_materials, materials };
            prefer_textures(&mut appearance, triangles);
            return Ok(Some(appearance));
        }
        let face_colours = face_colours.filter(|colours| colours.len() > 0 && vertex_colours.is_empty());
        if let Some(mut colours) = face_colours {
            colours.fill(triangles.len());
            let (face_materials, materials) = of_face_colours(&colours.finish());
            return Ok(Some(Appearance { face_materials, materials, ..Appearance::default() }));
        }
        let coloured = !vertex_colours.is_empty();
        Ok(coloured.then(|| Appearance { vertex_colours, ..Appearance::default() }))
    }
}

/// The material of each triangle by the number of its texture, and the materials. A number that no texture has is white.
fn load_textures(
    numbers: impl Iterator<Item = u32>,
    names: &[String],
    linked: &mut Linked,
) -> Result<(Vec<u16>, Vec<Material>), Flaw> {
    let mut materials = Materials::new();
    let mut faces = Vec::new();
    for number in numbers {
        let name = names.get(number as usize);
        let make = || -> Result<Material, Flaw> {
            let image = name.map(|name| linked.image(name)).transpose();
            let texture = image.map_err(|error| Flaw::in_object("TextureFile", number as usize, error))?;
            Ok(Material { texture, ..Material::default() })
        };
        let index = materials.index(name.map(|_| number), make)?;
        faces.push(index.ok_or(Flaw::in_object("mesh", 0, TOO_MANY_MATERIALS))?);
    }
    let materials = materials.into_list();
    Ok((if materials.len() == 1 { Vec::new() } else { faces }, materials))
}
