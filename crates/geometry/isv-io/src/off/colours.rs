//! Colours of OFF: of vertices, `r g b a` in files whose keyword has a `C`, and of faces, behind their corners.

use super::Variant;
use crate::materials::of_face_colours;
use crate::raw_colours::{RawColours, Scale};
use crate::text::parse_float;
use isv_volume::Appearance;
use std::sync::Arc;

/// The colours of the rows so far.
pub(super) struct Colours {
    /// Whether they are asked for.
    keeps: bool,
    vertices: RawColours,
    /// Colours of triangles, and whether one of them is known.
    faces: RawColours,
    any_face: bool,
}

impl Colours {
    pub(super) fn new(keeps: bool) -> Self {
        let none = || RawColours::new(Scale::Unit, 0);
        Self { keeps, vertices: none(), faces: none(), any_face: false }
    }

    /// Takes what follows a vertex's position.
    pub(super) fn vertex<'a>(&mut self, variant: Variant, rest: impl Iterator<Item = &'a [u8]>) {
        if self.keeps && variant.colours {
            let colour = colour(rest.skip(if variant.normals { 3 } else { 0 }));
            self.vertices.push(colour.unwrap_or([f64::NAN; 3]));
        }
    }

    /// Takes what follows a face's corners, for its triangles, which are those up to a count. One value is a place in a table of colours,
    /// which nobody has.
    pub(super) fn face<'a>(&mut self, rest: impl Iterator<Item = &'a [u8]>, triangles: usize) {
        if self.keeps {
            let colour = colour(rest);
            self.any_face |= colour.is_some();
            for _ in self.faces.len()..triangles {
                self.faces.push(colour.unwrap_or([f64::NAN; 3]));
            }
        }
    }

    /// The appearance of a mesh: the colours of vertices, or else those of faces; none without either.
    pub(super) fn finish(self, triangles: usize) -> Option<Arc<Appearance>> {
        if self.vertices.len() > 0 {
            let vertex_colours = self.vertices.finish();
            return Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
        }
        if !self.any_face || triangles == 0 {
            return None;
        }
        let (face_materials, materials) = of_face_colours(&self.faces.finish());
        Some(Arc::new(Appearance { face_materials, materials, ..Appearance::default() }))
    }
}

/// Red, green and blue; none if there are fewer numbers.
fn colour<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<[f64; 3]> {
    let mut number = || words.next().and_then(parse_float);
    Some([number()?, number()?, number()?])
}
