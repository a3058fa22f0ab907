//! Charts, drawn by kuva, as SVG or PNG.

use crate::StudyError;
use kuva::prelude::{BarPlot, Layout, LegendPosition, LinePlot, Plot, ScatterPlot, TickFormat};
use std::sync::Arc;

/// Width and height of a chart, in SVG units.
const SIZE: [f64; 2] = [720.0, 440.0];

/// Pixels of a PNG to an SVG unit.
const PNG_SCALE: f32 = 2.0;

/// Room left beyond the first and last point, as a share of what the points span.
const MARGIN: f64 = 0.05;

/// Ratio of the largest to the smallest value that a logarithmic axis shows. Values below are left out. One is the
/// distance of a mesh that came back as it was, which is rounding or nothing.
const LARGEST_RATIO: f64 = 1e4;

/// Smallest value that a logarithmic axis shows: a bit a second, a nanometre in millimetres.
const SMALLEST: f64 = 1e-6;

/// What a chart shows along one direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// With the unit.
    pub label: String,
    /// Whether distances stand for ratios.
    pub logarithmic: bool,
}

impl Axis {
    /// An axis on which distances stand for differences.
    #[must_use]
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: false }
    }

    /// An axis on which distances stand for ratios.
    #[must_use]
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), logarithmic: true }
    }

    /// The values that can be shown, given all of them.
    fn shows(&self, values: impl Iterator<Item = f64>) -> impl Fn(f64) -> bool {
        let largest = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
        let logarithmic = self.logarithmic;
        move |v| v.is_finite() && !(logarithmic && v < SMALLEST.max(largest / LARGEST_RATIO))
    }

    /// From a little before the first to a little after the last of some values.
    fn range(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let on_axis = |v: f64| if self.logarithmic { v.ln() } else { v };
        let (low, high) = values
            .map(on_axis)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let margin = MARGIN * (high - low).max(0.1 * high.abs()).max(1e-3);
        [low - margin, high + margin].map(|v| if self.logarithmic { v.exp() } else { v })
    }
}

/// Points joined by a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Colour of the line, as in CSS.
    pub colour: String,
    /// Whether the line is broken.
    pub dashed: bool,
    /// In the order of the line.
    pub points: Vec<(f64, f64)>,
    /// What is said of each point under the pointer; as many as points, or none.
    pub labels: Vec<String>,
    /// Half the length of a vertical bar at each point; as many as points, or none.
    pub spread: Vec<f64>,
}

/// A chart of series, or of bars.
#[derive(Clone, Debug, PartialEq)]
pub enum Chart {
    /// Lines and points.
    Lines {
        /// Above the chart.
        title: String,
        /// To the right.
        x: Axis,
        /// Upwards.
        y: Axis,
        /// What is shown.
        series: Vec<Series>,
    },
    /// Bars, each of stacked parts.
    Bars {
        /// Above the chart.
        title: String,
        /// What heights stand for, with the unit.
        y: String,
        /// Names and colours of the parts.
        parts: Vec<(String, String)>,
        /// A name, and the height of each part.
        bars: Vec<(String, Vec<f64>)>,
    },
}

impl Chart {
    /// Renders the chart as an SVG document, which scales with the place that it is put into.
    #[must_use]
    pub fn svg(&self) -> String {
        let (plots, layout) = self.plots();
        let [width, height] = SIZE;
        kuva::render_to_svg(plots, layout).replacen(
            "<svg ",
            &format!("<svg viewBox=\"0 0 {width} {height}\" "),
            1,
        )
    }

    /// Renders the chart as a PNG file.
    ///
    /// # Errors
    /// What the renderer says.
    pub fn png(&self) -> Result<Vec<u8>, StudyError> {
        let (plots, layout) = self.plots();
        kuva::render_to_png(plots, layout, PNG_SCALE).map_err(|error| StudyError::Chart(error.to_string()))
    }

    fn plots(&self) -> (Vec<Plot>, Layout) {
        match self {
            Self::Lines { title, x, y, series } => lines(title, x, y, series),
            Self::Bars { title, y, parts, bars } => stacked_bars(title, y, parts, bars),
        }
    }
}

fn lines(title: &str, x: &Axis, y: &Axis, series: &[Series]) -> (Vec<Plot>, Layout) {
    let series = &shown(x, y, series);
    let mut plots = Vec::new();
    for one in series.iter().filter(|one| !one.points.is_empty()) {
        let mut line = LinePlot::new()
            .with_data(one.points.iter().copied())
            .with_color(one.colour.as_str())
            .with_stroke_width(1.8)
            .with_legend(one.name.as_str());
        if one.dashed {
            line = line.with_dashed();
        }
        if one.spread.len() == one.points.len() {
            line = line.with_y_err(one.spread.iter().copied());
        }
        plots.push(line.into());
        let dots = ScatterPlot::new()
            .with_data(one.points.iter().copied())
            .with_color(one.colour.as_str())
            .with_size(3.5)
            .with_tooltip_labels(one.labels.iter().map(|label| format!("{}: {label}", one.name)));
        plots.push(dots.into());
    }
    let all = || series.iter().flat_map(|one| &one.points);
    let spread = series
        .iter()
        .flat_map(|one| one.points.iter().zip(&one.spread).flat_map(|((_, y), half)| [y - half, y + half]));
    let mut layout = styled(Layout::auto_from_plots(&plots), title, &y.label).with_x_label(x.label.as_str());
    if all().next().is_some() {
        if x.logarithmic {
            layout = layout.with_log_x();
        }
        if y.logarithmic {
            layout = layout.with_log_y();
        }
        let [left, right] = x.range(all().map(|p| p.0));
        let [bottom, top] = y.range(all().map(|p| p.1).chain(spread.filter(|v| !y.logarithmic || *v > 0.0)));
        layout = layout
            .with_x_axis_min(left)
            .with_x_axis_max(right)
            .with_y_axis_min(bottom)
            .with_y_axis_max(top)
            .with_clamp_axis();
    }
    (plots, layout)
}

/// The series without the points that the axes cannot show.
fn shown(x: &Axis, y: &Axis, series: &[Series]) -> Vec<Series> {
    let all = || series.iter().flat_map(|one| &one.points);
    let (shows_x, shows_y) = (x.shows(all().map(|p| p.0)), y.shows(all().map(|p| p.1)));
    let keep = |one: &Series| {
        let kept: Vec<_> = (0..one.points.len())
            .filter(|i| shows_x(one.points[*i].0) && shows_y(one.points[*i].1))
            .collect();
        Series {
            points: kept.iter().map(|i| one.points[*i]).collect(),
            labels: kept.iter().filter_map(|i| one.labels.get(*i).cloned()).collect(),
            spread: kept.iter().filter_map(|i| one.spread.get(*i).copied()).collect(),
            ..one.clone()
        }
    };
    series.iter().map(keep).collect()
}

fn stacked_bars(
    title: &str,
    y: &str,
    parts: &[(String, String)],
    bars: &[(String, Vec<f64>)],
) -> (Vec<Plot>, Layout) {
    let mut plot = BarPlot::new().with_stacked().with_tooltips().with_width(0.6);
    for (name, heights) in bars {
        let coloured = heights.iter().zip(parts).map(|(height, (_, colour))| (*height, colour.as_str()));
        plot = plot.with_group(name.as_str(), coloured.collect::<Vec<_>>());
    }
    let plots = vec![plot.with_legend(parts.iter().map(|(name, _)| name.as_str()).collect()).into()];
    let layout = styled(Layout::auto_from_plots(&plots), title, y).with_y_axis_min(0.0);
    (plots, layout)
}

fn styled(layout: Layout, title: &str, y_label: &str) -> Layout {
    // As people write numbers: 0.5 and 20, not 5e-1.
    let plain = TickFormat::Custom(Arc::new(|value| format!("{}", (value * 1e6).round() / 1e6)));
    layout
        .with_title(title)
        .with_y_label(y_label)
        .with_width(SIZE[0])
        .with_height(SIZE[1])
        .with_legend_position(LegendPosition::OutsideRightTop)
        .with_legend_box(false)
        .with_tick_format(plain)
        .with_title_size(16)
        .with_label_size(13)
        .with_tick_size(11)
        .with_body_size(12)
        // None is wider than the font that lengths of text are computed with.
        .with_font_family("Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let series = Series {
            name: "one & two".to_owned(),
            colour: "#1b6ca8".to_owned(),
            dashed: true,
            labels: points.iter().map(|p| format!("{} Mbps", p.0)).collect(),
            points,
            spread: Vec::new(),
        };
        let (x, y) = (Axis::logarithmic("rate, Mbps"), Axis::linear("error, mm"));
        Chart::Lines { title: "A chart".to_owned(), x, y, series: vec![series] }
    }

    #[test]
    fn what_is_drawn_is_in_the_picture() {
        let svg = chart(vec![(1.0, 0.8), (4.0, 0.3)]).svg();
        for part in ["A chart", "rate, Mbps", "error, mm", "#1b6ca8", "one &amp; two: 4 Mbps"] {
            assert!(svg.contains(part), "{part} is not in {svg}");
        }
        assert!(!svg.contains("NaN"));
        assert!(
            svg.contains("viewBox=\"0 0 720 440\"") && svg.contains("width=\"720\" height=\"440\""),
            "{svg}"
        );
    }

    #[test]
    fn charts_are_png_files_too() {
        let bars = Chart::Bars {
            title: "Bits".to_owned(),
            y: "Mbps".to_owned(),
            parts: vec![("motion".to_owned(), "#d1495b".to_owned()), ("AC".to_owned(), "#2e8b57".to_owned())],
            bars: vec![("paper-3dof".to_owned(), vec![1.0, 3.0]), ("paper-zero".to_owned(), vec![0.0, 7.0])],
        };
        for chart in [bars, chart(vec![(1.0, 0.8), (4.0, 0.3)])] {
            assert!(chart.png().unwrap().starts_with(b"\x89PNG"));
        }
    }

    #[test]
    fn one_point_or_none_is_no_reason_to_fail() {
        for points in [vec![], vec![(2.0, 0.5)], vec![(0.0, 1.0)], vec![(1e-17, 1.0)]] {
            let svg = chart(points).svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }

    #[test]
    fn what_an_axis_cannot_show_is_left_out() {
        let svg =
            chart(vec![(0.0, 0.8), (1.0, 0.3), (1e-7, 0.2), (f64::NAN, 0.1), (2.0, f64::INFINITY)]).svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(svg.contains(": 1 Mbps") && !svg.contains(": 0 Mbps") && !svg.contains(": 2 Mbps"), "{svg}");
    }
}
