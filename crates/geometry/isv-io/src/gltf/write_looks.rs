//! Materials and images of a file that is written, each once.

use super::write::List;
use crate::image::write_png;
use isv_volume::{Image, Material, Wrap};
use serde_json::{Value, json};
use std::io;
use std::sync::{Arc, Weak};

/// Lists of the JSON that colours need.
#[derive(Debug)]
pub(super) struct Looks {
    pub(super) materials: List,
    pub(super) textures: List,
    pub(super) images: List,
    pub(super) samplers: List,
    /// Materials that were written. The images are not kept: a sequence may have one a frame.
    written: Vec<Written>,
    /// Images that were written, and their places.
    written_images: Vec<(Weak<Image>, usize)>,
}

#[derive(Debug)]
struct Written {
    base_colour: [f32; 3],
    wrap: [Wrap; 2],
    image: Option<usize>,
    index: usize,
}

/// Place of the material of meshes without one.
const WHITE: usize = 0;

impl Looks {
    pub(super) fn new() -> Self {
        let list = List::default;
        let mut materials = list();
        materials.push(&material(json!({})));
        let (textures, images, samplers) = (list(), list(), list());
        Self { materials, textures, images, samplers, written: Vec::new(), written_images: Vec::new() }
    }

    /// Index of a material. `push_view` writes the bytes of an image that was not written before, and gives their view.
    pub(super) fn push(
        &mut self,
        look: Option<&Material>,
        push_view: impl FnOnce(Vec<u8>) -> io::Result<usize>,
    ) -> io::Result<usize> {
        let Some(look) = look.filter(|look| **look != Material::default()) else { return Ok(WHITE) };
        let image = look.texture.as_ref().map(|image| self.push_image(image, push_view)).transpose()?;
        let Material { base_colour, wrap, .. } = *look;
        let known = |written: &&Written| {
            written.base_colour == base_colour && written.wrap == wrap && written.image == image
        };
        if let Some(written) = self.written.iter().find(known) {
            return Ok(written.index);
        }
        let mut colour = json!({});
        if base_colour != [1.0; 3] {
            let [red, green, blue] = base_colour.map(f64::from);
            colour["baseColorFactor"] = json!([red, green, blue, 1.0]);
        }
        if let Some(image) = image {
            let sampler = json!({ "wrapS": code(wrap[0]), "wrapT": code(wrap[1]) });
            let texture = json!({ "source": image, "sampler": self.samplers.push(&sampler) });
            colour["baseColorTexture"] = json!({ "index": self.textures.push(&texture) });
        }
        let index = self.materials.push(&material(colour));
        self.written.push(Written { base_colour, wrap, image, index });
        Ok(index)
    }

    fn push_image(
        &mut self,
        image: &Arc<Image>,
        push_view: impl FnOnce(Vec<u8>) -> io::Result<usize>,
    ) -> io::Result<usize> {
        if let Some(place) = self.place_of(image) {
            return Ok(place);
        }
        let mut bytes = Vec::new();
        write_png(&mut bytes, image)?;
        let view = push_view(bytes)?;
        let place = self.images.push(&json!({ "bufferView": view, "mimeType": "image/png" }));
        self.written_images.push((Arc::downgrade(image), place));
        Ok(place)
    }

    fn place_of(&self, image: &Arc<Image>) -> Option<usize> {
        let image = Arc::downgrade(image);
        self.written_images.iter().find(|(other, _)| other.ptr_eq(&image)).map(|(_, place)| *place)
    }

    /// Most bytes that the images of materials take which were not written yet.
    pub(super) fn bytes_of_images(&self, materials: &[Material]) -> u64 {
        let images = materials.iter().filter_map(|material| material.texture.as_ref());
        let new = images.filter(|image| self.place_of(image).is_none());
        // What cannot be compressed is stored, with a byte a row and a few for each piece.
        const HEAD: u64 = 1 << 16;
        new.map(|image| (3 * u64::from(image.width()) + 2) * u64::from(image.height()) * 65 / 64 + HEAD).sum()
    }
}

/// A material of a base colour: matt, and seen from both sides, as captured surfaces may be open.
fn material(mut colour: Value) -> Value {
    colour["metallicFactor"] = 0.into();
    colour["roughnessFactor"] = json!(0.8);
    json!({ "pbrMetallicRoughness": colour, "doubleSided": true })
}

/// The specification's code of a treatment.
fn code(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 10497,
        Wrap::Mirror => 33648,
        Wrap::Clamp => 33071,
    }
}
