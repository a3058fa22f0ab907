//! Levels of coefficients, chosen by error and bits.

use super::syntax::coefficients::{node_energy, write_node, write_root};
use isv_decode::colour::frame::SAMPLE_BITS;
use isv_decode::colour::reconstruct::ColourSteps;
use isv_decode::colour::symbols::Coefficient;
use isv_decode::colour::syntax::coefficients::{CoefficientModels, NodeContext, NodeEnergies, energy};
use isv_decode::colour::transform::{DIFFERENCES, MAX_LEVEL, STEP_BITS, by_slot, differences, side_weights};
use isv_decode::colour::tree::{BlockTree, HALF_WEIGHT};
use isv_entropy::BitCount;

/// An 8-bit step, in samples.
pub(crate) const SAMPLE_SCALE: f32 = (1 << SAMPLE_BITS) as f32;

/// How levels are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trade {
    /// Squared error, in steps, that a bit may cost.
    pub lambda: f32,
    /// Rounding offset of magnitudes.
    pub rounding: f32,
    /// Whether smaller levels are tried, to save bits.
    pub search: bool,
}

/// Error that levels save, and bits that they take.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gain {
    /// By how much the squared error is less than without levels, in steps.
    pub error: f32,
    /// Bits.
    pub bits: f32,
}

/// Chooses levels under models as they are.
#[derive(Clone, Debug)]
pub(crate) struct Quantizer {
    pub models: CoefficientModels,
    pub steps: ColourSteps,
    pub trade: Trade,
}

/// Coefficients of a node in steps, by difference and channel.
type Steps = [[f32; 3]; DIFFERENCES];

impl Quantizer {
    fn in_steps(&self, value: [f32; 3], scale: f32) -> [f32; 3] {
        const STEP_SCALE: f32 = (1 << STEP_BITS) as f32;
        [0, 1, 2].map(|c| value[c] * scale * STEP_SCALE / self.steps.channel(c) as f32)
    }

    /// Levels of a block's mean. `change`: of the mean, in 8-bit steps.
    pub(crate) fn root(&mut self, kind: usize, weight: u32, change: [f32; 3]) -> ([i16; 3], Gain) {
        let scale = (weight as f32 / HALF_WEIGHT as f32).sqrt();
        let wanted = self.in_steps(change, scale);
        let first = wanted.map(|w| rounded(w, 0.5));
        if first == [0; 3] {
            return ([0; 3], Gain::default());
        }
        let mut best = (f32::INFINITY, [0; 3], Gain::default());
        for reduced in 0..8 {
            let levels: [i16; 3] =
                std::array::from_fn(
                    |c| if reduced >> c & 1 != 0 { towards_zero(first[c]) } else { first[c] },
                );
            let mut bits = BitCount::default();
            write_root(&mut self.models, &mut bits, kind, levels);
            let error = (0..3).map(|c| wanted[c].powi(2) - (wanted[c] - f32::from(levels[c])).powi(2)).sum();
            let cost = self.trade.lambda * bits.0 - error;
            if cost < best.0 {
                best = (cost, levels, Gain { error, bits: bits.0 });
            }
        }
        (best.1, best.2)
    }

    /// Levels of a node's differences; `None` if all are best left zero. `wanted`: what the means of its children change by, by
    /// slot, in 8-bit steps.
    pub(crate) fn node(
        &mut self,
        context: &NodeContext,
        children: u8,
        weights: &[u32; 8],
        wanted: &[[f32; 3]; 8],
    ) -> Option<([[i16; 3]; DIFFERENCES], Gain)> {
        let rounding = if self.trade.search { 0.5 } else { self.trade.rounding };
        if self.is_flat(children, weights, wanted, 1.0 - rounding) {
            return None;
        }
        let steps = self.analysed(children, weights, wanted);
        let mut levels = steps.map(|values| values.map(|value| rounded(value, rounding)));
        if levels == [[0; 3]; DIFFERENCES] {
            return None;
        }
        let mut best = self.cost(context, children, &levels, &steps);
        if self.trade.search {
            for place in (0..3 * DIFFERENCES).rev() {
                let (difference, channel) = (place / 3, place % 3);
                let level = levels[difference][channel];
                if level == 0 {
                    continue;
                }
                // A level that is nearly what is wanted is kept.
                let over = f32::from(level).abs() - steps[difference][channel].abs();
                if over < -0.25 && level.abs() > 1 {
                    continue;
                }
                levels[difference][channel] = towards_zero(level);
                let cost = self.cost(context, children, &levels, &steps);
                if cost.0 < best.0 {
                    best = cost;
                } else {
                    levels[difference][channel] = level;
                }
            }
            let none = self.cost(context, children, &[[0; 3]; DIFFERENCES], &steps);
            if none.0 <= best.0 {
                return None;
            }
            best.1.bits -= none.1.bits;
        }
        (levels != [[0; 3]; DIFFERENCES]).then_some((levels, best.1))
    }

    /// Whether all differences of a node are certainly less than `least` steps: the values are too near to one another.
    fn is_flat(&self, children: u8, weights: &[u32; 8], values: &[[f32; 3]; 8], least: f32) -> bool {
        // The sides of a difference weigh a and b; its scale has a b / (a + b), which is a quarter of all weights at most.
        let all: u32 = weights.iter().sum();
        let most_scale = (all as f32 / (4 * HALF_WEIGHT) as f32).sqrt();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (child, value) in values.iter().enumerate() {
            if children >> child & 1 != 0 {
                for c in 0..3 {
                    low[c] = low[c].min(value[c]);
                    high[c] = high[c].max(value[c]);
                }
            }
        }
        // Far more than means are rounded by.
        const MARGIN: f32 = 0.999;
        let most = self.in_steps([0, 1, 2].map(|c| high[c] - low[c]), most_scale);
        most.iter().all(|most| *most < MARGIN * least)
    }

    /// The differences between a node's children, in steps.
    fn analysed(&self, children: u8, weights: &[u32; 8], values: &[[f32; 3]; 8]) -> Steps {
        let mut steps = [[0.0; 3]; DIFFERENCES];
        for difference in differences(children) {
            let [lower, upper] = side_weights(weights, difference).map(|weight| weight as f32);
            let sides = isv_decode::colour::transform::SIDES[difference];
            let mut means = [[0.0f32; 3]; 2];
            for child in 0..8 {
                for (side, mean) in means.iter_mut().enumerate() {
                    if sides[side] & children & 1 << child != 0 {
                        let share = weights[child] as f32 / [lower, upper][side];
                        (0..3).for_each(|c| mean[c] += share * values[child][c]);
                    }
                }
            }
            let scale = (lower * upper / ((lower + upper) * HALF_WEIGHT as f32)).sqrt();
            steps[difference] = self.in_steps([0, 1, 2].map(|c| means[1][c] - means[0][c]), scale);
        }
        steps
    }

    /// Bits and error, the less the better, and what they are.
    fn cost(
        &mut self,
        context: &NodeContext,
        children: u8,
        levels: &[[i16; 3]; DIFFERENCES],
        wanted: &Steps,
    ) -> (f32, Gain) {
        let mut bits = BitCount::default();
        write_node(&mut self.models, &mut bits, context, children, levels);
        let of_channel =
            |(wanted, level): (&f32, &i16)| wanted.powi(2) - (wanted - f32::from(*level)).powi(2);
        let error: f32 = wanted.as_flattened().iter().zip(levels.as_flattened()).map(of_channel).sum();
        (self.trade.lambda * bits.0 - error, Gain { error, bits: bits.0 })
    }

    /// Coefficients of one layer of a block whose residual at its nodes is given: by level, the means of its nodes. What is not worth
    /// its bits as a whole is left out.
    pub(crate) fn layer(
        &mut self,
        tree: &BlockTree,
        layer: u8,
        kind: usize,
        means: &[Vec<[f32; 3]>],
        energies: &mut NodeEnergies,
        coded_bits: f32,
    ) -> Vec<Coefficient> {
        let mut out = Vec::new();
        let (mut place, mut all) = (0, Gain { error: 0.0, bits: coded_bits });
        if layer == 0 {
            let (levels, gain) = self.root(kind, tree.levels()[0].weights[0], means[0][0]);
            if levels != [0; 3] {
                out.push(Coefficient { place, levels });
            }
            energies.root = energy(levels.map(i32::from));
            all.error += gain.error;
            all.bits += gain.bits;
            place += 1;
        }
        for level in BlockTree::layer_levels(layer) {
            energies.begin_level();
            let [nodes, below] = [0, 1].map(|step| &tree.levels()[level + step]);
            let mut first = 0;
            for (node, children) in nodes.places.iter().zip(&nodes.children) {
                let count = children.count_ones() as usize;
                let own = first..first + count;
                first += count;
                if count == 1 {
                    continue;
                }
                let (parent, neighbours) = energies.around(level, usize::from(*node));
                let context = NodeContext { level, kind, parent, neighbours, count: count - 1 };
                let weights = by_slot(*children, &below.weights[own.clone()]);
                let values = values_by_slot(*children, &means[level + 1][own]);
                if let Some((levels, gain)) = self.node(&context, *children, &weights, &values) {
                    all.error += gain.error;
                    all.bits += gain.bits;
                    push(&mut out, place, *children, &levels);
                    energies.set(usize::from(*node), node_energy(&levels));
                }
                place += count as u32 - 1;
            }
        }
        if self.trade.search && all.error < self.trade.lambda * all.bits {
            out.clear();
        }
        out
    }
}

/// Adds the levels of a node whose first coefficient has a place.
pub(crate) fn push(out: &mut Vec<Coefficient>, place: u32, children: u8, levels: &[[i16; 3]; DIFFERENCES]) {
    for (place, difference) in (place..).zip(differences(children)) {
        if levels[difference] != [0; 3] {
            out.push(Coefficient { place, levels: levels[difference] });
        }
    }
}

/// Values of a node's children by slot.
pub(crate) fn values_by_slot(children: u8, values: &[[f32; 3]]) -> [[f32; 3]; 8] {
    let mut by_slot = [[0.0; 3]; 8];
    let slots = (0..8).filter(|slot| children >> slot & 1 != 0);
    slots.zip(values).for_each(|(slot, value)| by_slot[slot] = *value);
    by_slot
}

/// The means of the nodes of each level, from the values of the leaves.
pub(crate) fn level_means(tree: &BlockTree, leaves: Vec<[f32; 3]>) -> Vec<Vec<[f32; 3]>> {
    let levels = tree.levels();
    let mut means = vec![leaves];
    for level in (0..levels.len() - 1).rev() {
        let (nodes, below) = (&levels[level], &levels[level + 1]);
        let values = &means[means.len() - 1];
        let mut first = 0;
        let of_node = |children: &u8| {
            let own = first..first + children.count_ones() as usize;
            first = own.end;
            let mut sums = [0.0; 3];
            let mut all = 0.0;
            for (value, weight) in values[own.clone()].iter().zip(&below.weights[own]) {
                all += *weight as f32;
                (0..3).for_each(|c| sums[c] += *weight as f32 * value[c]);
            }
            sums.map(|sum| sum / all)
        };
        let upper = nodes.children.iter().map(of_node).collect();
        means.push(upper);
    }
    means.reverse();
    means
}

/// The level nearest to a value, or the lesser one if it is not above that by one less `rounding`.
fn rounded(value: f32, rounding: f32) -> i16 {
    let magnitude = (value.abs() + rounding).floor().min((MAX_LEVEL - 1) as f32) as i16;
    if value < 0.0 { -magnitude } else { magnitude }
}

fn towards_zero(level: i16) -> i16 {
    level - level.signum()
}
