//! The order in which people number files.

use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};
use std::fmt::Write;

/// Compares names so that `frame_2` comes before `frame_10`: runs of digits by value, however long, everything else
/// byte by byte. Names that differ only in leading zeros fall back to plain byte order, so that the order is total.
///
/// A name alone does not tell whether `1.10` is a decimal number or `-2` is below zero: [`NameOrder`] asks all names of a list.
///
/// ```
/// # use isv_io::natural_cmp;
/// assert!(natural_cmp(b"frame_2.ply", b"frame_10.ply").is_lt());
/// ```
#[must_use]
pub fn natural_cmp(a: &[u8], b: &[u8]) -> Ordering {
    NameOrder::default().cmp(a, b)
}

/// What the numbers in the names of a list are, decided by looking at all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NameOrder {
    /// Digits, a point and digits are one decimal number: 1.025 comes before 1.05.
    pub decimals: bool,
    /// A minus before digits is a sign: -2 comes before -1 and both before 0.
    pub signs: bool,
}

/// Names in order, and what was decided about them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OrderedNames<T> {
    /// The names.
    pub names: Vec<T>,
    /// What their numbers are.
    pub order: NameOrder,
    /// A sentence on what was decided, where another decision gives another order.
    pub note: Option<String>,
}

impl NameOrder {
    /// Decides for a list of names.
    ///
    /// - A minus is a sign if another name has digits in its place, as in `sim-0001`, `sim00000`. It is one
    ///   too at the start of a name or behind `_`, `=` or a blank. In `sim-0001`, `sim-0002` it parts words.
    /// - Two numbers with a point between them are a decimal number. They are none if the second ones count
    ///   (`1.9`, `1.10`), or if three numbers follow each other as in a version.
    #[must_use]
    pub fn new(names: &[&[u8]]) -> Self {
        Self { decimals: has_decimals(names), signs: has_signs(names) }
    }

    /// Sorts names by what their numbers are.
    pub fn sort<T: AsRef<[u8]>>(mut names: Vec<T>) -> OrderedNames<T> {
        let listed: Vec<&[u8]> = names.iter().map(AsRef::as_ref).collect();
        let order = Self::new(&listed);
        let other_decimals = Self { decimals: !order.decimals, ..order };
        let other_signs = Self { signs: !order.signs, ..order };
        let mut sorted = listed.clone();
        sorted.sort_by(|a, b| order.cmp(a, b));
        let mut note = String::new();
        // A hyphen in every name parts words, and nobody asks.
        let signs = order.signs.then_some((other_signs, "numbers with a sign"));
        let decimals = if order.decimals { "decimal numbers" } else { "counts with a point between them" };
        for (other, what) in [(other_decimals, decimals)].into_iter().chain(signs) {
            let disputed = sorted.windows(2).find(|pair| other.cmp(pair[0], pair[1]).is_gt());
            if let (Some([a, b]), true) = (disputed, note.is_empty()) {
                let name = |name: &[u8]| String::from_utf8_lossy(name).chars().take(60).collect::<String>();
                let _ = write!(note, "names are taken as {what}: {} comes before {}", name(a), name(b));
            }
        }
        names.sort_by(|a, b| order.cmp(a.as_ref(), b.as_ref()));
        OrderedNames { names, order, note: (!note.is_empty()).then_some(note) }
    }

    /// Compares two names. Names that are equal but for how numbers are written fall back to plain byte order.
    #[must_use]
    pub fn cmp(self, a: &[u8], b: &[u8]) -> Ordering {
        let (mut at_a, mut at_b) = (0, 0);
        while at_a < a.len() && at_b < b.len() {
            let order = match (self.number(a, at_a), self.number(b, at_b)) {
                (Some(number_a), Some(number_b)) => {
                    (at_a, at_b) = (at_a + number_a.length, at_b + number_b.length);
                    number_a.cmp(&number_b)
                }
                _ => {
                    (at_a, at_b) = (at_a + 1, at_b + 1);
                    a[at_a - 1].cmp(&b[at_b - 1])
                }
            };
            if order.is_ne() {
                return order;
            }
        }
        (a.len() - at_a).cmp(&(b.len() - at_b)).then_with(|| a.cmp(b))
    }

    /// The number that starts at a place of a name.
    fn number(self, name: &[u8], at: usize) -> Option<Number<'_>> {
        let negative =
            self.signs && name[at] == b'-' && !at.checked_sub(1).is_some_and(|at| name[at].is_ascii_digit());
        let start = at + usize::from(negative);
        let whole = digits(&name[start.min(name.len())..]);
        if whole.is_empty() {
            return None;
        }
        let end = start + whole.len();
        let decimals = match name[end..].split_first() {
            Some((b'.', rest)) if self.decimals => digits(rest),
            _ => &[],
        };
        let length = end - at + if decimals.is_empty() { 0 } else { 1 + decimals.len() };
        let zeros = whole.iter().take_while(|b| **b == b'0').count();
        let trailing = decimals.iter().rev().take_while(|b| **b == b'0').count();
        Some(Number {
            negative,
            whole: &whole[zeros..],
            decimals: &decimals[..decimals.len() - trailing],
            length,
        })
    }
}

/// A number in a name.
struct Number<'a> {
    negative: bool,
    /// Digits before the point, without leading zeros.
    whole: &'a [u8],
    /// Digits behind it, without trailing zeros.
    decimals: &'a [u8],
    /// Bytes of the name that it takes.
    length: usize,
}

impl Number<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        let magnitude = (self.whole.len().cmp(&other.whole.len()))
            .then_with(|| self.whole.cmp(other.whole))
            .then_with(|| self.decimals.cmp(other.decimals));
        // Zero is zero with any sign.
        let sign = |n: &Self| n.negative && !(n.whole.is_empty() && n.decimals.is_empty());
        match (sign(self), sign(other)) {
            (false, false) => magnitude,
            (true, true) => magnitude.reverse(),
            (true, false) => Ordering::Less,
            (false, true) => Ordering::Greater,
        }
    }
}

/// The digits that a text starts with.
fn digits(text: &[u8]) -> &[u8] {
    &text[..text.iter().take_while(|b| b.is_ascii_digit()).count()]
}

fn has_signs(names: &[&[u8]]) -> bool {
    let is_digit = |name: &[u8], at: usize| name.get(at).is_some_and(u8::is_ascii_digit);
    let mut before_minus: HashSet<&[u8]> = HashSet::new();
    for name in names {
        for at in 0..name.len() {
            let is_minus = name[at] == b'-' && is_digit(name, at + 1) && (at == 0 || !is_digit(name, at - 1));
            if is_minus {
                if at == 0 || matches!(name[at - 1], b'_' | b'=' | b' ') {
                    return true;
                }
                before_minus.insert(&name[..at]);
            }
        }
    }
    if before_minus.is_empty() {
        return false;
    }
    let starts_number = |name: &[u8], at: usize| is_digit(name, at) && (at == 0 || !is_digit(name, at - 1));
    names
        .iter()
        .any(|name| (0..name.len()).any(|at| starts_number(name, at) && before_minus.contains(&name[..at])))
}

fn has_decimals(names: &[&[u8]]) -> bool {
    // Fractions by what stands before them, the number before the point included.
    let mut fractions: HashMap<&[u8], Vec<&[u8]>> = HashMap::new();
    for name in names {
        let mut at = 0;
        while at < name.len() {
            let whole = digits(&name[at..]);
            let end = at + whole.len();
            if whole.is_empty() || name.get(end) != Some(&b'.') {
                at = end.max(at + 1);
                continue;
            }
            let fraction = digits(&name[end + 1..]);
            let behind = end + 1 + fraction.len();
            // 1.2.10 is a version, not a number.
            if !fraction.is_empty()
                && name.get(behind) == Some(&b'.')
                && !digits(&name[behind + 1..]).is_empty()
            {
                return false;
            }
            if !fraction.is_empty() {
                fractions.entry(&name[..end]).or_default().push(fraction);
            }
            at = behind;
        }
    }
    let counts = |fractions: &Vec<&[u8]>| {
        let padded = fractions.iter().any(|fraction| fraction.len() > 1 && fraction[0] == b'0');
        let mut numbers: Vec<u64> = fractions
            .iter()
            .filter_map(|fraction| std::str::from_utf8(fraction).ok()?.parse().ok())
            .collect();
        numbers.sort_unstable();
        numbers.dedup();
        let without_gap = numbers.windows(2).all(|pair| pair[1] - pair[0] == 1);
        !padded
            && without_gap
            && numbers.len() == fractions.len()
            && numbers.first().is_some_and(|first| *first <= 1)
    };
    // Who writes decimals without trailing zeros writes no 1.10.
    let all = || fractions.values().flatten();
    let widths_differ = all().any(|fraction| all().next().is_some_and(|first| first.len() != fraction.len()));
    let padded = all().any(|fraction| fraction.len() > 1 && fraction[0] == b'0');
    if widths_differ && !padded && all().any(|fraction| fraction.len() > 1 && fraction.ends_with(b"0")) {
        return false;
    }
    !fractions.is_empty() && !fractions.values().all(counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_compare_by_value_at_any_length() {
        let sorted = [
            "",
            "0",
            "00",
            "1",
            "9",
            "10",
            "a",
            "a1b2",
            "a1b10",
            "a01b11",
            "a2",
            "a99999999999999999999999999999998",
            "a99999999999999999999999999999999",
            "a100000000000000000000000000000000",
            "ab",
            "frame_2",
            "frame_02.x",
            "frame_10",
        ];
        for (i, a) in sorted.iter().enumerate() {
            for (j, b) in sorted.iter().enumerate() {
                assert_eq!(natural_cmp(a.as_bytes(), b.as_bytes()), i.cmp(&j), "{a} against {b}");
            }
        }
    }

    fn sorted(names: &[&str]) -> (Vec<String>, Option<String>) {
        let names = names.iter().map(|name| name.as_bytes().to_vec()).collect();
        let OrderedNames { names, note, .. } = NameOrder::sort(names);
        (names.into_iter().map(|name| String::from_utf8(name).unwrap()).collect(), note)
    }

    #[test]
    fn decimals_and_signs_are_told_from_counts_and_hyphens() {
        for (names, is_said) in [
            (&["0.95.ply", "0.975.ply", "1.0.ply", "1.025.ply", "1.05.ply"][..], true),
            (&["t_1.10.obj", "t_1.20.obj", "t_1.30.obj"], false),
            (&["1.5", "1.25e"], true),
            (&["take1.1", "take1.2", "take1.9", "take1.10", "take1.11"], true),
            (&["v1.2.9", "v1.2.10", "v1.10.1"], true),
            (&["sim-0002", "sim-0001", "sim00000", "sim00001", "sim00010"], true),
            (&["sim-0001", "sim-0002", "sim-0010"], false),
            (&["2024-01-05", "2024-01-06", "2024-02-01"], false),
            (&["-1.5.ply", "-1.25.ply", "0.ply", "0.5.ply", "10.ply"], true),
            (&["f_-10", "f_-9", "f_0", "f_3"], true),
            (&["frame_1.ply", "frame_2.ply", "frame_10.ply"], false),
        ] {
            let mut shuffled = names.to_vec();
            shuffled.reverse();
            let expected: Vec<_> =
                if names == ["1.5", "1.25e"] { vec!["1.25e", "1.5"] } else { names.to_vec() };
            let (found, note) = sorted(&shuffled);
            assert_eq!(found, expected, "{note:?}");
            assert_eq!(note.is_some(), is_said, "{note:?}");
        }
        assert_eq!(
            sorted(&["1.05", "1.025"]).1.unwrap(),
            "names are taken as decimal numbers: 1.025 comes before 1.05"
        );
    }

    proptest! {
        #[test]
        fn the_order_is_total_whatever_numbers_are(
            names in prop::collection::vec("[0-2a.-]{0,6}", 3), decimals: bool, signs: bool,
        ) {
            let order = NameOrder { decimals, signs };
            let cmp = |i: usize, j: usize| order.cmp(names[i].as_bytes(), names[j].as_bytes());
            prop_assert_eq!(cmp(0, 1), cmp(1, 0).reverse());
            prop_assert_eq!(cmp(0, 1).is_eq(), names[0] == names[1]);
            if cmp(0, 1).is_le() && cmp(1, 2).is_le() {
                prop_assert!(cmp(0, 2).is_le());
            }
        }

        #[test]
        fn the_order_is_total(names in prop::collection::vec("[0-2a/:]{0,6}", 3)) {
            let cmp = |i: usize, j: usize| natural_cmp(names[i].as_bytes(), names[j].as_bytes());
            prop_assert_eq!(cmp(0, 1), cmp(1, 0).reverse());
            prop_assert_eq!(cmp(0, 1).is_eq(), names[0] == names[1]);
            if cmp(0, 1).is_le() && cmp(1, 2).is_le() {
                prop_assert!(cmp(0, 2).is_le());
            }
        }
    }
}
