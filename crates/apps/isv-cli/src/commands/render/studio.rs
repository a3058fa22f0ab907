//! How one picture is made: drawn, captioned, with the legend of its colours.

use super::footage::Scene;
use isv::raw::volume::TriangleMesh;
use isv_render::{
    Background, Camera, ErrorPicture, ErrorScale, Picture, SeenErrors, Style, colour_bar, contact_sheet,
    render, render_errors, text_fits, text_line,
};
use isv_spatial::Bvh;

/// Letters of a caption with errors, as far as such things go. Where pictures are too narrow for it, it has a line for each error.
const LONGEST_CAPTION: usize = "frame 99999: mean 999.999 mm, largest 999.999 mm".len();

/// What all pictures have in common.
pub(super) struct Studio {
    pub(super) camera: Camera,
    pub(super) style: Style,
    /// Colours of errors, in pictures of them.
    pub(super) scale: Option<ErrorScale>,
    pub(super) captions: bool,
}

impl Studio {
    /// Draws a frame from a yaw; also says how large the errors are that it shows.
    pub(super) fn draw(&self, scene: &Scene, number: usize, yaw: f64) -> (Picture, Option<SeenErrors>) {
        let camera = Camera { yaw_degrees: yaw, ..self.camera };
        let ErrorPicture { picture, seen } = match (&scene.reference, &self.scale) {
            (Some(reference), Some(scale)) => self.draw_errors(&scene.mesh, &camera, scale, reference),
            _ => ErrorPicture { picture: render(&scene.mesh, &camera, &self.style), seen: None },
        };
        (self.captioned(picture, number, seen), seen)
    }

    fn draw_errors(
        &self,
        mesh: &TriangleMesh,
        camera: &Camera,
        scale: &ErrorScale,
        reference: &Bvh,
    ) -> ErrorPicture {
        render_errors(mesh, camera, &self.style, scale, |point| reference.distance(point))
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
                vec![format!("{frame}: {}", in_words(seen))]
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
    pub(super) fn with_legend(&self, picture: Picture) -> Picture {
        match &self.scale {
            Some(scale) => picture.above(&colour_bar(scale, picture.size()[0], self.background())),
            None => picture,
        }
    }

    /// One picture, or a contact sheet of several, and the legend.
    pub(super) fn still(&self, mut pictures: Vec<Picture>, columns: Option<usize>) -> Picture {
        let columns = columns.unwrap_or((pictures.len() as f64).sqrt().ceil() as usize);
        let picture =
            if pictures.len() == 1 { pictures.swap_remove(0) } else { contact_sheet(&pictures, columns) };
        self.with_legend(picture)
    }

    /// Width and height of each picture of an animation.
    pub(super) fn size(&self) -> [usize; 2] {
        let blank = Picture::filled(self.camera.size, self.background().rgba());
        self.with_legend(self.captioned(blank, 0, None)).size()
    }

    fn background(&self) -> Background {
        self.style.background
    }
}

/// Errors of a picture, for people.
pub(super) fn in_words(seen: SeenErrors) -> String {
    errors(seen).join(", ")
}

fn errors(seen: SeenErrors) -> [String; 2] {
    [format!("mean {:.3} mm", seen.mean_m * 1e3), format!("largest {:.3} mm", seen.max_m * 1e3)]
}
