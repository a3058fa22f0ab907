//! Bjontegaard deltas: how much rate one codec saves against another at equal quality, and how much quality it gains at
//! equal rate. They are Bjontegaard's (VCEG-M33), but piecewise-cubic as in the JVET reporting template (VCEG-AE07).
//!
//! Each codec's points become a curve of the logarithm of the rate over quality (or the other way round). Monotone
//! piecewise cubics interpolate it (Fritsch and Butland 1984, the "pchip" of numerical packages). Unlike one polynomial
//! through all points, they cannot swing between the points. The mean difference of two curves over the quality (or log
//! rate) that both cover is the delta.

/// An operating point: rate in any unit, above 0, and quality in decibels, higher better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatePoint {
    /// Bits, bytes or megabits a second: only ratios count.
    pub rate: f64,
    /// Decibels.
    pub quality_db: f64,
}

/// One codec against another, the anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delta {
    /// Mean rate at equal quality, in percent of the anchor's, minus 100: negative is a saving. Over the quality that both
    /// cover, in decibels; none where they share no quality.
    pub rate_percent: Option<MeanDifference>,
    /// Mean quality at equal rate, minus the anchor's, in decibels. Over the rates that both cover; none where they share
    /// none.
    pub quality_db: Option<MeanDifference>,
}

/// The mean difference of two curves, and over what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanDifference {
    /// The mean.
    pub mean: f64,
    /// What both curves cover, from and to.
    pub overlap: [f64; 2],
    /// Length of the overlap over that of all that either curve covers, 0 to 1 (of rates by ratio). A small share means
    /// that the codecs work in different places and the difference says little.
    pub overlap_share: f64,
}

/// The deltas of `test` against `anchor`, each of which needs two points or more.
#[must_use]
pub fn delta(anchor: &[RatePoint], test: &[RatePoint]) -> Delta {
    let (anchor, test) = (useful_points(anchor), useful_points(test));
    let log_rate_of_quality = |points: &[RatePoint]| {
        Curve::new(points.iter().map(|p| (p.quality_db, p.rate.ln())).collect::<Vec<_>>())
    };
    let quality_of_log_rate = |points: &[RatePoint]| {
        Curve::new(points.iter().map(|p| (p.rate.ln(), p.quality_db)).collect::<Vec<_>>())
    };
    let log_ratio = mean_difference(log_rate_of_quality(&anchor), log_rate_of_quality(&test));
    let quality_db = mean_difference(quality_of_log_rate(&anchor), quality_of_log_rate(&test));
    Delta {
        rate_percent: log_ratio.map(|d| MeanDifference { mean: 100.0 * d.mean.exp_m1(), ..d }),
        quality_db: quality_db.map(|d| MeanDifference { overlap: d.overlap.map(f64::exp), ..d }),
    }
}

/// The points that someone would use, by rising rate and quality. No other point has at least the quality of one of
/// them at no more rate. Points that are not numbers are left out.
#[must_use]
pub fn useful_points(points: &[RatePoint]) -> Vec<RatePoint> {
    let mut sorted: Vec<_> =
        points.iter().copied().filter(|p| p.rate > 0.0 && (p.rate * p.quality_db).is_finite()).collect();
    sorted.sort_by(|a, b| a.rate.total_cmp(&b.rate).then(b.quality_db.total_cmp(&a.quality_db)));
    let mut best = f64::NEG_INFINITY;
    sorted.retain(|p| {
        let better = p.quality_db > best;
        best = best.max(p.quality_db);
        better
    });
    sorted
}

/// Mean of the second curve minus the first over what both cover.
fn mean_difference(anchor: Option<Curve>, test: Option<Curve>) -> Option<MeanDifference> {
    let (anchor, test) = (anchor?, test?);
    let [a, b] = [anchor.domain(), test.domain()];
    let overlap = [a[0].max(b[0]), a[1].min(b[1])];
    let length = overlap[1] - overlap[0];
    let covered = a[1].max(b[1]) - a[0].min(b[0]);
    (length > 0.0).then(|| MeanDifference {
        mean: (test.integral(overlap) - anchor.integral(overlap)) / length,
        overlap,
        overlap_share: length / covered,
    })
}

/// A monotone piecewise-cubic curve through points.
#[derive(Clone, Debug)]
struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
    slopes: Vec<f64>,
}

impl Curve {
    /// Through at least two points of rising x.
    fn new(points: Vec<(f64, f64)>) -> Option<Self> {
        let (x, y): (Vec<_>, Vec<_>) = points.into_iter().unzip();
        (x.len() >= 2).then(|| Self { slopes: monotone_slopes(&x, &y), x, y })
    }

    fn domain(&self) -> [f64; 2] {
        [self.x[0], self.x[self.x.len() - 1]]
    }

    /// The exact integral of the curve over a part of its domain.
    fn integral(&self, [from, to]: [f64; 2]) -> f64 {
        (0..self.x.len() - 1)
            .map(|i| {
                let (start, width) = (self.x[i], self.x[i + 1] - self.x[i]);
                let part = [from, to].map(|end| ((end - start) / width).clamp(0.0, 1.0));
                width * (self.antiderivative(i, part[1]) - self.antiderivative(i, part[0]))
            })
            .sum()
    }

    /// Integral of the i-th cubic from its start to the share `t` of its width, over that width: the Hermite basis
    /// polynomials integrated.
    fn antiderivative(&self, i: usize, t: f64) -> f64 {
        let width = self.x[i + 1] - self.x[i];
        let (t2, t3, t4) = (t * t, t * t * t, t * t * t * t);
        self.y[i] * (t4 / 2.0 - t3 + t)
            + width * self.slopes[i] * (t4 / 4.0 - 2.0 * t3 / 3.0 + t2 / 2.0)
            + self.y[i + 1] * (t3 - t4 / 2.0)
            + width * self.slopes[i + 1] * (t4 / 4.0 - t3 / 3.0)
    }
}

/// Slopes at the points: the weighted harmonic mean of the two secants (Fritsch and Butland). At the ends a three-point
/// estimate keeps the sign and at most three times the size of the first secant.
fn monotone_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let width: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let secant: Vec<f64> = y.windows(2).zip(&width).map(|(w, h)| (w[1] - w[0]) / h).collect();
    let last = secant.len() - 1;
    if last == 0 {
        return vec![secant[0]; 2];
    }
    let inner = (1..=last).map(|i| {
        let (before, after) = (secant[i - 1], secant[i]);
        if before * after <= 0.0 {
            return 0.0;
        }
        let (a, b) = (2.0 * width[i] + width[i - 1], width[i] + 2.0 * width[i - 1]);
        (a + b) / (a / before + b / after)
    });
    let mut slopes = vec![end_slope([width[0], width[1]], [secant[0], secant[1]])];
    slopes.extend(inner);
    slopes.push(end_slope([width[last], width[last - 1]], [secant[last], secant[last - 1]]));
    slopes
}

/// Slope at an end, from the two nearest intervals, nearest first.
fn end_slope(width: [f64; 2], secant: [f64; 2]) -> f64 {
    let slope = ((2.0 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1]);
    if slope * secant[0] <= 0.0 {
        0.0
    } else if secant[0] * secant[1] <= 0.0 && slope.abs() > 3.0 * secant[0].abs() {
        3.0 * secant[0]
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(pairs: &[(f64, f64)]) -> Vec<RatePoint> {
        pairs.iter().map(|&(rate, quality_db)| RatePoint { rate, quality_db }).collect()
    }

    const ANCHOR: [(f64, f64); 5] = [(1.1, 31.0), (2.0, 34.2), (3.9, 37.1), (8.3, 40.2), (17.0, 42.0)];

    #[test]
    fn the_same_curve_at_three_quarters_of_the_rate_saves_a_quarter() {
        let test: Vec<_> = ANCHOR.iter().map(|(rate, quality)| (0.75 * rate, *quality)).collect();
        let found = delta(&points(&ANCHOR), &points(&test));
        let (rate, quality) = (found.rate_percent.unwrap(), found.quality_db.unwrap());
        assert!((rate.mean + 25.0).abs() < 1e-9, "{rate:?}");
        assert_eq!((rate.overlap, rate.overlap_share), ([31.0, 42.0], 1.0));
        assert!(quality.mean > 0.0);
        assert!((quality.overlap[0] - 1.1).abs() < 1e-12 && (quality.overlap[1] - 12.75).abs() < 1e-12);
        let share = (12.75f64 / 1.1).ln() / (17.0f64 / 0.825).ln();
        assert!((quality.overlap_share - share).abs() < 1e-12, "{quality:?}");
    }

    #[test]
    fn a_constant_gain_is_a_constant_gain() {
        let test: Vec<_> = ANCHOR.iter().map(|(rate, quality)| (*rate, quality + 1.5)).collect();
        let found = delta(&points(&ANCHOR), &points(&test));
        assert!((found.quality_db.unwrap().mean - 1.5).abs() < 1e-12, "{found:?}");
        assert_eq!(found.rate_percent.unwrap().overlap, [32.5, 42.0]);
        let back = delta(&points(&test), &points(&ANCHOR));
        assert!((back.quality_db.unwrap().mean + 1.5).abs() < 1e-12);
    }

    /// Computed with `scipy.interpolate.PchipInterpolator` (SciPy 1.17), which has the same slopes.
    #[test]
    fn deltas_of_unlike_curves_are_those_of_an_independent_implementation() {
        let test = [(0.9, 32.5), (1.3, 33.0), (3.0, 37.9), (5.5, 38.4), (14.0, 43.1)];
        let found = delta(&points(&ANCHOR), &points(&test));
        assert!((found.rate_percent.unwrap().mean + 14.556_213_565_194).abs() < 1e-6, "{found:?}");
        assert!((found.quality_db.unwrap().mean - 0.751_642_059_097_622).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn two_points_make_a_line() {
        let (anchor, test) = (points(&[(1.0, 0.0), (4.0, 2.0)]), points(&[(0.5, 0.0), (4.0, 3.0)]));
        // ln rate is 0 + q ln 2 against -ln 2 + q ln 2: half the rate at every quality.
        let found = delta(&anchor, &test).rate_percent.unwrap();
        assert!((found.mean + 50.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn dominated_points_do_not_count() {
        let mut with_a_bad_one = points(&ANCHOR);
        with_a_bad_one.push(RatePoint { rate: 5.0, quality_db: 30.0 });
        with_a_bad_one.push(RatePoint { rate: 2.0, quality_db: f64::NAN });
        assert_eq!(useful_points(&with_a_bad_one), points(&ANCHOR));
    }

    #[test]
    fn curves_that_do_not_meet_have_no_delta() {
        let nothing = Delta { rate_percent: None, quality_db: None };
        assert_eq!(delta(&points(&ANCHOR), &points(&[(20.0, 50.0), (30.0, 60.0)])), nothing);
        assert_eq!(delta(&points(&ANCHOR), &points(&[(1.5, 35.0)])), nothing);
        assert_eq!(delta(&[], &[]), nothing);
    }

    /// A codec that is better everywhere by so much that its highest rate is below the other's lowest still saves rate.
    #[test]
    fn curves_that_share_only_quality_have_a_delta_of_rate() {
        let test: Vec<_> = ANCHOR.iter().map(|(rate, quality)| (0.01 * rate, *quality)).collect();
        let found = delta(&points(&ANCHOR), &points(&test));
        assert!((found.rate_percent.unwrap().mean + 99.0).abs() < 1e-9);
        assert_eq!(found.quality_db, None);
    }
}
