//! The values of a graph file: names, numbers, choices, units.

mod expectations;
mod number;
mod scheduling;
mod triple;

use std::borrow::Cow;

use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Serialize;
use toml::de::DeValue;

use super::diagnostic::Report;
use super::read::{At, Read, Value, entries, mismatch, table, text};
use super::source::Span;
use crate::declare::ParameterValue;
use crate::nearest::{list, nearest};
use crate::plan::{
    ClockKind, LimitPolicy, OnDenied, OnError, OnFailure, OnMiss, OnOverrun, RestartWhen, ResumeRule,
    SafeState,
};
use crate::units::{Rate, TimeSpan, UnitError};
pub(super) use expectations::Expectations;
pub(super) use number::Number;
pub(super) use scheduling::{EventSource, Schedule, Share, SpinChoice};
pub(super) use triple::Triple;

impl<'i> Read<'i> for String {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let text = text(key, value, "text", report)?;
        if text.trim().is_empty() {
            report
                .error(format!("`{key}` is empty"))
                .label(&value.span(), "expected some text")
                .advise(format!("give it a value, or leave `{key}` out"));
            return None;
        }
        Some(text.to_string())
    }
}

/// A name of a graph or a component: `[a-z0-9_-]+`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Name(pub String);

/// Maximum length of a component's name, in characters, because it is part of names in shared memory.
const LONGEST_NAME: usize = 64;
/// Maximum length of a topic's name.
const LONGEST_TOPIC: usize = 128;

fn name_character(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '_' | '-')
}

/// Checks the name of a graph or component.
pub(super) fn check_name(what: &str, name: &str, span: &Span, report: &mut Report) -> bool {
    check(what, name, &name_character, LONGEST_NAME, span, report)
}

/// Checks the name of a robot, which may have capital letters, such as `UR5e`.
pub(super) fn check_robot_name(name: &str, span: &Span, report: &mut Report) -> bool {
    let allowed = |c: char| name_character(c) || c.is_ascii_uppercase();
    check("a robot", name, &allowed, LONGEST_NAME, span, report)
}

fn check(
    what: &str,
    name: &str,
    allowed: &dyn Fn(char) -> bool,
    longest: usize,
    span: &Span,
    report: &mut Report,
) -> bool {
    let slash = if allowed('/') { ", `/`" } else { "" };
    let capitals = if allowed('A') { "`A`-`Z`, " } else { "" };
    if let Some(wrong) = name.chars().find(|c| !allowed(*c)) {
        let fixed: String = name
            .chars()
            .map(|c| {
                if allowed(c) {
                    c
                } else if allowed(c.to_ascii_lowercase()) {
                    c.to_ascii_lowercase()
                } else if c.is_whitespace() || c == '.' {
                    '-'
                } else {
                    '_'
                }
            })
            .collect();
        let fixed = fixed.split('/').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("/");
        report
            .error(format!("`{name}` cannot be the name of {what}"))
            .label(span, format!("`{}` is not allowed here", wrong.escape_default()))
            .note(format!("names are made of `a`-`z`, {capitals}`0`-`9`, `_`, `-`{slash}"))
            .advise(format!("call it `{fixed}`"));
        return false;
    }
    let empty_part = name.split('/').any(str::is_empty);
    if empty_part || name.len() > longest {
        let (label, advice) = match (name.is_empty(), empty_part) {
            (true, _) => ("an empty name", "give it a name".to_string()),
            (_, true) => ("an empty part beside a `/`", "write it as in `panda/joint_state`".to_string()),
            _ => ("too long", format!("at most {longest} characters")),
        };
        report.error(format!("`{name}` cannot be the name of {what}")).label(span, label).advise(advice);
        return false;
    }
    true
}

impl<'i> Read<'i> for Name {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let text = text(key, value, "a name", report)?;
        check_name("a graph", text, &value.span(), report).then(|| Self(text.to_string()))
    }
}

impl schemars::JsonSchema for Name {
    fn schema_name() -> Cow<'static, str> {
        "Name".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": NAME_PATTERN })
    }
}

/// [`Name`] as a regular expression.
pub(super) const NAME_PATTERN: &str = "^[a-z0-9_-]{1,64}$";
/// The name of a robot as a regular expression.
pub(super) const ROBOT_NAME_PATTERN: &str = "^[A-Za-z0-9_-]{1,64}$";

/// The name of a topic, such as `panda/joint_state`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TopicName(pub String);

impl<'i> Read<'i> for TopicName {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let text = text(key, value, "the name of a topic", report)?;
        let allowed = |c: char| name_character(c) || c == '/';
        check("a topic", text, &allowed, LONGEST_TOPIC, &value.span(), report).then(|| Self(text.to_string()))
    }
}

impl schemars::JsonSchema for TopicName {
    fn schema_name() -> Cow<'static, str> {
        "TopicName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Name of a topic, such as `panda/joint_state`.",
            "type": "string",
            "pattern": "^[a-z0-9_-]+(/[a-z0-9_-]+)*$",
            "maxLength": LONGEST_TOPIC,
        })
    }
}

/// Reports an invalid time or rate.
fn refuse(key: &str, span: &Span, what: &str, error: &UnitError, report: &mut Report) {
    report
        .error(format!("`{key}` {}", error.found))
        .label(span, format!("expected {what}"))
        .advise(error.expected.as_str());
}

macro_rules! read_unit {
    ($type:ident, $what:literal, $advice:literal) => {
        impl<'i> Read<'i> for $type {
            fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
                let Some(text) = value.get_ref().as_str() else {
                    let number = match value.get_ref() {
                        DeValue::Integer(number) => Some(number.as_str().to_string()),
                        DeValue::Float(number) => Some(number.as_str().to_string()),
                        _ => None,
                    };
                    let diagnostic = mismatch(key, value, $what, report);
                    if let Some(number) = number {
                        diagnostic.advise(format!($advice, number = number));
                    }
                    return None;
                };
                text.parse().map_err(|error| refuse(key, &value.span(), $what, &error, report)).ok()
            }
        }
    };
}

read_unit!(
    TimeSpan,
    "a time with its unit",
    "add its unit: \"{number} us\", \"{number} ms\" or \"{number} s\""
);
read_unit!(Rate, "a rate with its unit", "add its unit: \"{number} Hz\"");

impl<'i> Read<'i> for bool {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let DeValue::Boolean(boolean) = value.get_ref() else {
            mismatch(key, value, "true or false", report);
            return None;
        };
        Some(*boolean)
    }
}

macro_rules! read_whole {
    ($($type:ident),*) => { $(
        impl<'i> Read<'i> for $type {
            fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
                let DeValue::Integer(number) = value.get_ref() else {
                    mismatch(key, value, "a whole number", report);
                    return None;
                };
                // values beyond 64 bits are rejected like any other number out of range
                let number = i128::from_str_radix(number.as_str(), number.radix()).unwrap_or(i128::MAX);
                let (low, high) = ($type::MIN as i128, ($type::MAX as i128).min(i64::MAX as i128));
                if number < low || number > high {
                    let sign = if number < 0 { "at least" } else { "at most" };
                    let limit = if number < 0 { low } else { high };
                    report
                        .error(format!("`{key}` is out of range"))
                        .label(&value.span(), format!("expected a whole number from {low} to {high}"))
                        .advise(format!("write {sign} {limit}"));
                    return None;
                }
                $type::try_from(number).ok()
            }
        }
    )* };
}

read_whole!(u64, u32, i64, usize);

/// A choice of one of a few words.
pub(super) trait Choice: Copy + Serialize + 'static {
    /// All choices.
    const ALL: &'static [Self];

    /// Returns its serialised name.
    fn word(self) -> String {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::String(word)) => word,
            other => format!("{other:?}"),
        }
    }
}

impl<'i, T: Choice> Read<'i> for T {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let words: Vec<String> = T::ALL.iter().map(|choice| choice.word()).collect();
        let known = || words.iter().map(String::as_str);
        let found = text(key, value, &format!("one of {}", list(known())), report)?;
        let index = words.iter().position(|word| word == found);
        if index.is_none() {
            let advice = match nearest(found, known()) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => format!("choose one of {}", list(known())),
            };
            report
                .error(format!("`{key}` is \"{found}\", expected one of {}", list(known())))
                .label(&value.span(), "not one of the choices")
                .advise(advice);
        }
        index.map(|index| T::ALL[index])
    }
}

macro_rules! choices {
    ($($type:ident: $($variant:ident),*;)*) => { $(
        impl Choice for $type {
            const ALL: &'static [Self] = &[$($type::$variant),*];
        }
    )* };
}

choices! {
    ClockKind: Realtime, Lockstep;
    OnDenied: Warn, Strict;
    EventSource: Fd;
    OnOverrun: Skip, CatchUp, Rephase, Hold, SafeStop;
    OnError: Fail, Hold;
    OnFailure: SafeStop, Ignore;
    OnMiss: Warn, SafeStop;
    RestartWhen: Never, Failure, Always;
    SafeState: Hold, Damp, ZeroTorque, Brake;
    LimitPolicy: Clamp, Refuse;
    ResumeRule: Near, Latch, AtOnce;
    Schedule: Fifo, Deadline, Normal;
}

impl<'i> Read<'i> for ParameterValue {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let number = match value.get_ref() {
            DeValue::Boolean(flag) => Some(Self::Boolean(*flag)),
            DeValue::Integer(_) => return i64::read(key, value, report).map(Self::Integer),
            DeValue::Float(number) => number.as_str().parse().ok().map(Self::Float),
            DeValue::String(text) => Some(Self::Choice(text.to_string())),
            DeValue::Array(_) => {
                let numbers = Vec::<At<Number>>::read(key, value, report)?;
                let numbers = numbers.iter().map(|at| at.get().map(|Number(number)| *number));
                return numbers.collect::<Option<_>>().map(Self::Array);
            }
            _ => None,
        };
        if number.is_none() {
            mismatch(key, value, "a number, true or false, a text, or an array of numbers", report);
        }
        number
    }
}

impl<'i, T: Read<'i>> Read<'i> for Vec<At<T>> {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let Some(array) = value.get_ref().as_array() else {
            mismatch(key, value, "an array", report).advise(format!("write `{key} = [ ... ]`"));
            return None;
        };
        let element = |item: &Value<'i>, report: &mut Report| {
            let span = item.span();
            At { value: T::read(key, item, report), key: span.clone(), span }
        };
        Some(array.iter().map(|item| element(item, report)).collect())
    }
}

/// A table with user-defined keys, in file order.
#[derive(Debug, Clone)]
pub(super) struct Named<T>(pub Vec<(String, At<T>)>);

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'i, T: Read<'i>> Read<'i> for Named<T> {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let entries = entries(table(key, value, report)?);
        let read = |(name, value): (&toml::Spanned<toml::de::DeString<'i>>, &Value<'i>),
                    report: &mut Report| {
            let text = name.get_ref().to_string();
            let read = T::read(&text, value, report);
            (text, At { value: read, span: value.span(), key: name.span() })
        };
        Some(Self(entries.into_iter().map(|entry| read(entry, report)).collect()))
    }
}

impl<T: schemars::JsonSchema> schemars::JsonSchema for Named<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("Named_{}", T::schema_name()).into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "object", "additionalProperties": generator.subschema_for::<T>() })
    }
}

/// A table that is not read here.
#[derive(Debug, Clone)]
pub(super) struct AnyTable<'i>(pub Value<'i>);

impl<'i> Read<'i> for AnyTable<'i> {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        table(key, value, report)?;
        Some(Self(value.clone()))
    }
}

impl schemars::JsonSchema for AnyTable<'_> {
    fn schema_name() -> Cow<'static, str> {
        "AnyTable".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "object" })
    }
}
