//! The materials of primitives, with their images, each loaded at its first use.

use super::accessor::Accessors;
use super::buffers::{data_of, name_of};
use super::fault::GltfFault;
use super::look_schema::{LookDocument, TextureInfo, TextureTransform};
use super::schema::object;
use crate::error::Flaw;
use crate::image::ImageFault;
use crate::linked::Linked;
use crate::materials::{Materials, TOO_MANY_MATERIALS};
use isv_volume::{Image, Material, Wrap};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// The materials of a file, of which those that are used are loaded.
#[derive(Debug)]
pub(super) struct Looks<'a> {
    document: LookDocument,
    linked: Linked<'a>,
    images: HashMap<usize, Arc<Image>>,
    materials: Materials<Option<usize>>,
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

impl<'a> Looks<'a> {
    /// Looks of a document, whose images may lie in a folder.
    pub(super) fn new(document: LookDocument, folder: Option<&'a Path>) -> Self {
        Self {
            document,
            linked: Linked::new(folder),
            images: HashMap::new(),
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
        let Self { document, linked, images, materials, says_colours } = self;
        let stated = material.map(|index| object(&document.materials, "material", index, ("mesh", mesh)));
        let (factors, texture) = stated.transpose()?.map(|stated| stated.base_colour()).unwrap_or_default();
        let key = material.filter(|_| !factors.is_empty() || texture.is_some());
        *says_colours |= key.is_some();
        let named_by = key.unwrap_or_default();
        let make = || -> Result<Material, Flaw> {
            let (texture, wrap) = match texture {
                Some(info) => {
                    let (image, wrap) = load_texture(document, info, named_by, (linked, images), accessors)?;
                    (Some(image), wrap)
                }
                None => (None, [Wrap::Repeat; 2]),
            };
            let factor = |channel: usize| factors.get(channel).filter(|factor| factor.is_finite());
            let base_colour = [0, 1, 2].map(|channel| factor(channel).map_or(1.0, |f| f.clamp(0.0, 1.0)));
            Ok(Material { base_colour, texture, wrap })
        };
        let material = materials.index(key, make)?;
        let material = material.ok_or(Flaw::in_object("mesh", mesh, TOO_MANY_MATERIALS))?;
        Ok(Surface { material, coordinates: texture.map(TextureInfo::coordinates) })
    }

    /// The materials that are used; none if they say nothing of colours.
    pub(super) fn into_materials(self) -> Vec<Material> {
        if self.says_colours { self.materials.into_list() } else { Vec::new() }
    }
}

/// The image of a texture, and how it goes on outside.
fn load_texture(
    document: &LookDocument,
    info: &TextureInfo,
    material: usize,
    (linked, images): (&mut Linked, &mut HashMap<usize, Arc<Image>>),
    accessors: &Accessors,
) -> Result<(Arc<Image>, [Wrap; 2]), Flaw> {
    let texture = object(&document.textures, "texture", info.index, ("material", material))?;
    let named_by = ("texture", info.index);
    let sampler = texture.sampler.map(|index| object(&document.samplers, "sampler", index, named_by));
    let sampler = sampler.transpose()?;
    let wrap = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap_of_code);
    let index = texture.image();
    let index = index.ok_or_else(|| Flaw::in_object(named_by.0, named_by.1, GltfFault::NoImage))?;
    if let Some(image) = images.get(&index) {
        return Ok((Arc::clone(image), wrap));
    }
    let image = object(&document.images, "image", index, named_by)?;
    let name = match (&image.uri, image.name.as_str()) {
        (Some(uri), _) if !uri.starts_with("data:") => uri.clone(),
        (_, "") => index.to_string(),
        (_, name) => name.to_owned(),
    };
    let error = |fault: ImageFault| Flaw::in_object("image", index, fault.of_image(&name));
    let loaded = match (&image.uri, image.buffer_view) {
        (_, Some(view)) => linked.decode(accessors.bytes(view, ("image", index))?, &name),
        (Some(uri), None) => match data_of(uri) {
            Some(data) => linked.decode(&data.map_err(|why| error(ImageFault::Name { why }))?, &name),
            None => linked.image(&name_of(uri).map_err(|why| error(ImageFault::Name { why }))?),
        },
        (None, None) => return Err(Flaw::in_object("image", index, GltfFault::NoImage)),
    };
    let loaded = loaded.map_err(|error| Flaw::in_object("image", index, error))?;
    images.insert(index, Arc::clone(&loaded));
    Ok((loaded, wrap))
}

/// The treatment of a code of the specification. Unknown ones repeat, as without any.
fn wrap_of_code(code: Option<u32>) -> Wrap {
    match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
