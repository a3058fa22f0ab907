//! Encodes meshes as a program makes them, and reads them back: `cargo run --release --example frame_by_frame`

use isv::{EncodeOptions, Mesh, Quantity, Reader, Writer};

/// A tetrahedron that moves 1 cm a frame.
fn mesh(frame: u32) -> Mesh {
    let x = 0.01 * frame as f32;
    let positions = vec![[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.0], [x, 0.0, 0.5]];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    Mesh { positions, triangles, ..Mesh::default() }
}

fn main() -> Result<(), isv::Error> {
    let path = std::env::temp_dir().join("frame_by_frame.isv");

    let options = EncodeOptions::bitrate(1.mbps()).voxel(10.mm()).fps(30);
    let mut writer = Writer::create(&path, &options)?;
    for frame in 0..10 {
        writer.push_mesh(&mesh(frame))?;
    }
    let report = writer.finish()?;
    println!("{} frames, {} bytes", report.frames, report.bytes);

    for frame in Reader::open(&path)? {
        let frame = frame?;
        let mesh = frame.mesh()?;
        println!(
            "frame {}: {} vertices, {} triangles",
            frame.number(),
            mesh.positions.len(),
            mesh.triangles.len()
        );
    }
    Ok(())
}
