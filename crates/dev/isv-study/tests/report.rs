//! Tables, charts and the page of made-up records.

use isv::raw::metrics::GeometryError;
use isv_study::{BytesByKind, Metric, Record, Report, Timing};

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
        frame_bytes: vec![bytes / 2; 2],
        kinds: codec.starts_with("paper").then(BytesByKind::default),
        prepare_ms: Timing::from_ms(vec![10.0, 12.0, 50.0]),
        encode_ms: Timing::from_ms(vec![20.0]),
        decode_ms: Timing::from_ms(vec![5.0]),
        encode_peak_bytes: Some(40_000_000),
        decode_peak_bytes: None,
        error,
        frame_errors: vec![error; 2],
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
    let mbps = report.common_mbps().unwrap();
    let near: Vec<_> = report.near_rate(mbps).into_iter().map(|r| (r.codec.as_str(), r.mbps())).collect();
    assert_eq!(near.len(), 2);
    let ratio = near[0].1 / near[1].1;
    assert!((ratio.ln().abs() - 1.25f64.ln()).abs() < 1e-9, "{near:?}");
    assert_eq!(Report { records: vec![], ..report }.common_mbps(), None);
}

#[test]
fn files_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    report().write(folder.path(), None).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();

    let results = read("results.csv");
    let columns: Vec<_> = results.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [columns[0]; 6], "{results}");
    assert!(results.lines().nth(1).unwrap().starts_with("paper-zero,k64-ac5mm,2,80000,9.600000,0.300000,"));

    let deltas = read("bd_rates.csv");
    let columns: Vec<_> = deltas.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns, [11; 11], "{deltas}");

    for name in ["p2s_mean_mm", "d2_psnr_db", "encode_ms", "decode_ms", "kinds"] {
        assert!(read(&format!("charts/{name}.svg")).starts_with("<svg"), "{name}");
        let png = std::fs::read(folder.path().join(format!("charts/{name}.png"))).unwrap();
        assert!(png.starts_with(b"\x89PNG"), "{name}");
    }
}

#[test]
fn the_page_needs_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    report().write(folder.path(), None).unwrap();
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
