//! Writing PCD 0.7, binary.

use crate::own::COMMENT;
use crate::placement::{Placement, write_components};
use glam::DVec3;
use isv_volume::PointCloud;
use std::io::{self, Write};

/// Writes points as one row of them. Fields are `float`, coordinates `double` where the placement needs it. The viewpoint line is
/// there if the viewpoint is known.
pub(crate) fn write(mut out: impl Write, points: &PointCloud, placement: &Placement) -> io::Result<()> {
    let (count, fields) = (points.positions.len(), if points.normals.is_empty() { 3 } else { 6 });
    let names = ["x", "y", "z", "normal_x", "normal_y", "normal_z"][..fields].join(" ");
    let each = |word: &str| vec![word; fields].join(" ");
    let double = placement.needs_double(&points.positions);
    let sizes = if double { ["8", "8", "8", "4", "4", "4"] } else { ["4"; 6] };
    writeln!(out, "# {COMMENT}\nVERSION 0.7\nFIELDS {names}")?;
    writeln!(out, "SIZE {}\nTYPE {}\nCOUNT {}", sizes[..fields].join(" "), each("F"), each("1"))?;
    writeln!(out, "WIDTH {count}\nHEIGHT 1")?;
    if let Some(viewpoint) = points.viewpoint {
        let DVec3 { x, y, z } = placement.place(viewpoint);
        writeln!(out, "VIEWPOINT {x} {y} {z} 1 0 0 0")?;
    }
    writeln!(out, "POINTS {count}\nDATA binary")?;
    for (index, position) in points.positions.iter().enumerate() {
        write_components(&mut out, placement.place(*position), double)?;
        if let Some(normal) = points.normals.get(index) {
            write_components(&mut out, *normal, false)?;
        }
    }
    Ok(())
}
