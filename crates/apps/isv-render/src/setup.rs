//! Settings and drawing of the pictures of a sequence.

use crate::{
    Background, Camera, ErrorPicture, ErrorScale, Picture, SeenErrors, Style, colour_bar, contact_sheet,
    render, render_errors, text_fits, text_line,
};
use glam::DVec3;
use isv_volume::TriangleMesh;
use std::fmt;

/// Letters of a caption with errors, as far as such things go. Where pictures are too narrow for it, it has a line for each error.
const LONGEST_CAPTION: usize = "frame 99999: mean 999.999 mm, largest 999.999 mm".len();

/// Settings that all pictures of a sequence share: camera, shading, caption and legend.
#[derive(Clone, Debug)]
pub struct RenderSetup {
    /// From where.
    pub camera: Camera,
    /// Shading and background.
    pub style: Style,
    /// Colours of errors, in pictures of them.
    pub scale: Option<ErrorScale>,
    /// Whether the number of the frame is written under each picture, with its errors.
    pub captions: bool,
}

impl RenderSetup {
    /// Draws a frame from a yaw (degrees). `distance`: how far a place (m) is from the surface that errors are measured against (m). Also
    /// says how large the errors are that the picture shows.
    pub fn draw(
        &self,
        mesh: &TriangleMesh,
        distance: Option<impl Fn(DVec3) -> f64 + Sync>,
        number: usize,
        yaw_degrees: f64,
    ) -> (Picture, Option<SeenErrors>) {
        let camera = Camera { yaw_degrees, ..self.camera };
        let ErrorPicture { picture, seen } = match (distance, &self.scale) {
            (Some(distance), Some(scale)) => render_errors(mesh, &camera, &self.style, scale, distance),
            _ => ErrorPicture { picture: render(mesh, &camera, &self.style), seen: None },
        };
        (self.captioned(picture, number, seen), seen)
    }

    /// The picture with its caption, which has as many lines in all pictures of a size.
    fn captioned(&self, picture: Picture, number: usize, seen: Option<SeenErrors>) -> Picture {
        if !self.captions {
            return picture;
        }
        let frame = format!("frame {number}");
        let width = picture.size()[0];
        let lines = match (&self.scale, seen) {
            (None, _) => vec![frame],
            (Some(_), Some(seen)) if text_fits(LONGEST_CAPTION, width) => {
                vec![format!("{frame}: {seen}")]
            }
            (Some(_), None) if text_fits(LONGEST_CAPTION, width) => vec![frame],
            (Some(_), seen) => {
                let [mean, largest] = seen.map(errors).unwrap_or_default();
                vec![frame, mean, largest]
            }
        };
        let line =
            |picture: Picture, text: &String| picture.above(&text_line(text, width, self.background()));
        lines.iter().fold(picture, line)
    }

    /// The picture with a legend under it, if its colours need one.
    #[must_use]
    pub fn with_legend(&self, picture: Picture) -> Picture {
        match &self.scale {
            Some(scale) => picture.above(&colour_bar(scale, picture.size()[0], self.background())),
            None => picture,
        }
    }

    /// One picture, or a contact sheet of several, and the legend.
    #[must_use]
    pub fn still(&self, mut pictures: Vec<Picture>, columns: Option<usize>) -> Picture {
        let columns = columns.unwrap_or((pictures.len() as f64).sqrt().ceil() as usize);
        let picture =
            if pictures.len() == 1 { pictures.swap_remove(0) } else { contact_sheet(&pictures, columns) };
        self.with_legend(picture)
    }

    /// Width and height of each picture of an animation.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        let blank = Picture::filled(self.camera.size, self.background().rgba());
        self.with_legend(self.captioned(blank, 0, None)).size()
    }

    fn background(&self) -> Background {
        self.style.background
    }
}

fn errors(seen: SeenErrors) -> [String; 2] {
    [format!("mean {:.3} mm", seen.mean_m * 1e3), format!("largest {:.3} mm", seen.max_m * 1e3)]
}

impl fmt::Display for SeenErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&errors(*self).join(", "))
    }
}
