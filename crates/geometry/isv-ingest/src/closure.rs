//! Triangles over the holes of a mesh.
//!
//! With them it is closed in the strict sense: along every line as many triangles are passed from the front as from the back. Where
//! that puts a surface over a hole that is to stay open, [`crate::caps`] takes it away again.

use crate::topology::NONE;
use glam::DVec3;
use rustc_hash::FxHashMap;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Triangles whose boundary is that of a mesh the other way round, given as a chain
/// ([`crate::boundary::Boundary`]). They span each loop by cutting off the corner with the shortest side
/// opposite, again and again. That zips up cracks from end to end and leaves a round hole about flat.
pub(crate) fn close(chain: &[[u32; 2]], positions: &[DVec3]) -> Vec<[u32; 3]> {
    loops(chain).iter().flat_map(|cycle| span(cycle, positions)).collect()
}

/// Takes a chain without boundary apart into loops that pass no vertex twice, each the other way round.
fn loops(chain: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut ends: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
    for [from, to] in chain {
        ends.entry(*to).or_default().push(*from);
    }
    let mut loops = Vec::new();
    // The way so far, and the place of each vertex on it.
    let (mut way, mut places): (Vec<u32>, FxHashMap<u32, usize>) = Default::default();
    for [start, _] in chain {
        let mut vertex = *start;
        loop {
            if let Some(place) = places.get(&vertex).copied() {
                loops.push(way.split_off(place));
                loops.last().into_iter().flatten().for_each(|passed| {
                    places.remove(passed);
                });
            }
            let Some(next) = ends.get_mut(&vertex).and_then(Vec::pop) else { break };
            places.insert(vertex, way.len());
            way.push(vertex);
            vertex = next;
        }
    }
    loops
}

/// Triangles over a loop, in its direction.
fn span(cycle: &[u32], positions: &[DVec3]) -> Vec<[u32; 3]> {
    let count = cycle.len() as u32;
    let mut before: Vec<u32> = (0..count).map(|place| (place + count - 1) % count).collect();
    let mut after: Vec<u32> = (0..count).map(|place| (place + 1) % count).collect();
    let across = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|place| positions[cycle[place as usize] as usize]);
        // Bits of numbers that are not negative are in the order of the numbers.
        a.distance_squared(b).to_bits()
    };
    let ear = |place: u32, [before, after]: [u32; 2]| Reverse((across(before, after), place, before, after));
    let mut ears: BinaryHeap<_> =
        (0..count).map(|place| ear(place, [before[place as usize], after[place as usize]])).collect();
    let mut triangles = Vec::new();
    while triangles.len() + 2 < cycle.len() {
        let Some(Reverse((_, place, low, high))) = ears.pop() else { break };
        if before[place as usize] != low || after[place as usize] != high {
            continue;
        }
        triangles.push([low, place, high].map(|place| cycle[place as usize]));
        (before[place as usize], after[place as usize]) = (NONE, NONE);
        after[low as usize] = high;
        before[high as usize] = low;
        for place in [low, high] {
            ears.push(ear(place, [before[place as usize], after[place as usize]]));
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::Random;
    use std::collections::BTreeMap;

    /// How often each edge is run along, upwards less downwards.
    fn balance(sides: impl Iterator<Item = [u32; 2]>) -> BTreeMap<[u32; 2], i32> {
        let mut balance = BTreeMap::new();
        for [from, to] in sides {
            *balance.entry([from.min(to), from.max(to)]).or_insert(0) += if from < to { 1 } else { -1 };
        }
        balance.retain(|_, count| *count != 0);
        balance
    }

    #[test]
    fn what_closes_any_cycle_has_it_as_its_boundary() {
        let mut random = Random::new(3);
        let positions: Vec<DVec3> = (0..40).map(|_| random.point()).collect();
        for _ in 0..50 {
            // Walks from a vertex back to it, through others, some of them more than once.
            let mut chain = Vec::new();
            for _ in 0..3 {
                let mut walk: Vec<u32> =
                    (0..12).map(|_| (random.signed().abs() * 40.0) as u32 % 40).collect();
                walk.dedup();
                walk.push(walk[0]);
                chain.extend(walk.windows(2).map(|w| [w[0], w[1]]).filter(|[a, b]| a != b));
            }
            let triangles = close(&chain, &positions);
            let sides = triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
            assert!(balance(sides.chain(chain.iter().copied())).is_empty());
        }
    }

    #[test]
    fn a_round_hole_is_closed_flat_and_a_crack_from_side_to_side() {
        let ring: Vec<DVec3> = (0..64)
            .map(|i| {
                let (y, x) = (f64::from(i) * std::f64::consts::PI / 32.0).sin_cos();
                DVec3::new(x, y, 0.0)
            })
            .collect();
        let chain: Vec<[u32; 2]> = (0..64).map(|i| [i, (i + 1) % 64]).collect();
        let area = |triangles: &[[u32; 3]], at: &[DVec3]| -> f64 {
            let corners = triangles.iter().map(|t| t.map(|v| at[v as usize]));
            corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
        };
        let triangles = close(&chain, &ring);
        assert_eq!(triangles.len(), 62);
        assert!((area(&triangles, &ring) - std::f64::consts::PI).abs() < 0.01);
        // The same ring, pressed together and bent around a cylinder.
        let bent: Vec<DVec3> =
            ring.iter().map(|p| DVec3::new((3.0 * p.x).cos(), (3.0 * p.x).sin(), 0.01 * p.y)).collect();
        assert!(area(&close(&chain, &bent), &bent) < 0.11);
    }
}
