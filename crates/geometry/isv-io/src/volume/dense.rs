//! Dense fields: one array of distances over a box of voxels, as `.npy` or `.npz`.

mod archive;
mod sample;
mod scale;

use super::npy::{Array, Wanted, shape_of};
use super::{COORDS, TSDF, VolumeError};
use crate::regular_file;
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use std::path::{Path, PathBuf};

pub(super) use scale::Scale;

/// Order of an array's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DenseAxes {
    /// `field[z, y, x]`, as in folders of blocks.
    #[default]
    Zyx,
    /// `field[x, y, z]`.
    Xyz,
}

/// Place of a sample in its voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleAt {
    /// In the middle: sample 0 is half a voxel from the origin.
    #[default]
    Centre,
    /// At the lowest corner: sample 0 is at the origin.
    Corner,
}

/// What a dense field does not say of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenseOptions {
    /// Order of the axes.
    pub axes: DenseAxes,
    /// Place of samples in their voxels.
    pub sample_at: SampleAt,
    /// Metres that a value of 1 stands for, of integers the largest one; `None` finds out.
    pub scale_m: Option<f64>,
}

/// A dense field with what its file says of it.
#[derive(Debug)]
pub(super) struct Dense {
    tsdf: Part,
    weight: Option<Part>,
    /// Along x, y and z.
    extents: [usize; 3],
    pub(super) voxel_size_m: Option<f64>,
    pub(super) truncation_m: Option<f64>,
    origin_m: [f64; 3],
}

/// An array over the box.
#[derive(Debug)]
struct Part {
    array: Array,
    /// Elements between neighbours along x, y and z.
    strides: [usize; 3],
}

/// What an array of weights beside `NAME.npy` is called: `NAME` and one of these.
const WEIGHT_SUFFIXES: [&str; 4] = ["_weight", "_weights", ".weight", ".weights"];
/// Names of the weights beside `tsdf.npy`.
const WEIGHT_NAMES: [&str; 2] = ["weight.npy", "weights.npy"];

/// Whether a file's name is one of dense fields.
pub(super) fn is_dense_name(path: &Path) -> bool {
    has_extension(path, "npy") || has_extension(path, "npz")
}

/// Whether a file's name is one of weights beside distances, which are no frame.
pub(super) fn is_weight_name(path: &Path) -> bool {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    has_extension(path, "npy")
        && (WEIGHT_SUFFIXES.iter().any(|suffix| stem.ends_with(suffix))
            || stem == "weight"
            || stem == "weights")
}

/// Whether a folder holds one dense field: distances of three axes, and no places of blocks.
pub(super) fn is_dense_folder(folder: &Path) -> bool {
    let tsdf = folder.join(TSDF);
    !folder.join(COORDS).exists()
        && regular_file::open(&tsdf).is_ok_and(|(file, _)| {
            archive::head(file)
                .and_then(|head| shape_of(&head))
                .is_some_and(|shape| axes_of(&shape).is_some())
        })
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}

/// The three axes of a shape; a last one of length 1 is passed over.
fn axes_of(shape: &[usize]) -> Option<[usize; 3]> {
    match *shape {
        [a, b, c] | [a, b, c, 1] => Some([a, b, c]),
        _ => None,
    }
}

/// What a shape that is no dense field is likely to be.
fn advice_for(shape: &[usize]) -> &'static str {
    match shape {
        [_, 3 | 6] | [3] => "points belong in a .ply or .xyz file",
        [_, x, y, z] if x == y && y == z => "blocks belong in a folder, as tsdf.npy with a coords.npy",
        [_, _, _, _] => "save one field a file, and its weights by themselves",
        _ => "save an array [z, y, x], or [x, y, z] with --axes xyz",
    }
}

impl Dense {
    /// Opens a `.npy` file, with weights beside it, or a `.npz` archive.
    pub(super) fn open(path: &Path, axes: DenseAxes) -> Result<Self, VolumeError> {
        if has_extension(path, "npz") { archive::open(path, axes) } else { Self::open_npy(path, axes) }
    }

    fn open_npy(path: &Path, axes: DenseAxes) -> Result<Self, VolumeError> {
        let read = |path: &Path, wanted| {
            let bytes =
                regular_file::read(path).map_err(|cause| VolumeError::Io { path: path.to_owned(), cause })?;
            Array::parse_in_any_order(bytes, wanted)
                .map_err(|why| VolumeError::Array { path: path.to_owned(), why })
        };
        // Points are named as such, whatever their type.
        if let Ok((file, _)) = regular_file::open(path)
            && let Some(shape) = archive::head(file).and_then(|head| shape_of(&head))
        {
            check_shape(path, "", &shape)?;
        }
        let tsdf = read(path, Wanted::Distances)?;
        let weights = weights_beside(path);
        let weight = weights.map(|weights| Ok((read(&weights, Wanted::Numbers)?, weights))).transpose()?;
        let weight = weight.map(|(array, at)| (array, at, String::new()));
        Self::new((path, ""), axes, tsdf, weight)
    }

    /// `at`: the file and the array's name in it. `weight`: with the same of its own.
    fn new(
        (path, member): (&Path, &str),
        axes: DenseAxes,
        tsdf: Array,
        weight: Option<(Array, PathBuf, String)>,
    ) -> Result<Self, VolumeError> {
        check_shape(path, member, &tsdf.shape)?;
        let tsdf = Part::new(tsdf, axes);
        let weight = weight
            .map(|(array, path, member)| {
                let (found, wanted) = (&array.shape, &tsdf.array.shape);
                if axes_of(found) != axes_of(wanted) {
                    let why = super::ArrayFlaw::Shape {
                        found: found.clone(),
                        wanted: format!("that of the distances, {wanted:?}"),
                    };
                    return Err(match member.is_empty() {
                        true => VolumeError::Array { path, why },
                        false => VolumeError::Member { path, member, why },
                    });
                }
                Ok(Part::new(array, axes))
            })
            .transpose()?;
        let extents = in_xyz(axes_of(&tsdf.array.shape).expect("the shape was checked"), axes);
        Ok(Self { tsdf, weight, extents, voxel_size_m: None, truncation_m: None, origin_m: [0.0; 3] })
    }

    /// The grid that the field is read on, as [`super::volume_grid`] has it; blocks have an edge of 8.
    pub(super) fn grid(
        &self,
        path: &Path,
        options: &DenseOptions,
        voxel_size: Option<VoxelSize>,
        truncation: Option<Truncation>,
    ) -> Result<(Grid, Scale), VolumeError> {
        let in_file = |cause| VolumeError::Grid { path: path.to_owned(), cause };
        let voxel_size = match (voxel_size, self.voxel_size_m) {
            (Some(size), _) => size,
            (None, Some(metres)) => VoxelSize::from_metres(metres).map_err(in_file)?,
            (None, None) => return Err(VolumeError::NoVoxelSize { path: path.to_owned() }),
        };
        let scale = Scale::new(self, path, options, voxel_size.metres())?;
        let truncation = match truncation {
            Some(truncation) => truncation,
            None => {
                let voxels = scale.truncation_m.map_or(8.0, |metres| metres / voxel_size.metres());
                let (least, most) = (*Truncation::RANGE.start(), *Truncation::RANGE.end());
                Truncation::from_voxels(((voxels - 1e-3).ceil() as u32).clamp(least, most))
                    .map_err(in_file)?
            }
        };
        Ok((Grid { voxel_size, edge: BlockEdge::E8, truncation }, scale))
    }

    /// Reads the field as a volume on a grid with this voxel size.
    pub(super) fn read(
        &self,
        path: &Path,
        options: &DenseOptions,
        grid: &Grid,
        scale: &Scale,
    ) -> Result<SparseVolume, VolumeError> {
        if let Some(metres) = self.voxel_size_m {
            let size = VoxelSize::from_metres(metres)
                .map_err(|cause| VolumeError::Grid { path: path.to_owned(), cause })?;
            if size != grid.voxel_size {
                return Err(VolumeError::OtherGrid {
                    path: path.to_owned(),
                    what: "the voxel size",
                    found: format!("{metres} m"),
                    asked: format!("{} m", grid.voxel_size.metres()),
                });
            }
        }
        sample::volume(self, path, options.sample_at, grid, scale)
    }

    /// Whether samples have to be interpolated to lie on a grid whose origin is that of the world.
    pub(super) fn is_interpolated(&self, sample_at: SampleAt, voxel_m: f64) -> bool {
        sample::placement(self, sample_at, voxel_m).iter().any(|(_, share)| *share > 0.0)
    }

    /// Whether the file says which voxels were observed.
    pub(super) fn has_weights(&self) -> bool {
        self.weight.is_some()
    }

    /// The value of a voxel in parts of full scale; NaN if it was not observed.
    fn value(&self, at: [usize; 3]) -> f64 {
        if let Some(weight) = &self.weight {
            let weight = weight.at(at);
            if weight.is_nan() || weight <= 0.0 {
                return f64::NAN;
            }
        }
        self.tsdf.at(at) / self.tsdf.array.full_scale()
    }
}

impl Part {
    fn new(array: Array, axes: DenseAxes) -> Self {
        let strides = array.strides();
        let strides = in_xyz([strides[0], strides[1], strides[2]], axes);
        Self { array, strides }
    }

    fn at(&self, at: [usize; 3]) -> f64 {
        self.array.at(at.iter().zip(self.strides).map(|(at, stride)| at * stride).sum())
    }
}

/// What an array has by its own axes, by x, y and z.
fn in_xyz([a, b, c]: [usize; 3], axes: DenseAxes) -> [usize; 3] {
    match axes {
        DenseAxes::Zyx => [c, b, a],
        DenseAxes::Xyz => [a, b, c],
    }
}

/// Refuses shapes of what is no dense field.
fn check_shape(path: &Path, member: &str, shape: &[usize]) -> Result<(), VolumeError> {
    // A cell has two samples along each axis.
    if axes_of(shape).is_some_and(|extents| extents.iter().all(|extent| *extent >= 2)) {
        return Ok(());
    }
    let (path, member, shape) = (path.to_owned(), member.to_owned(), shape.to_vec());
    let advice = advice_for(&shape);
    Err(VolumeError::NotDense { path, member, shape, advice })
}

/// The file of weights beside one of distances.
fn weights_beside(path: &Path) -> Option<PathBuf> {
    let stem = path.file_stem()?.to_str()?;
    let names = WEIGHT_SUFFIXES.iter().map(|suffix| format!("{stem}{suffix}.npy"));
    let usual = WEIGHT_NAMES.iter().filter(|_| stem == "tsdf").map(|name| (*name).to_owned());
    names.chain(usual).map(|name| path.with_file_name(name)).find(|path| path.is_file())
}
