//! Which tiles have to be sampled anew, and which are as they were in the frame before.
//!
//! The distances of a tile rest on its triangles alone. Its signs rest on the winding number as well, which far triangles may change:
//! where something moves over a still part, or out of it. So the winding numbers of its voxels are held against those of the frame
//! before. Around wide holes, samples of unobserved voxels rest on how all holes are closed, and caps and rims look at what is beside
//! a tile. There the surroundings of a hole are taken over as a whole or not at all. Beside sheets, false crossings and
//! rims look at the voxels just around a tile, so the tiles there must be the same too.

use crate::sampler::Sign;
use crate::scene::Scene;
use crate::tiles::Tile;
use glam::IVec3;
use rayon::prelude::*;
use rustc_hash::FxHashSet;

/// Distance in tiles from one that touches a wide hole, up to which samples may depend on more than their
/// tile. Caps and rims look five blocks far.
const AROUND_HOLES: i32 = 2;

/// Pairs the tiles of a scene with those of the one before, by their places. Gives for each tile which it
/// was, `None` if there was none, and the tiles that are no more.
pub(crate) fn pair(tiles: &[Tile], before: &[Tile]) -> (Vec<Option<usize>>, Vec<IVec3>) {
    let (mut pairs, mut gone, mut next) = (Vec::with_capacity(tiles.len()), Vec::new(), 0);
    for tile in tiles {
        while before.get(next).is_some_and(|other| other.code() < tile.code()) {
            gone.push(before[next].coord);
            next += 1;
        }
        let is_there = before.get(next).is_some_and(|other| other.code() == tile.code());
        pairs.push(is_there.then_some(next));
        next += usize::from(is_there);
    }
    gone.extend(before[next..].iter().map(|tile| tile.coord));
    (pairs, gone)
}

/// What a frame is made of.
pub(crate) struct Stage<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) tiles: &'a [Tile<'a>],
    pub(crate) sign: &'a Sign,
}

impl Stage<'_> {
    /// The places of tiles that touch a wide hole, or what closes one.
    fn beside_holes(&self) -> Vec<IVec3> {
        let tiles = self.tiles.par_iter().filter(|tile| self.scene.is_beside_hole(tile));
        let mut places: Vec<IVec3> = tiles.map(|tile| tile.coord).collect();
        if let Some(sides) = self.sign.sides()
            && self.scene.has_wide_holes()
        {
            places.extend(&sides.caps.tiles);
        }
        places
    }

    /// Whether the sheets in a tile are those in a tile of another frame that has the same triangles.
    fn has_sheets_alike(&self, tile: &Tile, before: &Self, place: usize) -> bool {
        match (self.sign, before.sign) {
            (Sign::Parts(now), Sign::Parts(old)) => {
                let mut faces = tile.faces().zip(before.tiles[place].faces());
                faces.all(|(face, old_face)| now.sheets.is_alike(face, &old.sheets, old_face))
            }
            _ => true,
        }
    }
}

/// For each tile of a frame, which tile of the one before is the same, samples and all.
pub(crate) fn unchanged(now: &Stage, before: &Stage) -> Vec<Option<usize>> {
    let (pairs, gone) = pair(now.tiles, before.tiles);
    let around = around_holes(&[now.beside_holes(), before.beside_holes()].concat());
    let has_sides_alike = |tile: &Tile| match (now.sign, before.sign) {
        (Sign::Offset(now), Sign::Offset(before)) => now == before,
        (now, before) => match (now.sides(), before.sides()) {
            (Some(now), Some(before)) => {
                now.crossings.are_alike_in(&before.crossings, tile.coord.to_array())
                    && (!around.contains(&tile.coord) || now.caps.are_alike_in(&before.caps, tile.coord))
            }
            (now, before) => now.is_none() && before.is_none(),
        },
    };
    let is_same = |tile: &Tile, place: usize| {
        now.scene.has_alike(tile, before.scene, &before.tiles[place])
            && now.has_sheets_alike(tile, before, place)
            && has_sides_alike(tile)
    };
    let still = |(tile, place): (&Tile, Option<usize>)| place.filter(|place| is_same(tile, *place));
    let mut same: Vec<Option<usize>> = now.tiles.par_iter().zip(pairs).map(still).collect();
    let changed = now.tiles.iter().zip(&same).filter(|(_, same)| same.is_none()).map(|(tile, _)| tile.coord);
    let changed: Vec<IVec3> = gone.into_iter().chain(changed).collect();
    let mut stale = flood(&around, changed.iter().copied());
    if let Sign::Parts(_) = now.sign {
        let all: FxHashSet<IVec3> = changed.into_iter().chain(stale.iter().copied()).collect();
        stale.extend(all.into_iter().flat_map(|place| neighbours(place, 1)));
    }
    for (tile, same) in now.tiles.iter().zip(&mut same) {
        *same = same.filter(|_| !stale.contains(&tile.coord));
    }
    same
}

/// Tiles to sample: those that are not the same, and, beside sheets, those around them, at which false crossings and rims look.
pub(crate) fn to_sample<'a>(tiles: &[Tile<'a>], same: &[Option<usize>], sign: &Sign) -> Vec<Tile<'a>> {
    let fresh = |(_, same): &(&Tile, &Option<usize>)| same.is_none();
    let mut wanted: FxHashSet<IVec3> = FxHashSet::default();
    if let Sign::Parts(_) = sign {
        let fresh = tiles.iter().zip(same).filter(fresh);
        wanted.extend(fresh.flat_map(|(tile, _)| neighbours(tile.coord, 1)));
    }
    let is_wanted = |(tile, same): &(&Tile, &Option<usize>)| same.is_none() || wanted.contains(&tile.coord);
    tiles.iter().zip(same).filter(is_wanted).map(|(tile, _)| *tile).collect()
}

/// The places around those of tiles that touch a wide hole.
fn around_holes(beside: &[IVec3]) -> FxHashSet<IVec3> {
    let mut around = FxHashSet::default();
    for place in beside {
        around.extend(neighbours(*place, AROUND_HOLES));
    }
    around
}

/// Places that can be reached from the seeds among them, from each to any that touches it.
fn flood(places: &FxHashSet<IVec3>, seeds: impl Iterator<Item = IVec3>) -> FxHashSet<IVec3> {
    let mut stack: Vec<IVec3> = seeds.filter(|seed| places.contains(seed)).collect();
    let mut reached: FxHashSet<IVec3> = stack.iter().copied().collect();
    while let Some(place) = stack.pop() {
        stack.extend(neighbours(place, 1).filter(|next| places.contains(next) && reached.insert(*next)));
    }
    reached
}

/// A place on the grid of tiles, and those up to `reach` away along each axis.
fn neighbours(place: IVec3, reach: i32) -> impl Iterator<Item = IVec3> {
    let side = 2 * reach + 1;
    (0..side.pow(3)).map(move |i| place + IVec3::new(i % side, i / side % side, i / (side * side)) - reach)
}
