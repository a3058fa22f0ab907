// The coded blocks of one dispatch (profile `main`).

struct Parameters {
    scale: Scale,
    /// Largest magnitude of a sample.
    truncation: i32,
    /// Where in the list the blocks of this dispatch begin, and how many there are.
    first: u32,
    count: u32,
    /// Whether blocks without a vector are predicted from their neighbours.
    predicts_spatially: u32,
}

@group(1) @binding(0) var<uniform> parameters: Parameters;
