//! The legend of pictures of errors.

use crate::error_scale::{BEYOND_RANGE, ErrorScale};
use crate::picture::Picture;
use crate::style::Background;
use crate::text::Font;

/// Largest width of the bar without its box, in pixels a pixel of text height.
const WIDEST: usize = 24;

/// Steps between labels, most first: as many labels are written as have room.
const STEPS: [usize; 3] = [4, 2, 1];

/// A strip of a width that shows the colours of a scale, with lengths in millimetres under them. Set apart is
/// the colour of what is beyond the range. In strips too narrow for them, labels are left out.
#[must_use]
pub fn colour_bar(scale: &ErrorScale, width: usize, background: Background) -> Picture {
    let font = Font::for_width(width);
    let layout = Layout::new(font, width, millimetres(scale, 1, 1).len());
    let mut strip = Picture::filled([width, font.height() * 3], background.rgba());
    let [top, bottom] = [font.height() / 2, font.height() * 5 / 4];
    for y in top..bottom {
        for x in 0..layout.bar {
            let error_m = scale.range_m() * (x as f64 + 0.5) / layout.bar as f64;
            strip.lay_over([layout.left + x, y], scale.colour(error_m), 255);
        }
        for x in layout.box_left..layout.box_left + layout.box_width {
            strip.lay_over([x, y], BEYOND_RANGE, 255);
        }
    }
    let mut label = |text: &str, middle: usize| {
        let left = middle.saturating_sub(font.width(text) / 2);
        font.write(&mut strip, text, [left, bottom + font.height() / 6], background.ink());
    };
    let Some(steps) = layout.steps(font, scale) else { return strip };
    for step in 0..=steps {
        label(&millimetres(scale, step, steps), layout.left + layout.bar * step / steps);
    }
    label("beyond", layout.box_left + layout.box_width / 2);
    strip
}

/// Places of things, in pixels from the left of the strip.
struct Layout {
    left: usize,
    bar: usize,
    box_left: usize,
    box_width: usize,
}

impl Layout {
    fn new(font: Font, width: usize, label_length: usize) -> Self {
        let letter = font.width("0");
        // Labels reach over both ends by half; the box is as wide as its label.
        let box_width = 6 * letter;
        let [margin, gap] = [label_length.div_ceil(2) * letter, (label_length.div_ceil(2) + 2) * letter];
        let bar = width.saturating_sub(margin + gap + box_width + letter).min(WIDEST * font.height());
        let left = (width - (bar + gap + box_width).min(width)) / 2;
        Self { left, bar, box_left: left + bar + gap, box_width }
    }

    /// Into how many parts labels divide the bar; none if not even both ends have room.
    fn steps(&self, font: Font, scale: &ErrorScale) -> Option<usize> {
        STEPS.into_iter().find(|&steps| {
            let longest = (0..=steps).map(|step| font.width(&millimetres(scale, step, steps))).max();
            longest.is_some_and(|longest| longest + font.width("0") <= self.bar / steps)
        })
    }
}

/// A part of a scale's range in millimetres; the last with its unit.
fn millimetres(scale: &ErrorScale, step: usize, steps: usize) -> String {
    let mm = scale.range_m() * 1e3 * step as f64 / steps as f64;
    let digits = (mm * 1e6).round() / 1e6;
    if step == steps { format!("{digits} mm") } else { digits.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_runs_through_the_scale_and_ends_before_the_box() {
        let scale = ErrorScale::new(0.002).unwrap();
        let strip = colour_bar(&scale, 384, Background::Light);
        assert_eq!(strip.size()[0], 384);
        let row: Vec<[u8; 3]> = (0..384)
            .map(|x| {
                let [r, g, b, _] = strip.pixel(x, 12);
                [r, g, b]
            })
            .collect();
        let background = [250, 250, 248];
        let bar = row.iter().position(|c| *c != background).unwrap();
        let end = bar + row[bar..].iter().position(|c| *c == background).unwrap();
        let worst = |a: [u8; 3], b: [u8; 3]| (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap();
        assert!(worst(row[bar], scale.colour(0.0)) < 4 && worst(row[end - 1], scale.colour(0.002)) < 4);
        assert!(worst(row[(bar + end) / 2], scale.colour(0.001)) < 4);
        assert_eq!(row.iter().filter(|c| **c == BEYOND_RANGE).count(), 6 * 7, "six letters");
        assert!(row[..end].iter().all(|c| *c != BEYOND_RANGE));
    }

    #[test]
    fn labels_divide_the_range_without_a_tail_of_digits() {
        let scale = ErrorScale::new(0.0003).unwrap();
        let labels: Vec<String> = (0..=4).map(|step| millimetres(&scale, step, 4)).collect();
        assert_eq!(labels, ["0", "0.075", "0.15", "0.225", "0.3 mm"]);
    }

    #[test]
    fn any_width_has_a_strip() {
        let scale = ErrorScale::new(12.345678).unwrap();
        for width in [0, 1, 7, 40, 99, 150, 384, 5000] {
            assert_eq!(colour_bar(&scale, width, Background::Transparent).size()[0], width);
        }
    }
}
