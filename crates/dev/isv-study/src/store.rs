//! The folder of a study: one JSON file a measured point, the decoded picture frame and the stream beside it.

use crate::captured_take::{CapturedTake, file_state};
use crate::{Codec, Measured, OperatingPoint, Record, StudyError, StudySettings};
use isv::raw::io::{AtomicFile, Format, Geometry, check_overwriting, write_mesh, write_points};
use isv_baseline::Tools;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Extensions of the frames of contact sheets.
const OF_MESH: &str = "glb";
const OF_POINTS: &str = "ply";

/// Folder in which a study keeps what it has measured.
pub struct Store {
    folder: PathBuf,
    /// What all figures depend on, but for codec and point.
    key: String,
    tools: Tools,
}

impl Store {
    /// The store of a study in a folder. A figure is good as long as the captures, the settings and this program are the same.
    ///
    /// # Errors
    /// A program that cannot be found.
    pub fn new(
        folder: &Path,
        take: &CapturedTake,
        training: &[CapturedTake],
        settings: &StudySettings,
        tools: &Tools,
    ) -> Result<Self, StudyError> {
        let program = std::env::current_exe()?;
        let training: Vec<_> = training.iter().map(CapturedTake::fingerprint).collect();
        let key = format!(
            "program {}; {} threads; {settings:?}; take {}; trained on {training:?}",
            file_state(&program),
            rayon::current_num_threads(),
            take.fingerprint(),
        );
        Ok(Self { folder: folder.to_owned(), key, tools: tools.clone() })
    }

    /// The folder of the study.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Makes the folder, or takes one that a study is in. In another, what a study writes at its end must not be there.
    ///
    /// # Errors
    /// [`StudyError::Output`] and [`StudyError::File`].
    pub fn make(&self) -> Result<(), StudyError> {
        let is_study = self.folder.join("points").is_dir();
        for name in
            ["index.html", "results.csv", "bd_rates.csv", "programs.csv", "sheet.png", "sheet_error.png"]
        {
            let path = self.folder.join(name);
            check_overwriting(&path, "this folder has no study", |_| is_study)?;
        }
        make_folder(&self.folder)
    }

    /// The record of a point, if it was measured from the same captures under the same settings by the same program.
    #[must_use]
    pub fn find(&self, codec: Codec, point: &OperatingPoint) -> Option<Record> {
        let path = self.path(&codec.to_string(), &point.to_string(), "json");
        let record: Record = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
        let whole = record.key == self.key(codec, point) && self.picture(&record).is_file();
        whole.then_some(record)
    }

    /// Keeps what was measured of a point. The record comes last: where it is, all is.
    ///
    /// # Errors
    /// [`StudyError::File`].
    pub fn keep(&self, codec: Codec, point: &OperatingPoint, measured: Measured) -> Result<(), StudyError> {
        let Measured { mut record, picture, isv_file, sheet_frames } = measured;
        record.key = self.key(codec, point);
        make_folder(&self.folder.join("points").join(&record.codec))?;
        self.remove_frames(&record)?;
        let path = self.picture(&record);
        match &picture {
            Geometry::Mesh(mesh) => write_mesh(&path, mesh, Format::Ply),
            Geometry::Points(points) => write_points(&path, points, Format::Ply),
        }
        .map_err(io::Error::from)?;
        if let Some(bytes) = isv_file {
            write_file(&self.path(&record.codec, &record.point, "isv"), &bytes)?;
        }
        for (frame, shape) in &sheet_frames {
            let path = |extension| self.frame_path(&record, *frame, extension);
            match shape {
                Geometry::Mesh(mesh) => write_mesh(&path(OF_MESH), mesh, Format::Glb),
                Geometry::Points(points) => write_points(&path(OF_POINTS), points, Format::Ply),
            }
            .map_err(io::Error::from)?;
        }
        let json = serde_json::to_vec_pretty(&record).map_err(io::Error::from)?;
        write_file(&self.path(&record.codec, &record.point, "json"), &json)
    }

    /// The decoded picture frame of a record.
    #[must_use]
    pub fn picture(&self, record: &Record) -> PathBuf {
        self.path(&record.codec, &record.point, "ply")
    }

    /// The stream of a record that other commands can read, if its codec makes such.
    #[must_use]
    pub fn stream(&self, record: &Record) -> Option<PathBuf> {
        Some(self.path(&record.codec, &record.point, "isv")).filter(|path| path.is_file())
    }

    /// File of a decoded frame, by its place in the take: a mesh as GLB or points as PLY. Records without a stream that other
    /// commands read have one of each frame that [`StudySettings::sheet_frames`] names.
    #[must_use]
    pub fn sheet_frame(&self, record: &Record, frame: usize) -> Option<PathBuf> {
        let paths = [OF_MESH, OF_POINTS].map(|extension| self.frame_path(record, frame, extension));
        paths.into_iter().find(|path| path.is_file())
    }

    /// Removes the frames that an earlier measurement of a point has left.
    fn remove_frames(&self, record: &Record) -> Result<(), StudyError> {
        let of_point = format!("{}-frame", record.point);
        for file in fs::read_dir(self.folder.join("points").join(&record.codec))? {
            let file = file?;
            if file.file_name().to_string_lossy().starts_with(&of_point) {
                fs::remove_file(file.path())?;
            }
        }
        Ok(())
    }

    fn frame_path(&self, record: &Record, frame: usize, extension: &str) -> PathBuf {
        self.path(&record.codec, &format!("{}-frame{frame}", record.point), extension)
    }

    fn path(&self, codec: &str, point: &str, extension: &str) -> PathBuf {
        self.folder.join("points").join(codec).join(format!("{point}.{extension}"))
    }

    fn key(&self, codec: Codec, point: &OperatingPoint) -> String {
        let state = |name: &&str| self.tools.find(name).map(|path| file_state(&path));
        let programs: Vec<_> = codec.programs().iter().map(state).collect();
        format!("{codec:?} {point:?} {programs:?}; {}", self.key)
    }
}

fn make_folder(folder: &Path) -> Result<(), StudyError> {
    fs::create_dir_all(folder).map_err(|error| {
        let sentence = format!("{}: cannot make this folder: {error}", folder.display());
        io::Error::new(error.kind(), sentence).into()
    })
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), StudyError> {
    let mut file = AtomicFile::create(path).map_err(io::Error::from)?;
    file.write_all(bytes)?;
    Ok(file.commit().map_err(io::Error::from)?)
}
