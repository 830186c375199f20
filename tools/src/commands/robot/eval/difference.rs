//! Comparison of the results in the input with motorium's results.

use std::collections::BTreeMap;

use serde_json::Value;

/// Quantities that are inputs, not results.
const GIVEN: [&str; 6] = ["q", "joint_positions", "v", "a", "tau", "fext"];

/// Returns, for every quantity in both documents, its number of occurrences and the largest difference
/// relative to its largest entry.
pub(super) fn differences(theirs: &Value, ours: &Value) -> BTreeMap<String, (usize, f64)> {
    let mut found = BTreeMap::new();
    let list =
        |document: &Value| document.as_array().or(document["cases"].as_array()).cloned().unwrap_or_default();
    for (theirs, ours) in list(theirs).iter().zip(list(ours).iter()) {
        let (Some(theirs), Some(ours)) = (theirs.as_object(), ours.as_object()) else { continue };
        for (key, theirs) in theirs.iter().filter(|(key, _)| !GIVEN.contains(&key.as_str())) {
            match (key.as_str(), theirs, ours.get(key)) {
                ("frames", Value::Object(theirs), Some(ours)) => {
                    for (frame, theirs) in theirs {
                        for (key, theirs) in theirs.as_object().into_iter().flatten() {
                            note(&format!("frames.{key}"), theirs, ours[frame].get(key), &mut found);
                        }
                    }
                }
                (_, theirs, ours) => note(key, theirs, ours, &mut found),
            }
        }
    }
    found
}

fn note(key: &str, theirs: &Value, ours: Option<&Value>, found: &mut BTreeMap<String, (usize, f64)>) {
    let (mut given, mut computed) = (Vec::new(), Vec::new());
    flatten(theirs, &mut given);
    if given.is_empty() {
        return;
    }
    if let Some(ours) = ours {
        flatten(ours, &mut computed);
    }
    let worst = if given.len() == computed.len() {
        let largest = given.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let apart = given.iter().zip(&computed).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
        // If all entries are zero, a rounding error of 1e-15 is not infinite: compare with 1 instead.
        apart / if largest > 1e-6 { largest } else { 1.0 }
    } else {
        f64::INFINITY
    };
    let entry = found.entry(key.to_string()).or_insert((0, 0.0));
    *entry = (entry.0 + 1, entry.1.max(worst));
}

/// Appends all numbers of a value to `numbers`, in order.
fn flatten(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Array(entries) => entries.iter().for_each(|entry| flatten(entry, numbers)),
        value => numbers.extend(value.as_f64()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn differences_are_relative_to_the_largest_entry() {
        let theirs = json!({ "cases": [
            { "q": [1.0], "rnea": [2.0, -4.0], "frames": { "a": { "p": [1.0, 0.0] } }, "aba": [1.0], "note": "x" },
            { "rnea": [0.0, 0.0] },
        ] });
        let ours = json!({ "cases": [
            { "q": [9.0], "rnea": [2.0, -4.4], "frames": { "a": { "p": [1.0, 0.5] } }, "aba": null },
            { "rnea": [0.0, 1e-3] },
        ] });
        let found = differences(&theirs, &ours);
        assert_eq!(found.keys().collect::<Vec<_>>(), ["aba", "frames.p", "rnea"]);
        assert_eq!(found["aba"], (1, f64::INFINITY));
        assert_eq!(found["frames.p"], (1, 0.5));
        assert_eq!(found["rnea"].0, 2);
        assert!((found["rnea"].1 - 0.1).abs() < 1e-12);
    }
}
