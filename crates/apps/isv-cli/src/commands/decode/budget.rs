//! `--target-faces` and `--simplify`: meshes with fewer faces.

use crate::count;
use crate::failure::usage;
use crate::output::{frames_in_words, say};
use crate::terms::FormName;
use anyhow::Result;
use isv::raw::simplify::{Budget, simplify};
use isv::raw::take::Length;
use isv::raw::volume::TriangleMesh;
use std::num::NonZero;

#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Fewer faces")]
pub(super) struct BudgetArgs {
    /// Most faces of each mesh
    ///
    /// Edges are collapsed where that changes the surface least. isv says how far the result is from the decoded
    /// surface, and whether a mesh kept more faces because its parts cannot have fewer. With --simplify too, the
    /// first limit that is reached counts.
    #[arg(help_heading = "Meshes", long, value_name = "N", value_parser = count::parse::<NonZero<usize>>)]
    target_faces: Option<NonZero<usize>>,
    /// Collapse edges as long as the surface stays within this distance
    ///
    /// The distance is measured both ways from the decoded surface.
    #[arg(help_heading = "Meshes", long, value_name = "LENGTH")]
    simplify: Option<Length>,
}

impl BudgetArgs {
    /// What meshes may have, if that is limited.
    pub(super) fn budget(&self, form: FormName) -> Result<Option<Budget>> {
        let (faces, max_error_m) = (self.target_faces.map(NonZero::get), self.simplify.map(Length::metres));
        if faces.is_none() && max_error_m.is_none() {
            return Ok(None);
        }
        if form != FormName::Mesh {
            return Err(usage("--target-faces and --simplify are for meshes"));
        }
        Ok(Some(Budget { faces, max_error_m }))
    }
}

/// What became of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reduction {
    faces_before: usize,
    faces: usize,
    error_m: f64,
}

impl Reduction {
    /// Simplifies a mesh. Its normals are those of what is left.
    pub(super) fn make(mesh: &TriangleMesh, budget: &Budget, normals: bool) -> Result<(TriangleMesh, Self)> {
        let simplified = simplify(mesh, budget)?;
        let (mut left, error_m) = (simplified.mesh, simplified.error_m);
        if normals && left.normals.is_empty() {
            left.normals = left.angle_weighted_normals();
        }
        let (faces_before, faces) = (mesh.triangles.len(), left.triangles.len());
        Ok((left, Self { faces_before, faces, error_m }))
    }
}

/// What became of all meshes.
#[derive(Debug, Default)]
pub(super) struct Reductions {
    frames: usize,
    faces_before: usize,
    faces: usize,
    /// Largest error, and the frame that has it.
    worst: (f64, usize),
    /// Faces of each frame.
    left: Vec<usize>,
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

    /// Says what was reached, and what was not.
    pub(super) fn say(&self, budget: &Budget) {
        if self.frames == 0 {
            return;
        }
        let [before, faces] = [self.faces_before, self.faces].map(|faces| faces / self.frames);
        let (error_m, number) = self.worst;
        let error_mm = error_m * 1e3;
        say(format_args!(
            "{faces} of {before} faces a frame left, largest error found {error_mm:.3} mm (frame {number})"
        ));
        let Some(target) = budget.faces else { return };
        let missed = self.left.iter().filter(|faces| **faces > target).count();
        if missed > 0 {
            let (frames, verb) = (frames_in_words(missed), if missed == 1 { "has" } else { "have" });
            let why = match budget.max_error_m {
                Some(error_m) => format!("--simplify {} allows no more", Length::from_metres(error_m)),
                None => "their parts and borders cannot have fewer".to_owned(),
            };
            say(format_args!("{frames} {verb} more than the {target} faces of --target-faces: {why}"));
        }
    }
}
