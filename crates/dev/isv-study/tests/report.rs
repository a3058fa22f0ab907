//! Tables, charts and the page of made-up records.

use isv::raw::metrics::{ColourError, GeometryError};
use isv_study::{Alike, BytesByKind, Metric, Record, Report, SheetFile, Timing};

fn record(codec: &str, point: &str, bytes: u64, p2s_mm: f64) -> Record {
    let error = GeometryError {
        chamfer_mm: p2s_mm + 2.5,
        p2s_mean_mm: Some(p2s_mm),
        normal_error_deg: Some(10.0 * p2s_mm),
        d1_psnr_db: Some(60.0 - p2s_mm),
        d2_psnr_db: None,
        ..GeometryError::default()
    };
    Record {
        key: String::new(),
        codec: codec.to_owned(),
        point: point.to_owned(),
        frames_per_second: 30.0,
        bytes,
        bytes_colour: 0,
        frame_bytes: vec![bytes / 2; 2],
        kinds: codec.starts_with("paper").then(BytesByKind::default),
        prepare_ms: Timing::from_ms(vec![10.0, 12.0, 50.0]),
        encode_ms: Timing::from_ms(vec![20.0]),
        colour_encode_ms: None,
        decode_ms: Timing::from_ms(vec![5.0]),
        encode_peak_bytes: Some(40_000_000),
        decode_peak_bytes: None,
        error,
        frame_errors: vec![error; 2],
        colour_error: ColourError::default(),
        frame_colour_errors: Vec::new(),
        point_step_m: None,
        programs: Vec::new(),
    }
}

fn report() -> Report {
    Report {
        take: "a <take> & more".to_owned(),
        setting: "voxels of 5mm".to_owned(),
        records: vec![
            record("paper-zero", "k64-ac5mm", 80_000, 0.3),
            record("paper-zero", "k64-ac10mm", 40_000, 0.6),
            record("paper-zero", "k64-ac20mm", 20_000, 1.2),
            record("draco", "10-bit", 64_000, 0.6),
            record("draco", "9-bit", 32_000, 1.2),
        ],
        notes: vec!["draco-25: not installed".to_owned()],
    }
}

#[test]
fn deltas_are_those_of_the_curves() {
    let deltas = report().deltas();
    assert_eq!(deltas.len(), Metric::ALL.len() * 2);
    let found =
        deltas.iter().find(|d| d.metric == Metric::PointToSurface && d.anchor == "paper-zero").unwrap();
    // Both curves are straight lines of log rate over log error; Draco takes 1.6 times the bytes.
    assert!((found.delta.rate_percent.unwrap().mean - 60.0).abs() < 1e-6, "{found:?}");
    let without_values = deltas.iter().find(|d| d.metric == Metric::D2).unwrap();
    assert_eq!(without_values.delta.rate_percent, None);
}

#[test]
fn codecs_are_shown_near_one_rate() {
    let report = report();
    // Points of 9.6, 4.8 and 2.4 Mbps against 7.68 and 3.84: only the ratio 1.25 is to be had, fine or coarse.
    let peers = report.peers(Alike::Rate).unwrap();
    let [one, other] = [0, 1].map(|codec| peers.records[codec].mbps());
    assert_eq!(peers.records.len(), 2);
    assert!(((one / other).ln().abs() - 1.25f64.ln()).abs() < 1e-9, "{one} {other}");
    assert!(Report { records: vec![], ..report }.peers(Alike::Rate).is_none());
}

#[test]
fn codecs_are_shown_near_one_error_if_they_have_one() {
    let mut report = report();
    let errors = [0.3, 0.61, 1.2, 0.5, 0.9];
    for (record, mm) in report.records.iter_mut().zip(errors) {
        record.error.test_to_ref_mean_mm = Some(mm);
    }
    report.records.push(record("draco-25", "10-bit", 48_000, 0.6));
    let peers = report.peers(Alike::Error).unwrap();
    let points: Vec<_> = peers.records.iter().map(|record| record.point.as_str()).collect();
    // Of all pairs these have the smallest ratio; the last codec has no such error.
    assert_eq!(points, ["k64-ac10mm", "10-bit"]);
    assert!(["0.61 mm", "0.50 mm"].contains(&peers.level_text().as_str()), "{}", peers.level_text());
    // At the same rate they would be others; where they are not, nothing is shown twice.
    assert_eq!(report.all_peers().len(), 2);
    report.records.retain(|record| record.point == "k64-ac10mm" || record.codec == "draco-25");
    assert_eq!(report.all_peers().len(), 2, "one codec has no error");
    report.records.pop();
    assert_eq!(report.all_peers().len(), 1);
}

#[test]
fn files_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    report().write(folder.path(), &[], &[]).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();

    let results = read("results.csv");
    let columns: Vec<_> = results.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [columns[0]; 6], "{results}");
    assert!(results.lines().nth(1).unwrap().starts_with("paper-zero,k64-ac5mm,2,80000,9.600000,0.300000,"));

    let deltas = read("bd_rates.csv");
    let columns: Vec<_> = deltas.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [11; 13], "{deltas}");

    for name in ["p2s_mean_mm", "d2_psnr_db", "encode_ms", "decode_ms", "kinds"] {
        assert!(read(&format!("charts/{name}.svg")).starts_with("<svg"), "{name}");
        let png = std::fs::read(folder.path().join(format!("charts/{name}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"), "{name}");
    }
}

#[test]
fn the_page_needs_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    report().write(folder.path(), &[], &[]).unwrap();
    let page = std::fs::read_to_string(folder.path().join("index.html")).unwrap();
    let without_names = page.replace("http://www.w3.org/", "").replace("url(#", "");
    for reference in ["http:", "https:", "src=\"/", "<link", "@import", "url("] {
        assert!(!without_names.contains(reference), "{reference}");
    }
    assert!(page.contains("a &lt;take&gt; &amp; more") && !page.contains("a <take>"));
    assert!(page.contains("+60.0 %") && page.contains("draco-25: not installed"));
    assert_eq!(page.matches("<svg").count(), report().charts().len());

    let mut ids: Vec<_> = page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "names are unique: {ids:?}");
}

#[test]
fn medians_are_of_the_middle() {
    let timing = Timing::from_ms(vec![50.0, 12.0, 10.0]);
    assert_eq!((timing.median, timing.mean), (12.0, 24.0));
    assert_eq!(Timing::from_ms(vec![10.0, 20.0]).median, 15.0);
    assert_eq!(Timing::from_ms(vec![]), Timing::default());
}

/// The report with colour at the points of a codec.
fn report_in_colour() -> Report {
    let mut report = report();
    for (index, record) in report.records.iter_mut().filter(|r| r.codec == "paper-zero").enumerate() {
        record.bytes_colour = record.bytes / 4;
        record.colour_error.colour_y_psnr_db = Some(40.0 - index as f64);
        record.colour_error.render_y_psnr_db = Some(36.0 - index as f64);
    }
    report
}

#[test]
fn colour_stands_against_its_own_rate() {
    let report = report_in_colour();
    let curve = report.curve("paper-zero", Metric::ColourY);
    let rates: Vec<_> = curve.iter().map(|point| point.rate).collect();
    assert_eq!(rates, [2.4, 1.2, 0.6]);
    assert_eq!(report.curve("paper-zero", Metric::PointToSurface)[0].rate, 7.2);
    assert!(report.curve("draco", Metric::ColourY).is_empty());
    let names: Vec<_> = report.charts().into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"colour_y_psnr_db") && names.contains(&"render_y_psnr_db"), "{names:?}");
    let plain: Vec<_> = self::report().charts().into_iter().map(|(name, _)| name).collect();
    assert!(!plain.contains(&"colour_y_psnr_db"), "{plain:?}");
}

#[test]
fn the_page_says_what_there_is_of_colour() {
    let folder = tempfile::tempdir().unwrap();
    let page = |report: &Report, sheets: &[SheetFile]| {
        report.write(folder.path(), &[], sheets).unwrap();
        std::fs::read_to_string(folder.path().join("index.html")).unwrap()
    };
    let plain = page(&report(), &[]);
    assert!(plain.contains("There is no colour to compare") && !plain.contains("sheet.png"));
    assert!(!folder.path().join("sheet.png").exists());
    let sheet = |alike: Alike| SheetFile { alike, png: format!("alike in {alike}").into_bytes() };
    let coloured = page(&report_in_colour(), &Alike::ALL.map(sheet));
    assert!(coloured.contains("against the rate of colour"));
    for (name, bytes) in [("sheet.png", b"alike in rate".as_slice()), ("sheet_error.png", b"alike in error")]
    {
        assert!(coloured.contains(name));
        assert_eq!(std::fs::read(folder.path().join(name)).unwrap(), bytes);
    }
    let table = std::fs::read_to_string(folder.path().join("results.csv")).unwrap();
    let columns: Vec<_> = table.lines().next().unwrap().split(',').collect();
    let cell = |name: &str| {
        let column = columns.iter().position(|column| *column == name).unwrap();
        table.lines().nth(1).unwrap().split(',').nth(column).unwrap().to_owned()
    };
    assert_eq!(cell("mbps"), "9.600000");
    assert_eq!([cell("mbps_geometry"), cell("mbps_colour")], ["7.200000", "2.400000"]);
    assert_eq!(cell("colour_y_psnr_db"), "40.000000");
}
