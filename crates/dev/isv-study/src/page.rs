//! One HTML file that holds a whole study: charts, tables and pictures, nothing to be fetched.

use crate::bjontegaard::Delta;
use crate::chart::Chart;
use crate::codec::Codec;
use crate::picture::{CodecPicture, CodecPictures, View};
use crate::report::{DeltaRow, SheetFile, colour};
use crate::{Metric, ProgramUse, Record, Report};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Overlap below which a delta is shown faintly: the codecs hardly work at the same qualities.
const FAINT_BELOW: f64 = 0.25;

/// The page.
pub(crate) fn html(
    report: &Report,
    deltas: &[DeltaRow],
    charts: &[(&'static str, Chart)],
    pictures: &[CodecPictures],
    sheets: &[SheetFile],
) -> String {
    let take = escape(&report.take);
    let sections = [
        head(report, !pictures.is_empty(), !sheets.is_empty()),
        charts_section("rates", "Rate and error", RATES, charts.iter().take(Metric::ALL.len())),
        colours_section(report, charts),
        pictures_section(pictures),
        sheets_section(sheets),
        deltas_section(report, deltas),
        charts_section(
            "costs",
            "Time, and what the bits say",
            COSTS,
            charts.iter().skip(report.metrics().len()),
        ),
        results_section(report),
        method_section(report),
    ];
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{take}: rate and distortion</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n{}</main>\n\
         <dialog><img alt=\"\"></dialog>\n<script>\n{}</script>\n</body>\n</html>\n",
        include_str!("page.css"),
        sections.concat(),
        include_str!("page.js"),
    )
}

const RATES: &str = "Every byte that a decoder needs is counted, except a trained transform. Each point is a whole take, \
                     encoded, decoded from its bytes and compared with what went in. Rates are on a logarithmic axis. Point at \
                     a dot for its settings.";

const COLOURS: &str = "Errors are measured where both the capture and the stream have colour. At points of the decoded surface they \
                       stand against the rate of colour; in pictures from six sides, which show the geometry too, against the \
                       rate of both. isv's colour has the quality of the geometry at the same point.";

const NO_COLOURS: &str = "There is no colour to compare: the capture has none, or no codec of this study keeps it. Profile main, \
                          draco-video, tmc13 and tmc2 do.";

const SHEETS: &str = "The source and the streams, each at its point nearest to one level. Frames are in their colours without light, where \
                      there are any, then by surface normal and by distance from the source. The last rows show the top, and the \
                      part where pictures differ most. Click to enlarge.";

const COSTS: &str = "Time to encode is from mesh to bytes: ingest or simplification, then coding; time to decode is from bytes \
                     to mesh. Colour is not part of these times, but of those of codecs of points. Codecs of others run as programs that read and write files, which is part of their time; those that code a whole take at once have equal shares.";

const POINTS: &str = "Codecs of points are given the voxels that the source's surface passes through, at the bits that their points name, and \
                      give points back. Without a decoded surface there is no distance from the source to it: point to surface, \
                      normals, area and components are left out for them. Decoded points to source is one direction, exact, and \
                      does not see what is missing; D1 and D2 take the worse of both directions. In pictures their points are \
                      cubes.";

const PICTURES: &str = "Each codec at its point nearest to one level: by surface normal, and by distance from what went in. Click \
                        to enlarge.";

const DELTAS: &str = "How much rate the codec of a row takes at equal quality, against the codec of a column: negative is a saving. \
                      Below it, how much better it is at equal rate. Piecewise-cubic Bjontegaard deltas over the quality that both \
                      cover; errors count as -20 log10. Faint: the two share less than a quarter of the quality that either \
                      covers. A dash: they share none.";

fn head(report: &Report, has_pictures: bool, has_sheets: bool) -> String {
    let frames = report.records.iter().map(Record::frames).max().unwrap_or(0);
    let links = [
        ("rates", "Rate and error"),
        ("colours", "Colour"),
        ("pictures", "Pictures"),
        ("sheets", "Contact sheets"),
        ("deltas", "Savings"),
        ("costs", "Time and bits"),
        ("results", "All results"),
        ("method", "How it was measured"),
    ];
    let is_there = |id: &str| match id {
        "pictures" => has_pictures,
        "sheets" => has_sheets,
        "deltas" => report.codecs().len() > 1,
        _ => true,
    };
    let links: String = links
        .into_iter()
        .filter(|(id, _)| is_there(id))
        .map(|(id, title)| format!("<a href=\"#{id}\">{title}</a>"))
        .collect();
    format!(
        "<h1>{}</h1>\n<p>{frames} frames. {}</p>\n<nav>{links}</nav>\n",
        escape(&report.take),
        escape(&report.setting)
    )
}

/// Charts of colour, or the reason why there are none.
fn colours_section(report: &Report, charts: &[(&'static str, Chart)]) -> String {
    let of_colour = |name: &str| Metric::COLOUR.iter().any(|metric| metric.key() == name);
    let figures: String =
        charts.iter().filter(|(name, _)| of_colour(name)).map(|(name, chart)| inline(name, chart)).collect();
    let figures = match figures.is_empty() {
        true => figures,
        false => format!("<div class=\"charts\">\n{figures}</div>\n"),
    };
    let words = if report.has_colour() { COLOURS } else { NO_COLOURS };
    section("colours", "Colour", words, &figures)
}

fn section(id: &str, title: &str, words: &str, body: &str) -> String {
    format!("<h2 id=\"{id}\">{title}</h2>\n<p>{words}</p>\n{body}\n")
}

fn charts_section<'a>(
    id: &str,
    title: &str,
    words: &str,
    charts: impl Iterator<Item = &'a (&'static str, Chart)>,
) -> String {
    let figures: String = charts.map(|(name, chart)| inline(name, chart)).collect();
    section(id, title, words, &format!("<div class=\"charts\">\n{figures}</div>"))
}

/// A chart as part of the page, where the names that its drawing refers to must not be those of another chart.
fn inline(name: &str, chart: &Chart) -> String {
    let svg =
        chart.svg().replace("id=\"", &format!("id=\"{name}-")).replace("url(#", &format!("url(#{name}-"));
    format!("<figure class=\"chart\">{svg}</figure>\n")
}

/// The frame at each level, with a group of tabs.
fn pictures_section(levels: &[CodecPictures]) -> String {
    let Some(first) = levels.first() else { return String::new() };
    let legend =
        picture(&first.legend, "Scale of distances in millimetres").replace("<img", "<img class=\"legend\"");
    let body: String = levels.iter().map(|pictures| at_level(pictures, &legend)).collect();
    section("pictures", "The same frame of all codecs", &format!("Frame {}. {PICTURES}", first.frame), &body)
}

fn at_level(pictures: &CodecPictures, legend: &str) -> String {
    let CodecPictures { alike, level, .. } = pictures;
    let panel = |id: &str, view: fn(&CodecPicture) -> &View| {
        let figures: String = pictures.codecs.iter().map(|picture| figure(picture, view(picture))).collect();
        format!(
            "<div role=\"tabpanel\" id=\"{id}\" class=\"panel\"><div class=\"codecs\">\n{figures}</div></div>\n"
        )
    };
    let [whole, close_up] = ["whole", "close-up"].map(|view| format!("{view}-{alike}"));
    let panels = panel(&whole, |e| &e.whole) + &panel(&close_up, |e| &e.close_up);
    let tabs = tabs(&[(whole, "Whole"), (close_up, "Close-up")]);
    format!("<h3>At the same {alike}, near {level}</h3>\n{legend}{tabs}{panels}")
}

fn sheets_section(sheets: &[SheetFile]) -> String {
    let figure = |sheet: &SheetFile| {
        let (alike, name) = (sheet.alike, sheet.alike.sheet_name());
        let image = picture(&sheet.png, &format!("The source and the streams at the same {alike}"))
            .replace("<img", "<img class=\"sheet\"");
        format!(
            "<h3>At the same {alike}</h3>\n<p>The same as <a href=\"{name}\">{name}</a>.</p>\n\
             <figure class=\"picture\">{image}</figure>"
        )
    };
    let figures: String = sheets.iter().map(figure).collect();
    if figures.is_empty() { figures } else { section("sheets", "Contact sheets", SHEETS, &figures) }
}

fn figure(shown: &CodecPicture, view: &View) -> String {
    let name = shown.codec.as_deref().unwrap_or("original");
    let swatch = shown.codec.as_deref().map_or(String::new(), swatch);
    let errors = view
        .errors
        .as_ref()
        .map_or(String::new(), |errors| picture(errors, &format!("{name}, distance from the original")));
    format!(
        "<figure class=\"picture\"><div class=\"pair\">{}{errors}</div><figcaption><b>{swatch}{}</b><span>{}</span>\
         </figcaption></figure>\n",
        picture(&view.normals, &format!("{name}, by normal")),
        escape(name),
        escape(&shown.caption),
    )
}

fn picture(png: &[u8], words: &str) -> String {
    let data = STANDARD.encode(png);
    format!("<img alt=\"{}\" src=\"data:image/png;base64,{data}\">", escape(words))
}

/// Buttons that show one of several panels, by their ids.
fn tabs(panels: &[(String, &str)]) -> String {
    let buttons: String = panels
        .iter()
        .map(|(id, title)| format!("<button role=\"tab\" aria-controls=\"{id}\">{title}</button>"))
        .collect();
    format!("<div class=\"tabs\" role=\"tablist\">{buttons}</div>\n")
}

fn deltas_section(report: &Report, deltas: &[DeltaRow]) -> String {
    let codecs = report.codecs();
    if codecs.len() < 2 {
        return String::new();
    }
    let metrics = report.metrics();
    let ids: Vec<_> = metrics.iter().map(|m| (format!("delta-{}", m.key()), m.title())).collect();
    let panels: String = metrics
        .iter()
        .zip(&ids)
        .map(|(metric, (id, _))| {
            let table = deltas_table(&codecs, deltas, *metric);
            format!("<div role=\"tabpanel\" id=\"{id}\" class=\"panel\">{table}</div>\n")
        })
        .collect();
    section("deltas", "Savings", DELTAS, &(tabs(&ids) + &panels))
}

fn deltas_table(codecs: &[&str], deltas: &[DeltaRow], metric: Metric) -> String {
    let heads: String = codecs.iter().map(|codec| format!("<th>{}</th>", escape(codec))).collect();
    let cell = |test: &str, anchor: &str| {
        let found = deltas.iter().find(|d| d.metric == metric && d.test == test && d.anchor == anchor);
        delta_cell(found.map(|row| row.delta))
    };
    let rows: String = codecs
        .iter()
        .map(|test| {
            let cells: String = codecs.iter().map(|anchor| cell(test, anchor)).collect();
            format!("<tr><th>{}{}</th>{cells}</tr>\n", swatch(test), escape(test))
        })
        .collect();
    format!(
        "<div class=\"scroll\"><table><thead><tr><th></th>{heads}</tr></thead><tbody>\n{rows}</tbody></table></div>"
    )
}

fn delta_cell(delta: Option<Delta>) -> String {
    let Some(Delta { rate_percent, quality_db }) = delta else {
        return "<td></td>".to_owned();
    };
    let quality = quality_db.map_or("-".to_owned(), |quality| format!("{:+.2} dB", quality.mean));
    let Some(rate) = rate_percent else {
        return format!("<td class=\"faint\">-<small>{quality}</small></td>");
    };
    let side = if rate.mean < 0.0 { "good" } else { "bad" };
    let faint = if rate.overlap_share < FAINT_BELOW { " faint" } else { "" };
    format!(
        "<td class=\"{side}{faint}\" title=\"over {:.2} to {:.2} dB, {:.0} %\">{:+.1} %<small>{quality}</small></td>",
        rate.overlap[0],
        rate.overlap[1],
        100.0 * rate.overlap_share,
        rate.mean,
    )
}

fn results_section(report: &Report) -> String {
    let heads = [
        "codec",
        "point",
        "Mbps",
        "of colour",
        "colour Y dB",
        "pictures Y dB",
        "p2s mm",
        "to source mm",
        "p2s rms",
        "Hausdorff",
        "Chamfer mm",
        "normals deg",
        "D1 dB",
        "D2 dB",
        "area",
        "components",
        "prepare ms",
        "encode ms",
        "decode ms",
        "encode MB",
        "decode MB",
    ];
    let heads: String = heads.iter().map(|head| format!("<th>{head}</th>")).collect();
    let rows: String = report.records.iter().map(result_row).collect();
    let table = format!(
        "<div class=\"scroll\"><table><thead><tr>{heads}</tr></thead><tbody>\n{rows}</tbody></table></div>"
    );
    let words = "Means over frames; times are medians, memory is the peak. The same as <a href=\"results.csv\">results.csv</a>, \
                 which has more; savings are in <a href=\"bd_rates.csv\">bd_rates.csv</a>, the charts in <a href=\"charts/\">charts</a>.";
    section("results", "All results", words, &table)
}

fn result_row(record: &Record) -> String {
    let error = &record.error;
    let number =
        |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
    let megabytes = |bytes: Option<u64>| number(bytes.map(|b| b as f64 / 1e6), 0);
    let cells = [
        format!("{:.3}", record.mbps()),
        number((record.bytes_colour > 0).then(|| record.colour_mbps()), 3),
        number(record.value(Metric::ColourY), 2),
        number(record.value(Metric::RenderY), 2),
        number(error.p2s_mean_mm, 3),
        number(error.test_to_ref_mean_mm, 3),
        number(error.p2s_rms_mm, 3),
        number(error.hausdorff_mm, 2),
        number(Some(error.chamfer_mm), 3),
        number(error.normal_error_deg, 2),
        number(error.d1_psnr_db, 2),
        number(error.d2_psnr_db, 2),
        number(error.area_ratio, 3),
        number(error.component_ratio, 1),
        format!("{:.1}", record.prepare_ms.median),
        format!("{:.1}", record.encode_ms.median),
        format!("{:.1}", record.decode_ms.median),
        megabytes(record.encode_peak_bytes),
        megabytes(record.decode_peak_bytes),
    ];
    let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
    format!(
        "<tr><th>{}{}</th><td class=\"text\">{}</td>{cells}</tr>\n",
        swatch(&record.codec),
        escape(&record.codec),
        escape(&record.point)
    )
}

fn method_section(report: &Report) -> String {
    let codecs: String = report
        .codecs()
        .iter()
        .map(|name| {
            let words = name.parse::<Codec>().map_or(String::new(), Codec::description);
            format!("<li><b>{}</b>: {}</li>\n", escape(name), escape(&words))
        })
        .collect();
    let all_notes = report.notes.iter().map(String::as_str).chain(report.program_notes());
    let notes: String = all_notes.map(|note| format!("<li>{}</li>\n", escape(note))).collect();
    let notes =
        if notes.is_empty() { notes } else { format!("<p>Notes:</p>\n<ul class=\"notes\">\n{notes}</ul>\n") };
    let first = report.records.first().map(|record| &record.error);
    let floor = first.and_then(|e| e.chamfer_floor_mm).map_or(String::new(), |mm| {
        format!(
            " Sampling alone makes a Chamfer distance of {mm:.2} mm between a frame and itself{}.",
            first
                .and_then(|e| e.d1_ceiling_db)
                .map_or(String::new(), |db| format!(" and limits D1 to {db:.1} dB"))
        )
    });
    let words = format!(
        "Point-to-surface distances are exact, from samples of each surface to the other. Chamfer is the mean distance to the \
         nearest sample, both ways halved. D1 and D2 follow MPEG's pc_error, with the longest side of the original's bounding box \
         as the peak.{floor}"
    );
    let words = if report.has_points() { words + " " + POINTS } else { words };
    let programs = programs_list(report);
    let body = format!("<ul class=\"notes\">\n{codecs}</ul>\n{notes}{programs}");
    section("method", "How it was measured", &words, &body)
}

/// Versions and command lines of other codecs' programs, each codec at its middle point.
fn programs_list(report: &Report) -> String {
    let mut items = String::new();
    for codec in report.codecs() {
        let records: Vec<_> = report.records.iter().filter(|record| record.codec == codec).collect();
        let Some(record) = records.get(records.len() / 2) else { continue };
        for ProgramUse { version, command, .. } in &record.programs {
            let version = if version.is_empty() { "version not told" } else { version };
            items += &format!(
                "<li><b>{}</b> at {} ({}): <code>{}</code></li>\n",
                escape(codec),
                escape(&record.point),
                escape(version),
                escape(command)
            );
        }
    }
    if items.is_empty() {
        return items;
    }
    format!(
        "<p>Programs of other codecs; all points are in <a href=\"programs.csv\">programs.csv</a>:</p>\n\
         <ul class=\"notes\">\n{items}</ul>\n"
    )
}

fn swatch(codec: &str) -> String {
    format!("<span class=\"swatch\" style=\"background:{}\"></span>", colour(codec))
}

/// Text as it may stand in HTML, quotes included.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
