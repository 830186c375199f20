//! Exact decimal numbers: a scaled 64-bit signal has more digits than a floating-point number can represent.

use core::fmt;

/// Decimal number: `digits` times ten to the power of `exponent`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decimal {
    digits: i128,
    exponent: i32,
}

impl Decimal {
    /// Converts the shortest decimal representation of `number`.
    fn from_f64(number: f64) -> Option<Self> {
        let text = format!("{number:e}");
        let (mantissa, exponent) = text.split_once('e')?;
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{fraction}").parse().ok()?;
        Some(Self { digits, exponent: exponent.parse::<i32>().ok()? - i32::try_from(fraction.len()).ok()? })
    }

    /// Returns the digits for an exponent that is not larger; `None` if there are too many.
    fn digits_at(self, exponent: i32) -> Option<i128> {
        10_i128.checked_pow(u32::try_from(self.exponent - exponent).ok()?)?.checked_mul(self.digits)
    }

    /// Returns `raw * factor + offset`; `None` for more than 38 digits, or if a number is not finite.
    pub(crate) fn scaled(raw: i128, factor: f64, offset: f64) -> Option<Self> {
        let (factor, offset) = (Self::from_f64(factor)?, Self::from_f64(offset)?);
        let exponent = factor.exponent.min(offset.exponent);
        let product = factor.digits_at(exponent)?.checked_mul(raw)?;
        Some(Self { digits: product.checked_add(offset.digits_at(exponent)?)?, exponent })
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mut digits, mut exponent } = *self;
        while exponent < 0 && digits % 10 == 0 {
            (digits, exponent) = (digits / 10, exponent + 1);
        }
        let sign = if digits < 0 { "-" } else { "" };
        let text = digits.unsigned_abs().to_string();
        let zeros = |count: i32| "0".repeat(usize::try_from(count).unwrap_or(0));
        if exponent >= 0 || digits == 0 {
            let behind = if digits == 0 { String::new() } else { zeros(exponent) };
            return write!(f, "{sign}{text}{behind}");
        }
        let places = usize::try_from(-exponent).unwrap_or(0);
        let text = format!("{:0>width$}", text, width = places + 1);
        let (whole, fraction) = text.split_at(text.len() - places);
        write!(f, "{sign}{whole}.{fraction}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_numbers_keep_all_digits() {
        let text = |raw, factor, offset| Decimal::scaled(raw, factor, offset).map(|x| x.to_string());
        for (raw, factor, offset, expected) in [
            (1_735_270_496_916_858, 1e-6, 0.0, "1735270496.916858"),
            (3, 0.1, 0.0, "0.3"),
            (-3, 0.1, 0.0, "-0.3"),
            (i128::from(u64::MAX), 0.0009765625, -40.0, "18014398509481943.9990234375"),
            (1234, 0.01, -12.34, "0"),
            (7, 100.0, 40.0, "740"),
            (2, 1e20, 0.0, "200000000000000000000"),
        ] {
            assert_eq!(text(raw, factor, offset).as_deref(), Some(expected), "{raw} * {factor} + {offset}");
        }
        assert_eq!(text(1, f64::NAN, 0.0), None);
        assert_eq!(text(1, 1e30, 1e-30), None);
    }
}
