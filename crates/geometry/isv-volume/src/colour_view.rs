//! Colour images and the cameras that took them.

use crate::{CameraPose, Image, Intrinsics};
use glam::{DMat3, DVec2};
use std::sync::Arc;

/// Colour image of one camera at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourView {
    image: Arc<Image>,
    intrinsics: Intrinsics,
    pose: CameraPose,
    /// Pixels that show something; empty if all do.
    shown: Vec<bool>,
    depth_image: Option<usize>,
    is_rough: bool,
}

impl ColourView {
    /// Joins an image and its camera, a pinhole; `None` if their sizes differ.
    #[must_use]
    pub fn new(image: Arc<Image>, intrinsics: Intrinsics, pose: CameraPose) -> Option<Self> {
        let fits = [intrinsics.width, intrinsics.height] == [image.width(), image.height()];
        fits.then(|| Self { image, intrinsics, pose, shown: Vec::new(), depth_image: None, is_rough: false })
    }

    /// Sets which pixels show something; all do if the count is not that of the image.
    #[must_use]
    pub fn with_shown(self, shown: Vec<bool>) -> Self {
        let shown = if shown.len() == self.image.pixels().len() { shown } else { Vec::new() };
        Self { shown, ..self }
    }

    /// Sets the depth image of the same frame, by its number, that looks the same way from nearby.
    #[must_use]
    pub fn with_depth_image(self, depth_image: Option<usize>) -> Self {
        Self { depth_image, ..self }
    }

    /// Sets whether the camera was never calibrated, so that pixels may be off by several.
    #[must_use]
    pub fn with_rough_calibration(self, is_rough: bool) -> Self {
        Self { is_rough, ..self }
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// The lens, of the image's size.
    #[must_use]
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The camera's place.
    #[must_use]
    pub fn pose(&self) -> &CameraPose {
        &self.pose
    }

    /// Number of the depth image of the same frame that looks the same way from nearby.
    #[must_use]
    pub fn depth_image(&self) -> Option<usize> {
        self.depth_image
    }

    /// Whether the camera was never calibrated, so that pixels may be off by several.
    #[must_use]
    pub fn is_rough(&self) -> bool {
        self.is_rough
    }

    /// Colour at a column and row, 0 to 255 a channel, where whole numbers are the middles of pixels. `None` outside of the image and
    /// beside pixels that show nothing.
    #[must_use]
    pub fn colour(&self, place: DVec2) -> Option<[f32; 3]> {
        let (right, bottom) = (f64::from(self.image.width() - 1), f64::from(self.image.height() - 1));
        if !((-0.5..=right + 0.5).contains(&place.x) && (-0.5..=bottom + 0.5).contains(&place.y)) {
            return None;
        }
        if !self.shown.is_empty() {
            let [low, high] = [place.floor(), place.ceil()]
                .map(|p| DVec2::new(p.x.clamp(0.0, right), p.y.clamp(0.0, bottom)).as_uvec2());
            let is_shown = |x: u32, y: u32| self.shown[(y * self.image.width() + x) as usize];
            let corners = [[low.x, low.y], [high.x, low.y], [low.x, high.y], [high.x, high.y]];
            if !corners.into_iter().all(|[x, y]| is_shown(x, y)) {
                return None;
            }
        }
        Some(self.image.bilinear(place.x + 0.5, place.y + 0.5))
    }

    /// The view with its camera turned about the world's origin by a rotation.
    #[must_use]
    pub fn turned(mut self, rotation: DMat3) -> Self {
        self.pose = self.pose.turned(rotation);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    fn view() -> ColourView {
        let image = Image::new(3, 2, (0..6).map(|i| [40 * i, 0, 0]).collect()).unwrap();
        let lens = Intrinsics { width: 3, height: 2, focal: DVec2::ONE, principal: DVec2::ZERO };
        let pose = CameraPose::from_matrix(DMat4::IDENTITY).unwrap();
        assert!(ColourView::new(Arc::new(image.clone()), Intrinsics { width: 2, ..lens }, pose).is_none());
        ColourView::new(Arc::new(image), lens, pose).unwrap()
    }

    #[test]
    fn colours_lie_between_the_middles_of_pixels() {
        let view = view();
        assert_eq!(view.colour(DVec2::new(1.0, 0.0)), Some([40.0, 0.0, 0.0]));
        assert_eq!(view.colour(DVec2::new(0.5, 0.5)), Some([80.0, 0.0, 0.0]));
        assert_eq!(view.colour(DVec2::new(2.5, 1.5)), Some([200.0, 0.0, 0.0]));
        for outside in [DVec2::new(2.6, 0.0), DVec2::new(0.0, -0.6), DVec2::NAN, DVec2::INFINITY] {
            assert_eq!(view.colour(outside), None);
        }
    }

    #[test]
    fn pixels_that_show_nothing_give_no_colour() {
        let view = view().with_shown(vec![true, true, false, true, true, true]);
        assert!(view.colour(DVec2::new(1.0, 0.0)).is_some());
        assert!(view.colour(DVec2::new(1.2, 0.2)).is_none());
        assert!(view.colour(DVec2::new(2.0, 1.0)).is_some());
        assert!(view.with_shown(vec![false]).colour(DVec2::new(2.0, 0.0)).is_some());
    }
}
