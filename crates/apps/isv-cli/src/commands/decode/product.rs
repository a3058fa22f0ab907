//! What a decoded frame is turned into.

use super::budget::Reduction;
use super::target_frame::TargetFrame;
use crate::failure::usage;
use crate::memory;
use crate::output_name;
use crate::terms::FormName;
use anyhow::Result;
use isv::raw::format::Profile;
use isv::raw::ingest::coded_field;
use isv::raw::io::Format;
use isv::raw::simplify::Budget;
use isv::raw::surface::{PointDensity, SurfaceOptions, sample_evenly};
use isv::raw::take::AnyVolume;
use isv::raw::take::Length;
use isv::raw::take::encode::with_distances;
use isv::raw::volume::{BlockSet, PointCloud, SparseVolume, TriangleMesh};
use std::fmt;
use std::num::NonZero;
use std::path::Path;
use std::str::FromStr;

/// A frame in the form that the user wants.
#[derive(Debug)]
pub(super) enum Product {
    Mesh(TriangleMesh),
    Points(PointCloud),
    Volume(SparseVolume),
}

/// A file format of any form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OutputFormat {
    /// Of meshes or points.
    Geometry(Format),
    /// A volume as a folder of NumPy arrays.
    Npy,
    /// A volume as OpenVDB has it.
    Vdb,
}

impl OutputFormat {
    const VOLUMES: [(&'static str, Self); 2] = [("npy", Self::Npy), ("vdb", Self::Vdb)];

    /// The extension of its files, and its name on the command line.
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Geometry(format) => format.extension(),
            Self::Npy => "npy",
            Self::Vdb => "vdb",
        }
    }

    /// The format that a file of this name has; none for a folder.
    pub(super) fn of_path(path: &Path) -> Option<Self> {
        if output_name::is_folder(path) {
            return None;
        }
        let vdb = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vdb"));
        if vdb { Some(Self::Vdb) } else { Format::of_path(path).map(Self::Geometry) }
    }

    /// Settles what was left open: the name of the output tells the format, the format tells the form.
    pub(super) fn settle(
        form: Option<FormName>,
        format: Option<Self>,
        output: &Path,
    ) -> Result<(FormName, Self)> {
        let named = Self::of_path(output);
        if named.is_none() {
            Self::check_folder(output)?;
        }
        if let (Some(asked), Some(named)) = (format, named)
            && asked != named
        {
            let output = output.display();
            return Err(usage(format!("--format {asked} does not fit the output's name, {output}")));
        }
        let known = format.or(named);
        let form = form.or(known.map(Self::usual_form)).unwrap_or(FormName::Mesh);
        let format = known.unwrap_or(match form {
            FormName::Mesh | FormName::Points => Self::Geometry(Format::Ply),
            FormName::Volume => Self::Npy,
        });
        if !format.holds(form) {
            let (form_name, formats) = (form.name(), Self::names_for(form));
            let whose = named.map_or(String::new(), |_| format!("{}: ", output.display()));
            return Err(usage(format!(
                "{whose}{format} files are not written of {form_name}: use one of {formats}"
            )));
        }
        Ok((form, format))
    }

    /// Refuses a folder that is named like a file.
    fn check_folder(output: &Path) -> Result<()> {
        let npy = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
        if npy && !output_name::is_folder(output) {
            let name = output.display();
            return Err(usage(format!("{name}: a volume as NumPy arrays is several files: name a folder")));
        }
        let [meshes, points, volumes] = FormName::ALL.map(Self::names_for);
        output_name::check_folder(
            output,
            &format!("{meshes} (meshes), {points} (points) and {volumes} (volumes)"),
        )
    }

    /// The form that goes without saying with a format.
    fn usual_form(self) -> FormName {
        match self {
            Self::Geometry(format) if format.writes_points() && !format.writes_mesh() => FormName::Points,
            Self::Geometry(_) => FormName::Mesh,
            Self::Npy | Self::Vdb => FormName::Volume,
        }
    }

    fn holds(self, form: FormName) -> bool {
        match (self, form) {
            (Self::Geometry(format), FormName::Mesh) => format.writes_mesh(),
            (Self::Geometry(format), FormName::Points) => format.writes_points(),
            (Self::Npy | Self::Vdb, FormName::Volume) => true,
            _ => false,
        }
    }

    /// All formats that hold a form.
    fn names_for(form: FormName) -> String {
        let geometry = Format::ALL.iter().map(|format| Self::Geometry(*format));
        let volumes = Self::VOLUMES.map(|(_, format)| format);
        let all = geometry.chain(volumes).filter(|format| format.holds(form));
        all.map(Self::extension).collect::<Vec<_>>().join(", ")
    }
}

impl fmt::Display for OutputFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

impl FromStr for OutputFormat {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let forms = FormName::ALL;
        let volume = Self::VOLUMES.into_iter().find(|(own, _)| *own == name).map(|(_, format)| format);
        let known = volume.or_else(|| name.parse().ok().map(Self::Geometry));
        known.filter(|format| forms.into_iter().any(|form| format.holds(form))).ok_or_else(|| {
            let [meshes, points, volumes] = forms.map(Self::names_for);
            format!("`{name}` is not one of {meshes} (meshes), {points} (points), {volumes} (volumes)")
        })
    }
}

/// How to make products.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recipe {
    pub(super) form: FormName,
    /// Whether meshes get normals; points always do.
    pub(super) normals: bool,
    pub(super) density: PointDensity,
    /// Of the stream.
    pub(super) profile: Profile,
    /// What meshes may have, if that is limited.
    pub(super) budget: Option<Budget>,
    pub(super) target_frame: TargetFrame,
}

impl Recipe {
    /// Which surface it is made from, if from any; points always have normals.
    pub(super) fn surface(&self) -> Option<SurfaceOptions> {
        match self.form {
            FormName::Mesh => Some(SurfaceOptions { normals: self.normals && self.budget.is_none() }),
            FormName::Points => Some(SurfaceOptions { normals: true }),
            FormName::Volume => None,
        }
    }

    /// Makes the product of a volume, and its surface if that was extracted already.
    ///
    /// `coded_blocks`: as [`StreamFrame`](isv::raw::take::stream::StreamFrame) has them.
    pub(super) fn make(
        &self,
        volume: AnyVolume,
        coded_blocks: Option<&BlockSet>,
        surface: Option<TriangleMesh>,
    ) -> Result<(Product, Option<Reduction>)> {
        let (product, reduction) = match (self.product(volume, coded_blocks, surface)?, &self.budget) {
            (Product::Mesh(mesh), Some(budget)) => {
                let (mesh, reduction) = Reduction::make(&mesh, budget, self.normals)?;
                (Product::Mesh(mesh), Some(reduction))
            }
            (product, _) => (product, None),
        };
        Ok((self.target_frame.turn(product), reduction))
    }

    /// The product as the stream has it: in metres, Y up.
    fn product(
        &self,
        volume: AnyVolume,
        coded_blocks: Option<&BlockSet>,
        surface: Option<TriangleMesh>,
    ) -> Result<Product> {
        let Some(options) = self.surface() else {
            let volume = volume.into_sparse()?;
            return Ok(Product::Volume(match self.profile {
                // Distances may be coded away from the surface too: --band full.
                Profile::Main => match coded_blocks.and_then(|coded| coded_field(&volume, coded)) {
                    Some(field) => field,
                    None => with_distances(&volume, memory::limit())?,
                },
                Profile::Paper(_) => volume,
            }));
        };
        let mesh = match surface {
            Some(mesh) => mesh,
            None => memory::limit().surface(&volume.into_sparse()?, options)?,
        };
        Ok(match self.form {
            FormName::Points => Product::Points(sample_evenly(&mesh, self.density)?),
            _ => Product::Mesh(mesh),
        })
    }
}

/// How many points to take, or else how far apart: by default a voxel.
pub(super) fn density(points: Option<NonZero<usize>>, spacing: Option<Length>, voxel_m: f64) -> PointDensity {
    match points {
        Some(count) => PointDensity::Count(count.get()),
        None => PointDensity::Spacing(spacing.map_or(voxel_m, Length::metres)),
    }
}
