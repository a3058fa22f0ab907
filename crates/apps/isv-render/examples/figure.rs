//! Draws the figure in colour at several times and from several sides, and a turntable of it.
//!
//! `cargo run --release -p isv-render --example figure -- figure.png figure.gif`

use isv_figure::{BOUNDS_M, PERIOD_S, painted_figure_mesh};
use isv_render::{Camera, GifWriter, PictureRate, Shading, Style, contact_sheet, render};
use isv_volume::VoxelSize;
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args().skip(1);
    let (Some(sheet_path), Some(turn_path)) = (paths.next(), paths.next()) else {
        return Err("usage: figure SHEET.png TURN.gif".into());
    };
    let style = Style { shading: Shading::LitColour, ..Style::default() };
    let voxel_size = VoxelSize::from_metres(0.004)?;
    let camera = Camera::fitting(BOUNDS_M, [540, 600]);
    let views = (0..8).map(|i| {
        let mesh = painted_figure_mesh(PERIOD_S * f64::from(i) / 8.0, voxel_size);
        let yaw_degrees = if i < 4 { 0.0 } else { 90.0 * f64::from(i) - 315.0 };
        render(&mesh, &camera.from_direction(yaw_degrees, 5.0), &style)
    });
    let sheet = contact_sheet(&views.collect::<Vec<_>>(), 4);
    sheet.write_png(BufWriter::new(File::create(sheet_path)?))?;

    let rate = PictureRate { pictures: 24, seconds: 1 };
    let mut turn = GifWriter::new(BufWriter::new(File::create(turn_path)?), camera.size, rate)?;
    for i in 0..48 {
        let part = f64::from(i) / 48.0;
        let mesh = painted_figure_mesh(PERIOD_S * part, voxel_size);
        let camera = camera.in_orbit().from_direction(360.0 * part, 5.0);
        turn.push(&render(&mesh, &camera, &style))?;
    }
    turn.finish()?;
    Ok(())
}
