//! Places on the command line that become the origin: `512000,5403000,0`.

/// Parses three numbers with commas between them.
pub(crate) fn parse(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "a place is three numbers, as in 512000,5403000,0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_three_numbers() {
        assert_eq!(parse("512000,5403000,0"), Ok([512_000.0, 5_403_000.0, 0.0]));
        assert_eq!(parse("-1.5, 2e3 ,0.25"), Ok([-1.5, 2000.0, 0.25]));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,inf", "nan,0,0", "1;2;3"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
