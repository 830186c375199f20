//! Axes: mapping of values to positions, and tick marks.

/// An axis: maps values to positions in the plot.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    log: bool,
}

/// Margin of a value axis beyond its data, as a fraction of their range.
const MARGIN: f64 = 0.04;

impl Axis {
    /// Creates the axis of the independent variable, such as time. The axis begins and ends with the data.
    pub(super) fn along(values: impl Iterator<Item = f64>, log: bool) -> Self {
        Self::fit(values, log, 0.0)
    }

    /// Creates the axis of the values. The axis extends a little beyond the values, and to zero if the values
    /// nearly reach zero.
    pub(super) fn values(values: impl Iterator<Item = f64>, log: bool) -> Self {
        Self::fit(values, log, MARGIN)
    }

    fn fit(values: impl Iterator<Item = f64>, log: bool, margin: f64) -> Self {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for value in values.filter(|value| value.is_finite() && (!log || *value > 0.0)) {
            range = [range[0].min(value), range[1].max(value)];
        }
        let [mut low, mut high] = if range[0] > range[1] { [0.1, 1.0] } else { range };
        if log {
            (low, high) =
                (10.0_f64.powf((low.log10() - 0.05).floor()), 10.0_f64.powf((high.log10() + 0.02).ceil()));
            return Self { low, high, log };
        }
        if high - low <= 1e-12 * (1.0 + high.abs()) {
            // A single value: add a range on either side.
            let half = if high == 0.0 { 0.5 } else { 0.1 * high.abs() };
            (low, high) = (low - half, high + half);
        }
        if margin > 0.0 {
            let width = high - low;
            let near_zero = low > 0.0 && low < 0.5 * width;
            low = if near_zero {
                0.0
            } else if low == 0.0 {
                low
            } else {
                low - margin * width
            };
            high += margin * width;
        }
        Self { low, high, log }
    }

    /// Returns the position along the axis, from 0 to 1.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        let at = |x: f64| if self.log { x.max(self.low * 1e-3).log10() } else { x };
        ((at(value) - at(self.low)) / (at(self.high) - at(self.low))).clamp(0.0, 1.0)
    }

    /// Returns round values within the range, with their labels: about `count`, or one per decade.
    pub(super) fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        if self.log {
            let decades = self.low.log10().round() as i32..=self.high.log10().round() as i32;
            return decades.map(|d| (10.0_f64.powi(d), number(10.0_f64.powi(d)))).collect();
        }
        let raw = (self.high - self.low) / count;
        let power = 10.0_f64.powf(raw.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * power).find(|step| *step >= raw).unwrap_or(raw);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        // All marks of an axis have the same number of digits, and zero has no sign.
        let words = |value: f64| match value.abs() {
            size if digits > 4 || size >= 1e6 => number(value),
            _ => format!("{value:.digits$}"),
        };
        (first..=last).map(|k| (k as f64 * step + 0.0, words(k as f64 * step + 0.0))).collect()
    }
}

/// Formats a number for an axis: three decimals without trailing zeros. Very small and very large numbers are
/// written with a power of ten.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        "0".into()
    } else if value.abs() < 1e-3 || value.abs() >= 1e5 {
        format!("{value:.0e}")
    } else {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        let words = |low: f64, high: f64| {
            let axis = Axis::along([low, high].into_iter(), false);
            axis.ticks(5.0).into_iter().map(|(_, text)| text).collect::<Vec<_>>()
        };
        assert_eq!(words(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(words(-0.013, 0.028), ["-0.01", "0.00", "0.01", "0.02"]);
        assert_eq!(words(-1200.0, 900.0), ["-1000", "-500", "0", "500"]);
    }

    #[test]
    fn axis_fits_values_and_shows_zero_only_nearby() {
        let ends = |values: [f64; 2]| {
            let axis = Axis::values(values.into_iter(), false);
            [axis.low, axis.high]
        };
        assert_eq!(ends([1.0, 10.0])[0], 0.0);
        let [low, high] = ends([100.0, 101.0]);
        assert!((99.9..100.0).contains(&low) && (101.0..101.1).contains(&high), "{low} {high}");
        assert!(ends([-2.0, -1.0])[1] < -0.9);
        let [low, high] = ends([3.0, 3.0]);
        assert!(low < 3.0 && high > 3.0);
    }
}
