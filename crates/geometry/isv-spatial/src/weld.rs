//! Vertices at one position taken as one.

use crate::{PositionMap, position_key};
use glam::DVec3;

/// Numbers of the positions of a mesh's vertices. Captures cut a surface along the seams of its texture, and store its vertices twice
/// there.
#[derive(Clone, Debug)]
pub struct Weld {
    /// Number of each vertex's position. Positions are numbered from 0, in the order of their first vertices.
    pub positions: Vec<u32>,
    /// Number of positions.
    pub count: usize,
}

impl Weld {
    /// Finds vertices at exactly the same position.
    #[must_use]
    pub fn new(vertices: &[DVec3]) -> Self {
        let mut numbers = PositionMap::default();
        numbers.reserve(vertices.len());
        let positions = vertices.iter().map(|v| {
            let next = numbers.len() as u32;
            *numbers.entry(position_key(*v)).or_insert(next)
        });
        Self { positions: positions.collect(), count: numbers.len() }
    }
}
