//! Writing PCD 0.7, binary.

use crate::own::COMMENT;
use crate::placement::{Placement, write_components};
use glam::DVec3;
use isv_volume::PointCloud;
use std::io::{self, Write};

/// Writes points as one row of them. Fields are `float`, coordinates `double` where the placement needs it. The viewpoint line is
/// there if the viewpoint is known. Colours are `rgb`, packed into a `float` as the Point Cloud Library has them.
pub(crate) fn write(mut out: impl Write, points: &PointCloud, placement: &Placement) -> io::Result<()> {
    let count = points.positions.len();
    let mut names = vec!["x", "y", "z"];
    if !points.normals.is_empty() {
        names.extend(["normal_x", "normal_y", "normal_z"]);
    }
    if !points.colours.is_empty() {
        names.push("rgb");
    }
    let double = placement.needs_double(&points.positions);
    let mut sizes = vec!["4"; names.len()];
    sizes[..3].fill(if double { "8" } else { "4" });
    let each = |word: &str| vec![word; names.len()].join(" ");
    writeln!(out, "# {COMMENT}\nVERSION 0.7\nFIELDS {}", names.join(" "))?;
    writeln!(out, "SIZE {}\nTYPE {}\nCOUNT {}", sizes.join(" "), each("F"), each("1"))?;
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
        if let Some([red, green, blue]) = points.colours.get(index) {
            out.write_all(&[*blue, *green, *red, 0])?;
        }
    }
    Ok(())
}
