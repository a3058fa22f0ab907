//! Shell-like patterns for file names.

/// Whether a name contains a wildcard.
pub(crate) fn has_wildcard(name: &[u8]) -> bool {
    name.iter().any(|b| matches!(b, b'*' | b'?'))
}

/// Whether a name matches a pattern: `*` stands for any bytes, `?` for one character, everything else for itself.
///
/// Only the last `*` is ever tried again, which suffices and keeps the time within pattern length times name length.
pub(crate) fn matches(pattern: &[u8], name: &[u8]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut retry = None;
    while n < name.len() {
        match pattern.get(p) {
            Some(b'*') => {
                p += 1;
                retry = Some((p, n));
            }
            Some(b'?') => {
                p += 1;
                n = next_character(name, n);
            }
            Some(byte) if *byte == name[n] => {
                p += 1;
                n += 1;
            }
            _ => {
                let Some((star, from)) = retry else { return false };
                (p, n) = (star, next_character(name, from));
                retry = Some((p, n));
            }
        }
    }
    pattern[p..].iter().all(|b| *b == b'*')
}

/// Start of the UTF-8 character after the one at `at`.
fn next_character(name: &[u8], at: usize) -> usize {
    let continuation = name[at + 1..].iter().take_while(|b| **b & 0xc0 == 0x80).count();
    at + 1 + continuation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_take_any_run_and_question_marks_one_character() {
        for (pattern, name) in [
            ("*", ""),
            ("*.ply", "a.b.ply"),
            ("f?_*.ply", "f1_02.ply"),
            ("a*b*c", "axbxbxc"),
            ("?", "é"),
            ("**a", "ba"),
            ("abc", "abc"),
        ] {
            assert!(matches(pattern.as_bytes(), name.as_bytes()), "{pattern} {name}");
        }
        for (pattern, name) in [
            ("?", ""),
            ("*.ply", "a.ply.gz"),
            ("f?.ply", "f12.ply"),
            ("a*b*c", "axbx"),
            ("abc", "ab"),
            ("", "a"),
        ] {
            assert!(!matches(pattern.as_bytes(), name.as_bytes()), "{pattern} {name}");
        }
    }

    #[test]
    fn many_stars_take_no_exponential_time() {
        assert!(!matches("*a".repeat(200).as_bytes(), "b".repeat(20_000).as_bytes()));
        assert!(!matches("a*".repeat(200).as_bytes(), "a".repeat(199).as_bytes()));
    }
}
