//! The materials of primitives, loaded at their first use. Their images are decoded for the poses that show them: an animation may have
//! one for each frame, far more than fit in memory.

use super::accessor::Accessors;
use super::buffers::{data_of, name_of};
use super::fault::GltfFault;
use super::look_schema::{Image as ImageObject, LookDocument, TextureInfo, TextureTransform};
use super::schema::object;
use crate::error::Flaw;
use crate::image::{self, ImageFault};
use crate::linked::{Linked, PixelCount};
use crate::materials::{Materials, TOO_MANY_MATERIALS};
use isv_volume::{Image, Material, Wrap};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The materials of a file, of which those that are used are loaded.
#[derive(Debug)]
pub(super) struct Looks<'a> {
    document: LookDocument,
    linked: Linked<'a>,
    /// Places in `images`.
    places: HashMap<ImagePlace, usize>,
    images: Vec<ImageSource>,
    materials: Materials<Option<usize>, MaterialSource>,
    /// Whether a material that is used says anything of colours.
    says_colours: bool,
}

/// The material of a primitive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Place among the materials that are used.
    pub(super) material: u16,
    /// The set of texture coordinates that its texture takes, and their transform; none without a texture.
    pub(super) coordinates: Option<(usize, TextureTransform)>,
}

/// All materials that a scene uses, and their images; no materials if they say nothing of colours.
#[derive(Debug, Default)]
pub(super) struct Palette {
    materials: Vec<MaterialSource>,
    images: Vec<ImageSource>,
}

/// A material whose image need not be decoded.
#[derive(Debug)]
struct MaterialSource {
    base_colour: [f32; 3],
    wrap: [Wrap; 2],
    /// Place of its image in [`Palette::images`].
    image: Option<usize>,
}

/// Place of an image's bytes: images of one place are one.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum ImagePlace {
    View(usize),
    File(PathBuf),
    /// Bytes in the address of an image, which has this number.
    Address(usize),
}

/// An image of a file.
#[derive(Debug)]
struct ImageSource {
    /// Number of the image in the file.
    index: usize,
    name: String,
    bytes: ImageBytes,
}

#[derive(Debug)]
enum ImageBytes {
    Held(Vec<u8>),
    File(PathBuf),
}

/// An image, and how many bytes it was decoded from.
#[derive(Clone, Debug)]
pub(super) struct DecodedImage {
    image: Arc<Image>,
    bytes: usize,
}

/// The images of a pose, by their places in [`Palette::images`].
pub(super) type DecodedImages = HashMap<usize, DecodedImage>;

impl<'a> Looks<'a> {
    /// Looks of a document, whose images may lie in a folder.
    pub(super) fn new(document: LookDocument, folder: Option<&'a Path>) -> Self {
        Self {
            document,
            linked: Linked::new(folder),
            places: HashMap::new(),
            images: Vec::new(),
            materials: Materials::new(),
            says_colours: false,
        }
    }

    /// The material of a primitive, named by a mesh. One without a colour of its own is white.
    pub(super) fn surface(
        &mut self,
        material: Option<usize>,
        accessors: &Accessors,
        mesh: usize,
    ) -> Result<Surface, Flaw> {
        let Self { document, linked, places, images, materials, says_colours } = self;
        let stated = material.map(|index| object(&document.materials, "material", index, ("mesh", mesh)));
        let (factors, texture) = stated.transpose()?.map(|stated| stated.base_colour()).unwrap_or_default();
        let key = material.filter(|_| !factors.is_empty() || texture.is_some());
        *says_colours |= key.is_some();
        let named_by = key.unwrap_or_default();
        let make = || -> Result<MaterialSource, Flaw> {
            let (image, wrap) = match texture {
                Some(info) => {
                    let (index, wrap) = image_of_texture(document, info, named_by)?;
                    let image = object(&document.images, "image", index, ("texture", info.index))?;
                    let place = image.place(index, linked)?;
                    let known = places.get(&place).copied();
                    if known.is_none() {
                        images.push(image.source(index, &place, accessors)?);
                        places.insert(place, images.len() - 1);
                    }
                    (known.or(Some(images.len() - 1)), wrap)
                }
                None => (None, [Wrap::Repeat; 2]),
            };
            let factor = |channel: usize| factors.get(channel).filter(|factor| factor.is_finite());
            let base_colour = [0, 1, 2].map(|channel| factor(channel).map_or(1.0, |f| f.clamp(0.0, 1.0)));
            Ok(MaterialSource { base_colour, wrap, image })
        };
        let material = materials.index(key, make)?;
        let material = material.ok_or(Flaw::in_object("mesh", mesh, TOO_MANY_MATERIALS))?;
        Ok(Surface { material, coordinates: texture.map(TextureInfo::coordinates) })
    }

    /// The materials that are used; none if they say nothing of colours.
    pub(super) fn into_palette(self) -> Palette {
        match self.says_colours {
            true => Palette { materials: self.materials.into_list(), images: self.images },
            false => Palette::default(),
        }
    }
}

impl Palette {
    /// Whether materials say nothing of colours.
    pub(super) fn is_empty(&self) -> bool {
        self.materials.is_empty()
    }

    /// Some of the materials, by their places, and the images that these have. Images that are known are not decoded again.
    pub(super) fn materials(
        &self,
        places: &[u16],
        known: &DecodedImages,
    ) -> Result<(Vec<Material>, DecodedImages), Flaw> {
        let mut decoded = DecodedImages::new();
        let mut count = PixelCount::default();
        let mut materials = Vec::with_capacity(places.len());
        for place in places {
            let MaterialSource { base_colour, wrap, image } = self.materials[usize::from(*place)];
            if let Some(place) = image.filter(|place| !decoded.contains_key(place)) {
                let source = &self.images[place];
                let flaw = |fault| source.flaw(fault);
                let image = known.get(&place).cloned().map_or_else(|| source.decode(), Ok).map_err(flaw)?;
                count.add(&image.image, image.bytes).map_err(flaw)?;
                decoded.insert(place, image);
            }
            let texture = image.map(|place| Arc::clone(&decoded[&place].image));
            materials.push(Material { base_colour, texture, wrap });
        }
        Ok((materials, decoded))
    }
}

impl ImageObject {
    /// The name of image `index` in errors.
    fn title(&self, index: usize) -> String {
        match (&self.uri, self.name.as_str()) {
            (Some(uri), _) if !uri.starts_with("data:") => uri.clone(),
            (_, "") => index.to_string(),
            (_, name) => name.to_owned(),
        }
    }

    /// The place of the bytes of image `index`.
    fn place(&self, index: usize, linked: &Linked) -> Result<ImagePlace, Flaw> {
        let flaw = |fault: ImageFault, name: &str| Flaw::in_object("image", index, fault.of_image(name));
        match (self.buffer_view, &self.uri) {
            (Some(view), _) => Ok(ImagePlace::View(view)),
            (None, Some(uri)) if uri.starts_with("data:") => Ok(ImagePlace::Address(index)),
            (None, Some(uri)) => {
                let file = name_of(uri).map_err(|why| flaw(ImageFault::Name { why }, uri))?;
                linked.path(&file).map(ImagePlace::File).map_err(|fault| flaw(fault, &file))
            }
            (None, None) => Err(Flaw::in_object("image", index, GltfFault::NoImage)),
        }
    }

    /// Image `index`, which is at a place. Its bytes are not looked at.
    fn source(&self, index: usize, place: &ImagePlace, accessors: &Accessors) -> Result<ImageSource, Flaw> {
        let name = match (place, &self.uri) {
            (ImagePlace::File(_), Some(uri)) => name_of(uri).unwrap_or_default().into_owned(),
            _ => self.title(index),
        };
        let bytes = match place {
            ImagePlace::View(view) => {
                let bytes = accessors.bytes(*view, ("image", index))?;
                // Views may share their bytes: each copy counts.
                let numbers = bytes.len().div_ceil(size_of::<f32>());
                accessors.limit.take(numbers, 1).map_err(|fault| Flaw::in_object("image", index, fault))?;
                ImageBytes::Held(bytes.to_vec())
            }
            ImagePlace::File(path) => ImageBytes::File(path.clone()),
            ImagePlace::Address(_) => {
                let data = self.uri.as_deref().and_then(data_of).unwrap_or_else(|| Ok(Vec::new()));
                let flaw = |why| Flaw::in_object("image", index, ImageFault::Name { why }.of_image(&name));
                ImageBytes::Held(data.map_err(flaw)?)
            }
        };
        Ok(ImageSource { index, name, bytes })
    }
}

impl ImageSource {
    fn decode(&self) -> Result<DecodedImage, ImageFault> {
        let bytes = match &self.bytes {
            ImageBytes::Held(bytes) => Cow::Borrowed(bytes),
            ImageBytes::File(path) => Cow::Owned(image::read_file(path)?),
        };
        Ok(DecodedImage { image: Arc::new(image::decode(&bytes)?), bytes: bytes.len() })
    }

    fn flaw(&self, fault: ImageFault) -> Flaw {
        Flaw::in_object("image", self.index, fault.of_image(&self.name))
    }
}

/// The number of a texture's image, and how the texture goes on outside.
fn image_of_texture(
    document: &LookDocument,
    info: &TextureInfo,
    material: usize,
) -> Result<(usize, [Wrap; 2]), Flaw> {
    let texture = object(&document.textures, "texture", info.index, ("material", material))?;
    let named_by = ("texture", info.index);
    let sampler = texture.sampler.map(|index| object(&document.samplers, "sampler", index, named_by));
    let sampler = sampler.transpose()?;
    let wrap = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap_of_code);
    let index = texture.image();
    let index = index.ok_or_else(|| Flaw::in_object(named_by.0, named_by.1, GltfFault::NoImage))?;
    Ok((index, wrap))
}

/// The treatment of a code of the specification. Unknown ones repeat, as without any.
fn wrap_of_code(code: Option<u32>) -> Wrap {
    match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
