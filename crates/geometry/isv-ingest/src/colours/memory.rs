//! Colours seen so far of a scene that stands still.

use super::views::level;
use isv_volume::{BlockCoord, CODES_PER_VOXEL, ColourSample, SparseVolume};
use rayon::prelude::*;

/// Most places that are remembered: 1.2 GiB. Places beyond it stay without a colour of their own.
const MOST_PLACES: usize = 1 << 24;

/// Cells along the edge of a voxel. Each remembers a colour a side of the surface.
const CELLS: f64 = 2.0;

/// Distance from the surface beyond which a place is forgotten, in codes of distance.
const FORGOTTEN: i16 = 2 * CODES_PER_VOXEL as i16;

/// Weight at which new readings no longer count less than old ones: 30 from 1 m, as fusion has it.
const MOST_WEIGHT: f32 = 30.0;

/// Growth of a weight since a colour was last given out, from which on a small change is given out, too.
const GROWTH: f32 = 2.0;

/// Change of a channel from which on a colour is given out anew once it rests on much more than before.
const SMALL_CHANGE: f32 = 3.0;

/// Change of a channel from which on a colour is given out anew at once. A quantizer step of keyframes at the default quality is 20.
const CHANGE: f32 = 12.0;

/// Share of all places that must have been given out anew for colours to count as changed: one in so many.
const CHANGED_SHARE: usize = 64;

/// Colours of all places of a scene that were seen so far, for takes in which each frame is all that was seen.
///
/// A place is half a voxel wide and has a colour for each side of a surface. Readings are averaged by weight.
/// A colour is given out anew only once it has changed visibly, or a little and rests on twice the weight. So
/// colours of a still room stay the same from frame to frame, bit for bit, and cost nothing. Places that lie
/// near no surface any more are forgotten.
#[derive(Clone, Debug)]
pub struct ColourMemory {
    voxel_m: f64,
    /// In the order of their keys.
    places: Vec<Place>,
}

/// Cell of a block, and the side that a surface faces. Blocks first, so that those of a block follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    block: [i32; 3],
    cell: u16,
}

#[derive(Clone, Debug)]
struct Place {
    key: Key,
    /// Mean colour of all readings.
    colour: [f32; 3],
    weight: f32,
    /// Sample as it was last given out; its weight is that of all readings then.
    given: ColourSample,
    /// Whether that is since colours last counted as changed.
    is_new: bool,
}

/// The cell that a sample lies in; none for one that lies nowhere.
fn cell_of(sample: &ColourSample, voxel_m: f64) -> Option<[i32; 3]> {
    let at = sample.position.map(|p| (f64::from(p) / voxel_m * CELLS).floor());
    at.iter().all(|c| c.abs() < f64::from(i32::MAX)).then(|| at.map(|c| c as i32))
}

fn block_of(cell: [i32; 3]) -> [i32; 3] {
    cell.map(|c| c >> 4)
}

impl ColourMemory {
    /// Creates a memory of nothing. `voxel_m`: edge of a voxel (m), in blocks of 8.
    #[must_use]
    pub fn new(voxel_m: f64) -> Self {
        Self { voxel_m, places: Vec::new() }
    }

    /// Adds what was seen in a frame, and forgets what is near no surface of its volume.
    pub fn add(&mut self, seen: &[ColourSample], volume: &SparseVolume) {
        let keyed = seen.par_iter().filter_map(|sample| Some((self.key(sample)?, *sample)));
        let mut keyed: Vec<(Key, ColourSample)> = keyed.collect();
        // Samples of a place stay in their order, so that sums are the same on every machine.
        keyed.par_sort_by_key(|(key, _)| *key);
        let mut merged: Vec<Place> = Vec::with_capacity(self.places.len().max(keyed.len() / 2));
        let mut known = std::mem::take(&mut self.places).into_iter().peekable();
        for group in keyed.chunk_by(|a, b| a.0 == b.0) {
            while let Some(place) = known.next_if(|place| place.key < group[0].0) {
                merged.push(place);
            }
            let place = known.next_if(|place| place.key == group[0].0);
            merged.push(with_readings(place, group));
        }
        merged.extend(known);
        let near = Nearness::new(volume);
        merged.retain(|place| near.is_near(&place.key, self.voxel_m, &place.given));
        merged.truncate(MOST_PLACES);
        self.places = merged;
    }

    /// Colours of all places, as last given out.
    #[must_use]
    pub fn samples(&self) -> Vec<ColourSample> {
        let given = self.places.par_iter().map(|place| place.given);
        given.map(|given| ColourSample { weight: level(given.weight), ..given }).collect()
    }

    /// Whether enough places have a new colour, since this was last so, that a frame is worth coding for it: one in 64.
    pub fn has_changed(&mut self) -> bool {
        let new = self.places.iter().filter(|place| place.is_new).count();
        let has_changed = new > 0 && new * CHANGED_SHARE >= self.places.len();
        if has_changed {
            self.places.iter_mut().for_each(|place| place.is_new = false);
        }
        has_changed
    }

    /// The place of a sample; none for one that lies nowhere.
    fn key(&self, sample: &ColourSample) -> Option<Key> {
        if sample.weight.is_nan() || sample.weight <= 0.0 {
            return None;
        }
        let cell = cell_of(sample, self.voxel_m)?;
        let along = (0..3).max_by(|a, b| sample.normal[*a].abs().total_cmp(&sample.normal[*b].abs()))?;
        let side = 2 * along as u16 + u16::from(sample.normal[along] < 0.0);
        let [x, y, z] = cell.map(|c| (c & 15) as u16);
        Some(Key { block: block_of(cell), cell: (z << 8 | y << 4 | x) << 3 | side })
    }
}

/// A place with more readings of it, of which there is at least one.
fn with_readings(place: Option<Place>, readings: &[(Key, ColourSample)]) -> Place {
    let (key, first) = readings[0];
    // Samples lie closer than places: a frame counts once.
    let share = 1.0 / readings.len() as f32;
    let given = ColourSample { weight: 0.0, ..first };
    let unseen = Place { key, colour: [0.0; 3], weight: 0.0, given, is_new: true };
    let mut place = place.unwrap_or(unseen);
    for (_, reading) in readings {
        let weight = reading.weight * share;
        place.weight += weight;
        let part = weight / place.weight;
        (0..3).for_each(|c| place.colour[c] += (reading.colour[c] - place.colour[c]) * part);
    }
    place.weight = place.weight.min(MOST_WEIGHT);
    let has_grown = place.weight >= GROWTH * place.given.weight;
    let least = if has_grown { SMALL_CHANGE } else { CHANGE };
    let has_changed = (0..3).any(|c| (place.colour[c] - place.given.colour[c]).abs() > least);
    if has_changed || place.given.weight == 0.0 {
        place.given.colour = place.colour;
        place.given.weight = place.weight;
        place.is_new = true;
    }
    place
}

/// Looks up how far places are from the surface of a volume.
struct Nearness<'a> {
    volume: &'a SparseVolume,
    index: isv_volume::BlockIndex,
}

impl<'a> Nearness<'a> {
    fn new(volume: &'a SparseVolume) -> Self {
        Self { volume, index: volume.index() }
    }

    /// Whether the voxel that a sample lies in is observed and near the surface.
    fn is_near(&self, key: &Key, voxel_m: f64, sample: &ColourSample) -> bool {
        let edge = self.volume.grid().edge.voxels() as i32;
        let voxel = sample.position.map(|p| (f64::from(p) / voxel_m).floor() as i32);
        debug_assert!(edge != 8 || voxel.map(|v| v >> 3) == key.block);
        let block = BlockCoord::from(voxel.map(|v| v.div_euclid(edge)));
        let Some(found) = block.in_range().then(|| self.index.get(block)).flatten() else { return false };
        let [x, y, z] = voxel.map(|v| v.rem_euclid(edge) as usize);
        let edge = edge as usize;
        let at = (z * edge + y) * edge + x;
        let is_observed = self.volume.unobserved(found as usize).is_none_or(|mask| !mask.contains(at));
        is_observed && self.volume.block(found as usize)[at].abs() <= FORGOTTEN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::{BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};

    const VOXEL_M: f64 = 0.01;

    /// A wall at x = 0.04 m that is solid to the left, in one block.
    fn wall() -> SparseVolume {
        let voxel_size = VoxelSize::from_metres(VOXEL_M).unwrap();
        let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::DEFAULT };
        let mut builder = VolumeBuilder::new(grid);
        let samples = (0..512).map(|i| (256 * (i % 8) - 896i32).clamp(-1024, 1024) as i16).collect();
        builder.push(BlockCoord { x: 0, y: 0, z: 0 }, samples, None);
        builder.finish()
    }

    fn sample(y: f32, grey: f32, weight: f32) -> ColourSample {
        ColourSample { position: [0.041, y, 0.03], normal: [1.0, 0.0, 0.0], colour: [grey; 3], weight }
    }

    #[test]
    fn colours_that_hardly_change_are_given_out_as_they_were() {
        let mut memory = ColourMemory::new(VOXEL_M);
        memory.add(&[sample(0.02, 100.0, 0.25)], &wall());
        let first = memory.samples();
        assert_eq!(first.len(), 1);
        // The mean is beyond 103 from the fifth frame on.
        let mut changes = 0;
        let mut last = first;
        for frame in 1..8 {
            memory.add(&[sample(0.02, 103.9, 0.25)], &wall());
            changes += usize::from(memory.samples() != last);
            last = memory.samples();
            let expected = if frame < 4 { 100.0 } else { 103.12 };
            assert!((last[0].colour[0] - expected).abs() < 1e-3, "{frame}: {last:?}");
        }
        assert_eq!(changes, 1);
    }

    #[test]
    fn colours_have_changed_when_one_place_in_64_has() {
        let mut memory = ColourMemory::new(VOXEL_M);
        let cell = |i: usize, grey: f32| ColourSample {
            position: [0.041, 0.0025 + 0.005 * (i % 12) as f32, 0.0025 + 0.005 * (i / 12) as f32],
            ..sample(0.0, grey, 1.0)
        };
        let all: Vec<ColourSample> = (0..144).map(|i| cell(i, 50.0)).collect();
        memory.add(&all, &wall());
        assert_eq!(memory.samples().len(), 144);
        assert!(memory.has_changed() && !memory.has_changed());
        memory.add(&[cell(5, 250.0), cell(70, 250.0)], &wall());
        assert!(!memory.has_changed(), "two of 144");
        memory.add(&[cell(100, 250.0)], &wall());
        assert!(memory.has_changed(), "three of 144");
    }

    #[test]
    fn a_visible_change_is_given_out_at_once() {
        let mut memory = ColourMemory::new(VOXEL_M);
        memory.add(&[sample(0.02, 100.0, 1.0)], &wall());
        memory.add(&[sample(0.02, 200.0, 0.5)], &wall());
        let given = memory.samples()[0].colour[0];
        assert!((given - 133.3).abs() < 0.1, "{given}");
    }

    #[test]
    fn what_was_seen_earlier_stays_and_what_is_gone_is_forgotten() {
        let mut memory = ColourMemory::new(VOXEL_M);
        memory.add(&[sample(0.02, 10.0, 1.0)], &wall());
        memory.add(&[sample(0.06, 200.0, 1.0), sample(0.3, 1.0, 1.0), sample(f32::NAN, 1.0, 1.0)], &wall());
        let colours: Vec<f32> = memory.samples().iter().map(|sample| sample.colour[0]).collect();
        assert_eq!(colours, [10.0, 200.0]);
        memory.add(&[], &SparseVolume::empty(*wall().grid()));
        assert!(memory.samples().is_empty());
    }

    #[test]
    fn both_sides_of_a_sheet_keep_their_colours() {
        let mut memory = ColourMemory::new(VOXEL_M);
        let back = ColourSample { normal: [-1.0, 0.0, 0.0], ..sample(0.02, 250.0, 1.0) };
        memory.add(&[sample(0.02, 10.0, 1.0), back], &wall());
        assert_eq!(memory.samples().len(), 2);
    }
}
