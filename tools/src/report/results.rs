//! The results of components as text: one figure after the other, with its unit, on lines that fit a
//! terminal.

use serde_json::Value;

/// Columns that a summary takes at most.
pub(super) const WIDTH: usize = 80;

/// Values of a list that are printed; the rest are counted.
const LISTED: usize = 8;

/// Units that end the names of figures.
const UNITS: [(&str, &str); 9] = [
    ("_rad_s", "rad/s"),
    ("_m_s", "m/s"),
    ("_percent", "%"),
    ("_rad", "rad"),
    ("_hz", "Hz"),
    ("_ns", "ns"),
    ("_us", "us"),
    ("_s", "s"),
    ("_m", "m"),
];

/// A result of a component, by figures: values within values by their paths. Counters that are zero and
/// figures without a value are left out. Lines after the first begin with blanks; the first has `heading`
/// columns before it.
pub(super) fn lines(heading: usize, result: &Value) -> String {
    let mut text = String::new();
    let mut used = heading;
    for figure in figures(result) {
        let length = figure.chars().count();
        // a comma follows
        if used > 4 && used + length + 3 > WIDTH {
            text.push_str(if text.is_empty() { "\n    " } else { ",\n    " });
            used = 4;
        } else if !text.is_empty() {
            text.push_str(", ");
            used += 2;
        }
        used += length;
        text.push_str(&figure);
    }
    for warning in warnings(result) {
        text.push_str(&format!("\n    warning: {warning}"));
    }
    text
}

/// The figures of a result, each with its path and its unit.
pub(crate) fn figures(result: &Value) -> Vec<String> {
    let mut figures = Vec::new();
    collect("", result, result, &mut figures);
    figures
}

/// The key of warnings, which are printed on separate lines.
const WARNINGS: &str = "warnings";

pub(crate) fn warnings(result: &Value) -> impl Iterator<Item = &str> {
    result.get(WARNINGS).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
}

/// Collects the figures of a value within a `whole` result. A figure of a part that the whole has, too, under
/// the same name and of the same value, is left out.
fn collect(path: &str, value: &Value, whole: &Value, figures: &mut Vec<String>) {
    match value {
        Value::Object(values) => {
            let joints = names_of_joints(values);
            for (name, value) in values.iter().filter(|(name, _)| joints.is_none() || *name != JOINTS) {
                if path.is_empty() && name == WARNINGS && warnings(whole).next().is_some()
                    || !path.is_empty() && value.is_number() && whole.get(name) == Some(value)
                {
                    continue;
                }
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                match (&joints, value) {
                    (Some(joints), Value::Array(numbers))
                        if numbers.len() == joints.len() && numbers.iter().all(Value::is_number) =>
                    {
                        // one figure for each joint: the lines break between them
                        figures.extend(joints.iter().zip(numbers).enumerate().map(
                            |(index, (joint, number))| {
                                let number = scalar(number);
                                if index == 0 {
                                    format!("{path}: {joint} {number}")
                                } else {
                                    format!("{joint} {number}")
                                }
                            },
                        ));
                    }
                    _ => collect(&path, value, whole, figures),
                }
            }
        }
        Value::Array(values) if values.iter().any(|value| value.is_object() || value.is_array()) => {
            for (index, value) in values.iter().enumerate() {
                collect(&format!("{path}.{index}"), value, whole, figures);
            }
        }
        Value::Array(values) if values.is_empty() => {}
        Value::Array(values) => {
            let mut listed: Vec<String> = values.iter().take(LISTED).map(scalar).collect();
            if values.len() > LISTED {
                listed.push(format!("... {} in all", values.len()));
            }
            figures.push(format!("{path} [{}]", listed.join(", ")));
        }
        Value::Null => {}
        Value::Number(number) if number.as_u64() == Some(0) => {}
        value => figures.push(figure(path, value)),
    }
}

/// The key of the names to which lists of as many numbers belong.
const JOINTS: &str = "joints";

/// The names of joints that a result gives for its lists.
fn names_of_joints(values: &serde_json::Map<String, Value>) -> Option<Vec<&str>> {
    let names: Vec<&str> = values.get(JOINTS)?.as_array()?.iter().filter_map(Value::as_str).collect();
    (names.len() == values[JOINTS].as_array()?.len()).then_some(names)
}

fn figure(path: &str, value: &Value) -> String {
    let unit = UNITS.iter().find(|(ending, _)| value.is_number() && path.ends_with(ending));
    match unit {
        Some((ending, unit)) => format!("{} {} {unit}", &path[..path.len() - ending.len()], scalar(value)),
        None => format!("{path} {}", scalar(value)),
    }
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => decimal(number.as_f64().unwrap_or(f64::NAN)),
        Value::String(text) => text.clone(),
        value => value.to_string(),
    }
}

/// A number with four digits; powers of ten only far from one.
pub(crate) fn decimal(number: f64) -> String {
    let magnitude = number.abs();
    if number == 0.0 {
        return "0".to_string();
    }
    if !(1e-3..1e6).contains(&magnitude) {
        return format!("{number:.2e}");
    }
    let digits = (3 - magnitude.log10().floor() as i32).max(0) as usize;
    let text = format!("{number:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn numbers_are_written_as_people_read_them() {
        for (number, text) in [
            (1.445, "1.445"),
            (0.5, "0.5"),
            (12.0, "12"),
            (-0.012_345, "-0.01235"),
            (123_456.7, "123457"),
            (6.9e-5, "6.90e-5"),
            (2.5e9, "2.50e9"),
            (0.0, "0"),
        ] {
            assert_eq!(decimal(number), text);
        }
    }

    #[test]
    fn lists_with_a_number_for_each_joint_name_the_joints() {
        let result =
            json!({ "joints": ["hip", "knee"], "joint_position": [0.5, 0.0], "base": [1.0, 2.0, 3.0] });
        assert_eq!(lines(0, &result), "base [1, 2, 3], joint_position: hip 0.5, knee 0");
        let result = json!({ "joints": [0.5, 0.25] });
        assert_eq!(lines(0, &result), "joints [0.5, 0.25]", "numbers are no names");
    }

    #[test]
    fn result_skips_repeated_figures_and_lists_warnings() {
        let task = json!({ "goals_reached": 4, "position_error_m": 0.5, "last_position_error_m": 0.25 });
        let result = json!({ "goals_reached": 4, "position_error_m": 0.75, "tasks": { "hand": task },
                             "warnings": ["the hand is hot", "the foot is cold"] });
        let text = lines(0, &result);
        let (figures, warnings) = text.split_once("\n    warning: ").expect("a warning");
        assert_eq!(warnings, "the hand is hot\n    warning: the foot is cold");
        let figures: Vec<&str> = figures.split(',').map(str::trim).collect();
        for figure in ["goals_reached 4", "position_error 0.75 m", "tasks.hand.position_error 0.5 m"] {
            assert!(figures.contains(&figure), "{figure}: {text}");
        }
        assert!(!text.contains("tasks.hand.goals_reached"), "{text}");
    }

    #[test]
    fn figures_have_units_and_paths_and_no_zeros() {
        let result = json!({
            "position_error_m": 0.0123, "goals_missed": 0, "goals_reached": 4, "phase": "resting", "none": null,
            "tasks": { "hand": { "angle_rad": 0.5, "refused": 0 } }, "path": [{ "terms": 3 }, { "terms": 5 }],
            "joints": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], "warnings": [], "finished": true,
        });
        let text = lines(0, &result);
        for figure in [
            "position_error 0.0123 m",
            "goals_reached 4",
            "phase resting",
            "tasks.hand.angle 0.5 rad",
            "path.0.terms 3",
            "path.1.terms 5",
            "joints [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, ... 9 in all]",
            "finished true",
        ] {
            assert!(text.contains(figure), "{figure}: {text}");
        }
        for absent in ["goals_missed", "none", "refused", "warnings"] {
            assert!(!text.contains(absent), "{absent}: {text}");
        }
        assert!(
            text.lines().count() > 1 && text.lines().all(|line| line.chars().count() <= WIDTH + 1),
            "{text}"
        );
    }
}
