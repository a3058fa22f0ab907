// All blocks of an extended frame, coded and extrapolated (profile `main`).

/// What a block is, as bits.
const CODED = 1u;
const UNSETTLED = 2u;

/// The slots of a neighbourhood: those of faces, with one more for each coordinate of the offset that is not 0.
fn slot_offset(slot: u32) -> vec3<i32> {
    return bitcast<vec3<i32>>(vec3<u32>(slot % 3u, slot / 3u % 3u, slot / 9u)) - vec3<i32>(1);
}
