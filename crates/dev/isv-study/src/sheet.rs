//! A contact sheet: the source and some streams side by side at a few frames, with close-ups.

use crate::picture::{Bounds, crop, png, top_of};
use crate::{Metric, Record, StudyError};
use glam::DVec3;
use isv::raw::volume::TriangleMesh;
use isv_render::{
    Background, Camera, ErrorScale, Picture, Shading, Style, colour_bar, contact_sheet, render,
    render_errors, text_line,
};
use isv_spatial::Bvh;

/// Width and height in pixels of a picture of the whole, and of a close-up.
const WHOLE: [usize; 2] = [320, 420];
const CLOSE_UP: [usize; 2] = [320, 320];

/// How many times finer the pictures are in which the largest difference is looked for, and out of which it is cut.
const FINER: usize = 4;

/// Height of the camera above the horizon (degrees).
const PITCH_DEGREES: f64 = 4.0;

/// Pixels from a silhouette within which pictures are not compared: colours are mixed with the background there.
const MARGIN: usize = 2;

/// A stream in a contact sheet.
#[derive(Debug)]
pub struct SheetStream {
    /// Name and figures of the column, which stand above it.
    pub lines: [String; 3],
    /// The decoded frames of the sheet, with the stream's colour if it has any.
    pub meshes: Vec<TriangleMesh>,
}

impl SheetStream {
    /// The stream of a record: its rates of geometry and of colour, and its errors, stand above it.
    #[must_use]
    pub fn of_record(record: &Record, meshes: Vec<TriangleMesh>) -> Self {
        let rates = match record.bytes_colour {
            0 => format!("{:.2} Mbps", record.geometry_mbps()),
            _ => format!("{:.2} + {:.2} Mbps", record.geometry_mbps(), record.colour_mbps()),
        };
        let one_way = || Some(format!("{:.2} mm one way", record.value(Metric::DecodedToSource)?));
        let both_ways = record.value(Metric::PointToSurface).map(|mm| format!("{mm:.2} mm"));
        let distance = both_ways.or_else(one_way);
        let colour = record.value(Metric::ColourY).map(|db| format!("Y {db:.1} dB"));
        let errors = distance.into_iter().chain(colour).collect::<Vec<_>>().join(", ");
        Self { lines: [record.codec.clone(), rates, errors], meshes }
    }
}

/// Frames of a source and of its streams, as pictures.
#[derive(Debug)]
pub struct Sheet {
    /// Numbers of the frames.
    pub frames: Vec<usize>,
    /// The source at these frames.
    pub source: Vec<TriangleMesh>,
    /// Streams at the same frames.
    pub streams: Vec<SheetStream>,
    /// Place among the frames of the one that close-ups are of.
    pub close_up: usize,
    /// Turn of the camera about the up axis (degrees): 0 looks from +z.
    pub yaw_degrees: f64,
    /// End of the scale of distances (m), above 0.
    pub range_m: f64,
}

impl Sheet {
    /// Draws the sheet as a PNG file: a column for the source and one for each stream. If the source has colour, pictures
    /// show colour without light, and a stream without colour is grey. Else pictures show surface normals. A row of the frame
    /// of the close-ups shows distances from the source, and one normals where the others show colour.
    ///
    /// # Errors
    /// A picture that cannot be made into a file, a range that is no length.
    ///
    /// # Panics
    /// If there are no frames, or a column has more or fewer.
    pub fn png(&self) -> Result<Vec<u8>, StudyError> {
        let bounds = self.source.iter().filter_map(TriangleMesh::bounds);
        let bounds = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default();
        let mut sheet = self.heads();
        for (place, frame) in self.frames.iter().enumerate() {
            let camera = self.camera(bounds, WHOLE);
            let row = self.meshes(place).map(|mesh| self.draw(mesh, &camera)).collect();
            sheet = sheet.above(&captioned(&format!("frame {frame}"), row));
        }
        let (place, frame) = (self.close_up, self.frames[self.close_up]);
        let whole = self.camera(bounds, WHOLE);
        if self.has_colour() {
            let row = self.meshes(place).map(|mesh| render(mesh, &whole, &Style::default())).collect();
            sheet = sheet.above(&captioned(&format!("frame {frame}, surface normals"), row));
        }
        sheet = sheet.above(&self.distances(place, &whole)?);
        let top = self.camera(crop(&self.source[place], top_of(bounds)), CLOSE_UP);
        let row = self.meshes(place).map(|mesh| self.draw(mesh, &top)).collect();
        sheet = sheet.above(&captioned(&format!("frame {frame}, its top"), row));
        let fine = self.camera(bounds, WHOLE.map(|edge| edge * FINER));
        let pictures: Vec<_> = self.meshes(place).map(|mesh| self.draw(mesh, &fine)).collect();
        if let Some(corner) = self.largest_difference(place, &pictures) {
            let row = pictures.iter().map(|picture| picture.part(corner, CLOSE_UP)).collect();
            let what = if self.has_colour() { "colours" } else { "normals" };
            sheet = sheet.above(&captioned(&format!("frame {frame}, where {what} differ most"), row));
        }
        png(&sheet)
    }

    /// A row of distances from the source, under the scale of their colours.
    fn distances(&self, place: usize, camera: &Camera) -> Result<Picture, StudyError> {
        let scale = ErrorScale::new(self.range_m)
            .ok_or_else(|| StudyError::Chart("no range of distances".to_owned()))?;
        let source = Bvh::new(&self.source[place]);
        let distance = |point| source.distance(point);
        let draw = |mesh| render_errors(mesh, camera, &Style::default(), &scale, distance).picture;
        let row = self.meshes(place).map(draw).collect();
        let caption = format!("frame {}, distance from the source in mm", self.frames[place]);
        let bar = colour_bar(&scale, 2 * WHOLE[0], Background::Light);
        Ok(captioned(&caption, row).above(&bar))
    }

    fn has_colour(&self) -> bool {
        self.source.iter().any(|mesh| mesh.appearance.is_some())
    }

    /// The source and the streams at one of the frames.
    fn meshes(&self, place: usize) -> impl Iterator<Item = &TriangleMesh> {
        std::iter::once(&self.source[place])
            .chain(self.streams.iter().map(move |stream| &stream.meshes[place]))
    }

    fn draw(&self, mesh: &TriangleMesh, camera: &Camera) -> Picture {
        let shading = if self.has_colour() { Shading::Colour } else { Shading::Normals };
        render(mesh, camera, &Style { shading, ..Style::default() })
    }

    fn camera(&self, bounds: Bounds, size: [usize; 2]) -> Camera {
        Camera::fitting(bounds, size).from_direction(self.yaw_degrees, PITCH_DEGREES)
    }

    /// Draws the lines above the columns.
    fn heads(&self) -> Picture {
        let source = ["source", "", ""].map(str::to_owned);
        let columns: Vec<_> = std::iter::once(&source).chain(self.streams.iter().map(|s| &s.lines)).collect();
        let lines = (0..source.len()).flat_map(|line| columns.iter().map(move |column| &column[line]));
        let lines: Vec<_> = lines.map(|text| text_line(text, WHOLE[0], Background::Light)).collect();
        contact_sheet(&lines, columns.len())
    }

    /// Corner of the part, as large as a close-up, in which the pictures of comparable streams differ most from that of the source.
    /// `None` if they do not differ.
    fn largest_difference(&self, place: usize, pictures: &[Picture]) -> Option<[usize; 2]> {
        let (source, streams) = pictures.split_first()?;
        let [width, height] = source.size();
        let mut difference = vec![0.0; width * height];
        let comparable = |mesh: &TriangleMesh| mesh.appearance.is_some() == self.has_colour();
        for (stream, picture) in self.streams.iter().zip(streams) {
            if comparable(&stream.meshes[place]) {
                add_squares(&mut difference, source, picture);
            }
        }
        let sums = Sums::new(&difference, width);
        let [most_x, most_y] = [width - CLOSE_UP[0], height - CLOSE_UP[1]];
        // Corners on a grid finer than anyone sees.
        let corners = (0..=most_y).step_by(8).flat_map(|y| (0..=most_x).step_by(8).map(move |x| [x, y]));
        let best =
            corners.map(|corner| (sums.of(corner, CLOSE_UP), corner)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > 0.0).then_some(best.1)
    }
}

/// A row of pictures under a line of text.
fn captioned(caption: &str, row: Vec<Picture>) -> Picture {
    let pictures = contact_sheet(&row, row.len());
    text_line(caption, pictures.size()[0], Background::Light).above(&pictures)
}

/// Adds the squared differences of two pictures, where both show a surface and no silhouette is near.
fn add_squares(difference: &mut [f64], one: &Picture, other: &Picture) {
    let behind = Background::Light.rgba();
    let [width, height] = one.size();
    let pairs = || one.rgba().chunks_exact(4).zip(other.rgba().chunks_exact(4));
    let uncovered: Vec<_> = pairs().map(|(a, b)| f64::from(u8::from(a == behind || b == behind))).collect();
    let uncovered = Sums::new(&uncovered, width);
    for (pixel, (sum, (a, b))) in difference.iter_mut().zip(pairs()).enumerate() {
        let [left, top] = [pixel % width, pixel / width].map(|at| at.saturating_sub(MARGIN));
        let size = [(width - left).min(2 * MARGIN + 1), (height - top).min(2 * MARGIN + 1)];
        if uncovered.of([left, top], size) == 0.0 {
            let colours = DVec3::new(f64::from(a[0]), f64::from(a[1]), f64::from(a[2]))
                - DVec3::new(f64::from(b[0]), f64::from(b[1]), f64::from(b[2]));
            *sum += colours.length_squared();
        }
    }
}

/// Sums over rectangles, by the table of the sums up to each pixel.
struct Sums {
    width: usize,
    /// One row and one column more than pixels: the first are zero.
    table: Vec<f64>,
}

impl Sums {
    fn new(values: &[f64], width: usize) -> Self {
        let columns = width + 1;
        let mut table = vec![0.0; columns * (values.len() / width + 1)];
        for (y, row) in values.chunks_exact(width).enumerate() {
            let mut sum = 0.0;
            for (x, value) in row.iter().enumerate() {
                sum += value;
                table[(y + 1) * columns + x + 1] = table[y * columns + x + 1] + sum;
            }
        }
        Self { width, table }
    }

    /// The sum over a rectangle, by its upper left corner and its size.
    fn of(&self, [x, y]: [usize; 2], [width, height]: [usize; 2]) -> f64 {
        let at = |x: usize, y: usize| self.table[y * (self.width + 1) + x];
        at(x + width, y + height) - at(x, y + height) - at(x + width, y) + at(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv::raw::volume::Appearance;
    use std::sync::Arc;

    /// A square of a metre in one colour but for a small part of it.
    fn square(part: [u8; 3]) -> TriangleMesh {
        let side = 20;
        let places = (0..=side).flat_map(|y| (0..=side).map(move |x| [x, y]));
        let vertices =
            places.clone().map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 0.0) / f64::from(side));
        let colours = places.map(|[x, y]| if x > 15 && (4..9).contains(&y) { part } else { [90, 120, 60] });
        let face = |k: u32| {
            let a = k / side * (side + 1) + k % side;
            [[a, a + 1, a + side + 2], [a, a + side + 2, a + side + 1]]
        };
        let appearance = Appearance { vertex_colours: colours.collect(), ..Appearance::default() };
        TriangleMesh {
            vertices: vertices.collect(),
            triangles: (0..side * side).flat_map(face).collect(),
            appearance: Some(Arc::new(appearance)),
            ..TriangleMesh::default()
        }
    }

    fn sheet_of(decoded: TriangleMesh) -> Sheet {
        let stream = SheetStream { lines: ["a", "b", "c"].map(str::to_owned), meshes: vec![decoded] };
        let source = vec![square([90, 120, 60])];
        Sheet {
            frames: vec![7],
            source,
            streams: vec![stream],
            close_up: 0,
            yaw_degrees: 0.0,
            range_m: 0.002,
        }
    }

    #[test]
    fn the_close_up_shows_what_differs() {
        let sheet = sheet_of(square([200, 60, 60]));
        let fine = sheet.camera(sheet.source[0].bounds().unwrap(), WHOLE.map(|edge| edge * FINER));
        let pictures: Vec<_> = sheet.meshes(0).map(|mesh| sheet.draw(mesh, &fine)).collect();
        let corner = sheet.largest_difference(0, &pictures).unwrap();
        let reds =
            |picture: &Picture| picture.rgba().chunks_exact(4).filter(|p| p[0] > 180 && p[1] < 90).count();
        let [shown, all] = [reds(&pictures[1].part(corner, CLOSE_UP)), reds(&pictures[1])];
        assert!(all > 0 && shown == all, "{shown} of {all} at {corner:?}");
        assert!(sheet.png().unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn equal_pictures_have_no_close_up_of_differences() {
        let sheet = sheet_of(square([90, 120, 60]));
        let camera = sheet.camera(sheet.source[0].bounds().unwrap(), WHOLE);
        let pictures: Vec<_> = sheet.meshes(0).map(|mesh| sheet.draw(mesh, &camera)).collect();
        assert_eq!(sheet.largest_difference(0, &pictures), None);
    }

    #[test]
    fn sums_are_those_of_rectangles() {
        let values: Vec<f64> = (0..20).map(f64::from).collect();
        let sums = Sums::new(&values, 5);
        assert_eq!(sums.of([0, 0], [5, 4]), 190.0);
        assert_eq!(sums.of([1, 2], [2, 2]), 11.0 + 12.0 + 16.0 + 17.0);
    }
}
