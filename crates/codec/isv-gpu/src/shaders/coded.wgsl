// What is known of a block coded in a frame (profile `main`).

/// How a block was coded.
struct CodedBlock {
    /// As in `vector_of`.
    mode: u32,
    /// Where its levels begin.
    levels: u32,
    level_count: u32,
    /// The first block of its slice.
    slice: u32,
}
