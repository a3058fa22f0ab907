//! Frame rates on the command line: `30`, `29.97`, `30000/1001`.

use isv::format::FrameRate;

/// Parses a whole number, a decimal number or a fraction, exactly as written and in lowest terms.
pub(crate) fn parse(text: &str) -> Result<FrameRate, String> {
    let (numerator, denominator) = match text.split_once('/') {
        Some((numerator, denominator)) => (digits(numerator), digits(denominator)),
        None => {
            let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
            (digits(&format!("{whole}{decimals}")), 10u64.checked_pow(decimals.len() as u32))
        }
    };
    let (Some(numerator @ 1..), Some(denominator @ 1..)) = (numerator, denominator) else {
        return Err("a frame rate is a number above 0, such as 30, 29.97 or 30000/1001".to_owned());
    };
    let divisor = greatest_common_divisor(numerator, denominator);
    match (u32::try_from(numerator / divisor), u32::try_from(denominator / divisor)) {
        (Ok(numerator), Ok(denominator)) => Ok(FrameRate { numerator, denominator }),
        _ => Err("numerator and denominator of a frame rate must be below 2^32".to_owned()),
    }
}

/// The rate closest to a number of frames a second, in thousandths; `None` if that is none.
pub(crate) fn nearest(per_second: f64) -> Option<FrameRate> {
    parse(&format!("{per_second:.3}")).ok()
}

fn digits(text: &str) -> Option<u64> {
    // `u64::from_str` would also take a plus sign.
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_exact() {
        for (text, numerator, denominator) in [
            ("30", 30, 1),
            ("29.97", 2997, 100),
            ("30000/1001", 30000, 1001),
            ("12.50", 25, 2),
            ("50/2", 25, 1),
        ] {
            assert_eq!(parse(text), Ok(FrameRate { numerator, denominator }), "{text}");
        }
        assert_eq!(nearest(29.99996), Some(FrameRate { numerator: 30, denominator: 1 }));
        assert_eq!(nearest(29.97003), Some(FrameRate { numerator: 2997, denominator: 100 }));
        assert_eq!((nearest(0.0001), nearest(f64::NAN), nearest(-1.0)), (None, None, None));
        for wrong in ["", "0", "-30", "+30", "30fps", "1/0", "0/1", ".", "1e3", "30/1.001", "9999999999"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
