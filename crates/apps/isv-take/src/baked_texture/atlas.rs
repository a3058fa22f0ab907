//! Places of charts in a texture, from frame to frame.

use super::TextureTooSmall;
use super::charts::{Chart, ChartKey};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Texels a voxel, at most: colour has four samples a voxel at most.
const DENSEST: f64 = 8.0;
/// Texels around a chart, and the least texels a voxel beside which so many are kept. All places and sizes are multiples of them: a mip
/// map of so much smaller a size has a texel for them. The last density is a texel a block.
const PADDINGS: [(u32, f64); 3] = [(4, 1.5), (2, 0.75), (1, 1.0 / 8.0)];
/// Density of each step from the one before.
const COARSER: f64 = 0.917;
/// Part of the texture that the first frame may take: the rest is for frames that are larger.
const FIRST_PART: f64 = 0.92;
/// Heights of shelves that a patch is put on, over its own, while there is room for more shelves.
const TALLEST: f64 = 1.25;

/// Place of a chart in a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// First texel as seen, from the middle of the chart's block.
    pub(super) low: [i32; 2],
    pub(super) size: [u32; 2],
    /// First texel in the texture.
    pub(super) at: [u32; 2],
}

/// A texture, and what is where in it.
#[derive(Clone, Debug)]
pub(super) struct Atlas {
    side: u32,
    density: f64,
    padding: u32,
    places: BTreeMap<ChartKey, Vec<Place>>,
    shelves: Shelves,
}

impl Atlas {
    /// An empty texture.
    pub(super) fn new(side: u32) -> Self {
        let (padding, shelves) = (PADDINGS[0].0, Shelves::new(side, side));
        Self { side, density: DENSEST, padding, places: BTreeMap::new(), shelves }
    }

    /// Texels along a side.
    pub(super) fn side(&self) -> u32 {
        self.side
    }

    /// Texels a voxel.
    pub(super) fn density(&self) -> f64 {
        self.density
    }

    /// Texels around each chart.
    #[cfg(test)]
    pub(super) fn padding(&self) -> u32 {
        self.padding
    }

    /// Whether the last frame had charts of a key.
    pub(super) fn has(&self, key: ChartKey) -> bool {
        self.places.contains_key(&key)
    }

    /// Places the charts of the next frame: where they were, if they fit there, else where there is room. If there is none, all are placed
    /// anew, coarser if that must be.
    pub(super) fn place(&mut self, charts: &[Chart]) -> Result<Vec<Place>, TextureTooSmall> {
        let is_first = self.places.is_empty();
        let places = match is_first {
            true => None,
            false => self.succeed(charts),
        };
        let places = match places {
            Some(places) => places,
            None => self.place_anew(charts, if is_first { FIRST_PART } else { 1.0 })?,
        };
        self.places.clear();
        for (chart, place) in charts.iter().zip(&places) {
            self.places.entry(chart.key).or_default().push(*place);
        }
        Ok(places)
    }

    /// Places beside what stays; `None` if there is no room.
    fn succeed(&mut self, charts: &[Chart]) -> Option<Vec<Place>> {
        let mut before = self.places.clone();
        let wanted: Vec<Place> =
            charts.iter().map(|chart| frame_of(chart, self.density, self.padding)).collect();
        let mut places: Vec<Option<Place>> = vec![None; charts.len()];
        for ((chart, wanted), place) in charts.iter().zip(&wanted).zip(&mut places) {
            let Some(held) = before.get_mut(&chart.key) else { continue };
            if let Some(fits) = held.iter().position(|held| holds(held, wanted)) {
                *place = Some(held.remove(fits));
            }
        }
        let mut shelves = self.shelves.clone();
        before.values().flatten().for_each(|gone| shelves.free(gone.at, gone.size[0]));
        for number in order(&wanted) {
            if places[number].is_none() {
                let at = shelves.take(wanted[number].size)?;
                places[number] = Some(Place { at, ..wanted[number] });
            }
        }
        self.shelves = shelves;
        places.into_iter().collect()
    }

    /// Places all charts in an empty texture, of which a part may be used: as dense as the frame before, or coarser.
    fn place_anew(&mut self, charts: &[Chart], part: f64) -> Result<Vec<Place>, TextureTooSmall> {
        let height = (f64::from(self.side) * part) as u32;
        let mut density = self.density;
        for (padding, least) in PADDINGS.into_iter().filter(|(padding, _)| *padding <= self.padding) {
            while density >= least {
                if let Some((places, shelves)) = self.packed(charts, density, padding, height) {
                    (self.density, self.padding, self.shelves) = (density, padding, shelves);
                    return Ok(places);
                }
                density *= COARSER;
            }
        }
        Err(TextureTooSmall { patches: charts.len(), side: self.side })
    }

    /// Packs all charts up to a height, if they fit.
    fn packed(
        &self,
        charts: &[Chart],
        density: f64,
        padding: u32,
        height: u32,
    ) -> Option<(Vec<Place>, Shelves)> {
        let mut places: Vec<Place> = charts.iter().map(|chart| frame_of(chart, density, padding)).collect();
        let area: u64 = places.iter().map(|place| u64::from(place.size[0]) * u64::from(place.size[1])).sum();
        if area > u64::from(self.side) * u64::from(height) {
            return None;
        }
        let mut shelves = Shelves::new(self.side, height);
        for number in order(&places) {
            places[number].at = shelves.take(places[number].size)?;
        }
        shelves.height = self.side;
        Some((places, shelves))
    }
}

/// The tallest first, which leaves least room beside them.
fn order(places: &[Place]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|number| Reverse(places[*number].size[1]));
    order
}

/// The texels of a chart with those around it, at no place yet.
fn frame_of(chart: &Chart, density: f64, padding: u32) -> Place {
    let step = f64::from(padding);
    let low = chart.extent[0].map(|voxels| ((voxels * density / step).floor() as i32 - 1) * padding as i32);
    let high = chart.extent[1].map(|voxels| ((voxels * density / step).ceil() as i32 + 1) * padding as i32);
    let size = [0, 1].map(|axis| high[axis].abs_diff(low[axis]));
    Place { low, size, at: [0; 2] }
}

/// Whether a place has all texels that are wanted.
fn holds(held: &Place, wanted: &Place) -> bool {
    (0..2).all(|axis| {
        let end = |place: &Place| i64::from(place.low[axis]) + i64::from(place.size[axis]);
        held.low[axis] <= wanted.low[axis] && end(held) >= end(wanted)
    })
}

/// Rows of patches of about the same height.
#[derive(Clone, Debug)]
struct Shelves {
    width: u32,
    height: u32,
    shelves: Vec<Shelf>,
}

#[derive(Clone, Debug)]
struct Shelf {
    at: u32,
    height: u32,
    /// First texel and number of texels of each gap, in order.
    gaps: Vec<(u32, u32)>,
}

impl Shelves {
    fn new(width: u32, height: u32) -> Self {
        Self { width, height, shelves: Vec::new() }
    }

    /// Takes room for a patch.
    fn take(&mut self, [width, height]: [u32; 2]) -> Option<[u32; 2]> {
        let tallest = (f64::from(height) * TALLEST) as u32;
        if let Some(at) = self.take_up_to([width, height], tallest) {
            return Some(at);
        }
        let end = self.shelves.last().map_or(0, |shelf| shelf.at + shelf.height);
        if width <= self.width && height <= self.height.saturating_sub(end) {
            let gap = (width, self.width - width);
            let gaps = if gap.1 > 0 { vec![gap] } else { Vec::new() };
            self.shelves.push(Shelf { at: end, height, gaps });
            return Some([0, end]);
        }
        self.take_up_to([width, height], u32::MAX)
    }

    /// Takes room on a shelf that is no taller, on the lowest that has any.
    fn take_up_to(&mut self, [width, height]: [u32; 2], tallest: u32) -> Option<[u32; 2]> {
        let fits = |shelf: &Shelf| {
            let is_tall = (height..=tallest).contains(&shelf.height);
            is_tall.then(|| shelf.gaps.iter().position(|(_, gap)| *gap >= width)).flatten()
        };
        let found = (0..self.shelves.len()).filter_map(|shelf| Some((shelf, fits(&self.shelves[shelf])?)));
        let (shelf, gap) = found.min_by_key(|(shelf, _)| self.shelves[*shelf].height)?;
        let shelf = &mut self.shelves[shelf];
        let (x, room) = shelf.gaps[gap];
        shelf.gaps[gap] = (x + width, room - width);
        if room == width {
            shelf.gaps.remove(gap);
        }
        Some([x, shelf.at])
    }

    /// Gives room back.
    fn free(&mut self, [x, y]: [u32; 2], width: u32) {
        let found = self.shelves.binary_search_by_key(&y, |shelf| shelf.at);
        let shelf = &mut self.shelves[found.expect("a patch lies on a shelf")];
        let next = shelf.gaps.partition_point(|(gap, _)| *gap < x);
        shelf.gaps.insert(next, (x, width));
        shelf.gaps.dedup_by(|gap, before| {
            let touch = before.0 + before.1 == gap.0;
            if touch {
                before.1 += gap.1;
            }
            touch
        });
        while self.shelves.last().is_some_and(|last| last.gaps == [(0, self.width)]) {
            self.shelves.pop();
        }
    }
}
