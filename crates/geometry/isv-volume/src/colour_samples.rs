//! Colours seen near a surface.

/// A colour as seen at a point: of a texture, a scanned point, or a camera's pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSample {
    /// Place in metres.
    pub position: [f32; 3],
    /// Unit normal towards the outside; zero if it is not known.
    pub normal: [f32; 3],
    /// sRGB of 0 to 255 a channel.
    pub colour: [f32; 3],
    /// How much it counts: the area that it stands for, less where it was seen at an angle. In any unit that all samples of a frame
    /// have.
    pub weight: f32,
}
