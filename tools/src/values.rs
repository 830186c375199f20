//! Parsers of option values, which refuse numbers that have no meaning.

use clap::builder::RangedU64ValueParser;

/// Returns the parser of a whole number from `least` up.
pub(crate) fn at_least(least: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(least..)
}

/// Returns the parser of a whole number from 0 to `most`.
pub(crate) fn up_to(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(..=most)
}

/// Parses a finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err("expected a positive number".to_string()),
    }
}

/// Parses a number from 0 to 1.
pub(crate) fn fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if (0.0..=1.0).contains(&number) => Ok(number),
        _ => Err("expected a number from 0 to 1".to_string()),
    }
}

/// Parses a finite number from 0 up.
pub(crate) fn from_zero(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        _ => Err("expected a number from 0 up".to_string()),
    }
}

/// Parses a finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("expected a finite number".to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_without_a_meaning_are_refused() {
        for (parse, good, bad) in [
            (
                positive as fn(&str) -> Result<f64, String>,
                &["1e-3", "2"][..],
                &["0", "-1", "nan", "inf", "x", ""][..],
            ),
            (fraction, &["0", "0.5", "1"], &["-0.1", "1.01", "nan", "50%"]),
            (from_zero, &["0", "2.5"], &["-1", "nan", "inf"]),
            (finite, &["-1", "0"], &["nan", "-inf", "1,5"]),
        ] {
            assert!(good.iter().all(|text| parse(text).is_ok()), "{good:?}");
            assert!(bad.iter().all(|text| parse(text).is_err()), "{bad:?}");
        }
    }
}
