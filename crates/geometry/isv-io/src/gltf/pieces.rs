//! A mesh as the primitives of glTF: one for each material, whose vertices have a texture coordinate each.

use super::encoding::{Remapped, in_order};
use glam::{DVec3, Vec3};
use isv_volume::{Appearance, Material, Rgb, TriangleMesh};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io;

/// The vertices and triangles of a primitive. Lists of attributes are empty or as long as the vertices.
#[derive(Debug)]
pub(super) struct Piece<'a> {
    pub(super) vertices: Cow<'a, [DVec3]>,
    pub(super) triangles: Cow<'a, [[u32; 3]]>,
    pub(super) normals: Cow<'a, [Vec3]>,
    pub(super) colours: Cow<'a, [Rgb]>,
    /// Texture coordinates; never without a texture.
    pub(super) coordinates: Vec<[f32; 2]>,
    /// Material; white without one.
    pub(super) material: Option<Material>,
}

impl<'a> Piece<'a> {
    /// Splits a mesh by its materials. Triangles without texture coordinates get a material without texture.
    pub(super) fn split(mesh: &'a TriangleMesh, normals: &'a [Vec3]) -> Vec<Self> {
        let whole = |material: Option<Material>, colours: &'a [Rgb]| Piece {
            vertices: (&mesh.vertices).into(),
            triangles: (&mesh.triangles).into(),
            normals: normals.into(),
            colours: colours.into(),
            coordinates: Vec::new(),
            material,
        };
        let Some(appearance) = mesh.appearance.as_deref() else { return vec![whole(None, &[])] };
        let is_textured = |material: &Material| material.texture.is_some();
        if appearance.materials.len() <= 1 && !appearance.materials.iter().any(is_textured) {
            return vec![whole(appearance.materials.first().cloned(), &appearance.vertex_colours)];
        }
        let mut faces: BTreeMap<(u16, bool), Vec<usize>> = BTreeMap::new();
        for face in 0..mesh.triangles.len() {
            let material = appearance.face_materials.get(face).copied().unwrap_or(0);
            let textured = is_textured(&appearance.materials[usize::from(material)])
                && coordinates_of(appearance, face).is_some();
            faces.entry((material, textured)).or_default().push(face);
        }
        let pieces = faces.into_iter().map(|((material, textured), faces)| {
            let mut material = appearance.materials[usize::from(material)].clone();
            if !textured {
                material.texture = None;
            }
            Self::of_faces(mesh, normals, appearance, &faces, material)
        });
        pieces.collect()
    }

    /// The triangles of some faces, and their vertices, once for each texture coordinate that they have.
    fn of_faces(
        mesh: &TriangleMesh,
        normals: &[Vec3],
        appearance: &Appearance,
        faces: &[usize],
        material: Material,
    ) -> Self {
        let textured = material.texture.is_some();
        let mut places: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        let (mut vertices, mut coordinates, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for &face in faces {
            let corners = coordinates_of(appearance, face).filter(|_| textured).unwrap_or_default();
            triangles.push([0, 1, 2].map(|i| {
                let (vertex, coordinate) = (mesh.triangles[face][i], corners[i]);
                *places.entry((vertex, coordinate.map(f32::to_bits))).or_insert_with(|| {
                    vertices.push(vertex);
                    coordinates.push(coordinate);
                    (vertices.len() - 1) as u32
                })
            }));
        }
        if !textured {
            coordinates.clear();
        }
        Self {
            vertices: vertices.iter().map(|v| mesh.vertices[*v as usize]).collect(),
            triangles: triangles.into(),
            normals: picked(normals, &vertices).into(),
            colours: picked(&appearance.vertex_colours, &vertices).into(),
            coordinates,
            material: Some(material),
        }
    }

    /// Orders triangles and vertices as compression needs them.
    pub(super) fn in_order(self) -> io::Result<Piece<'static>> {
        let Remapped { triangles, vertices } = in_order(&self.triangles, self.vertices.len())?;
        Ok(Piece {
            vertices: picked(&self.vertices, &vertices).into(),
            triangles: triangles.into(),
            normals: picked(&self.normals, &vertices).into(),
            colours: picked(&self.colours, &vertices).into(),
            coordinates: picked(&self.coordinates, &vertices),
            material: self.material,
        })
    }
}

/// Texture coordinates of a face, if it has any: glTF cannot say that it has none.
fn coordinates_of(appearance: &Appearance, face: usize) -> Option<[[f32; 2]; 3]> {
    let corners = appearance.texture_coordinates.get(face)?;
    corners.as_flattened().iter().all(|value| value.is_finite()).then_some(*corners)
}

/// The entries of a list at some places; none of an empty list.
fn picked<T: Copy>(list: &[T], places: &[u32]) -> Vec<T> {
    if list.is_empty() { Vec::new() } else { places.iter().map(|place| list[*place as usize]).collect() }
}
