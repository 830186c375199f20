//! The axis of a timeline: positions and labels of its marks.

use super::labels;

/// Maximum number of parts between the marks of an axis.
const MOST_PARTS: u64 = 8;

/// Distance of the marks on an axis of this length, ns: 1, 2, 2.5 or 5 times a power of ten, for about four
/// to eight marks.
pub(super) fn grain(length_ns: u64) -> u64 {
    let mut power = 1u64;
    loop {
        for step in [power, power * 2, power * 5 / 2, power * 5] {
            if step > 0 && (power > 1 || step != 2) && length_ns.div_ceil(step) <= MOST_PARTS {
                return step;
            }
        }
        match power.checked_mul(10) {
            Some(next) if next < u64::MAX / 10 => power = next,
            _ => return length_ns.max(1),
        }
    }
}

/// The marks: times from 0 to the end of the axis, ns.
pub(super) fn marks(length_ns: u64) -> Vec<u64> {
    let grain = grain(length_ns);
    (0..=length_ns / grain).map(|index| index * grain).collect()
}

/// A time on the axis.
pub(super) fn mark(ns: u64) -> String {
    if ns == 0 { "0".to_string() } else { labels::time(ns) }
}

/// A share in whole percent; small shares are not rounded to zero.
pub(super) fn percent(part_ns: u64, whole_ns: u64) -> String {
    let percent = part_ns as f64 * 100.0 / whole_ns.max(1) as f64;
    if part_ns > 0 && percent < 1.0 { "<1 %".to_string() } else { format!("{percent:.0} %") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_round_and_of_suitable_number() {
        assert_eq!(marks(1_000_000), [0, 200_000, 400_000, 600_000, 800_000, 1_000_000]);
        assert_eq!(grain(50_000_000), 10_000_000);
        for length in [7u64, 100, 999, 4_321, 123_456_789, u64::MAX / 4] {
            let count = marks(length).len();
            assert!((2..=9).contains(&count), "{length}: {count}");
        }
        assert_eq!(marks(1), [0, 1]);
    }

    #[test]
    fn small_durations_stay_visible() {
        assert_eq!(percent(0, 100), "0 %");
        assert_eq!(percent(1, 1_000), "<1 %");
        assert_eq!(percent(70, 100), "70 %");
    }
}
