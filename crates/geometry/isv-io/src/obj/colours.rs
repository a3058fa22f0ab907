//! Colours of OBJ: colours of vertices, texture coordinates of corners, and the materials of faces.

use super::mtl::{self, Mtl};
use crate::error::{Flaw, Malformation, quote};
use crate::linked::Linked;
use crate::materials::{Materials, TOO_MANY_MATERIALS};
use crate::raw_colours::{RawColours, Scale};
use crate::text::{first_word, parse_float, parse_word, words};
use isv_volume::{Appearance, Material, Rgb};
use std::collections::{HashMap, HashSet};

/// The number of a texture coordinate that a corner does not have, and of a material that a face does not have.
pub(super) const NONE: u32 = u32::MAX;

/// Colours of the records so far.
#[derive(Debug)]
pub(super) struct Colours {
    vertices: RawColours,
    coordinates: Vec<[f32; 2]>,
    /// The rest of each `mtllib` line.
    libraries: Vec<Vec<u8>>,
    /// Names that `usemtl` has given, and their numbers.
    names: HashMap<String, u32>,
    current: u32,
    /// The material of each triangle so far, as a number of `names`.
    faces: Vec<u32>,
}

impl Colours {
    pub(super) fn new() -> Self {
        Self {
            vertices: RawColours::new(Scale::Unit, 0),
            coordinates: Vec::new(),
            libraries: Vec::new(),
            names: HashMap::new(),
            current: NONE,
            faces: Vec::new(),
        }
    }

    /// Takes what follows a vertex's coordinates: `r g b`, with or without alpha. Fewer numbers are a weight.
    pub(super) fn vertex<'a>(&mut self, vertex: usize, mut rest: impl Iterator<Item = &'a [u8]>) {
        let mut number = || rest.next().and_then(parse_float);
        if let (Some(red), Some(green), Some(blue)) = (number(), number(), number()) {
            self.vertices.fill(vertex);
            self.vertices.push([red, green, blue]);
        }
    }

    /// Takes `vt u v`; a coordinate that is missing is 0, one that is no number is not known.
    pub(super) fn coordinate<'a>(&mut self, mut rest: impl Iterator<Item = &'a [u8]>) {
        let mut number = || rest.next().map_or(0.0, |word| parse_float(word).unwrap_or(f64::NAN) as f32);
        self.coordinates.push([number(), number()]);
    }

    /// Takes `mtllib` or `usemtl`, whose line is given without its comment cut off: `#` may be in a name.
    pub(super) fn names(&mut self, line: &[u8]) {
        match first_word(line) {
            Some((b"mtllib", rest)) => self.libraries.push(rest.to_vec()),
            Some((b"usemtl", rest)) => {
                let next = self.names.len() as u32;
                self.current = *self.names.entry(mtl::name(rest)).or_insert(next);
            }
            _ => {}
        }
    }

    /// Number of the texture coordinate of a corner `v/vt` or `v/vt/vn`; [`NONE`] without one.
    pub(super) fn coordinate_of_corner(&self, corner: &[u8]) -> u32 {
        let number: Option<i64> = corner.split(|b| *b == b'/').nth(1).and_then(parse_word);
        let index = match number {
            Some(number @ 1..) => number.checked_sub(1),
            Some(number @ ..=-1) => number.checked_add(self.coordinates.len() as i64),
            _ => None,
        };
        index.and_then(|index| u32::try_from(index).ok()).unwrap_or(NONE)
    }

    /// Gives triangles, up to a count, the material in use.
    pub(super) fn paint(&mut self, triangles: usize) {
        self.faces.resize(triangles, self.current);
    }

    /// The colours of `count` vertices; none if the file has none.
    pub(super) fn of_vertices(self, count: usize) -> Vec<Rgb> {
        finish(self.vertices, count)
    }

    /// The appearance of a mesh of `vertices`, whose triangles' corners have the texture coordinates of these numbers. `None` for a
    /// file that says nothing of colours.
    pub(super) fn finish(
        self,
        vertices: usize,
        corners: &[[u32; 3]],
        linked: &mut Linked,
    ) -> Result<Option<Appearance>, Flaw> {
        let library = self.load_libraries(linked)?;
        let mut found: Vec<Option<&Mtl>> = vec![None; self.names.len()];
        for (name, number) in &self.names {
            found[*number as usize] = library.get(name);
        }
        let of_face = |face: u32| found.get(face as usize).copied().flatten();
        let vertex_colours = finish(self.vertices, vertices);
        if self.faces.iter().all(|face| of_face(*face).is_none()) {
            let coloured = !vertex_colours.is_empty();
            return Ok(coloured.then(|| Appearance { vertex_colours, ..Appearance::default() }));
        }
        let mut materials = Materials::new();
        let mut face_materials = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            let material = of_face(*face);
            // Faces without a material that is known share one, which is white.
            let key = material.map(|_| *face);
            let make = || material.map_or(Ok(Material::default()), |material| load(material, *face, linked));
            let index = materials.index(key, make)?;
            face_materials.push(index.ok_or(Flaw::in_object("mesh", 0, TOO_MANY_MATERIALS))?);
        }
        let textured = materials.list().iter().any(|material| material.texture.is_some());
        let place = |(corners, face): (&[u32; 3], &u32)| {
            let corners = corners.map(|corner| self.coordinates.get(corner as usize));
            match (of_face(*face).and_then(|material| material.map.as_ref()), corners) {
                (Some(map), [Some(a), Some(b), Some(c)]) => [a, b, c].map(|corner| map.place(*corner)),
                _ => [[f32::NAN; 2]; 3],
            }
        };
        let texture_coordinates =
            if textured { corners.iter().zip(&self.faces).map(place).collect() } else { Vec::new() };
        let materials = materials.into_list();
        if materials.len() == 1 {
            face_materials = Vec::new();
        }
        Ok(Some(Appearance { vertex_colours, texture_coordinates, face_materials, materials }))
    }

    /// The materials of all libraries, by name. A library that is not there has none; one whose name leads out of the folder is an
    /// error.
    fn load_libraries(&self, linked: &Linked) -> Result<HashMap<String, Mtl>, Flaw> {
        let (mut materials, mut read) = (HashMap::new(), HashSet::new());
        for (index, rest) in self.libraries.iter().enumerate() {
            // One name with blanks, or several names.
            let whole = vec![mtl::name(rest)];
            let each: Vec<String> = words(rest).map(mtl::name).collect();
            for name in if linked.is_there(&whole[0]) { whole } else { each } {
                if read.contains(&name) {
                    continue;
                }
                let bytes = linked.read_if_there(&name).map_err(|fault| {
                    let name = quote(name.as_bytes());
                    Flaw::in_object("mtllib", index, Malformation::Library { name, fault: Box::new(fault) })
                })?;
                for material in mtl::parse(&bytes.unwrap_or_default()) {
                    materials.entry(material.name.clone()).or_insert(material);
                }
                read.insert(name);
            }
        }
        Ok(materials)
    }
}

fn finish(mut colours: RawColours, vertices: usize) -> Vec<Rgb> {
    if colours.len() > 0 {
        colours.fill(vertices);
    }
    colours.finish()
}

/// A material with its texture. Black under a texture is white: programs write it that leave the colour to the texture.
fn load(material: &Mtl, number: u32, linked: &mut Linked) -> Result<Material, Flaw> {
    let Some(map) = &material.map else {
        let base_colour = material.diffuse.unwrap_or([1.0; 3]);
        return Ok(Material { base_colour, ..Material::default() });
    };
    let image = linked.image(&map.file);
    let image = image.map_err(|error| Flaw::in_object("material", number as usize, error))?;
    let base_colour = material.diffuse.filter(|colour| *colour != [0.0; 3]).unwrap_or([1.0; 3]);
    Ok(Material { base_colour, texture: Some(image), wrap: [map.wrap; 2] })
}
