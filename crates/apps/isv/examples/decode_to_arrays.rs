//! Decodes one frame at half resolution into plain arrays: `cargo run --release --example decode_to_arrays -- take7.isv 5`

use isv::{Lod, Reader};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("name a stream")?;
    let number: usize = arguments.next().map_or(Ok(0), |number| number.parse())?;

    let mut reader = Reader::open(path)?.lod(Lod::Half);
    reader.seek(number)?;
    let frame = reader.next_frame()?.ok_or("the stream has no such frame")?;

    let mesh = frame.mesh()?;
    let positions: &[f32] = mesh.positions.as_flattened(); // x, y, z, x, y, z, ... in metres
    let triangles: &[u32] = mesh.triangles.as_flattened(); // three indices each
    println!("mesh: {} floats, {} indices, first {:?}", positions.len(), triangles.len(), positions.get(..3));

    let field = frame.volume()?;
    println!("field: {} blocks of {}^3 distances (m)", field.blocks.len(), field.edge);
    Ok(())
}
