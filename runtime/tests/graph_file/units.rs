//! Times and rates.

use motorium::units::{Rate, TimeSpan, UnitError};
use proptest::prelude::*;

fn ns(text: &str) -> Result<u64, UnitError> {
    text.parse::<TimeSpan>().map(|time| time.ns)
}

fn period(text: &str) -> Result<u64, UnitError> {
    text.parse::<Rate>().map(|rate| rate.period_ns)
}

#[test]
fn times_are_exact() {
    for (text, expected) in [
        ("1 ns", 1),
        ("200 us", 200_000),
        ("200us", 200_000),
        ("200 µs", 200_000),
        ("1.5 ms", 1_500_000),
        ("0.001 us", 1),
        ("10 s", 10_000_000_000),
        (" 2 min ", 120_000_000_000),
        ("0 us", 0),
        ("1. s", 1_000_000_000),
        // with floats the result would be one nanosecond less
        ("4.35 ms", 4_350_000),
        ("0.1 s", 100_000_000),
    ] {
        assert_eq!(ns(text), Ok(expected), "{text}");
    }
}

#[test]
fn invalid_times_are_refused_with_the_reason() {
    for (text, reason) in [
        ("", "is empty"),
        ("10", "without a unit"),
        ("s", "does not begin with a number"),
        (".5 s", "not a number"),
        ("1e3 us", "unknown unit \"e3 us\""),
        ("1.2.3 s", "not a number"),
        ("-1 s", "is negative"),
        ("+1 s", "not a number"),
        ("1 h", "unknown unit \"h\""),
        ("1 kHz", "unknown unit"),
        ("1 S", "unknown unit"),
        ("0.5 ns", "not a whole number of nanoseconds"),
        ("1000000 min", "too long"),
        ("99999999999999999999999999999999 s", "too many digits"),
        ("0.0000000000000000000000001 s", "too many digits"),
    ] {
        let error = ns(text).expect_err(text);
        assert!(error.found.contains(reason), "{text}: {error}");
        assert!(!error.expected.is_empty(), "{text}");
    }
    assert!(ns("1e3 us").expect_err("an exponent").expected.contains("without an exponent"));
    assert!(ns("1.5E-3 s").expect_err("an exponent").expected.contains("without an exponent"));
    assert!(ns("1,5 s").expect_err("a comma").expected.contains("decimals with a point"));
}

#[test]
fn rates_become_whole_nanoseconds() {
    for (text, expected) in [
        ("1 kHz", 1_000_000),
        ("1kHz", 1_000_000),
        ("1 khz", 1_000_000),
        ("200 Hz", 5_000_000),
        ("62.5 Hz", 16_000_000),
        ("60 Hz", 16_666_667),
        ("3 Hz", 333_333_333),
        ("0.001 Hz", 1_000_000_000_000),
        ("100 kHz", 10_000),
        ("0.5 kHz", 2_000_000),
    ] {
        assert_eq!(period(text), Ok(expected), "{text}");
    }
}

#[test]
fn invalid_rates_are_refused_with_the_reason() {
    for (text, reason) in [
        ("0 Hz", "never step"),
        ("0.00 kHz", "never step"),
        ("-5 Hz", "is negative"),
        ("1000", "without a unit"),
        ("100.001 kHz", "too fast"),
        ("0.0009 Hz", "too slow"),
        ("1 ms", "unknown unit \"ms\""),
        ("1 MHz", "unknown unit"),
    ] {
        let error = period(text).expect_err(text);
        assert!(error.found.contains(reason), "{text}: {error}");
    }
}

#[test]
fn times_and_rates_are_formatted_readably() {
    for text in ["1 kHz", "62.5 Hz", "200 Hz", "0.5 Hz", "12.5 kHz"] {
        assert_eq!(text.parse::<Rate>().expect(text).to_string(), text);
    }
    for text in ["200 us", "1.5 ms", "10 s", "1 ns", "1.234 us", "0 ns"] {
        assert_eq!(text.parse::<TimeSpan>().expect(text).to_string(), text);
    }
    assert_eq!(TimeSpan { ns: 1_000_001 }.to_string(), "1000.001 us");
}

proptest! {
    #[test]
    fn formatted_time_parses_to_the_same_value(ns_in in 0..u64::MAX / 1_000) {
        prop_assert_eq!(ns(&TimeSpan { ns: ns_in }.to_string()), Ok(ns_in));
    }

    #[test]
    fn whole_numbers_of_any_unit_are_scaled(number in 0u64..1_000_000, unit in 0usize..4) {
        let (name, scale) = [("ns", 1), ("us", 1_000), ("ms", 1_000_000), ("s", 1_000_000_000)][unit];
        prop_assert_eq!(ns(&format!("{number} {name}")), Ok(number * scale));
    }

    #[test]
    fn a_period_is_within_half_a_nanosecond(millihertz in 1u64..=100_000_000) {
        let text = format!("{}.{:03} Hz", millihertz / 1_000, millihertz % 1_000);
        let period_ns = period(&text).expect("a possible rate");
        // |period - 1/f| <= 1/2 ns, in whole numbers
        let error = (u128::from(period_ns) * u128::from(millihertz)).abs_diff(1_000_000_000_000);
        prop_assert!(2 * error <= u128::from(millihertz), "{}: {}", text, period_ns);
    }

    #[test]
    fn parsing_never_panics(text in "[0-9.+-]{0,30}[ ]?[a-zA-Zµ]{0,4}") {
        let _ = ns(&text);
        let _ = period(&text);
    }
}
