//! Times and rates as text with a unit: `"200 us"`, `"1.5 ms"`, `"1 kHz"`.
//!
//! All conversions are exact: decimal digits are scaled as integers, never as floating-point numbers.

use std::borrow::Cow;

use serde::{Deserialize, Deserializer, Serialize};

/// A time span in whole nanoseconds. In files and arguments it is text with a unit, such as `"200 us"`.
///
/// ```
/// use motorium::units::TimeSpan;
///
/// #[derive(serde::Deserialize)]
/// struct Config {
///     duration: TimeSpan,
/// }
///
/// let config: Config = toml::from_str("duration = \"1.5 ms\"")?;
/// assert_eq!(config.duration.ns, 1_500_000);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeSpan {
    /// Duration in nanoseconds.
    pub ns: u64,
}

impl TimeSpan {
    /// Returns the time in seconds.
    pub fn as_secs_f64(self) -> f64 {
        std::time::Duration::from(self).as_secs_f64()
    }
}

impl From<TimeSpan> for std::time::Duration {
    fn from(span: TimeSpan) -> Self {
        Self::from_nanos(span.ns)
    }
}

/// A rate, stored as its period. In files and arguments it is text with a unit, such as `"1 kHz"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rate {
    /// Time between two releases, rounded to whole nanoseconds.
    pub period_ns: u64,
}

/// Error of parsing a time or rate.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {expected}")]
pub struct UnitError {
    /// The found value, as the end of a sentence that begins with the name of the key.
    pub found: String,
    /// Expected values, with advice on how to write them.
    pub expected: String,
}

const TIME_UNITS: [(&str, u64); 7] = [
    ("ns", 1),
    ("us", 1_000),
    ("µs", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
    ("min", 60_000_000_000),
    ("μs", 1_000),
];
const RATE_UNITS: [(&str, u64); 2] = [("Hz", 1), ("kHz", 1_000)];

/// Fastest rate, Hz: above 100 kHz, a step and its wake-up do not fit into a period.
const FASTEST_HZ: u128 = 100_000;
/// The slowest rate, mHz.
const SLOWEST_MHZ: u128 = 1;

const TIME_EXAMPLE: &str = "write a number and a unit, such as \"200 us\", \"1.5 ms\" or \"10 s\"";
const RATE_EXAMPLE: &str = "write a number and a unit, such as \"1 kHz\" or \"62.5 Hz\"";

impl core::str::FromStr for TimeSpan {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        let (number, unit) = split(text, TIME_EXAMPLE)?;
        let number = Decimal::parse(number, TIME_EXAMPLE)?;
        let Some((_, scale)) = TIME_UNITS.iter().find(|(name, _)| *name == unit) else {
            return Err(unknown_unit(unit, "ns, us, ms, s and min", number.text, "time", TIME_EXAMPLE));
        };
        let scaled = number.digits.checked_mul(u128::from(*scale));
        let power = 10u128.checked_pow(number.decimals);
        let (Some(scaled), Some(power)) = (scaled, power) else { return Err(too_long(text)) };
        if scaled % power != 0 {
            return Err(UnitError {
                found: format!("is \"{text}\", which is not a whole number of nanoseconds"),
                expected: "the smallest unit of time is 1 ns".into(),
            });
        }
        let ns = u64::try_from(scaled / power).map_err(|_| too_long(text))?;
        // times are added up, so keep them well below the end of the range
        if ns > u64::MAX / 1_000 { Err(too_long(text)) } else { Ok(Self { ns }) }
    }
}

impl core::str::FromStr for Rate {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        let (number, unit) = split(text, RATE_EXAMPLE)?;
        let number = Decimal::parse(number, RATE_EXAMPLE)?;
        let unit = if unit.eq_ignore_ascii_case("hz") { "Hz" } else { unit };
        let unit = if unit.eq_ignore_ascii_case("khz") { "kHz" } else { unit };
        let Some((_, scale)) = RATE_UNITS.iter().find(|(name, _)| *name == unit) else {
            return Err(unknown_unit(unit, "Hz and kHz", number.text, "rate", RATE_EXAMPLE));
        };
        if number.digits == 0 {
            return Err(UnitError {
                found: format!("is \"{text}\": a component at that rate would never step"),
                expected: "rates go from 0.001 Hz to 100 kHz; for steps on demand use `trigger`".into(),
            });
        }
        let scaled = number.digits.checked_mul(u128::from(*scale));
        let power = 10u128.checked_pow(number.decimals);
        let (Some(hz), Some(power)) = (scaled, power) else { return Err(impossible(text)) };
        // the rate is hz / power
        let (Some(mhz), Some(fastest)) = (hz.checked_mul(1_000), power.checked_mul(FASTEST_HZ)) else {
            return Err(impossible(text));
        };
        if hz > fastest || mhz < power.saturating_mul(SLOWEST_MHZ) {
            let how = if hz > fastest { "fast" } else { "slow" };
            return Err(UnitError {
                found: format!("is \"{text}\", which is too {how}"),
                ..impossible(text)
            });
        }
        let Some(ns) = power.checked_mul(1_000_000_000) else { return Err(impossible(text)) };
        let period_ns = u64::try_from((ns + hz / 2) / hz).map_err(|_| impossible(text))?;
        Ok(Self { period_ns })
    }
}

/// A decimal number: `digits / 10^decimals`.
struct Decimal<'a> {
    digits: u128,
    decimals: u32,
    text: &'a str,
}

impl<'a> Decimal<'a> {
    fn parse(text: &'a str, example: &str) -> Result<Self, UnitError> {
        let fail = |found: String| Err(UnitError { found, expected: example.to_string() });
        if let Some(number) = text.strip_prefix('-') {
            return fail(format!("is negative (-{number})"));
        }
        let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
        let digits = [whole, fraction].concat();
        if whole.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
            return fail(format!("begins with \"{text}\", which is not a number"));
        }
        match digits.parse::<u128>() {
            Ok(value) if digits.len() <= 24 => {
                Ok(Self { digits: value, decimals: u32::try_from(fraction.len()).unwrap_or(u32::MAX), text })
            }
            _ => fail(format!("has too many digits ({})", digits.len())),
        }
    }
}

/// Splits `"200 us"` into number and unit; the space between them is optional.
fn split<'a>(text: &'a str, example: &str) -> Result<(&'a str, &'a str), UnitError> {
    let text = text.trim();
    let end =
        text.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-' || c == '+')).unwrap_or(text.len());
    let (number, unit) = (&text[..end], text[end..].trim());
    if !number.bytes().any(|byte| byte.is_ascii_digit()) && !text.is_empty() {
        let found = format!("is \"{text}\", which does not begin with a number");
        return Err(UnitError { found, expected: example.to_string() });
    }
    if text.is_empty() || unit.is_empty() {
        let found =
            if text.is_empty() { "is empty".to_string() } else { format!("is \"{text}\", without a unit") };
        return Err(UnitError { found, expected: example.to_string() });
    }
    Ok((number, unit))
}

fn unknown_unit(unit: &str, units: &str, number: &str, what: &str, example: &str) -> UnitError {
    let is_exponent = unit
        .strip_prefix(['e', 'E'])
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '+'));
    let expected = match (what, unit) {
        _ if unit.starts_with(',') => format!("write decimals with a point; {example}"),
        _ if is_exponent => format!("write the number without an exponent; {example}"),
        ("time", "h" | "hour" | "hours") => {
            format!("the units are {units}; an hour is \"60 min\"")
        }
        ("time", "sec" | "second" | "seconds") => format!("the units are {units}; write \"{number} s\""),
        ("time", _) if unit.eq_ignore_ascii_case("hz") || unit.eq_ignore_ascii_case("khz") => {
            format!("{unit} is a rate, expected a time; {example}")
        }
        ("rate", "ns" | "us" | "ms" | "s" | "min") => {
            format!("{unit} is a time, expected a rate; {example}")
        }
        _ => format!("the units are {units}"),
    };
    UnitError { found: format!("has the unknown unit \"{unit}\""), expected }
}

fn too_long(text: &str) -> UnitError {
    UnitError { found: format!("is \"{text}\", which is too long"), expected: "at most 213 days".into() }
}

fn impossible(text: &str) -> UnitError {
    UnitError { found: format!("is \"{text}\""), expected: "rates go from 0.001 Hz to 100 kHz".into() }
}

impl core::fmt::Display for TimeSpan {
    /// Formats in the largest unit that needs at most three decimals: `1.5 ms`, `200 us`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let units = [("s", 1_000_000_000u64), ("ms", 1_000_000), ("us", 1_000), ("ns", 1)];
        let fits = |scale: &u64| self.ns >= *scale && ((self.ns % scale) * 1_000).is_multiple_of(*scale);
        let (unit, scale) = units.into_iter().find(|(_, scale)| fits(scale)).unwrap_or(("ns", 1));
        let thousandths = (self.ns % scale) * 1_000 / scale;
        let fraction = format!("{thousandths:03}");
        match fraction.trim_end_matches('0') {
            "" => write!(f, "{} {unit}", self.ns / scale),
            fraction => write!(f, "{}.{fraction} {unit}", self.ns / scale),
        }
    }
}

impl core::fmt::Display for Rate {
    /// Formats in Hz or kHz with at most three decimals: `1 kHz`, `62.5 Hz`.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let hz = 1e9 / self.period_ns as f64;
        let (value, unit) = if hz >= 999.999_5 { (hz / 1e3, "kHz") } else { (hz, "Hz") };
        let text = format!("{value:.3}");
        write!(f, "{} {unit}", text.trim_end_matches('0').trim_end_matches('.'))
    }
}

impl Serialize for TimeSpan {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for TimeSpan {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;

        impl serde::de::Visitor<'_> for Text {
            type Value = TimeSpan;

            fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str("a time with its unit, such as \"200 us\"")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<TimeSpan, E> {
                text.parse().map_err(|UnitError { found, expected }| {
                    E::custom(format!("the time {found}: {expected}"))
                })
            }
        }

        deserializer.deserialize_str(Text)
    }
}

impl schemars::JsonSchema for TimeSpan {
    fn schema_name() -> Cow<'static, str> {
        "TimeSpan".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "A time with its unit (ns, us, ms, s, min), such as \"200 us\".",
            "type": "string",
            "pattern": r"^\s*[0-9]+(\.[0-9]*)?\s*(ns|us|µs|μs|ms|s|min)\s*$",
        })
    }
}

impl schemars::JsonSchema for Rate {
    fn schema_name() -> Cow<'static, str> {
        "Rate".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "A rate with its unit (Hz, kHz), from 0.001 Hz to 100 kHz, such as \"1 kHz\".",
            "type": "string",
            "pattern": r"^\s*[0-9]+(\.[0-9]*)?\s*[kK]?[hH][zZ]\s*$",
        })
    }
}
