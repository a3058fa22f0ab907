//! `.npz`: arrays by name in a zip archive, as `numpy.savez` and `numpy.savez_compressed` write it.

use super::{Dense, DenseAxes, check_shape};
use crate::regular_file;
use crate::volume::VolumeError;
use crate::volume::npy::{Array, Wanted, shape_of};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use zip::ZipArchive;

/// Names of the arrays, in small letters; the first that is there is taken.
const TSDF: [&str; 9] =
    ["tsdf", "sdf", "tsdf_volume", "tsdf_vol", "tsdf_grid", "distance", "distances", "values", "voxels"];
const WEIGHT: [&str; 7] =
    ["weight", "weights", "weight_volume", "weight_vol", "tsdf_weight", "tsdf_weights", "observed"];
const VOXEL_SIZE: [&str; 5] = ["voxel_size", "voxel_size_m", "voxel_length", "voxelsize", "voxel"];
const ORIGIN: [&str; 4] = ["origin", "origin_m", "vol_origin", "volume_origin"];
const TRUNCATION: [&str; 8] = [
    "truncation",
    "truncation_m",
    "trunc",
    "sdf_trunc",
    "trunc_margin",
    "truncation_distance",
    "truncation_distance_m",
    "truncation_length",
];

/// An archive may unpack to so many times its size, and to this many bytes however small it is. Fields are smooth, and pack well.
const LARGEST_RATIO: u64 = 256;
const ALWAYS: u64 = 1 << 28;
/// Bytes that hold a header; NumPy's of a plain array has 128.
const HEAD: u64 = 4096;
/// Most entries that are looked at.
const MAX_MEMBERS: usize = 1024;

/// The first bytes of a file.
pub(super) fn head(file: impl Read) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(HEAD).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Opens an archive.
pub(super) fn open(path: &Path, axes: DenseAxes) -> Result<Dense, VolumeError> {
    let io_error = |cause| VolumeError::Io { path: path.to_owned(), cause };
    let (file, length) = regular_file::open(path).map_err(io_error)?;
    let mut archive = Archive::new(path, file, length)?;
    let name = archive.field()?;
    let tsdf = archive.array(&name, Wanted::Distances)?;
    let weight = match archive.find(&WEIGHT) {
        Some(name) => Some((archive.array(&name, Wanted::Numbers)?, path.to_owned(), name)),
        None => None,
    };
    let mut dense = Dense::new((path, &name), axes, tsdf, weight)?;
    dense.voxel_size_m = archive.length(&VOXEL_SIZE)?;
    dense.truncation_m = archive.length(&TRUNCATION)?;
    if let Some(origin) = archive.numbers(&ORIGIN)? {
        dense.origin_m = match origin.1[..] {
            [x, y, z] if [x, y, z].iter().all(|c| c.is_finite()) => [x, y, z],
            _ => return Err(archive.number_error(origin, "three numbers, x, y and z in metres")),
        };
    }
    Ok(dense)
}

struct Archive<'a> {
    path: &'a Path,
    zip: ZipArchive<BufReader<File>>,
    /// Names without `.npy`, and the shapes that their headers state.
    members: Vec<(String, Option<Vec<usize>>)>,
    /// Bytes that may still be unpacked.
    allowed: u64,
}

impl<'a> Archive<'a> {
    fn new(path: &'a Path, file: File, length: u64) -> Result<Self, VolumeError> {
        let failed = |why: String| VolumeError::Archive { path: path.to_owned(), why };
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|cause| failed(format!("not an archive of NumPy arrays: {cause}")))?;
        if zip.len() > MAX_MEMBERS {
            return Err(failed(format!("{} entries, more than {MAX_MEMBERS}", zip.len())));
        }
        let allowed = length.saturating_mul(LARGEST_RATIO).max(ALWAYS);
        let mut archive = Self { path, zip, members: Vec::new(), allowed };
        for entry in 0..archive.zip.len() {
            let failed = |cause: zip::result::ZipError| VolumeError::Archive {
                path: path.to_owned(),
                why: format!("entry {entry}: {cause}"),
            };
            let file = archive.zip.by_index(entry).map_err(failed)?;
            let name = file.name().map_err(failed)?.into_owned();
            let name = name.strip_suffix(".npy").map(str::to_owned).unwrap_or(name);
            let shape = head(file).and_then(|head| shape_of(&head));
            archive.members.push((name, shape));
        }
        Ok(archive)
    }

    /// The member with the first of these names, in capitals or not.
    fn find(&self, names: &[&str]) -> Option<String> {
        let named = |name: &&str| self.members.iter().find(|(member, _)| member.eq_ignore_ascii_case(name));
        names.iter().find_map(named).map(|(member, _)| member.clone())
    }

    /// The name of the distances: one that is known, or of the only array of three axes.
    fn field(&self) -> Result<String, VolumeError> {
        if let Some(name) = self.find(&TSDF) {
            let shape = self.members.iter().find(|(member, _)| *member == name).and_then(|(_, s)| s.as_ref());
            shape.map_or(Ok(()), |shape| check_shape(self.path, &name, shape))?;
            return Ok(name);
        }
        let is_dense = |shape: &Vec<usize>| check_shape(self.path, "", shape).is_ok();
        let others = [&WEIGHT[..], &ORIGIN, &VOXEL_SIZE, &TRUNCATION].concat();
        let unknown = |name: &str| !others.iter().any(|other| name.eq_ignore_ascii_case(other));
        let candidates =
            self.members.iter().filter(|(name, shape)| unknown(name) && shape.as_ref().is_some_and(is_dense));
        match candidates.collect::<Vec<_>>()[..] {
            [(name, _)] => Ok(name.clone()),
            _ => {
                let named = |(name, shape): &(String, Option<Vec<usize>>)| match shape {
                    Some(shape) => format!("`{name}` {shape:?}"),
                    None => format!("`{name}`"),
                };
                let members: Vec<_> = self.members.iter().take(8).map(named).collect();
                let members = if members.is_empty() { "none".to_owned() } else { members.join(", ") };
                // Points alone are named as such.
                if let [(name, Some(shape))] = &self.members[..] {
                    check_shape(self.path, name, shape)?;
                }
                Err(VolumeError::NoField { path: self.path.to_owned(), members })
            }
        }
    }

    fn array(&mut self, name: &str, wanted: Wanted) -> Result<Array, VolumeError> {
        let failed = |why: String| VolumeError::Archive { path: self.path.to_owned(), why };
        let place = self.members.iter().position(|(member, _)| member == name).expect("names are of members");
        let entry = self.zip.by_index(place).map_err(|cause| failed(format!("`{name}`: {cause}")))?;
        // The stated size is no more than a claim: what comes out is counted.
        let mut bytes = Vec::new();
        entry
            .take(self.allowed + 1)
            .read_to_end(&mut bytes)
            .map_err(|cause| failed(format!("`{name}`: {cause}")))?;
        let unpacked = bytes.len() as u64;
        if unpacked > self.allowed {
            return Err(failed(format!(
                "`{name}` unpacks to more than {LARGEST_RATIO} times the file: save it with numpy.savez, unpacked"
            )));
        }
        self.allowed -= unpacked;
        Array::parse_in_any_order(bytes, wanted).map_err(|why| VolumeError::Member {
            path: self.path.to_owned(),
            member: name.to_owned(),
            why,
        })
    }

    /// The few numbers of a member, with its name, if there is one of these names.
    fn numbers(&mut self, names: &[&str]) -> Result<Option<(String, Vec<f64>)>, VolumeError> {
        let Some(name) = self.find(names) else { return Ok(None) };
        let array = self.array(&name, Wanted::Numbers)?;
        let numbers = (0..array.count().min(4)).map(|place| array.at(place)).collect();
        Ok(Some((name, numbers)))
    }

    /// A length in metres, or three equal ones.
    fn length(&mut self, names: &[&str]) -> Result<Option<f64>, VolumeError> {
        let Some((name, numbers)) = self.numbers(names)? else { return Ok(None) };
        match numbers[..] {
            [length] | [length, ..]
                if length.is_finite()
                    && length > 0.0
                    && numbers.len() != 2
                    && numbers.len() < 4
                    && numbers.iter().all(|other| (other - length).abs() <= 1e-6 * length) =>
            {
                // A float32 says 0.019999999552965164 where its writer meant 0.02.
                Ok(Some(rounded(length)))
            }
            _ => Err(self.number_error((name, numbers), "one length above 0, in metres")),
        }
    }

    fn number_error(&self, (member, numbers): (String, Vec<f64>), wanted: &'static str) -> VolumeError {
        VolumeError::Number { path: self.path.to_owned(), member, found: format!("{numbers:?}"), wanted }
    }
}

/// A length to seven digits, which is what a float32 holds.
fn rounded(length: f64) -> f64 {
    format!("{length:.6e}").parse().unwrap_or(length)
}
