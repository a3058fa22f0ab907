//! Compression of integers in binary USD files: differences with codes of two bits, then LZ4.

/// Most bytes that LZ4 takes as one block.
const MOST_BYTES: usize = 0x7E00_0000;

/// Encodes and compresses integers. Returns nothing for more of them than one block of LZ4 holds.
pub(super) fn compress_integers(values: &[i32]) -> Option<Vec<u8>> {
    compress(&encode(values))
}

/// Compresses bytes as one LZ4 block, behind a byte of 0 that says so.
pub(super) fn compress(bytes: &[u8]) -> Option<Vec<u8>> {
    (bytes.len() <= MOST_BYTES).then(|| {
        let mut compressed = vec![0];
        compressed.extend(lz4_flex::block::compress(bytes));
        compressed
    })
}

/// Encodes integers as differences: the most frequent difference, a code of two bits for each, then those of other values.
///
/// | code | difference |
/// |---|---|
/// | 0 | the most frequent one |
/// | 1, 2, 3 | follows in 8, 16 or 32 bits |
fn encode(values: &[i32]) -> Vec<u8> {
    let mut last = 0;
    let difference = |value: &i32| value.wrapping_sub(std::mem::replace(&mut last, *value));
    let differences: Vec<i32> = values.iter().map(difference).collect();
    let common = most_frequent(&differences);
    let mut bytes = common.to_le_bytes().to_vec();
    let first_code = bytes.len();
    bytes.resize(first_code + values.len().div_ceil(4), 0);
    for (at, difference) in differences.iter().enumerate() {
        let code = if *difference == common {
            0
        } else if let Ok(small) = i8::try_from(*difference) {
            bytes.extend(small.to_le_bytes());
            1
        } else if let Ok(medium) = i16::try_from(*difference) {
            bytes.extend(medium.to_le_bytes());
            2
        } else {
            bytes.extend(difference.to_le_bytes());
            3
        };
        bytes[first_code + at / 4] |= code << (2 * (at % 4));
    }
    bytes
}

/// Returns the value that occurs most; of several, the largest, which saves most.
fn most_frequent(values: &[i32]) -> i32 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a == b).map(|run| (run.len(), run[0]));
    runs.max().map_or(0, |(_, value)| value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Decodes what `encode` wrote, from the layout alone.
    fn decode(bytes: &[u8], count: usize) -> Vec<i32> {
        let (common, rest) = bytes.split_at(4);
        let common = i32::from_le_bytes(common.try_into().unwrap());
        let (codes, mut rest) = rest.split_at(count.div_ceil(4));
        let mut take = |bytes: usize| {
            let (value, left) = rest.split_at(bytes);
            rest = left;
            let sign = if value[bytes - 1] < 128 { 0 } else { 255 };
            let mut whole = [sign; 4];
            whole[..bytes].copy_from_slice(value);
            i32::from_le_bytes(whole)
        };
        let mut last = 0i32;
        let values = (0..count).map(|at| {
            last = last.wrapping_add(match codes[at / 4] >> (2 * (at % 4)) & 3 {
                0 => common,
                1 => take(1),
                2 => take(2),
                _ => take(4),
            });
            last
        });
        let values = values.collect();
        assert!(rest.is_empty());
        values
    }

    #[test]
    fn differences_have_the_shortest_code() {
        let values = [123, 124, 125, 100_125, 100_125, 100_126, 100_126];
        let mut expected = vec![1, 0, 0, 0, 0b1100_0001, 0b01_00_01];
        expected.extend([123, 0xA0, 0x86, 0x01, 0, 0, 0]);
        assert_eq!(encode(&values), expected);
    }

    proptest! {
        #[test]
        fn integers_come_back(values: Vec<i32>, small in proptest::collection::vec(-300..300, 0..99)) {
            for values in [values, small] {
                prop_assert_eq!(decode(&encode(&values), values.len()), values);
            }
        }
    }
}
