//! Patterns, components and times as text.

use motorium::declare::TopicPattern;
use motorium::plan::Plan;

/// Returns a pattern as text.
pub(super) fn pattern(pattern: TopicPattern) -> String {
    match pattern {
        TopicPattern::State => "state".to_string(),
        TopicPattern::Stream { capacity } => format!("stream of {capacity}"),
        TopicPattern::Slices { capacity, longest } => format!("slices of {longest}, {capacity} deep"),
    }
}

/// Returns the names of components by their indices.
pub(super) fn names(plan: &Plan, components: &[usize]) -> Vec<String> {
    components.iter().map(|&index| plan.components[index].name.clone()).collect()
}

/// Formats a time in a suitable unit.
pub(super) fn readable(ns: u64) -> String {
    let ns = ns as f64;
    match ns {
        _ if ns < 1e4 => format!("{ns:.0} ns"),
        _ if ns < 1e6 => format!("{:.1} us", ns * 1e-3),
        _ if ns < 1e9 => format!("{:.2} ms", ns * 1e-6),
        _ => format!("{:.2} s", ns * 1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::readable;

    #[test]
    fn times_are_printed_in_suitable_units() {
        let texts = [850, 22_300, 1_500_000, 12_345_000_000].map(readable);
        assert_eq!(texts, ["850 ns", "22.3 us", "1.50 ms", "12.35 s"]);
    }
}
