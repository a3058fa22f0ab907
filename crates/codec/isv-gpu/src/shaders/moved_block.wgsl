// A block of a frame of profile `paper`.

/// A block and where it comes from.
struct MovedBlock {
    slot: u32,
    /// Whether it is predicted.
    is_predicted: u32,
    levels: u32,
    level_count: u32,
    /// As in `moved_row`.
    motion: array<i32, 12>,
}

/// A row of its prediction, 8 z + y being the thread; zero if there is none.
fn predicted_row(thread: u32, coord: vec3<i32>, block: MovedBlock, truncation: i32) -> array<i32, 8> {
    if block.is_predicted == 0u {
        return array<i32, 8>(0, 0, 0, 0, 0, 0, 0, 0);
    }
    find_neighbourhood(thread, coord, truncation);
    return moved_row(thread, block.motion);
}
