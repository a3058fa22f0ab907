//! The JSON of glTF 2.0, as far as colours need it: materials, textures, images and samplers. All names are the specification's. It is
//! parsed only where colours are kept, so that nobody else stumbles over a broken material.

use serde::Deserialize;

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct LookDocument {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<Image>,
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Material {
    pbr_metallic_roughness: MetallicRoughness,
    extensions: MaterialExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct MetallicRoughness {
    base_color_factor: Vec<f32>,
    base_color_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct MaterialExtensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct SpecularGlossiness {
    diffuse_factor: Vec<f32>,
    diffuse_texture: Option<TextureInfo>,
}

impl Material {
    /// Linear factors of the base colour, and its texture. The older model of specular colours goes before the newer one.
    pub(super) fn base_colour(&self) -> (&[f32], Option<&TextureInfo>) {
        match &self.extensions.specular_glossiness {
            Some(older) => (&older.diffuse_factor, older.diffuse_texture.as_ref()),
            None => {
                let newer = &self.pbr_metallic_roughness;
                (&newer.base_color_factor, newer.base_color_texture.as_ref())
            }
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    tex_coord: usize,
    #[serde(default)]
    extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Option<TextureTransform>,
}

/// A transform of texture coordinates: scale first, then rotation, then offset.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureTransform {
    offset: [f32; 2],
    /// Radians, counter-clockwise where v goes down.
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<usize>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

impl TextureTransform {
    /// A texture coordinate where the transform puts it.
    pub(super) fn place(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let (u, v) = (u * self.scale[0], v * self.scale[1]);
        let (sin, cos) = self.rotation.sin_cos();
        [cos * u + sin * v + self.offset[0], cos * v - sin * u + self.offset[1]]
    }
}

impl TextureInfo {
    /// The set of texture coordinates, and what becomes of them.
    pub(super) fn coordinates(&self) -> (usize, TextureTransform) {
        let transform = self.extensions.transform.unwrap_or_default();
        (transform.tex_coord.unwrap_or(self.tex_coord), transform)
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct Texture {
    pub(super) sampler: Option<usize>,
    source: Option<usize>,
    #[serde(default)]
    extensions: TextureExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    webp: Option<TextureSource>,
    #[serde(rename = "KHR_texture_basisu")]
    basisu: Option<TextureSource>,
}

#[derive(Debug, Deserialize)]
struct TextureSource {
    source: Option<usize>,
}

impl Texture {
    /// The image: PNG or JPEG if the file has it, else WebP, else KTX2.
    pub(super) fn image(&self) -> Option<usize> {
        let TextureExtensions { webp, basisu } = &self.extensions;
        let of_extension = |source: &Option<TextureSource>| source.as_ref().and_then(|source| source.source);
        self.source.or_else(|| of_extension(webp)).or_else(|| of_extension(basisu))
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Image {
    pub(super) name: String,
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) wrap_s: Option<u32>,
    pub(super) wrap_t: Option<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_extension_uses_the_lower_left_quadrant() {
        let transform = TextureTransform {
            offset: [0.0, 1.0],
            rotation: std::f32::consts::FRAC_PI_2,
            scale: [0.5, 0.5],
            tex_coord: None,
        };
        for (from, to) in [([0.0, 0.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.5]), ([0.0, 1.0], [0.5, 1.0])] {
            let placed = transform.place(from);
            assert!((0..2).all(|axis| (placed[axis] - to[axis]).abs() < 1e-6), "{placed:?} is not {to:?}");
        }
    }
}
