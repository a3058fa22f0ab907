//! Meshes with fewer faces, and what that cost.

use isv_simplify::{Budget, SimplifyError, simplify};
use isv_volume::TriangleMesh;

/// What became of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reduction {
    faces_before: usize,
    faces: usize,
    error_m: f64,
}

impl Reduction {
    /// Simplifies a mesh. Its normals are those of what is left.
    pub(super) fn make(
        mesh: &TriangleMesh,
        budget: &Budget,
        normals: bool,
    ) -> Result<(TriangleMesh, Self), SimplifyError> {
        let simplified = simplify(mesh, budget)?;
        let (mut left, error_m) = (simplified.mesh, simplified.error_m);
        if normals && left.normals.is_empty() {
            left.normals = left.angle_weighted_normals();
        }
        let (faces_before, faces) = (mesh.triangles.len(), left.triangles.len());
        Ok((left, Self { faces_before, faces, error_m }))
    }
}

/// Results of all mesh simplifications.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Reductions {
    /// Number of meshes.
    pub frames: usize,
    /// Faces of all meshes before.
    pub faces_before: usize,
    /// Faces of all meshes after.
    pub faces: usize,
    /// Largest distance found from the decoded surface (m), and the number of the frame that has it.
    pub worst: (f64, usize),
    /// Faces of each mesh after.
    pub left: Vec<usize>,
}

impl Reductions {
    /// Takes in a frame.
    pub(super) fn add(&mut self, number: usize, reduction: Option<Reduction>) {
        let Some(Reduction { faces_before, faces, error_m }) = reduction else { return };
        self.frames += 1;
        self.faces_before += faces_before;
        self.faces += faces;
        self.left.push(faces);
        if error_m > self.worst.0 {
            self.worst = (error_m, number);
        }
    }
}
