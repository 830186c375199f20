//! TOML text of a draft profile.

use std::fmt::Write as _;

use nalgebra::Isometry3;

use crate::BasePose;

/// Maximum width of a line, in characters.
const WIDTH: usize = 100;

/// Rounds a number to two digits.
pub(super) fn rounded(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

/// Rounds a length in m to micrometres, or an angle in rad likewise; never to -0.
pub(super) fn micrometres(number: f64) -> f64 {
    (number * 1e6).round() / 1e6 + 0.0
}

pub(super) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// Returns the key of a table, quoted if required.
pub(super) fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.to_string() } else { quoted(name) }
}

pub(super) fn strings(key: &str, values: &[String]) -> String {
    list(key, values.iter().map(|value| quoted(value)))
}

pub(super) fn numbers(key: &str, values: impl Iterator<Item = f64>) -> String {
    list(
        key,
        values.map(|value| match value {
            value if value.is_infinite() => "inf".to_string(),
            value => format!("{:?}", micrometres(value)),
        }),
    )
}

/// Formats a key with a list, over several lines if it is long.
pub(super) fn list(key: &str, values: impl Iterator<Item = String>) -> String {
    let values: Vec<String> = values.collect();
    let inline = format!("{key} = [{}]\n", values.join(", "));
    if inline.len() <= WIDTH {
        return inline;
    }
    let mut text = format!("{key} = [\n");
    let mut line = String::new();
    for value in values {
        if !line.is_empty() && line.len() + value.len() + 2 > WIDTH - 4 {
            let _ = writeln!(text, "    {}", line.trim_end());
            line.clear();
        }
        let _ = write!(line, "{value}, ");
    }
    let _ = writeln!(text, "    {}\n]", line.trim_end());
    text
}

/// Formats the entry of a base pose.
pub(super) fn base_pose(key: &str, pose: &Isometry3<f64>) -> String {
    let BasePose { position, rpy } = BasePose::from_isometry(pose);
    let list = |values: [f64; 3]| values.map(|value| format!("{:?}", micrometres(value))).join(", ");
    format!("{key} = {{ position = [{}], rpy = [{}] }}\n", list(position), list(rpy))
}
