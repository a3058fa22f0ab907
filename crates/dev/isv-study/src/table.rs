//! Comma-separated tables.

use crate::bjontegaard::MeanDifference;
use crate::report::DeltaRow;
use crate::{Metric, ProgramUse, Record};

/// One row a record: sizes, errors, times and memory.
pub(crate) fn results(records: &[Record]) -> String {
    let mut csv = "codec,point,frames,bytes,mbps".to_owned();
    for metric in Metric::ALL {
        csv += ",";
        csv += metric.key();
    }
    csv += ",p2s_rms_mm,p2s_p99_mm,hausdorff_mm,area_ratio,component_ratio,chamfer_floor_mm,d1_ceiling_db";
    csv += ",prepare_ms,encode_ms,decode_ms,encode_peak_bytes,decode_peak_bytes";
    csv += ",bytes_occupancy,bytes_masks,bytes_motion,bytes_dc,bytes_ac,bytes_headers,bytes_colour";
    csv += ",mbps_geometry,mbps_colour,colour_encode_ms,colour_y_psnr_db,colour_ycc_psnr_db";
    csv += ",colour_y_symmetric_psnr_db,colour_ycc_symmetric_psnr_db,render_y_psnr_db,render_ssim\n";
    for record in records {
        csv += &row(record);
    }
    csv
}

fn row(record: &Record) -> String {
    let error = &record.error;
    let mut cells = vec![
        record.codec.clone(),
        record.point.clone(),
        record.frames().to_string(),
        record.bytes.to_string(),
        format!("{:.6}", record.mbps()),
    ];
    let measured = Metric::ALL.map(|metric| record.value(metric));
    let others = [
        error.p2s_rms_mm,
        error.p2s_p99_mm,
        error.hausdorff_mm,
        error.area_ratio,
        error.component_ratio,
        error.chamfer_floor_mm,
        error.d1_ceiling_db,
    ];
    cells.extend(
        measured.into_iter().chain(others).map(|value| value.map_or(String::new(), |v| format!("{v:.6}"))),
    );
    cells.extend([record.prepare_ms, record.encode_ms, record.decode_ms].map(|t| format!("{:.3}", t.median)));
    let peaks = [record.encode_peak_bytes, record.decode_peak_bytes];
    cells.extend(peaks.map(|peak| peak.map_or(String::new(), |bytes| bytes.to_string())));
    match &record.kinds {
        Some(kinds) => cells.extend(kinds.named().map(|(_, bytes)| format!("{bytes:.1}"))),
        None => cells.extend(std::iter::repeat_n(String::new(), 7)),
    }
    cells.extend([record.geometry_mbps(), record.colour_mbps()].map(|mbps| format!("{mbps:.6}")));
    let colour = &record.colour_error;
    let times = record.colour_encode_ms.map_or(String::new(), |timing| format!("{:.3}", timing.median));
    let figures = [
        colour.colour_y_psnr_db,
        colour.colour_ycc_psnr_db,
        colour.colour_y_symmetric_psnr_db,
        colour.colour_ycc_symmetric_psnr_db,
        colour.render_y_psnr_db,
        colour.render_ssim,
    ];
    cells.push(times);
    cells.extend(figures.map(|value| value.map_or(String::new(), |v| format!("{v:.6}"))));
    cells.join(",") + "\n"
}

/// One row a program of another codec and a point: its version and its command line.
pub(crate) fn programs(records: &[Record]) -> String {
    let mut csv = "codec,point,version,command\n".to_owned();
    for Record { codec, point, programs, .. } in records {
        for ProgramUse { version, command, .. } in programs {
            csv += &format!("{codec},{point},{version},\"{}\"\n", command.replace('"', "\"\""));
        }
    }
    csv
}

/// One row a pair of codecs and a metric: what `test` saves against `anchor`, and over what; empty where they do not meet.
pub(crate) fn deltas(rows: &[DeltaRow]) -> String {
    let mut csv = "metric,anchor,test".to_owned();
    csv += ",bd_rate_percent,quality_from_db,quality_to_db,quality_overlap_share";
    csv += ",bd_quality_db,mbps_from,mbps_to,mbps_overlap_share\n";
    for DeltaRow { metric, anchor, test, delta } in rows {
        let cells = [delta.rate_percent, delta.quality_db].map(|difference| {
            difference.map_or(
                ",,,".to_owned(),
                |MeanDifference { mean, overlap: [from, to], overlap_share }| {
                    format!("{mean:.4},{from:.4},{to:.4},{overlap_share:.4}")
                },
            )
        });
        csv += &format!("{},{anchor},{test},{}\n", metric.key(), cells.join(","));
    }
    csv
}
