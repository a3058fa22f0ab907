//! Structural similarity of two pictures (Wang et al. 2004, "Image quality assessment: from error visibility to structural similarity",
//! IEEE Transactions on Image Processing 13).

use super::cameras::SIZE;
use super::picture::{BACKGROUND, Picture};
use std::ops::Range;

/// Pixels from the middle of the window to its edge: the window has 11 x 11.
const RADIUS: usize = 5;

/// Standard deviation of the window's weights in pixels.
const SIGMA: f64 = 1.5;

/// Pixels that must be covered on each side of one that counts: 9 x 9 in all. The silhouette has next to no weight then.
const SURROUNDINGS: usize = 4;

/// Constants that keep quotients away from 0: (0.01 * 255)^2 and (0.03 * 255)^2.
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;

/// Mean similarity of Y over the pixels around which both pictures are covered; none if there are no such pixels.
pub(super) fn ssim(a: &Picture, b: &Picture) -> Option<f64> {
    let covered: Vec<bool> = a.iter().zip(b).map(|(a, b)| a.is_some() && b.is_some()).collect();
    let counted = surrounded(&covered);
    let window = Window::new();
    let part = |part: fn(f64, f64) -> f64| {
        let plane: Vec<f64> =
            a.iter().zip(b).map(|(a, b)| part(a.unwrap_or(BACKGROUND), b.unwrap_or(BACKGROUND))).collect();
        window.means(&plane, &counted)
    };
    let means = [part(|a, _| a), part(|_, b| b)];
    let squares = [part(|a, _| a * a), part(|_, b| b * b)];
    let products = part(|a, b| a * b);
    let similarity = |i: usize| {
        let ([a, b], [aa, bb]) = ([means[0][i], means[1][i]], [squares[0][i], squares[1][i]]);
        let (of_means, of_both) = (2.0 * a * b + C1, 2.0 * (products[i] - a * b) + C2);
        // Exactly 1 of equal pictures: both variances are rounded as the covariance is.
        of_means * of_both / ((a * a + b * b + C1) * ((aa - a * a) + (bb - b * b) + C2))
    };
    let count = counted.pixels.len();
    (count > 0).then(|| (0..count).map(similarity).sum::<f64>() / count as f64)
}

/// Pixels that count, and the rows that their windows reach.
struct Counted {
    /// Places in the picture, in order.
    pixels: Vec<usize>,
    rows: Range<usize>,
}

/// The pixels whose surroundings are inside the picture and covered.
fn surrounded(covered: &[bool]) -> Counted {
    let [width, height] = SIZE;
    let inner = |side: usize| SURROUNDINGS..side - SURROUNDINGS;
    let around = |at: usize| at - SURROUNDINGS..=at + SURROUNDINGS;
    // First along the rows, then along the columns.
    let mut in_row = vec![false; covered.len()];
    for y in 0..height {
        for x in inner(width) {
            in_row[y * width + x] = covered[y * width..][around(x)].iter().all(|covered| *covered);
        }
    }
    let mut pixels = Vec::new();
    for y in inner(height) {
        let counts = |x: &usize| around(y).all(|row| in_row[row * width + x]);
        pixels.extend((0..width).filter(counts).map(|x| y * width + x));
    }
    let row = |pixel: Option<&usize>| pixel.map_or(0, |pixel| pixel / width);
    let rows = row(pixels.first()).saturating_sub(RADIUS)..(row(pixels.last()) + RADIUS + 1).min(height);
    Counted { pixels, rows }
}

/// Weights of a Gaussian window, which are those of its rows times those of its columns.
struct Window([f64; 2 * RADIUS + 1]);

impl Window {
    fn new() -> Self {
        let weights: [f64; 2 * RADIUS + 1] = std::array::from_fn(|i| {
            let from_middle = i as f64 - RADIUS as f64;
            (-from_middle * from_middle / (2.0 * SIGMA * SIGMA)).exp()
        });
        let sum: f64 = weights.iter().sum();
        Self(weights.map(|weight| weight / sum))
    }

    /// Weighted means of a picture around the pixels that count. Outside the picture its edge goes on, which only the outermost column
    /// or row of a window ever meets.
    fn means(&self, plane: &[f64], counted: &Counted) -> Vec<f64> {
        let [width, height] = SIZE;
        let mut along_rows = vec![0.0; plane.len()];
        let mut wide = [0.0; SIZE[0] + 2 * RADIUS];
        for y in counted.rows.clone() {
            let row = &plane[y * width..][..width];
            wide[..RADIUS].fill(row[0]);
            wide[RADIUS..][..width].copy_from_slice(row);
            wide[RADIUS + width..].fill(row[width - 1]);
            let means = &mut along_rows[y * width..][..width];
            for (i, weight) in self.0.iter().enumerate() {
                add_weighted(means, &wide[i..], *weight);
            }
        }
        let mut means = Vec::with_capacity(counted.pixels.len());
        for pixels in counted.pixels.chunk_by(|a, b| a / width == b / width) {
            let mut of_row = [0.0; SIZE[0]];
            for (i, weight) in self.0.iter().enumerate() {
                let row = (pixels[0] / width + i).saturating_sub(RADIUS).min(height - 1);
                add_weighted(&mut of_row, &along_rows[row * width..], *weight);
            }
            means.extend(pixels.iter().map(|pixel| of_row[pixel % width]));
        }
        means
    }
}

/// Adds weighted values to sums, as far as there are sums.
fn add_weighted(sums: &mut [f64], values: &[f64], weight: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value * weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    fn picture(value: impl Fn(usize, usize) -> Option<f64>) -> Picture {
        (0..SIZE[0] * SIZE[1]).map(|i| value(i % SIZE[0], i / SIZE[0])).collect()
    }

    /// The formula as it is written, at one pixel.
    fn slow(a: &Picture, b: &Picture, [x, y]: [usize; 2]) -> f64 {
        let (mut sum, mut sums) = (0.0, [0.0; 5]);
        for dy in -5i32..=5 {
            for dx in -5i32..=5 {
                let weight = (-f64::from(dx * dx + dy * dy) / 4.5).exp();
                let at = (y as i32 + dy) as usize * SIZE[0] + (x as i32 + dx) as usize;
                let (a, b) = (a[at].unwrap_or(128.0), b[at].unwrap_or(128.0));
                sum += weight;
                for (sum, value) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                    *sum += weight * value;
                }
            }
        }
        let [a, b, aa, bb, ab] = sums.map(|s| s / sum);
        (2.0 * a * b + 6.5025) * (2.0 * (ab - a * b) + 58.5225)
            / ((a * a + b * b + 6.5025) * (aa - a * a + bb - b * b + 58.5225))
    }

    #[test]
    fn it_is_the_mean_of_the_published_formula() {
        let mut random = SplitMix64::new(5);
        let noise: Vec<[f64; 2]> =
            (0..SIZE[0] * SIZE[1]).map(|_| [random.next_f64() * 255.0, random.next_f64() * 40.0]).collect();
        let shown = |x: usize, y: usize| (100..160).contains(&x) && (300..350).contains(&y);
        let a = picture(|x, y| shown(x, y).then(|| noise[y * SIZE[0] + x][0]));
        let b = picture(|x, y| {
            let [first, second] = noise[y * SIZE[0] + x];
            (shown(x, y) && !(x > 150 && y > 340)).then_some(first * 0.7 + second)
        });
        let counts =
            |x: usize, y: usize| (104..156).contains(&x) && (304..346).contains(&y) && (x <= 146 || y <= 336);
        let places: Vec<[usize; 2]> = (0..SIZE[0] * SIZE[1])
            .map(|i| [i % SIZE[0], i / SIZE[0]])
            .filter(|[x, y]| counts(*x, *y))
            .collect();
        let expected = places.iter().map(|at| slow(&a, &b, *at)).sum::<f64>() / places.len() as f64;
        assert!((ssim(&a, &b).unwrap() - expected).abs() < 1e-9, "{expected}");
        assert!((0.3..0.95).contains(&expected));
    }

    #[test]
    fn a_picture_is_like_itself_and_flat_greys_are_what_the_formula_says() {
        let a = picture(|x, y| Some((x * y % 255) as f64));
        assert_eq!(ssim(&a, &a), Some(1.0));
        let [dark, light] = [100.0, 150.0].map(|grey| picture(|_, _| Some(grey)));
        let expected = (2.0 * 100.0 * 150.0 + C1) / (100.0 * 100.0 + 150.0 * 150.0 + C1);
        assert!((ssim(&dark, &light).unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn too_little_is_no_picture() {
        let small = picture(|x, y| (x < 8 && y < 8).then_some(3.0));
        assert_eq!(ssim(&small, &small), None);
        let enough = picture(|x, y| (x < 9 && y < 9).then_some(3.0));
        assert_eq!(ssim(&enough, &enough), Some(1.0));
    }
}
