//! The order in which people number files.

use std::cmp::Ordering;

/// Compares names so that `frame_2` comes before `frame_10`: runs of digits by value, however long, everything else
/// byte by byte. Names that differ only in leading zeros fall back to plain byte order, so that the order is total.
///
/// ```
/// # use isv_io::natural_cmp;
/// assert!(natural_cmp(b"frame_2.ply", b"frame_10.ply").is_lt());
/// ```
#[must_use]
pub fn natural_cmp(a: &[u8], b: &[u8]) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    while let ([first_a, ..], [first_b, ..]) = (rest_a, rest_b) {
        let order = if first_a.is_ascii_digit() && first_b.is_ascii_digit() {
            let (number_a, number_b);
            (number_a, rest_a) = split_number(rest_a);
            (number_b, rest_b) = split_number(rest_b);
            number_a.len().cmp(&number_b.len()).then_with(|| number_a.cmp(number_b))
        } else {
            (rest_a, rest_b) = (&rest_a[1..], &rest_b[1..]);
            first_a.cmp(first_b)
        };
        if order.is_ne() {
            return order;
        }
    }
    rest_a.len().cmp(&rest_b.len()).then_with(|| a.cmp(b))
}

/// The digits that a name starts with, without leading zeros, and what follows them.
fn split_number(name: &[u8]) -> (&[u8], &[u8]) {
    let end = name.iter().position(|b| !b.is_ascii_digit()).unwrap_or(name.len());
    let (digits, rest) = name.split_at(end);
    let zeros = digits.iter().take_while(|b| **b == b'0').count();
    (&digits[zeros..], rest)
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

    proptest! {
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
