//! The results of components as text: figures with their units on lines that fit a terminal.

use serde_json::Value;

/// Maximum width of a summary in columns.
pub(super) const WIDTH: usize = 80;

/// Maximum number of list values that are printed; the rest are counted.
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

/// Returns the result of a component as text. Its own figures follow a heading of `heading` columns; each
/// part and each list of joints begins a line. Counters that are zero and figures without a value are left
/// out.
pub(super) fn lines(heading: usize, result: &Value) -> String {
    let mut text = String::new();
    for group in groups(result) {
        let (mut used, indent) = match group.name.as_str() {
            "" => (heading, 4),
            name => {
                text.push_str(&format!("\n    {name}: "));
                (name.chars().count() + 6, 6)
            }
        };
        for (index, figure) in group.figures.iter().enumerate() {
            let length = figure.chars().count();
            // a comma follows
            if used > indent && used + length + 3 > WIDTH {
                let text_before = text.trim_end().len();
                text.truncate(text_before);
                text.push_str(if index == 0 { "\n" } else { ",\n" });
                text.push_str(&" ".repeat(indent));
                used = indent;
            } else if index > 0 {
                text.push_str(", ");
                used += 2;
            }
            used += length;
            text.push_str(figure);
        }
    }
    for warning in warnings(result) {
        text.push_str(&format!("\n    warning: {warning}"));
    }
    text
}

/// Returns the figures of a result with their units, then its parts and lists of joints, one item each.
pub(crate) fn items(result: &Value) -> Vec<String> {
    let items = groups(result).into_iter().flat_map(|group| match group.name.as_str() {
        "" => group.figures,
        name => vec![format!("{name}: {}", group.figures.join(", "))],
    });
    items.collect()
}

/// Figures that belong together: a result's own (without a name), a part's, or one for each joint.
#[derive(Debug, Default)]
struct Group {
    /// Path of the part or the list.
    name: String,
    figures: Vec<String>,
}

/// Returns the figures of a result with their units, part by part.
fn groups(result: &Value) -> Vec<Group> {
    let mut groups = Vec::new();
    collect("", result, result, &mut groups);
    groups.retain(|group| !group.figures.is_empty());
    groups
}

/// The key of warnings, which are printed on separate lines.
const WARNINGS: &str = "warnings";

pub(crate) fn warnings(result: &Value) -> impl Iterator<Item = &str> {
    result.get(WARNINGS).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
}

/// Collects the figures of a part of a `whole` result. A figure of a part is omitted if the whole has one of
/// the same name and value.
fn collect(path: &str, value: &Value, whole: &Value, groups: &mut Vec<Group>) {
    let own = groups.len();
    groups.push(Group { name: path.to_string(), figures: Vec::new() });
    let Value::Object(values) = value else {
        groups[own].figures.extend(figure("", value));
        return;
    };
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
                let figures = joints.iter().zip(numbers);
                let figures = figures.map(|(joint, number)| format!("{joint} {}", scalar(number))).collect();
                groups.push(Group { name: path, figures });
            }
            (_, Value::Object(_)) => collect(&path, value, whole, groups),
            (_, Value::Array(values)) if values.iter().any(|value| value.is_object() || value.is_array()) => {
                for (index, value) in values.iter().enumerate() {
                    collect(&format!("{path}.{index}"), value, whole, groups);
                }
            }
            _ => groups[own].figures.extend(figure(name, value)),
        }
    }
}

/// The key of the names to which lists of as many numbers belong.
const JOINTS: &str = "joints";

/// Returns the names of joints that a result gives for its lists.
fn names_of_joints(values: &serde_json::Map<String, Value>) -> Option<Vec<&str>> {
    let names: Vec<&str> = values.get(JOINTS)?.as_array()?.iter().filter_map(Value::as_str).collect();
    (names.len() == values[JOINTS].as_array()?.len()).then_some(names)
}

/// Returns a value with its name and unit; `None` for counters that are zero and for missing values.
fn figure(name: &str, value: &Value) -> Option<String> {
    let text = match value {
        Value::Null => return None,
        Value::Number(number) if number.as_u64() == Some(0) => return None,
        Value::Array(values) if values.is_empty() => return None,
        Value::Array(values) => {
            let mut listed: Vec<String> = values.iter().take(LISTED).map(scalar).collect();
            if values.len() > LISTED {
                listed.push(format!("... {} in all", values.len()));
            }
            format!("{name} [{}]", listed.join(", "))
        }
        value => match UNITS.iter().find(|(ending, _)| value.is_number() && name.ends_with(ending)) {
            Some((ending, unit)) => {
                format!("{} {} {unit}", &name[..name.len() - ending.len()], scalar(value))
            }
            None => format!("{name} {}", scalar(value)),
        },
    };
    Some(text.trim_start().to_string())
}

fn scalar(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => decimal(number.as_f64().unwrap_or(f64::NAN)),
        Value::String(text) => text.clone(),
        value => value.to_string(),
    }
}

/// Returns a number with four digits; powers of ten only far from one.
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
    fn numbers_have_four_readable_digits() {
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
        assert_eq!(lines(0, &result), "base [1, 2, 3]\n    joint_position: hip 0.5, knee 0");
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
        let own = "goals_reached 4, position_error 0.75 m";
        let hand = "tasks.hand: last_position_error 0.25 m, position_error 0.5 m";
        assert_eq!(figures, format!("{own}\n    {hand}"));
        assert_eq!(items(&result), ["goals_reached 4", "position_error 0.75 m", hand]);
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
            "\n    tasks.hand: angle 0.5 rad",
            "\n    path.0: terms 3",
            "\n    path.1: terms 5",
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
