//! Times that components need to declare themselves.

use std::fmt::Write as _;

use motorium::graph::{DECLARE_BOUND_NS, DeclareTime};
use motorium::units::TimeSpan;
use serde_json::{Value, json};

use crate::style;

/// Returns the times as JSON.
pub(super) fn to_json(times: &[DeclareTime]) -> Value {
    let time = |time: &DeclareTime| {
        json!({
            "component": time.component,
            "wall_ns": time.wall_ns,
            "bound_ns": DECLARE_BOUND_NS,
            "within_bound": time.wall_ns <= DECLARE_BOUND_NS,
        })
    };
    times.iter().map(time).collect()
}

/// Warnings for components that exceed their bound.
pub(super) fn warnings(times: &[DeclareTime]) -> String {
    let mut text = String::new();
    for DeclareTime { component, wall_ns } in times.iter().filter(|time| time.wall_ns > DECLARE_BOUND_NS) {
        let (took, bound) =
            (TimeSpan { ns: wall_ns / 1_000_000 * 1_000_000 }, TimeSpan { ns: DECLARE_BOUND_NS });
        let _ = writeln!(
            text,
            "{}: component `{component}` took {took} to declare itself, more than {bound}\n  every check and every \
             start waits for this: move long computations from `declare` to `configure`\n",
            style::warning("warning"),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_slow_declarations_cause_a_warning() {
        let time = |component: &str, wall_ns| DeclareTime { component: component.to_string(), wall_ns };
        let times = [time("quick", DECLARE_BOUND_NS), time("slow", 1_234_567_890)];
        let text = warnings(&times);
        assert!(text.contains("component `slow` took 1.234 s to declare itself, more than 100 ms"), "{text}");
        assert!(!text.contains("quick"), "{text}");
        let data = to_json(&times);
        assert_eq!((&data[0]["within_bound"], &data[1]["within_bound"]), (&json!(true), &json!(false)));
    }
}
