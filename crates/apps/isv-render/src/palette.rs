//! At most 256 colours for a picture of many.

use crate::picture::Picture;
use rayon::prelude::*;

/// Most colours of a palette.
const MOST: usize = 256;

/// Thresholds of ordered dithering, 0 to 63 (Bayer 1973, "An optimum method for two-level rendition of continuous-tone
/// pictures"). They stay where they are from picture to picture, so what stands still does not shimmer.
const THRESHOLDS: [[u8; 8]; 8] = [
    [0, 32, 8, 40, 2, 34, 10, 42],
    [48, 16, 56, 24, 50, 18, 58, 26],
    [12, 44, 4, 36, 14, 46, 6, 38],
    [60, 28, 52, 20, 62, 30, 54, 22],
    [3, 35, 11, 43, 1, 33, 9, 41],
    [51, 19, 59, 27, 49, 17, 57, 25],
    [15, 47, 7, 39, 13, 45, 5, 37],
    [63, 31, 55, 23, 61, 29, 53, 21],
];

/// A picture as indices into a palette.
#[derive(Debug)]
pub(crate) struct Indexed {
    /// RGB, at most 256.
    pub(crate) palette: Vec<[u8; 3]>,
    /// An index a pixel, row after row.
    pub(crate) indices: Vec<u8>,
    /// The index that stands for nothing, if pixels are less than half covered.
    pub(crate) transparent: Option<u8>,
}

impl Indexed {
    /// Finds a palette for a picture and the entry of each of its pixels.
    ///
    /// The most common colour, which is the background, has an entry of its own and is not dithered. It must
    /// be the same from picture to picture. Alpha of less than half is nothing, the rest is opaque.
    pub(crate) fn new(picture: &Picture) -> Self {
        let [width, _] = picture.size();
        let is_clear = |pixel: &[u8]| pixel[3] < 128;
        let mut opaque: Vec<[u8; 3]> =
            picture.rgba().chunks_exact(4).filter(|p| !is_clear(p)).map(|p| [p[0], p[1], p[2]]).collect();
        let has_clear = opaque.len() * 4 < picture.rgba().len();
        opaque.par_sort_unstable();
        let mut counts: Vec<Count> = opaque
            .chunk_by(|a, b| a == b)
            .map(|same| Count { colour: same[0], pixels: same.len() as u64 })
            .collect();
        let common =
            counts.iter().enumerate().max_by_key(|(i, c)| (c.pixels, std::cmp::Reverse(*i))).map(|(i, _)| i);
        let common = common.map(|i| counts.remove(i).colour);
        let mut palette = cut(&mut counts, MOST - 1 - usize::from(has_clear));
        palette.extend(common);
        let amplitude = spread(&palette, &counts);
        let transparent = has_clear.then_some(palette.len() as u8);
        let index = |(i, pixel): (usize, &[u8])| {
            let colour = [pixel[0], pixel[1], pixel[2]];
            match transparent {
                Some(nothing) if is_clear(pixel) => nothing,
                _ if Some(colour) == common => (palette.len() - 1) as u8,
                _ => nearest(&palette, dithered(colour, [i % width, i / width], amplitude)),
            }
        };
        let indices = picture.rgba().par_chunks_exact(4).with_min_len(4096).enumerate().map(index).collect();
        palette.extend(transparent.map(|_| [0; 3]));
        Self { palette, indices, transparent }
    }
}

/// A colour and how many pixels have it.
#[derive(Clone, Copy)]
struct Count {
    colour: [u8; 3],
    pixels: u64,
}

/// Colours that are cut off from others by planes, and what would be gained by cutting once more.
struct Cluster {
    start: usize,
    end: usize,
    /// Sum of squared distances to the mean along the axis where it is largest.
    scatter: u64,
    axis: usize,
}

/// Divides colours into at most `most` clusters and returns their means, in order of division. This is median
/// cut with the mean in place of the median (Heckbert 1982, "Color image quantization for frame buffer
/// display"). The cluster that scatters most is cut next (Wan, Wong and Prusinkiewicz 1988, "An algorithm for
/// multidimensional data clustering").
fn cut(counts: &mut [Count], most: usize) -> Vec<[u8; 3]> {
    if counts.is_empty() {
        return Vec::new();
    }
    let mut clusters = vec![Cluster::new(counts, 0, counts.len())];
    while clusters.len() < most {
        let widest = (0..clusters.len()).max_by_key(|i| (clusters[*i].scatter, std::cmp::Reverse(*i)));
        let Some(i) = widest.filter(|i| clusters[*i].scatter > 0) else { break };
        let Cluster { start, end, axis, .. } = clusters[i];
        let middle = start + part(&mut counts[start..end], axis);
        clusters[i] = Cluster::new(counts, start, middle);
        clusters.push(Cluster::new(counts, middle, end));
    }
    clusters.iter().map(|cluster| mean(&counts[cluster.start..cluster.end])).collect()
}

impl Cluster {
    fn new(counts: &[Count], start: usize, end: usize) -> Self {
        let scatters = [0, 1, 2].map(|axis| scatter(&counts[start..end], axis));
        let axis = (0..3).max_by_key(|axis| scatters[*axis]).expect("three axes");
        Self { start, end, scatter: scatters[axis], axis }
    }
}

/// Moves colours below the mean of a channel before the others and returns how many they are. Not all are equal.
fn part(counts: &mut [Count], axis: usize) -> usize {
    let [pixels, sum, _] = moments(counts, axis);
    counts.sort_by_key(|c| c.colour[axis]);
    counts.partition_point(|c| u64::from(c.colour[axis]) * pixels < sum)
}

/// Number, sum and sum of squares of a channel over all pixels.
fn moments(counts: &[Count], axis: usize) -> [u64; 3] {
    counts.iter().fold([0; 3], |[n, sum, squares], count| {
        let value = u64::from(count.colour[axis]);
        [n + count.pixels, sum + count.pixels * value, squares + count.pixels * value * value]
    })
}

fn scatter(counts: &[Count], axis: usize) -> u64 {
    let [pixels, sum, squares] = moments(counts, axis);
    // Squares of sums of 2^28 pixels pass 64 bits.
    squares - (u128::from(sum) * u128::from(sum) / u128::from(pixels)) as u64
}

fn mean(counts: &[Count]) -> [u8; 3] {
    [0, 1, 2].map(|axis| {
        let [pixels, sum, _] = moments(counts, axis);
        ((sum + pixels / 2) / pixels) as u8
    })
}

/// Root mean square distance of colours to the palette, a channel: by how much dithering must move them.
fn spread(palette: &[[u8; 3]], counts: &[Count]) -> f32 {
    let squares = |count: &Count| {
        let entry = palette[usize::from(nearest(palette, count.colour))];
        u64::from(distance_sq(entry, count.colour)) * count.pixels
    };
    let sum: u64 = counts.par_iter().map(squares).sum();
    let pixels: u64 = counts.iter().map(|c| c.pixels).sum();
    (sum as f32 / (3 * pixels.max(1)) as f32).sqrt()
}

/// A colour moved by the threshold of its place, by -1 to 1 times the amplitude.
fn dithered(colour: [u8; 3], [x, y]: [usize; 2], amplitude: f32) -> [u8; 3] {
    let threshold = (f32::from(THRESHOLDS[y % 8][x % 8]) - 31.5) / 31.5;
    colour.map(|channel| (f32::from(channel) + threshold * amplitude).round() as u8)
}

/// The first of the entries that are closest to a colour.
fn nearest(palette: &[[u8; 3]], colour: [u8; 3]) -> u8 {
    let mut best = (u32::MAX, 0);
    for (i, entry) in palette.iter().enumerate() {
        let distance = distance_sq(*entry, colour);
        if distance < best.0 {
            best = (distance, i);
        }
    }
    best.1 as u8
}

fn distance_sq(a: [u8; 3], b: [u8; 3]) -> u32 {
    let [x, y, z] = [0, 1, 2].map(|channel| u32::from(a[channel].abs_diff(b[channel])));
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: [usize; 2], pixel: impl Fn(usize, usize) -> [u8; 4]) -> Picture {
        let mut picture = Picture::filled(size, [0; 4]);
        for (i, place) in picture.rgba_mut().chunks_exact_mut(4).enumerate() {
            place.copy_from_slice(&pixel(i % size[0], i / size[0]));
        }
        picture
    }

    #[test]
    fn few_colours_are_kept_as_they_are() {
        let few = picture([16, 16], |x, y| [(x * 16) as u8, (y % 4) as u8 * 60, 7, 255]);
        let Indexed { palette, indices, transparent } = Indexed::new(&few);
        assert_eq!((palette.len(), transparent), (64, None));
        for (pixel, index) in few.rgba().chunks(4).zip(indices) {
            assert_eq!(pixel[..3], palette[usize::from(index)]);
        }
    }

    #[test]
    fn many_colours_stay_close_and_their_background_exact() {
        let many = picture([256, 256], |x, y| {
            if x < 100 { [250, 250, 248, 255] } else { [x as u8, y as u8, (x ^ y) as u8, 255] }
        });
        let Indexed { palette, indices, .. } = Indexed::new(&many);
        assert_eq!(palette.len(), 256);
        let mut squares = 0;
        for (pixel, index) in many.rgba().chunks(4).zip(indices) {
            let entry = palette[usize::from(index)];
            if pixel[..3] == [250, 250, 248] {
                assert_eq!(entry, [250, 250, 248]);
            }
            squares += distance_sq(entry, [pixel[0], pixel[1], pixel[2]]);
        }
        // 255 cells in a volume of 156 x 256 x 256 are about 34 wide; without dithering 17 is their RMS distance.
        let rms = f64::from(squares / (156 * 256)).sqrt();
        assert!(rms < 24.0, "{rms}");
    }

    #[test]
    fn less_than_half_covered_is_nothing() {
        let half = picture([4, 1], |x, _| [10, 20, 30, [0, 127, 128, 255][x]]);
        let Indexed { palette, indices, transparent } = Indexed::new(&half);
        let nothing = transparent.unwrap();
        assert_eq!(indices[..2], [nothing; 2]);
        assert_eq!(palette[usize::from(indices[2])], [10, 20, 30]);
        assert_eq!(indices[2], indices[3]);
    }

    #[test]
    fn a_picture_of_nothing_has_a_palette() {
        let Indexed { palette, indices, transparent } = Indexed::new(&Picture::filled([3, 3], [0; 4]));
        assert_eq!((palette.len(), transparent), (1, Some(0)));
        assert_eq!(indices, [0; 9]);
    }
}
