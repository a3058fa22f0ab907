//! The plane that stands for the surface in a cell, and the parts of the cell that the surface crosses.

use super::morton::position;
use isv_kernels::simd::vectorized;

/// Cells whose surfels are derived at a time.
pub(super) const LANES: usize = 16;
/// Codes at the corners of cells: by corner, x fastest, then by cell.
pub(super) type Corners = [[i32; LANES]; 8];
/// A value of each cell.
type Values = [i32; LANES];
/// A byte of each cell.
type Bytes = [u8; LANES];

/// The plane that stands for the surface in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Surfel {
    /// From the cell's middle to the plane's nearest point, in 1/256 voxel; at most one voxel along each axis.
    pub offset: [i16; 3],
    /// The unit normal, towards the outside, times 127.
    pub normal: [i8; 3],
    /// Half cells that the surface crosses, a bit each: x from the lowest bit, then y, z.
    pub halves: u8,
}

impl Surfel {
    /// Whether the surfaces of two cells face the same half of all directions.
    #[must_use]
    #[inline(always)]
    pub fn faces(&self, normal: [i8; 3]) -> bool {
        let mut product = 0;
        for axis in 0..3 {
            product += i32::from(self.normal[axis]) * i32::from(normal[axis]);
        }
        product >= 0
    }
}

/// Derives the surfels of cells from the codes at their corners.
#[must_use]
pub(super) fn surfels(corners: &Corners) -> [Surfel; LANES] {
    let mut out = [Surfel::default(); LANES];
    vectorized(
        #[inline(always)]
        || derive(corners, &mut out),
    );
    out
}

/// Divides and takes roots in `f64`, which is exact. Integers are below 2^44, the squared gradient below 2^38. A quotient or a root
/// that is no integer is farther from the next one than `f64` rounds. This also holds for products with a reciprocal.
#[inline(always)]
fn derive(corners: &Corners, out: &mut [Surfel; LANES]) {
    let mut sum = [0; LANES];
    // Four times the gradient, in codes a voxel.
    let mut gradient = [[0; LANES]; 3];
    for (corner, codes) in corners.iter().enumerate() {
        for lane in 0..LANES {
            sum[lane] += codes[lane];
        }
        for (axis, gradient) in gradient.iter_mut().enumerate() {
            for lane in 0..LANES {
                gradient[lane] += if corner >> axis & 1 != 0 { codes[lane] } else { -codes[lane] };
            }
        }
    }
    let (mut by_square, mut by_length) = ([0.0f64; LANES], [0.0f64; LANES]);
    for lane in 0..LANES {
        let [x, y, z] = [gradient[0][lane], gradient[1][lane], gradient[2][lane]].map(f64::from);
        // Without a gradient everything that is divided is 0.
        let square = (x * x + y * y + z * z).max(1.0);
        by_square[lane] = 1.0 / square;
        by_length[lane] = 1.0 / square.sqrt().floor();
    }
    let (mut offset, mut normal) = ([[0; LANES]; 3], [[0; LANES]; 3]);
    for axis in 0..3 {
        for lane in 0..LANES {
            let component = f64::from(gradient[axis][lane]);
            // One step of Newton's method from the middle.
            let step = -128.0 * f64::from(sum[lane]) * component * by_square[lane];
            offset[axis][lane] = towards_zero::<256>(step);
            normal[axis][lane] = towards_zero::<127>(127.0 * component * by_length[lane]);
        }
    }
    let halves = crossed_halves(corners);
    for (lane, surfel) in out.iter_mut().enumerate() {
        for axis in 0..3 {
            surfel.offset[axis] = offset[axis][lane] as i16;
            surfel.normal[axis] = normal[axis][lane] as i8;
        }
        surfel.halves = halves[lane];
    }
}

/// A quotient rounded towards zero, within `-MOST ..= MOST`. Integers that are short of themselves are lifted; all others are at least
/// 2^-38 away from the next one.
#[inline(always)]
fn towards_zero<const MOST: i32>(quotient: f64) -> i32 {
    const LIFT: f64 = 1.0 / (1u64 << 41) as f64;
    let most = f64::from(MOST);
    (quotient.clamp(-most, most) + LIFT.copysign(quotient)) as i32
}

#[inline(always)]
fn add(a: &Values, b: &Values) -> Values {
    let mut sum = [0; LANES];
    for lane in 0..LANES {
        sum[lane] = a[lane] + b[lane];
    }
    sum
}

/// Which points of a cell's half grid lie inside, x fastest: a byte of ones or zeros a cell.
#[inline(always)]
fn half_grid(corners: &Corners) -> [Bytes; 27] {
    // Multiples of the values there, of which only the sign counts.
    let mut grid = [[0; LANES]; 27];
    for (corner, codes) in corners.iter().enumerate() {
        grid[2 * (corner & 1) + 6 * (corner >> 1 & 1) + 18 * (corner >> 2)] = *codes;
    }
    for y in [0, 6] {
        for z in [0, 18] {
            grid[y + z + 1] = add(&grid[y + z], &grid[y + z + 2]);
        }
    }
    for x in 0..3 {
        for z in [0, 18] {
            grid[x + z + 3] = add(&grid[x + z], &grid[x + z + 6]);
        }
    }
    for at in 0..9 {
        grid[at + 9] = add(&grid[at], &grid[at + 18]);
    }
    let mut inside = [[0; LANES]; 27];
    for (inside, values) in inside.iter_mut().zip(&grid) {
        for lane in 0..LANES {
            inside[lane] = (values[lane] >> 31) as u8;
        }
    }
    inside
}

/// Half cells that have corners inside and outside, a bit each.
#[inline(always)]
fn crossed_halves(corners: &Corners) -> Bytes {
    let inside = half_grid(corners);
    // Whether any of a number of points lies inside, and whether all do: first of pairs along x.
    let (mut any, mut all) = ([[0; LANES]; 18], [[0; LANES]; 18]);
    for pair in 0..18 {
        let [first, second] = [0, 1].map(|x| &inside[pair / 2 * 3 + pair % 2 + x]);
        (any[pair], all[pair]) = (either(first, second), both(first, second));
    }
    // Then of squares, in the places of their lower pairs.
    for z in 0..3 {
        for at in 6 * z..6 * z + 4 {
            (any[at], all[at]) = (either(&any[at], &any[at + 2]), both(&all[at], &all[at + 2]));
        }
    }
    let mut crossed = [0; LANES];
    for half in 0..8 {
        let at = 6 * (half >> 2) + (half & 3);
        let (any, all) = (either(&any[at], &any[at + 6]), both(&all[at], &all[at + 6]));
        for lane in 0..LANES {
            crossed[lane] |= (any[lane] ^ all[lane]) & 1 << half;
        }
    }
    crossed
}

#[inline(always)]
fn either(a: &Bytes, b: &Bytes) -> Bytes {
    let mut either = [0; LANES];
    for lane in 0..LANES {
        either[lane] = a[lane] | b[lane];
    }
    either
}

#[inline(always)]
fn both(a: &Bytes, b: &Bytes) -> Bytes {
    let mut both = [0; LANES];
    for lane in 0..LANES {
        both[lane] = a[lane] & b[lane];
    }
    both
}

/// Quarter cells that have corners inside and outside, a bit each, in Morton order.
pub(super) fn crossed_quarters(corners: &[i32; 8]) -> u64 {
    const POINTS: usize = 5;
    let between = |a: i32, b: i32, step: usize| (4 - step as i32) * a + step as i32 * b;
    let mut signs = [[0u8; POINTS]; POINTS];
    for (z, layer) in signs.iter_mut().enumerate() {
        let face: [i32; 4] = std::array::from_fn(|c| between(corners[c], corners[c + 4], z));
        for (y, row) in layer.iter_mut().enumerate() {
            let [a, b] = [0, 1].map(|c| between(face[c], face[c + 2], y));
            for x in 0..POINTS {
                *row |= u8::from(between(a, b, x) < 0) << x;
            }
        }
    }
    let mut crossed = 0;
    for (quarter, [x, y, z]) in (0..64).map(|q| (q, position(q))) {
        let rows = [signs[z][y], signs[z][y + 1], signs[z + 1][y], signs[z + 1][y + 1]];
        let inside = rows.map(|row| row >> x & 0b11);
        let (any, all) = inside.iter().fold((0, 0b11), |(any, all), row| (any | row, all & row));
        crossed |= u64::from(any != 0 && all != 0b11) << quarter;
    }
    crossed
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_kernels::simd::with_each;

    /// The surfel of a cell, in integers and one by one.
    fn expected(corners: [i32; 8]) -> Surfel {
        let sum: i64 = corners.iter().map(|code| i64::from(*code)).sum();
        let gradient: [i64; 3] = std::array::from_fn(|axis| {
            (0..8).map(|c| i64::from(if c >> axis & 1 != 0 { corners[c] } else { -corners[c] })).sum()
        });
        let square: i64 = gradient.iter().map(|g| g * g).sum();
        let mut halves = 0;
        for half in 0..8 {
            let place = |point: usize| [0, 1, 2].map(|axis| (half >> axis & 1) + (point >> axis & 1));
            let value = |[x, y, z]: [usize; 3]| -> i64 {
                let share = |c: usize, at: usize| if c == 0 { 2 - at } else { at } as i64;
                let shares = |c: usize| share(c & 1, x) * share(c >> 1 & 1, y) * share(c >> 2, z);
                (0..8).map(|c| shares(c) * i64::from(corners[c])).sum()
            };
            let inside = (0..8).filter(|point| value(place(*point)) < 0).count();
            halves |= u8::from(inside != 0 && inside != 8) << half;
        }
        if square == 0 {
            return Surfel { halves, ..Surfel::default() };
        }
        let length = square.isqrt();
        Surfel {
            offset: gradient.map(|g| (-128 * sum * g / square).clamp(-256, 256) as i16),
            normal: gradient.map(|g| (127 * g / length).clamp(-127, 127) as i8),
            halves,
        }
    }

    #[test]
    fn surfels_are_those_of_integers() {
        let mut random = isv_testkit::Random::new(11);
        for scale in [1.0, 3.0, 40.0, 1024.0, 32767.0] {
            for _ in 0..300 {
                let corners: Corners =
                    [0; 8].map(|_| [0; LANES].map(|_| (random.signed() * scale).round() as i32));
                let wanted: [Surfel; LANES] =
                    std::array::from_fn(|lane| expected(corners.map(|codes| codes[lane])));
                for (set, found) in with_each(|| surfels(&corners)) {
                    assert_eq!(found, wanted, "{set}");
                }
            }
        }
        let extreme = [[i32::from(i16::MIN); LANES], [i32::from(i16::MAX); LANES]];
        let corners: Corners = std::array::from_fn(|corner| extreme[corner & 1]);
        assert_eq!(surfels(&corners)[0], expected(corners.map(|codes| codes[0])));
    }
}
