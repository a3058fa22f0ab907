//! The folder of a study: one JSON file a measured point, the decoded picture frame and the stream beside it.

use super::take::{CapturedTake, file_state};
use crate::output::check_output;
use anyhow::{Context, Result};
use isv::raw::io::{AtomicFile, Format, write_mesh};
use isv_study::{Codec, Draco, Measured, OperatingPoint, Record, StudySettings};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Where a study keeps what it has measured.
pub(super) struct Store {
    folder: PathBuf,
    /// What all figures depend on, but for codec and point.
    key: String,
}

impl Store {
    /// The store of a study in a folder. A figure is good as long as the captures, the settings and this program are the same.
    pub(super) fn new(
        folder: &Path,
        take: &CapturedTake,
        training: &[CapturedTake],
        settings: &StudySettings,
    ) -> Result<Self> {
        let program = std::env::current_exe().context("cannot find this program")?;
        let training: Vec<_> = training.iter().map(CapturedTake::fingerprint).collect();
        let key = format!(
            "program {}; {} threads; {settings:?}; take {}; trained on {training:?}",
            file_state(&program),
            rayon::current_num_threads(),
            take.fingerprint(),
        );
        Ok(Self { folder: folder.to_owned(), key })
    }

    /// The folder of the study.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Makes the folder, or takes one that a study is in. In another, what a study writes at its end must not be there.
    pub(super) fn make(&self) -> Result<()> {
        let is_study = self.folder.join("points").is_dir();
        for name in ["index.html", "results.csv", "bd_rates.csv"] {
            let path = self.folder.join(name);
            check_output(&path, "this folder has no study", |_| is_study)?;
        }
        make_folder(&self.folder)
    }

    /// The record of a point, if it was measured from the same captures under the same settings by the same program.
    pub(super) fn find(&self, codec: Codec, point: &OperatingPoint) -> Option<Record> {
        let path = self.path(&codec.to_string(), &point.to_string(), "json");
        let record: Record = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
        let whole = record.key == self.key(codec, point) && self.picture(&record).is_file();
        whole.then_some(record)
    }

    /// Keeps what was measured of a point. The record comes last: where it is, all is.
    pub(super) fn keep(&self, codec: Codec, point: &OperatingPoint, measured: Measured) -> Result<()> {
        let Measured { mut record, picture, isv_file } = measured;
        record.key = self.key(codec, point);
        make_folder(&self.folder.join("points").join(&record.codec))?;
        write_mesh(&self.picture(&record), &picture, Format::Ply)?;
        if let Some(bytes) = isv_file {
            write_file(&self.path(&record.codec, &record.point, "isv"), &bytes)?;
        }
        let json = serde_json::to_vec_pretty(&record)?;
        write_file(&self.path(&record.codec, &record.point, "json"), &json)
    }

    /// The decoded picture frame of a record.
    pub(super) fn picture(&self, record: &Record) -> PathBuf {
        self.path(&record.codec, &record.point, "ply")
    }

    fn path(&self, codec: &str, point: &str, extension: &str) -> PathBuf {
        self.folder.join("points").join(codec).join(format!("{point}.{extension}"))
    }

    fn key(&self, codec: Codec, point: &OperatingPoint) -> String {
        let programs = match codec {
            Codec::Draco { .. } => Draco::find().map(|draco| draco.programs().map(file_state)),
            _ => None,
        };
        format!("{codec:?} {point:?} {programs:?}; {}", self.key)
    }
}

fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("{}: cannot make this folder", folder.display()))
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes)?;
    Ok(file.commit()?)
}
