//! Sends frames over TCP while they are made, and shows them as they come: `cargo run --release --example live`

use isv::{EncodeOptions, Mesh, Preset, Quantity, Reader, Writer};
use std::net::{TcpListener, TcpStream};
use std::thread;

/// A square of 1 m whose middle goes up and down.
fn mesh(frame: u32) -> Mesh {
    let height = 0.3 * (0.4 * frame as f32).sin();
    let positions = vec![[0., 0., 0.], [1., 0., 0.], [1., 0., 1.], [0., 0., 1.], [0.5, height, 0.5]];
    let triangles = vec![[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]];
    Mesh { positions, triangles, ..Mesh::default() }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?;
    let sender = thread::spawn(move || -> Result<(), isv::Error> {
        let options = EncodeOptions::quality(50.0).voxel(20.mm()).fps(30).preset(Preset::Realtime).gop(15);
        let mut writer = Writer::new(TcpStream::connect(address)?, &options)?;
        for frame in 0..30 {
            writer.push_mesh(&mesh(frame))?;
        }
        writer.into_inner().map(drop)
    });
    let (connection, _) = listener.accept()?;
    for frame in Reader::from_read("camera 1", connection) {
        let frame = frame?;
        println!("{:?}: {} triangles", frame.timestamp(), frame.mesh()?.triangles.len());
    }
    sender.join().expect("the sender does not panic")?;
    Ok(())
}
