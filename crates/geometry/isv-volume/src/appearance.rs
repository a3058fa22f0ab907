//! Colours of triangle meshes: images, materials and texture coordinates.

use std::fmt;
use std::sync::Arc;
use thiserror::Error;

/// A colour as 8-bit sRGB: red, green, blue.
pub type Rgb = [u8; 3];

/// An image of 8-bit sRGB pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<Rgb>,
}

impl Image {
    /// Creates an image from `width * height` pixels, row by row from the top; `None` if the counts differ or a side is 0.
    #[must_use]
    pub fn new(width: u32, height: u32, pixels: Vec<Rgb>) -> Option<Self> {
        let count = (width as usize).checked_mul(height as usize)?;
        (count > 0 && count == pixels.len()).then_some(Self { width, height, pixels })
    }

    /// Width in pixels.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// Colour between pixels, 0 to 255 a channel. `x` and `y` count pixels from the left and the top edge, so
    /// that the middle of the first pixel lies at (0.5, 0.5). Outside the image the nearest pixel counts.
    /// sRGB values are averaged as they are.
    #[must_use]
    #[inline(always)]
    pub fn bilinear(&self, x: f64, y: f64) -> [f32; 3] {
        let along = |at: f64, side: u32| {
            let at = (at - 0.5).clamp(0.0, f64::from(side - 1));
            let low = at as u32;
            (low as usize, (low + 1).min(side - 1) as usize, (at - f64::from(low)) as f32)
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (along(x, self.width), along(y, self.height));
        let row = |y: usize| &self.pixels[y * self.width as usize..][..self.width as usize];
        let (upper, lower) = (row(y0), row(y1));
        let corners = [upper[x0], upper[x1], lower[x0], lower[x1]];
        let mut colour = [0.0; 3];
        for channel in 0..3 {
            let mut of_corners = [0.0; 4];
            for corner in 0..4 {
                of_corners[corner] = f32::from(corners[corner][channel]);
            }
            let [a, b, c, d] = of_corners;
            let (above, below) = (a + (b - a) * fx, c + (d - c) * fx);
            colour[channel] = above + (below - above) * fy;
        }
        colour
    }
}

/// Treatment of texture coordinates outside `0 ..= 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, every second time mirrored.
    Mirror,
    /// The texture's edge goes on.
    Clamp,
}

impl Wrap {
    /// The place inside `0 ..= 1` that a coordinate stands for. A coordinate that is not finite stands for 0.
    #[must_use]
    #[inline]
    pub fn place(self, at: f64) -> f64 {
        if !at.is_finite() {
            return 0.0;
        }
        match self {
            // A coordinate of exactly 1 is the far edge, not the near one: atlases are addressed up to 1.
            Self::Repeat if (0.0..=1.0).contains(&at) => at,
            Self::Repeat => at.rem_euclid(1.0),
            Self::Mirror => {
                let at = at.rem_euclid(2.0);
                if at > 1.0 { 2.0 - at } else { at }
            }
            Self::Clamp => at.clamp(0.0, 1.0),
        }
    }
}

/// A base colour and a texture that it tints.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Linear factors of red, green and blue, `0 ..= 1`: glTF's `baseColorFactor`, OBJ's `Kd`.
    pub base_colour: [f32; 3],
    /// Texture of the base colour; `None` where the factors are all.
    pub texture: Option<Arc<Image>>,
    /// Treatment of coordinates outside the texture, along its width and its height.
    pub wrap: [Wrap; 2],
}

impl Default for Material {
    /// White, without texture.
    fn default() -> Self {
        Self { base_colour: [1.0; 3], texture: None, wrap: [Wrap::Repeat; 2] }
    }
}

impl Material {
    /// Colour at a texture coordinate, as sRGB of 0 to 255 a channel. `u` goes right and `v` down from the image's upper left corner.
    /// A coordinate that is not finite gives the base colour.
    #[must_use]
    #[inline(always)]
    pub fn colour(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let texel = match &self.texture {
            Some(image) if u.is_finite() && v.is_finite() => {
                let (u, v) = (self.wrap[0].place(f64::from(u)), self.wrap[1].place(f64::from(v)));
                image.bilinear(u * f64::from(image.width()), v * f64::from(image.height()))
            }
            _ => [255.0; 3],
        };
        if self.base_colour == [1.0; 3] { texel } else { tinted(texel, self.base_colour) }
    }
}

/// Multiplies sRGB values of 0 to 255 with linear factors.
#[inline(never)]
fn tinted(colour: [f32; 3], factors: [f32; 3]) -> [f32; 3] {
    let tint = |value: f32, factor: f32| 255.0 * srgb_from_linear(linear_from_srgb(value / 255.0) * factor);
    [0, 1, 2].map(|channel| tint(colour[channel], factors[channel]))
}

/// Linear light of an sRGB value, both `0 ..= 1` (IEC 61966-2-1).
#[must_use]
pub fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB value of linear light, both `0 ..= 1` (IEC 61966-2-1).
#[must_use]
pub fn srgb_from_linear(light: f32) -> f32 {
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// A list of an appearance that is as long as a list of its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AppearanceList {
    /// One a vertex.
    VertexColours,
    /// One a face.
    TextureCoordinates,
    /// One a face.
    FaceMaterials,
}

impl fmt::Display for AppearanceList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::VertexColours => "vertex colours",
            Self::TextureCoordinates => "texture coordinates",
            Self::FaceMaterials => "face materials",
        })
    }
}

/// An appearance that does not fit its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AppearanceError {
    /// Lists of vertex colours, texture coordinates or materials that are neither empty nor as long as the mesh's.
    #[error("{found} {what} for {expected}")]
    Count {
        /// Contents of the list.
        what: AppearanceList,
        /// Length of the list.
        found: usize,
        /// The length of the mesh's list.
        expected: usize,
    },
    /// A face names a material that is not there.
    #[error("face {face} names material {material} of {materials}")]
    Material {
        /// Index of the face.
        face: usize,
        /// The material it names.
        material: u16,
        /// How many there are.
        materials: usize,
    },
}

/// The colour of a mesh: of its vertices, of textures, or of both, multiplied as glTF does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Appearance {
    /// sRGB of each vertex; empty without vertex colours.
    pub vertex_colours: Vec<Rgb>,
    /// Texture coordinates of each triangle's corners, right and down from the upper left corner; empty without textures. A triangle
    /// that has none in its file has NaN, and its material's base colour.
    pub texture_coordinates: Vec<[[f32; 2]; 3]>,
    /// Material of each triangle; empty if all have the first.
    pub face_materials: Vec<u16>,
    /// Materials; empty if vertex colours are all.
    pub materials: Vec<Material>,
}

impl Appearance {
    /// Checks that the lists fit a mesh of so many vertices and faces.
    ///
    /// # Errors
    /// The first list that does not fit.
    pub fn validate(&self, vertices: usize, faces: usize) -> Result<(), AppearanceError> {
        let lengths = [
            (AppearanceList::VertexColours, self.vertex_colours.len(), vertices),
            (AppearanceList::TextureCoordinates, self.texture_coordinates.len(), faces),
            (AppearanceList::FaceMaterials, self.face_materials.len(), faces),
        ];
        for (what, found, expected) in lengths {
            if found != 0 && found != expected {
                return Err(AppearanceError::Count { what, found, expected });
            }
        }
        let materials = self.materials.len();
        match self.face_materials.iter().position(|m| usize::from(*m) >= materials.max(1)) {
            Some(face) => {
                let material = self.face_materials[face];
                Err(AppearanceError::Material { face, material, materials })
            }
            None => Ok(()),
        }
    }

    /// The appearance of some faces of the mesh, in their order; each comes with whether its second and third corner change places. Vertices
    /// keep their numbers.
    ///
    /// # Panics
    /// If a face is not there.
    #[must_use]
    pub fn of_faces(&self, faces: impl Iterator<Item = (usize, bool)>) -> Self {
        let mut kept = Self {
            vertex_colours: self.vertex_colours.clone(),
            materials: self.materials.clone(),
            ..Self::default()
        };
        for (face, is_turned) in faces {
            if !self.texture_coordinates.is_empty() {
                let [a, b, c] = self.texture_coordinates[face];
                kept.texture_coordinates.push(if is_turned { [a, c, b] } else { [a, b, c] });
            }
            if !self.face_materials.is_empty() {
                kept.face_materials.push(self.face_materials[face]);
            }
        }
        kept
    }

    /// Colour at a point of a face, as sRGB of 0 to 255 a channel. `triangle` is the face's vertices, `weights` are the point's
    /// barycentric coordinates.
    ///
    /// # Panics
    /// If the appearance does not fit the mesh ([`Self::validate`]).
    #[must_use]
    #[inline(always)]
    pub fn colour(&self, face: usize, triangle: [u32; 3], weights: [f32; 3]) -> [f32; 3] {
        let material = self.face_materials.get(face).map_or(0, |m| usize::from(*m));
        let of_material = match self.materials.get(material) {
            Some(material) => {
                let corners = self.texture_coordinates.get(face).copied().unwrap_or([[f32::NAN; 2]; 3]);
                let mut at = [0.0; 2];
                for corner in 0..3 {
                    at[0] += weights[corner] * corners[corner][0];
                    at[1] += weights[corner] * corners[corner][1];
                }
                Some(material.colour(at))
            }
            None => None,
        };
        if self.vertex_colours.is_empty() {
            return of_material.unwrap_or([255.0; 3]);
        }
        let of_vertices = self.vertex_colour(triangle, weights);
        match of_material {
            Some(material) if of_vertices != [255.0; 3] => {
                tinted(material, of_vertices.map(|value| linear_from_srgb(value / 255.0)))
            }
            Some(material) => material,
            None => of_vertices,
        }
    }

    /// Colour between the vertices of a triangle, of which each has one.
    #[inline(never)]
    fn vertex_colour(&self, triangle: [u32; 3], weights: [f32; 3]) -> [f32; 3] {
        let corners = triangle.map(|vertex| self.vertex_colours[vertex as usize]);
        [0, 1, 2].map(|channel| (0..3).map(|i| weights[i] * f32::from(corners[i][channel])).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks() -> Image {
        Image::new(2, 2, vec![[0; 3], [255, 0, 0], [0, 255, 0], [255, 255, 255]]).unwrap()
    }

    #[test]
    fn an_image_has_as_many_pixels_as_its_sides_say() {
        assert!(Image::new(2, 2, vec![[0; 3]; 3]).is_none());
        assert!(Image::new(0, 5, vec![]).is_none());
        assert!(Image::new(u32::MAX, u32::MAX, vec![]).is_none());
    }

    #[test]
    fn bilinear_reads_middles_and_between() {
        let image = checks();
        assert_eq!(image.bilinear(1.5, 0.5), [255.0, 0.0, 0.0]);
        assert_eq!(image.bilinear(1.0, 1.0), [127.5, 127.5, 63.75]);
        assert_eq!(image.bilinear(-9.0, 99.0), [0.0, 255.0, 0.0]);
    }

    #[test]
    fn wraps_stay_in_the_texture() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for at in [-1.25, 0.0, 0.3, 1.0, 7.75, f64::NAN, f64::INFINITY] {
                assert!((0.0..=1.0).contains(&wrap.place(at)), "{wrap:?} {at}");
            }
        }
        assert_eq!([Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(|w| w.place(1.25)), [0.25, 0.75, 1.0]);
        assert_eq!(Wrap::Repeat.place(1.0), 1.0);
    }

    #[test]
    fn factors_multiply_light() {
        let half = Material { base_colour: [0.5; 3], ..Material::default() };
        let [grey, ..] = half.colour([0.0; 2]);
        assert!((grey - 187.5).abs() < 0.1, "{grey}");
        let textured = Material { texture: Some(Arc::new(checks())), ..Material::default() };
        assert_eq!(textured.colour([0.75, 0.25]), [255.0, 0.0, 0.0]);
    }

    #[test]
    fn without_a_coordinate_the_base_colour_counts() {
        let material = Material {
            base_colour: [1.0, 0.0, 1.0],
            texture: Some(Arc::new(checks())),
            ..Material::default()
        };
        for coordinate in [[f32::NAN, 0.5], [0.5, f32::INFINITY]] {
            assert_eq!(material.colour(coordinate).map(f32::round), [255.0, 0.0, 255.0]);
        }
        let appearance = Appearance { materials: vec![material], ..Appearance::default() };
        assert_eq!(appearance.colour(0, [0, 1, 2], [1.0, 0.0, 0.0]).map(f32::round), [255.0, 0.0, 255.0]);
    }

    #[test]
    fn lists_fit_the_mesh_or_are_refused() {
        let appearance = Appearance { vertex_colours: vec![[1, 2, 3]; 3], ..Appearance::default() };
        assert_eq!(appearance.validate(3, 1), Ok(()));
        assert_eq!(appearance.validate(5, 1).unwrap_err().to_string(), "3 vertex colours for 5");
        assert!(matches!(appearance.validate(4, 1), Err(AppearanceError::Count { found: 3, .. })));
        let appearance = Appearance { face_materials: vec![1], ..Appearance::default() };
        assert!(matches!(appearance.validate(3, 1), Err(AppearanceError::Material { material: 1, .. })));
    }

    #[test]
    fn some_faces_keep_their_colours() {
        let corners = |face: f32| [[face, 0.0], [face, 1.0], [face, 2.0]];
        let appearance = Appearance {
            vertex_colours: vec![[7; 3]; 4],
            texture_coordinates: vec![corners(0.0), corners(1.0), corners(2.0)],
            face_materials: vec![0, 1, 2],
            materials: vec![Material::default(); 3],
        };
        let kept = appearance.of_faces([(2, true), (0, false)].into_iter());
        assert_eq!(kept.texture_coordinates, [[[2.0, 0.0], [2.0, 2.0], [2.0, 1.0]], corners(0.0)]);
        assert_eq!((kept.face_materials, kept.vertex_colours.len()), (vec![2, 0], 4));
    }

    #[test]
    fn vertices_tint_textures() {
        let appearance = Appearance {
            vertex_colours: vec![[255, 0, 255]; 3],
            texture_coordinates: vec![[[0.75, 0.75]; 3]],
            materials: vec![Material { texture: Some(Arc::new(checks())), ..Material::default() }],
            ..Appearance::default()
        };
        assert_eq!(appearance.colour(0, [0, 1, 2], [1.0 / 3.0; 3]).map(f32::round), [255.0, 0.0, 255.0]);
    }
}
