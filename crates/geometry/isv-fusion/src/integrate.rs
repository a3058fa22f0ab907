//! What the views say about the voxels of one block (Eq. 3 to 5).

use crate::view::{Surfel, View};
use glam::{DVec3, Vec3};
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, BlockEdge, Grid};

/// Running sums over the readings of each voxel of a block, x fastest. Distances are in voxels, weights in those of a
/// [`Surfel`].
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockSums {
    /// Weight of the readings with the voxel in their band; [`HIDDEN`] for each that has it behind.
    pub(crate) weight: Vec<f32>,
    /// Weight times distance.
    pub(crate) sum: Vec<f32>,
    /// Weight of the readings that saw past the voxel.
    pub(crate) free: Vec<f32>,
}

/// What a reading counts to a voxel behind its band: nothing beside any other reading.
const HIDDEN: f32 = 1e-30;

/// Weights below this are sums of [`HIDDEN`] alone.
pub(crate) const LEAST_WEIGHT: f32 = 1e-25;

/// How far behind a surface, in voxels, a reading still counts in full.
const BEHIND: f32 = 0.75;

impl BlockSums {
    pub(crate) fn new(edge: BlockEdge) -> Self {
        let zeros = || vec![0.0; edge.block_voxels()];
        Self { weight: zeros(), sum: zeros(), free: zeros() }
    }

    pub(crate) fn clear(&mut self) {
        [&mut self.weight, &mut self.sum, &mut self.free].into_iter().for_each(|sums| sums.fill(0.0));
    }

    /// Scales each voxel's sums down to a largest weight, so that old readings count less than new ones.
    pub(crate) fn forget(&mut self, most_weight: f32) {
        for ((weight, sum), free) in self.weight.iter_mut().zip(&mut self.sum).zip(&mut self.free) {
            let scale = (most_weight / (*weight + *free)).min(1.0);
            *weight *= scale;
            *sum *= scale;
            *free *= scale;
        }
    }

    /// Adds what a view says, if it can see the block at all.
    pub(crate) fn integrate(&mut self, view: &View, grid: &Grid, coord: BlockCoord) {
        let edge = grid.edge.voxels();
        let first = DVec3::from(coord.to_array().map(f64::from)) * edge as f64 + 0.5;
        let block = BlockInView {
            view,
            first: (view.rotation * (first - view.centre)).as_vec3(),
            axes: [view.rotation.x_axis, view.rotation.y_axis, view.rotation.z_axis].map(DVec3::as_vec3),
        };
        if !block.may_be_seen(edge as f32) {
            return;
        }
        vectorized(
            #[inline(always)]
            || match grid.edge {
                BlockEdge::E4 => self.integrate_rows::<4>(&block),
                BlockEdge::E8 => self.integrate_rows::<8>(&block),
                BlockEdge::E16 => self.integrate_rows::<16>(&block),
            },
        );
    }

    /// All voxels, a row of `EDGE` along x at a time.
    #[inline(always)]
    fn integrate_rows<const EDGE: usize>(&mut self, block: &BlockInView) {
        let rows = self.weight.chunks_exact_mut(EDGE).zip(self.sum.chunks_exact_mut(EDGE));
        for (row, ((weight, sum), free)) in rows.zip(self.free.chunks_exact_mut(EDGE)).enumerate() {
            let [_, down, deep] = block.axes;
            let start = block.first + down * (row % EDGE) as f32 + deep * (row / EDGE) as f32;
            let readings = block.read::<EDGE>(start);
            for x in 0..EDGE {
                let (s, band, counts) = (readings.distance[x], readings.band[x], readings.weight[x]);
                let within = if s.abs() <= band { counts * share(s) } else { 0.0 };
                let hidden = if (s < -band) & (counts > 0.0) { HIDDEN } else { 0.0 };
                weight[x] += within + hidden;
                sum[x] += within * s;
                free[x] += if s > band { readings.free[x] } else { 0.0 };
            }
        }
    }
}

/// Weight of a reading at a distance. Behind a surface the weight falls with the fourth power. What lies
/// there may belong to the far side of something thin, which other views know better.
#[inline(always)]
fn share(s: f32) -> f32 {
    let beyond = (-s - BEHIND).max(0.0);
    1.0 / (1.0 + (beyond * beyond) * (beyond * beyond))
}

/// A block in camera coordinates, in voxels.
struct BlockInView<'a> {
    view: &'a View,
    /// Centre of its first voxel.
    first: Vec3,
    /// One voxel along each axis of the grid.
    axes: [Vec3; 3],
}

/// What a view says about a row of voxels; see [`Surfel`].
struct Readings<const EDGE: usize> {
    /// From the plane that the voxel's pixel sees, positive before it.
    distance: [f32; EDGE],
    band: [f32; EDGE],
    weight: [f32; EDGE],
    free: [f32; EDGE],
}

impl BlockInView<'_> {
    /// Whether a ball around the block reaches into the cone of the image.
    fn may_be_seen(&self, edge: f32) -> bool {
        let half = (edge - 1.0) / 2.0;
        let centre = self.first + (self.axes[0] + self.axes[1] + self.axes[2]) * half;
        let radius = half * 3f32.sqrt();
        if centre.z <= 2.0 * radius {
            return centre.z > -radius;
        }
        let (lens, near) = (&self.view.intrinsics, centre.z - radius);
        // A step aside moves the image by focal / z, a step towards the camera by that times the slant of the ray.
        let reach =
            lens.focal.as_vec2() * (radius / near) * (1.0 + centre.truncate().length() / centre.z) + 1.0;
        let at = lens.project(centre.as_dvec3()).as_vec2();
        (at + reach).min_element() >= 0.0
            && at.x - reach.x <= lens.width as f32
            && at.y - reach.y <= lens.height as f32
    }

    /// Projects a row of voxels (Eq. 4) and measures how far each lies before the plane that its pixel sees.
    #[inline(always)]
    fn read<const EDGE: usize>(&self, start: Vec3) -> Readings<EDGE> {
        let mut points = [[0.0; EDGE]; 3];
        let pixels = self.project::<EDGE>(start, &mut points);
        let zeros = [0.0; EDGE];
        let mut readings = Readings { distance: zeros, band: zeros, weight: zeros, free: zeros };
        for x in 0..EDGE {
            let Surfel { normal: [a, b, c], distance, band, weight, free } =
                self.view.surfels[pixels[x] as usize];
            readings.distance[x] = distance - (a * points[0][x] + b * points[1][x] + c * points[2][x]);
            readings.band[x] = band;
            readings.weight[x] = weight;
            readings.free[x] = free;
        }
        readings
    }

    /// The points of a row of voxels, and the pixels they fall on; where there is none, the surfel that says nothing.
    #[inline(always)]
    fn project<const EDGE: usize>(&self, start: Vec3, points: &mut [[f32; EDGE]; 3]) -> [u32; EDGE] {
        let lens = &self.view.intrinsics;
        let (width, height) = (lens.width as f32, lens.height as f32);
        let (focal, principal) = (lens.focal.as_vec2(), lens.principal.as_vec2());
        let nowhere = lens.width * lens.height;
        let mut pixels = [nowhere; EDGE];
        for x in 0..EDGE {
            let p = start + self.axes[0] * x as f32;
            points[0][x] = p.x;
            points[1][x] = p.y;
            points[2][x] = p.z;
            let column = focal.x * p.x / p.z + principal.x + 0.5;
            let row = focal.y * p.y / p.z + principal.y + 0.5;
            let inside = (p.z > 0.0) & (column >= 0.0) & (column < width) & (row >= 0.0) & (row < height);
            // Numbers outside the image saturate, and are not used.
            let pixel = (row as u32).wrapping_mul(lens.width).wrapping_add(column as u32);
            pixels[x] = if inside { pixel } else { nowhere };
        }
        pixels
    }
}
