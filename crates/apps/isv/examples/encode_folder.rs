//! Encodes a folder of frames: `cargo run --release --example encode_folder -- captures/take7 take7.isv`

use isv::{EncodeOptions, Quantity};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let input = arguments.next().ok_or("name a folder of meshes, points, depth images or volumes")?;
    let output = arguments.next().ok_or("name the stream to write")?;

    let options =
        EncodeOptions::quality(50.0).voxel(10.mm()).on_event(|event| eprintln!("{event}")).on_progress(
            |done, total| eprintln!("{done} of {} frames", total.map_or("?".into(), |n| n.to_string())),
        );
    let report = isv::take::encode(input, output, &options)?;

    println!("{} frames, {} bytes, {:.2} Mbps", report.frames, report.bytes, report.megabits_per_second());
    Ok(())
}
