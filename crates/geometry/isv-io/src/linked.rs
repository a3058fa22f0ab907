//! Files that a frame's file names: material libraries and images. They lie in its folder or below.

use crate::image::{self, ImageError, ImageFault};
use crate::inside::inside;
use isv_volume::Image;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most pixels of all images of a mesh: 768 MiB.
const MAX_PIXELS: u64 = 1 << 28;

/// Pixels that all images of a mesh may have, however few bytes they have. Beyond it, a byte must be there
/// for so many of them.
const LEAST_PIXELS: u64 = 1 << 24;
const MOST_PIXELS_A_BYTE: u64 = 4096;

/// Counts the pixels of a mesh's images, and the bytes that they came from.
#[derive(Debug, Default)]
pub(crate) struct PixelCount {
    pixels: u64,
    bytes: u64,
}

impl PixelCount {
    /// Adds an image of so many bytes.
    ///
    /// # Errors
    /// [`ImageFault::Total`] if a mesh cannot have so many pixels.
    pub(crate) fn add(&mut self, image: &Image, bytes: usize) -> Result<(), ImageFault> {
        self.pixels += u64::from(image.width()) * u64::from(image.height());
        self.bytes += bytes as u64;
        let limit = self.bytes.saturating_mul(MOST_PIXELS_A_BYTE).clamp(LEAST_PIXELS, MAX_PIXELS);
        if self.pixels > limit { Err(ImageFault::Total { limit }) } else { Ok(()) }
    }
}

/// The images of a mesh, each decoded once, and the folder that linked files lie in.
#[derive(Debug)]
pub(crate) struct Linked<'a> {
    /// Folder of the frame's file; `None` for a frame that came without files beside it.
    folder: Option<&'a Path>,
    images: HashMap<String, Arc<Image>>,
    count: PixelCount,
}

impl<'a> Linked<'a> {
    /// Files beside a frame's file, in a folder; none may be opened without a folder.
    pub(crate) fn new(folder: Option<&'a Path>) -> Self {
        Self { folder, images: HashMap::new(), count: PixelCount::default() }
    }

    /// Files beside the file at a path.
    pub(crate) fn beside(path: &'a Path) -> Self {
        Self::new(Some(path.parent().unwrap_or(Path::new(""))))
    }

    /// Whether a name leads to a file.
    pub(crate) fn is_there(&self, name: &str) -> bool {
        self.folder.and_then(|folder| inside(folder, name)).is_some_and(|path| path.is_file())
    }

    /// Reads a file whole; `None` if it is not there. A name that leads out of the folder is a fault all the same.
    pub(crate) fn read_if_there(&self, name: &str) -> Result<Option<Vec<u8>>, ImageFault> {
        match self.folder {
            Some(folder) if inside(folder, name).is_none() || self.is_there(name) => {
                self.read(name).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// The path of a file that a name leads to, which may not be there.
    pub(crate) fn path(&self, name: &str) -> Result<PathBuf, ImageFault> {
        const ALONE: &str = "is another file, and this one came without any";
        const OUTSIDE: &str = "leaves the folder of the file; linked files must lie beside it or below";
        let folder = self.folder.ok_or(ImageFault::Name { why: ALONE })?;
        inside(folder, name).ok_or(ImageFault::Name { why: OUTSIDE })
    }

    /// Reads a file whole.
    fn read(&self, name: &str) -> Result<Vec<u8>, ImageFault> {
        image::read_file(&self.path(name)?)
    }

    /// Reads an image by its name. One of the same name is decoded once.
    pub(crate) fn image(&mut self, name: &str) -> Result<Arc<Image>, ImageError> {
        if let Some(image) = self.images.get(name) {
            return Ok(Arc::clone(image));
        }
        let image = self.decode(name).map_err(|fault| fault.of_image(name))?;
        self.images.insert(name.to_owned(), Arc::clone(&image));
        Ok(image)
    }

    fn decode(&mut self, name: &str) -> Result<Arc<Image>, ImageFault> {
        let bytes = self.read(name)?;
        let image = image::decode(&bytes)?;
        self.count.add(&image, bytes.len())?;
        Ok(Arc::new(image))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testfiles::image::four_colours;

    #[test]
    fn many_images_of_few_bytes_are_refused() {
        let bytes = four_colours();
        let image = image::decode(&bytes).unwrap();
        // As if images of no bytes had come before.
        let mut count = PixelCount { pixels: LEAST_PIXELS - 4, bytes: 0 };
        assert_eq!(count.add(&image, bytes.len()), Ok(()));
        assert_eq!(count.add(&image, bytes.len()), Err(ImageFault::Total { limit: LEAST_PIXELS }));
        let mut count = PixelCount { pixels: LEAST_PIXELS, bytes: LEAST_PIXELS };
        assert_eq!(count.add(&image, bytes.len()), Ok(()), "the bytes are there");
        let mut count = PixelCount { pixels: MAX_PIXELS, bytes: u64::MAX / 2 };
        assert_eq!(count.add(&image, bytes.len()), Err(ImageFault::Total { limit: MAX_PIXELS }));
    }

    #[test]
    fn images_come_from_the_folder_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.png"), four_colours()).unwrap();
        let path = folder.path().join("frame.obj");
        let mut linked = Linked::beside(&path);
        let first = linked.image("a.png").unwrap();
        assert!(Arc::ptr_eq(&first, &linked.image("a.png").unwrap()));
        assert!(
            linked.image("./gone.png").is_err() && linked.image("").is_err() && linked.image(".").is_err()
        );
        assert_eq!(linked.read_if_there("gone.mtl"), Ok(None));
        assert!(linked.read_if_there("../gone.mtl").is_err());
        assert_eq!(Linked::new(None).read_if_there("../gone.mtl"), Ok(None));
        let alone = Linked::new(None).image("a.png").unwrap_err().to_string();
        assert_eq!(alone, "image `a.png`: its name is another file, and this one came without any");
    }
}
