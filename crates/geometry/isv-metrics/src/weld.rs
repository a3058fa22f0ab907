//! Vertices at one place taken as one.

use glam::DVec3;
use isv_spatial::{PositionMap, position_key};

/// Numbers of the positions of a mesh's vertices: captures cut a surface along the seams of its texture, where vertices
/// are there twice.
pub(crate) struct Weld {
    /// For each vertex the number of its position, the first of them 0.
    pub(crate) positions: Vec<u32>,
    /// How many positions there are.
    pub(crate) count: usize,
}

impl Weld {
    /// Finds vertices at exactly the same position.
    pub(crate) fn new(vertices: &[DVec3]) -> Self {
        let mut numbers = PositionMap::default();
        numbers.reserve(vertices.len());
        let positions = vertices.iter().map(|v| {
            let next = numbers.len() as u32;
            *numbers.entry(position_key(*v)).or_insert(next)
        });
        Self { positions: positions.collect(), count: numbers.len() }
    }
}
