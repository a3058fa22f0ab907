//! Triangle meshes.

#[cfg(feature = "encode")]
use isv_volume::Appearance;
use isv_volume::TriangleMesh;
#[cfg(feature = "encode")]
use std::sync::Arc;

/// A triangle mesh. Axes are those of the stream: Y up, right-handed; units are metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions of vertices: x, y, z.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one a vertex; empty if there are none. Encoding does not need them.
    pub normals: Vec<[f32; 3]>,
    /// 8-bit sRGB colours, one a vertex; empty if there are none.
    pub colours: Vec<[u8; 3]>,
    /// Vertices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    #[cfg(feature = "encode")]
    pub(crate) fn to_raw(&self) -> TriangleMesh {
        TriangleMesh {
            vertices: self.positions.iter().map(|p| p.map(f64::from).into()).collect(),
            // No normals are needed: a surface's sides are those of its triangles.
            normals: Vec::new(),
            triangles: self.triangles.clone(),
            appearance: (!self.colours.is_empty()).then(|| {
                let vertex_colours = self.colours.clone();
                Arc::new(Appearance { vertex_colours, ..Appearance::default() })
            }),
        }
    }

    pub(crate) fn from_raw(mesh: TriangleMesh) -> Self {
        Self {
            positions: mesh.vertices.iter().map(|p| p.as_vec3().to_array()).collect(),
            normals: mesh.normals.iter().map(|n| n.as_vec3().to_array()).collect(),
            triangles: mesh.triangles,
            colours: Vec::new(),
        }
    }
}
