//! Which way normals point.
//!
//! The scanner's place decides, if it is known and the surface was not seen at a grazing angle. From there sides spread
//! to neighbours, the most nearly parallel first (Hoppe et al. 1992). What no scanner reaches faces outward, which is a guess
//! unless it is closed.

use crate::points::parts::Parts;
use glam::DVec3;
use rayon::prelude::*;
use std::fmt;

/// Neighbours of each point, itself among them, that its normal is compared with.
pub(crate) const NEIGHBOURS: usize = 9;

/// Least cosine between a normal and the direction of the scanner at which that alone decides. Estimated
/// normals are rarely off by more than the 14 degrees that remain.
const HEAD_ON: f64 = 0.25;

/// Neighbours whose normals have at least this cosine are on one smooth surface.
const SMOOTH: f64 = 0.9;

/// Points seen head-on that count as much as what decides for a smooth patch of points seen at grazing angles.
const PATCH_VOTES: f64 = 1.0;

/// Neighbours with a smaller cosine say nothing about each other's sides.
pub(super) const CREASE: f64 = 0.5;

/// Share of its outermost points, those inward taken off, that faces outward on a part that is nearly closed.
const OUTWARD: f64 = 0.5;

/// Share of the points whose sides may be guesses apart from each other, with signs still being used.
const MOST_SCATTERED: f64 = 0.1;

/// The nearest points of a point; none where there are fewer.
pub(crate) type Neighbours = [Option<u32>; NEIGHBOURS];

/// What normals were turned by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NormalSides {
    /// They face the place that their points were seen from, or those of several scans.
    Viewpoint,
    /// They face a place that the points look scanned from, as nobody said where it was.
    Guessed(DVec3),
    /// Neighbours agree, and the outermost ones of each part look outward. That decides little for parts that are no closed bodies.
    #[default]
    Outward,
}

/// What the sides of estimated normals rest on. Its text says it in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SideEvidence {
    /// What most of them were turned by.
    pub basis: NormalSides,
    /// Share of the points with a normal, 0 to 1, whose side follows from where their scanner stood.
    pub seen: f64,
    /// Share of the points with a normal, 0 to 1, whose side is a guess.
    pub guessed: f64,
    /// Patches with a side that was guessed, each by itself.
    pub patches: usize,
    /// Share of the points with a normal, 0 to 1, in all those patches but the largest: patches may contradict each other.
    pub scattered: f64,
}

impl SideEvidence {
    /// Whether few enough sides are guesses to tell inside from outside.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.scattered <= MOST_SCATTERED
    }
}

impl fmt::Display for SideEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seen, guessed) = (100.0 * self.seen, 100.0 * self.guessed);
        match self.patches {
            0 if self.seen > 0.0 => write!(f, "{seen:.0} % of the sides follow from where the scanner stood"),
            0 => f.write_str("the points close around an inside, and face away from it"),
            1 => write!(f, "sides are a guess for {guessed:.0} % of the points, in 1 patch"),
            patches => write!(f, "sides are a guess for {guessed:.0} % of the points, in {patches} patches"),
        }
    }
}

/// Gives all normals a side. `views`: where each point was seen from, if that is known.
pub(crate) fn orient(
    positions: &[DVec3],
    neighbours: &[Neighbours],
    views: &[Option<DVec3>],
    normals: &mut [DVec3],
) -> SideEvidence {
    let edges = edges(neighbours, normals);
    let facing: Vec<f64> = (normals.par_iter().zip(positions).zip(views))
        .map(|((normal, p), view)| view.map_or(0.0, |view| normal.dot((view - p).normalize_or_zero())))
        .collect();
    let mut sides = Sides { parts: Parts::new(positions.len()), turned: vec![None; positions.len()] };
    sides.settle_head_on(&facing);
    sides.settle_smooth_patches(&edges, normals, &facing);
    let patches = sides.spread(&edges, normals, &facing);
    let known = |i: usize| normals[i] != DVec3::ZERO;
    let seen = (0..positions.len()).filter(|i| known(*i) && sides.turned[*i].is_some()).count();
    let guesses = sides.face_outward(positions, normals, &patches);
    for (normal, turned) in normals.iter_mut().zip(&sides.turned) {
        if *turned == Some(true) {
            *normal = -*normal;
        }
    }
    let all = normals.iter().filter(|normal| **normal != DVec3::ZERO).count().max(1) as f64;
    let guessed: usize = guesses.iter().sum();
    let largest = guesses.iter().copied().max().unwrap_or(0);
    SideEvidence {
        basis: NormalSides::default(),
        seen: seen as f64 / all,
        guessed: guessed as f64 / all,
        patches: guesses.len(),
        scattered: (guessed - largest) as f64 / all,
    }
}

/// Two neighbours; ordered by how far from parallel their normals are.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    /// Bits of a number that is not negative, which are in the order of the numbers.
    bend: u32,
    from: u32,
    to: u32,
}

impl Edge {
    /// Cosine between the normals, whichever way they point.
    fn cosine(self) -> f64 {
        1.0 - f64::from(f32::from_bits(self.bend))
    }

    fn is_turned(self, normals: &[DVec3]) -> bool {
        normals[self.from as usize].dot(normals[self.to as usize]) < 0.0
    }
}

/// All pairs of neighbours that both have a normal, the most nearly parallel first.
fn edges(neighbours: &[Neighbours], normals: &[DVec3]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = neighbours
        .par_iter()
        .zip(0..neighbours.len() as u32)
        .flat_map_iter(|(list, from)| {
            let n = normals[from as usize];
            list.iter().flatten().filter(move |to| **to != from).filter_map(move |to| {
                let m = normals[*to as usize];
                let bend = ((1.0 - n.dot(m).abs()).max(0.0) as f32).to_bits();
                let known = n != DVec3::ZERO && m != DVec3::ZERO;
                known.then_some(Edge { bend, from: from.min(*to), to: from.max(*to) })
            })
        })
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    edges
}

/// Sides while they are found.
struct Sides {
    /// Points whose sides depend on each other.
    parts: Parts,
    /// Whether each normal is turned over; `None` until that is known.
    turned: Vec<Option<bool>>,
}

impl Sides {
    /// Points that were not seen at a grazing angle face their scanner.
    fn settle_head_on(&mut self, facing: &[f64]) {
        for (turned, facing) in self.turned.iter_mut().zip(facing) {
            *turned = (facing.abs() >= HEAD_ON).then_some(*facing < 0.0);
        }
    }

    /// Turns smooth patches of other points towards their scanner, and the way of neighbours that face it.
    /// The sum of all points of a patch decides: one point that is seen at a grazing angle says little.
    fn settle_smooth_patches(&mut self, edges: &[Edge], normals: &[DVec3], facing: &[f64]) {
        if facing.iter().all(|facing| *facing == 0.0) {
            return;
        }
        let mut patches = Parts::new(normals.len());
        let smooth = || edges.iter().take_while(|edge| edge.cosine() >= SMOOTH);
        for edge in smooth() {
            if [edge.from, edge.to].iter().all(|point| self.turned[*point as usize].is_none()) {
                patches.join(edge.from, edge.to, edge.is_turned(normals));
            }
        }
        let mut votes = vec![0.0; normals.len()];
        let signed = |turned: bool, vote: f64| if turned { -vote } else { vote };
        for (point, facing) in facing.iter().enumerate() {
            let (root, turned) = patches.root(point as u32);
            votes[root as usize] += signed(turned, *facing);
        }
        for edge in smooth() {
            let (open, settled) = match [edge.from, edge.to].map(|point| self.turned[point as usize]) {
                [None, Some(settled)] => (edge.from, settled),
                [Some(settled), None] => (edge.to, settled),
                _ => continue,
            };
            let (root, turned) = patches.root(open);
            votes[root as usize] += signed(turned ^ edge.is_turned(normals) ^ settled, HEAD_ON);
        }
        for point in 0..normals.len() {
            let (root, turned) = patches.root(point as u32);
            let vote = votes[root as usize];
            if self.turned[point].is_none() && vote.abs() >= PATCH_VOTES {
                self.turned[point] = Some(turned ^ (vote < 0.0));
            }
        }
    }

    /// Spreads sides from where they are known to all that hangs together with it, and makes the rest agree within each part. Gives
    /// the parts that were there before any were joined across a crease, for points without a known side.
    fn spread(&mut self, edges: &[Edge], normals: &[DVec3], facing: &[f64]) -> Parts {
        // All points with a known side are one part, in which they have it.
        let known: Vec<u32> =
            (0..normals.len() as u32).filter(|i| self.turned[*i as usize].is_some()).collect();
        let side = |sides: &Self, point: u32| sides.turned[point as usize] == Some(true);
        for pair in known.windows(2) {
            let turned = side(self, pair[0]) ^ side(self, pair[1]);
            self.parts.join(pair[0], pair[1], turned);
        }
        let creases = edges.partition_point(|edge| edge.cosine() >= CREASE);
        for edge in &edges[..creases] {
            self.parts.join(edge.from, edge.to, edge.is_turned(normals));
        }
        let patches = self.parts.clone();
        for edge in &edges[creases..] {
            self.parts.join(edge.from, edge.to, edge.is_turned(normals));
        }
        let anchor = known.first().map(|first| (self.parts.root(*first), side(self, *first)));
        // What does not hang together with any of them faces its scanner as far as it can.
        let mut votes = vec![0.0; normals.len()];
        for (point, facing) in facing.iter().enumerate() {
            let (root, turned) = self.parts.root(point as u32);
            votes[root as usize] += if turned { -facing } else { *facing };
        }
        for point in 0..normals.len() {
            let (root, turned) = self.parts.root(point as u32);
            match anchor {
                Some(((first, first_turned), side)) if first == root => {
                    self.turned[point] = Some(turned ^ first_turned ^ side);
                }
                _ if votes[root as usize] != 0.0 => {
                    self.turned[point] = Some(turned ^ (votes[root as usize] < 0.0));
                }
                _ => {}
            }
        }
        patches
    }

    /// Turns parts without a known side outward. Gives the number of points of each patch for which that is a
    /// guess. It is one in parts that are far from closed. It is one in all patches of a part but the
    /// largest, which only creases join to it.
    fn face_outward(&mut self, positions: &[DVec3], normals: &[DVec3], patches: &Parts) -> Vec<usize> {
        let mut patches = patches.clone();
        let open: Vec<u32> = (0..positions.len() as u32)
            .filter(|i| self.turned[*i as usize].is_none() && normals[*i as usize] != DVec3::ZERO)
            .collect();
        let parts = self.parts.groups(&open);
        let centre = open.iter().map(|i| positions[*i as usize]).sum::<DVec3>() / open.len().max(1) as f64;
        let mut guesses = Vec::new();
        for part in parts {
            let sided =
                |i: u32, turned: bool| if turned { -normals[i as usize] } else { normals[i as usize] };
            let members: Vec<(u32, DVec3)> =
                part.iter().map(|(i, turned)| (*i, sided(*i, *turned))).collect();
            let outward = outwardness(&members, positions);
            let is_guess = outward.abs() < OUTWARD;
            // An open part faces away from the middle of all.
            let away = || members.iter().map(|(i, n)| n.dot(positions[*i as usize] - centre)).sum::<f64>();
            let inward = if is_guess && outward.abs() < OUTWARD / 2.0 { away() < 0.0 } else { outward < 0.0 };
            for (i, turned) in &part {
                self.turned[*i as usize] = Some(turned ^ inward);
            }
            let points: Vec<u32> = part.iter().map(|(i, _)| *i).collect();
            let mut sizes: Vec<usize> = patches.groups(&points).iter().map(Vec::len).collect();
            sizes.sort_unstable();
            if !is_guess {
                sizes.pop();
            }
            guesses.extend(sizes);
        }
        guesses
    }
}

/// How far the outermost points of a part face outward: 1 if all do, -1 if none does, 0 if they cancel out.
fn outwardness(members: &[(u32, DVec3)], positions: &[DVec3]) -> f64 {
    let (mut sum, mut size) = (0.0, 0.0);
    for number in 0..27 {
        let axis = |power: i32| f64::from(number / power % 3 - 1);
        let direction = DVec3::new(axis(1), axis(3), axis(9)).normalize_or_zero();
        let height = |member: &(u32, DVec3)| positions[member.0 as usize].dot(direction);
        let Some((_, normal)) = members.iter().max_by(|a, b| height(a).total_cmp(&height(b))) else {
            continue;
        };
        sum += normal.dot(direction);
        size += normal.dot(direction).abs();
    }
    if size > 0.0 { sum / size } else { 0.0 }
}
