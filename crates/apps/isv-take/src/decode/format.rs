//! Forms of decoded frames, and their file formats.

use super::{DecodeOptionsError, DecodeTakeError};
use isv_io::{Format, UsdEncoding, check_folder_name, is_folder, is_pipe};
use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Extension of USD files that are text or binary; readers look.
const EITHER_USD: &str = "usd";

/// Kind of product that a decoded frame is turned into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A triangle mesh of the surface.
    Mesh,
    /// Points spread evenly over the surface.
    Points,
    /// The truncated signed distances themselves.
    Volume,
}

impl Form {
    /// All forms.
    pub const ALL: [Self; 3] = [Self::Mesh, Self::Points, Self::Volume];

    /// The form in a sentence.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "meshes",
            Self::Points => "points",
            Self::Volume => "volumes",
        }
    }
}

/// A file format of any form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputFormat {
    /// A file of a mesh or of points.
    Geometry(Format),
    /// A volume as a folder of NumPy arrays.
    Npy,
    /// A volume as OpenVDB has it.
    Vdb,
    /// A mesh, or many of them over time, in a USD file.
    Usd(UsdEncoding),
}

impl OutputFormat {
    /// Formats beside those of [`Format`].
    const OTHERS: [Self; 4] =
        [Self::Usd(UsdEncoding::Text), Self::Usd(UsdEncoding::Binary), Self::Npy, Self::Vdb];

    /// The extension of its files, and its name on the command line.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Geometry(format) => format.extension(),
            Self::Npy => "npy",
            Self::Vdb => "vdb",
            Self::Usd(UsdEncoding::Text) => "usda",
            Self::Usd(UsdEncoding::Binary) => "usdc",
        }
    }

    /// The format that a file of this name has; none for a folder.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        if is_folder(path) {
            return None;
        }
        // USD's own tools write binary files of this name too.
        let usd = is_named(path, EITHER_USD).then_some(Self::Usd(UsdEncoding::Binary));
        let is_file = |format: &Self| *format != Self::Npy && is_named(path, format.extension());
        let other = Self::OTHERS.into_iter().find(is_file);
        usd.or(other).or_else(|| Format::of_path(path).map(Self::Geometry))
    }

    /// Whether the format may have a file of this name, which stands for another.
    fn may_be_named(self, path: &Path) -> bool {
        matches!(self, Self::Usd(_)) && is_named(path, EITHER_USD)
    }

    /// Settles what was left open: the name of the output tells the format, the format tells the form.
    pub(super) fn settle(
        form: Option<Form>,
        format: Option<Self>,
        output: &Path,
    ) -> Result<(Form, Self), DecodeTakeError> {
        let named = Self::of_path(output);
        let name = || output.display().to_string();
        if named.is_none() {
            Self::check_folder(output)?;
        }
        if let (Some(format), Some(named)) = (format, named)
            && format != named
            && !format.may_be_named(output)
        {
            return Err(DecodeOptionsError::FormatAndName { format, name: name() }.into());
        }
        let known = format.or(named);
        let form = form.or(known.map(Self::usual_form)).unwrap_or(Form::Mesh);
        let format = known.unwrap_or(match form {
            Form::Mesh | Form::Points => Self::Geometry(Format::Ply),
            Form::Volume => Self::Npy,
        });
        if !format.holds(form) {
            let (name, formats) = (named.map(|_| name()), Self::names_for(form));
            return Err(DecodeOptionsError::FormatAndForm { name, format, form, formats }.into());
        }
        Ok((form, format))
    }

    /// Settles what was left open for meshes with a texture.
    pub(super) fn settle_textured(
        form: Option<Form>,
        format: Option<Self>,
        output: &Path,
    ) -> Result<(Form, Self), DecodeTakeError> {
        if form.is_some_and(|form| form != Form::Mesh) {
            return Err(DecodeOptionsError::NoTexturedMesh.into());
        }
        let usual = Self::of_path(output).is_none().then_some(Self::Geometry(Format::Glb));
        let (form, format) = Self::settle(Some(Form::Mesh), format.or(usual), output)?;
        match format {
            Self::Geometry(Format::Glb) => Ok((form, format)),
            Self::Geometry(Format::Obj) if is_pipe(output) => Err(DecodeOptionsError::TexturedPipe.into()),
            Self::Geometry(Format::Obj) => Ok((form, format)),
            _ => Err(DecodeOptionsError::NoTextureInFormat { format }.into()),
        }
    }

    /// Refuses a folder that is named like a file.
    fn check_folder(output: &Path) -> Result<(), DecodeTakeError> {
        let npy = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
        if npy && !is_folder(output) {
            return Err(DecodeOptionsError::ArraysInFile { name: output.display().to_string() }.into());
        }
        let [meshes, points, volumes] = Form::ALL.map(Self::names_for);
        let contents = format!("{meshes} (meshes), {points} (points) and {volumes} (volumes)");
        Ok(check_folder_name(output, &contents)?)
    }

    /// The form that goes without saying with a format.
    fn usual_form(self) -> Form {
        match self {
            Self::Geometry(format) if format.writes_points() && !format.writes_mesh() => Form::Points,
            Self::Geometry(_) => Form::Mesh,
            Self::Usd(_) => Form::Mesh,
            Self::Npy | Self::Vdb => Form::Volume,
        }
    }

    fn holds(self, form: Form) -> bool {
        match (self, form) {
            (Self::Geometry(format), Form::Mesh) => format.writes_mesh(),
            (Self::Geometry(format), Form::Points) => format.writes_points(),
            (Self::Usd(_), Form::Mesh) => true,
            (Self::Npy | Self::Vdb, Form::Volume) => true,
            _ => false,
        }
    }

    /// All formats that hold a form.
    fn names_for(form: Form) -> String {
        let geometry = Format::ALL.iter().map(|format| Self::Geometry(*format));
        let all = geometry.chain(Self::OTHERS).filter(|format| format.holds(form));
        all.map(Self::extension).collect::<Vec<_>>().join(", ")
    }
}

fn is_named(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

impl fmt::Display for OutputFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

impl FromStr for OutputFormat {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let forms = Form::ALL;
        let other = Self::OTHERS.into_iter().find(|format| format.extension() == name);
        let known = other.or_else(|| name.parse().ok().map(Self::Geometry));
        known.filter(|format| forms.into_iter().any(|form| format.holds(form))).ok_or_else(|| {
            let [meshes, points, volumes] = forms.map(Self::names_for);
            format!("`{name}` is not one of {meshes} (meshes), {points} (points), {volumes} (volumes)")
        })
    }
}
