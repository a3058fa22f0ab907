//! Writing PCD 0.7, binary.

use crate::own::COMMENT;
use glam::DVec3;
use isv_volume::PointCloud;
use std::io::{self, Write};

/// Writes points as one row of them, all fields `float`. The viewpoint line is there if the viewpoint is known.
pub(crate) fn write(mut out: impl Write, points: &PointCloud) -> io::Result<()> {
    let (count, fields) = (points.positions.len(), if points.normals.is_empty() { 3 } else { 6 });
    let names = ["x", "y", "z", "normal_x", "normal_y", "normal_z"][..fields].join(" ");
    let each = |word: &str| vec![word; fields].join(" ");
    writeln!(out, "# {COMMENT}\nVERSION 0.7\nFIELDS {names}")?;
    writeln!(out, "SIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {count}\nHEIGHT 1", each("4"), each("F"), each("1"))?;
    if let Some(DVec3 { x, y, z }) = points.viewpoint {
        writeln!(out, "VIEWPOINT {x} {y} {z} 1 0 0 0")?;
    }
    writeln!(out, "POINTS {count}\nDATA binary")?;
    for (index, position) in points.positions.iter().enumerate() {
        for vector in [Some(position), points.normals.get(index)].into_iter().flatten() {
            for component in vector.as_vec3().to_array() {
                out.write_all(&component.to_le_bytes())?;
            }
        }
    }
    Ok(())
}
