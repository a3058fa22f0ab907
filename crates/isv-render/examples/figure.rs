//! Draws the figure at several times and from several sides.
//!
//! `cargo run --release -p isv-render --example figure -- figure.png`

use isv_figure::{BOUNDS_M, PERIOD_S, figure_mesh};
use isv_render::{Camera, Style, contact_sheet, render};
use isv_volume::VoxelSize;
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: figure PICTURE.png")?;
    let voxel_size = VoxelSize::from_metres(0.006)?;
    let camera = Camera::fitting(BOUNDS_M, [540, 600]);
    let views = (0..8).map(|i| {
        let mesh = figure_mesh(PERIOD_S * f64::from(i) / 8.0, voxel_size);
        let yaw_degrees = if i < 4 { 0.0 } else { 90.0 * f64::from(i) - 315.0 };
        render(&mesh, &camera.from_direction(yaw_degrees, 5.0), &Style::default())
    });
    let sheet = contact_sheet(&views.collect::<Vec<_>>(), 4);
    sheet.write_png(BufWriter::new(File::create(path)?))?;
    Ok(())
}
