//! LZF, Marc Lehmann's LibLZF: literals and back references, told apart by a control byte.
//!
//! - `000LLLLL`: L + 1 literal bytes follow;
//! - `LLLooooo oooooooo`: copy L + 2 bytes from o + 1 bytes back, L in 1..=6;
//! - `111ooooo LLLLLLLL oooooooo`: the same with L + 9 bytes.

/// Most bytes that one compressed byte can stand for: three of them copy 264.
const MAX_RATIO: usize = 88;

/// Decompresses what must become exactly `length` bytes; `None` if it does not.
pub(super) fn decompress(compressed: &[u8], length: usize) -> Option<Vec<u8>> {
    if length / MAX_RATIO > compressed.len() {
        return None;
    }
    let mut out = Vec::with_capacity(length);
    let mut rest = compressed;
    while let Some((&control, after)) = rest.split_first() {
        rest = after;
        let control = usize::from(control);
        if control < 32 {
            let (literals, after) = rest.split_at_checked(control + 1)?;
            out.extend_from_slice(literals);
            rest = after;
        } else {
            let mut copied = (control >> 5) + 2;
            if control >> 5 == 7 {
                copied += usize::from(*rest.split_off_first()?);
            }
            let back = ((control & 31) << 8) + usize::from(*rest.split_off_first()?) + 1;
            copy_back(&mut out, back, copied)?;
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

/// Appends bytes from `back` bytes before the end; they may reach into what is being appended.
fn copy_back(out: &mut Vec<u8>, back: usize, copied: usize) -> Option<()> {
    let start = out.len().checked_sub(back)?;
    for at in start..start + copied {
        out.push(out[at]);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_copies_of_both_lengths() {
        // "abc", 3 bytes from 3 back, then 12 bytes from 1 back, over themselves.
        let compressed = [2, b'a', b'b', b'c', 1 << 5, 2, 7 << 5, 3, 0];
        assert_eq!(decompress(&compressed, 18).unwrap(), b"abcabccccccccccccc");
        for length in [0, 17, 19, usize::MAX] {
            assert_eq!(decompress(&compressed, length), None);
        }
        for cut in 0..compressed.len() {
            assert_eq!(decompress(&compressed[..cut], 18), None);
        }
    }

    #[test]
    fn a_copy_from_before_the_start_is_refused() {
        assert_eq!(decompress(&[0, b'a', 1 << 5, 1], 4), None);
        assert_eq!(decompress(&[0, b'a', 1 << 5, 0], 4).unwrap(), b"aaaa");
    }
}
