//! Kinds as text, 80 columns wide.

use std::fmt::Write as _;

use motorium::declare::{Direction, ParameterDeclaration, ParameterValue, TopicPattern};
use serde_json::Value as Json;

use super::keys::Key;
use super::sheet::{Port, Sheet};
use super::source::KindSource;
use crate::style;

/// Line width in characters.
const WIDTH: usize = 80;

/// Returns one line for each kind.
pub(super) fn list(kinds: &[KindSource<'_>]) -> String {
    let width = kinds.iter().map(|kind| kind.name().len()).max().unwrap_or(0);
    let mut text = String::new();
    for kind in kinds {
        let lines = wrapped(kind.summary(), WIDTH - width - 2);
        for (index, line) in lines.iter().enumerate() {
            let name = if index == 0 { kind.name() } else { "" };
            let _ = writeln!(text, "{}  {line}", style::strong(format!("{name:width$}")));
        }
    }
    text
}

/// Returns everything about a kind.
pub(super) fn sheet(sheet: &Sheet) -> String {
    let mut text = String::new();
    for (index, line) in wrapped(&format!("{}: {}", sheet.kind, sheet.summary), WIDTH).iter().enumerate() {
        let line = match (index, line.strip_prefix(&sheet.kind)) {
            (0, Some(rest)) => format!("{}{rest}", style::strong(&sheet.kind)),
            _ => line.clone(),
        };
        let _ = writeln!(text, "{line}");
    }
    if let Some(program) = &sheet.program {
        let _ = writeln!(text, "{}", style::dim(format!("hosted by {}", program.display())));
    }
    if let Some(page) = &sheet.page {
        let _ = writeln!(text, "{}", style::dim(format!("page of the book: {page}")));
    }
    let with = match &sheet.robot {
        Some(robot) => format!(", with the example below and the robot `{robot}`"),
        None => ", with the example below".to_string(),
    };
    if let Some(error) = &sheet.refused {
        paragraph(
            &mut text,
            0,
            &format!("\n{}: the ports are not known: {error}", style::warning("warning")),
        );
    } else {
        heading(&mut text, &format!("ports{with}"));
        sheet.ports.iter().for_each(|one| port(&mut text, one));
        if sheet.ports.is_empty() {
            text.push_str("  none\n");
        }
        heading(&mut text, "parameters");
        sheet.parameters.iter().for_each(|one| parameter(&mut text, one));
        if sheet.parameters.is_empty() {
            text.push_str("  none\n");
        }
    }
    heading(&mut text, "configuration");
    sheet.config.iter().for_each(|one| key(&mut text, one));
    if sheet.config.is_empty() {
        text.push_str("  none\n");
    }
    heading(&mut text, "example");
    text + &sheet.example
}

fn heading(text: &mut String, title: &str) {
    let _ = writeln!(text, "\n{}", style::strong(title));
}

fn port(text: &mut String, port: &Port) {
    let direction = match (port.direction, port.required) {
        (Direction::Input, true) => "input, required",
        (Direction::Input, false) => "input",
        (Direction::Output, _) => "output",
    };
    let pattern = match port.pattern {
        TopicPattern::State => String::new(),
        TopicPattern::Stream { capacity } => format!(", stream of {capacity}"),
        TopicPattern::Slices { capacity, longest: 0 } => format!(", slices, {capacity} deep"),
        TopicPattern::Slices { capacity, longest } => format!(", slices of {longest}, {capacity} deep"),
    };
    let _ = writeln!(text, "  {}  {direction}, {}{pattern}", style::strong(&port.name), port.message);
    paragraph(text, 6, &port.description);
}

fn parameter(text: &mut String, parameter: &ParameterDeclaration) {
    let mut facts = match &parameter.default {
        ParameterValue::Boolean(_) => "true or false".to_string(),
        ParameterValue::Integer(_) => "whole number".to_string(),
        ParameterValue::Float(_) => "number".to_string(),
        ParameterValue::Choice(_) => parameter.choices.join(" or "),
        ParameterValue::Array(values) => format!("list of {} numbers", values.len()),
    };
    match (parameter.min, parameter.max) {
        (Some(low), Some(high)) => facts += &format!(", {} to {}", short(low), short(high)),
        (Some(low), None) => facts += &format!(", at least {}", short(low)),
        (None, Some(high)) => facts += &format!(", at most {}", short(high)),
        (None, None) => {}
    }
    if !parameter.unit.is_empty() {
        facts += &format!(" {}", parameter.unit);
    }
    let default = match &parameter.default {
        ParameterValue::Float(value) => short(*value),
        other => other.to_string(),
    };
    entry(text, &parameter.name, &format!("{facts}; default {default}"));
    paragraph(text, 6, &parameter.doc);
}

fn key(text: &mut String, key: &Key) {
    let mut facts = key.kind.clone();
    match (&key.minimum, &key.maximum) {
        (Some(low), Some(high)) => facts += &format!(", {low} to {high}"),
        (Some(low), None) => facts += &format!(", at least {low}"),
        (None, Some(high)) => facts += &format!(", at most {high}"),
        (None, None) => {}
    }
    if key.required {
        facts += "; required";
    }
    // most descriptions already contain the default, in the unit of the key
    if let Some(default) = key.default.as_ref().filter(|_| !key.description.contains("efault")) {
        facts += &format!("; default {}", value(default));
    }
    entry(text, &key.key, &facts);
    paragraph(text, 6, &key.description);
}

/// Formats a value as in a graph file.
fn value(json: &Json) -> String {
    match json {
        Json::Number(number) if number.is_f64() => short(number.as_f64().unwrap_or_default()),
        Json::Array(values) => format!("[{}]", values.iter().map(value).collect::<Vec<_>>().join(", ")),
        Json::Object(table) => {
            let kept = table.iter().filter(|(_, value)| !value.is_null());
            let entries: Vec<String> = kept.map(|(key, one)| format!("{key} = {}", value(one))).collect();
            if entries.is_empty() { "{}".to_string() } else { format!("{{ {} }}", entries.join(", ")) }
        }
        json => json.to_string(),
    }
}

/// Formats a number with all its digits, with an exponent only far from one.
fn short(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_string(),
        1e-3..1e6 => number.to_string(),
        _ => format!("{number:e}"),
    }
}

/// Adds a name and its facts, continued on further lines if needed.
fn entry(text: &mut String, name: &str, facts: &str) {
    let room = WIDTH.saturating_sub(name.chars().count() + 4);
    let first = wrapped(facts, room).into_iter().next().unwrap_or_default();
    let rest = facts.split_whitespace().skip(first.split_whitespace().count()).collect::<Vec<_>>().join(" ");
    let _ = writeln!(text, "  {}  {first}", style::strong(name));
    paragraph(text, 6, &rest);
}

fn paragraph(text: &mut String, indent: usize, words: &str) {
    for line in wrapped(words, WIDTH - indent) {
        let _ = writeln!(text, "{:indent$}{line}", "");
    }
}

/// Wraps a text at blanks to at most `width` characters.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}
