//! Overrides of the command line (`--set component.key=value`), which replace values in the graph file.
//!
//! An override changes the parsed tables and leaves the text of the file unchanged. Positions in the file
//! therefore stay valid, and an error in an override is shown in the text of the override.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeArray, DeString, DeTable, DeValue};

use super::diagnostic::Report;
use super::model::TOP_KEYS;
use super::read::Value;
use super::source::{Source, Span};
use crate::nearest::{list, nearest};

/// A value from the command line that overrides a value in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// Dotted path of the key, such as `clock`, `controller.config.damping` or `latency.0.max`. The prefix
    /// `component.` may be omitted.
    pub path: String,
    /// The value in TOML. Anything that is not valid TOML is treated as text, so `clock=lockstep` needs no
    /// quotes.
    pub value: String,
}

/// Error of parsing an override.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not an override, expected `component.key=value`, such as `controller.config.damping=1e-4`")]
pub struct OverrideError(String);

impl core::str::FromStr for Override {
    type Err = OverrideError;

    fn from_str(argument: &str) -> Result<Self, OverrideError> {
        match argument.split_once('=') {
            Some((path, value)) if !path.trim().is_empty() => {
                Ok(Self { path: path.trim().to_string(), value: value.trim().to_string() })
            }
            _ => Err(OverrideError(argument.to_string())),
        }
    }
}

impl core::fmt::Display for Override {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}={}", self.path, self.value)
    }
}

/// A step of a path: the key and its position in the override.
type Step<'i> = Spanned<DeString<'i>>;

/// Applies an override with the text `source` to the tables of the graph. `padded` is its value in the form
/// required by the parser, see [`Source::padded`].
pub(super) fn apply<'i>(
    graph: &mut DeTable<'i>,
    setting: &'i Override,
    source: &Source,
    padded: &'i str,
    report: &mut Report,
) {
    let Some(value) = read_value(setting, source, padded, report) else { return };
    let Some(path) = read_path(graph, setting, source, report) else { return };
    let [before @ .., last] = path.as_slice() else { return };
    let mut place = Place::Table(graph);
    for step in before {
        match place.enter(step, report) {
            Some(next) => place = next,
            None => return,
        }
    }
    place.put(last, value, report);
}

fn read_value<'i>(
    setting: &'i Override,
    source: &Source,
    padded: &'i str,
    report: &mut Report,
) -> Option<Value<'i>> {
    let start = source.start + setting.path.len() + 1;
    let span = start..start + setting.value.len();
    let parsed = DeTable::parse(padded).map(|table| {
        let mut values = table.into_inner().into_iter();
        values.next().filter(|_| values.next().is_none())
    });
    match parsed {
        Ok(Some((_, value))) => Some(value),
        Ok(None) => Some(Spanned::new(span, DeValue::String(Cow::Borrowed(&setting.value)))),
        Err(error) if setting.value.starts_with(['[', '{', '"', '\'']) => {
            report
                .error(format!("the value of `{}` is not TOML: {}", setting.path, error.message()))
                .label(&error.span().unwrap_or(span), "")
                .advise("quote the whole argument in the shell: --set 'name.key=[1, 2]'");
            None
        }
        Err(_) if setting.value.is_empty() => {
            report
                .error(format!("`{}` is set without a value", setting.path))
                .label(&span, "a value is missing")
                .advise(format!("for empty text write --set '{}=\"\"'", setting.path));
            None
        }
        Err(_) => Some(Spanned::new(span, DeValue::String(Cow::Borrowed(&setting.value)))),
    }
}

/// Returns the steps of the path from the top of the graph.
fn read_path<'i>(
    graph: &DeTable<'i>,
    setting: &'i Override,
    source: &Source,
    report: &mut Report,
) -> Option<Vec<Step<'i>>> {
    let mut path = Vec::new();
    let mut start = source.start;
    for step in setting.path.split('.') {
        let span = start..start + step.len();
        start = span.end + 1;
        if step.trim().is_empty() {
            report
                .error(format!("`{}` has an empty part", setting.path))
                .label(&span, "expected a key here")
                .advise("write it as in `controller.config.damping`");
            return None;
        }
        path.push(Spanned::new(span, Cow::Borrowed(step)));
    }
    let components = graph.get("component").and_then(|value| value.get_ref().as_table());
    let known: Vec<&str> =
        components.iter().flat_map(|table| table.keys()).map(|key| key.get_ref().as_ref()).collect();
    let first = path[0].get_ref().as_ref();
    let (name, explicit) = match (first, path.get(1)) {
        ("component", Some(second)) => (second, true),
        // a key of the graph itself, or an unknown key, which is reported later
        (first, _) if TOP_KEYS.contains(&first) => return Some(path),
        (_, None) if !known.contains(&first) => return Some(path),
        _ => (&path[0], false),
    };
    if !known.contains(&name.get_ref().as_ref()) {
        let near = nearest(name.get_ref(), known.iter().copied().chain(TOP_KEYS));
        let advice = near.map_or_else(
            || format!("the components are {}", list(known.iter().copied())),
            |near| format!("did you mean `{near}`?"),
        );
        report
            .error(format!("the graph has no component named `{}`", name.get_ref()))
            .label(&name.span(), "not a component of this graph")
            .advise(advice);
        return None;
    }
    if !explicit {
        path.insert(0, Spanned::new(path[0].span(), Cow::Borrowed("component")));
    }
    Some(path)
}

/// The position of a path so far.
enum Place<'t, 'i> {
    Table(&'t mut DeTable<'i>),
    Array(&'t mut DeArray<'i>),
}

impl<'t, 'i> Place<'t, 'i> {
    /// Descends one level; missing tables are created.
    fn enter(self, step: &Step<'i>, report: &mut Report) -> Option<Self> {
        let name = step.get_ref().as_ref();
        let value = match self {
            Self::Table(table) => table
                .entry(step.clone())
                .or_insert_with(|| Spanned::new(step.span(), DeValue::Table(DeTable::new()))),
            Self::Array(array) => element(array, step, report)?,
        };
        let old = value.span();
        match value.get_mut() {
            DeValue::Table(table) => Some(Self::Table(table)),
            DeValue::Array(array) => Some(Self::Array(array)),
            _ => {
                report
                    .error(format!("`{name}` has no keys"))
                    .label(&step.span(), "not a table")
                    .and(&old, "its value here")
                    .advise(format!("end the path at `{name}`"));
                None
            }
        }
    }

    /// Sets the value, replacing an existing one.
    fn put(self, step: &Step<'i>, value: Value<'i>, report: &mut Report) {
        match self {
            Self::Table(table) => {
                // replace the key as well, so that messages about it point to the override
                table.remove(step.get_ref().as_ref());
                table.insert(step.clone(), value);
            }
            Self::Array(array) => {
                if let Some(element) = element(array, step, report) {
                    *element = value;
                }
            }
        }
    }
}

fn element<'t, 'i>(
    array: &'t mut DeArray<'i>,
    step: &Step<'i>,
    report: &mut Report,
) -> Option<&'t mut Value<'i>> {
    let (name, span, count): (_, Span, _) = (step.get_ref(), step.span(), array.len());
    let index = name.parse::<usize>().ok().filter(|index| *index < count);
    if index.is_none() {
        let label = match count {
            0 => "the array is empty".to_string(),
            count => format!("expected a number from 0 to {}", count - 1),
        };
        report
            .error(format!("`{name}` is not the index of an array entry"))
            .label(&span, label)
            .advise("count entries from 0, as in `latency.0.max`");
    }
    array.get_mut(index?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn argument_without_an_equals_sign_sets_nothing() {
        assert_eq!("clock=lockstep".parse(), Ok(Override { path: "clock".into(), value: "lockstep".into() }));
        assert_eq!("a.b = c = d".parse(), Ok(Override { path: "a.b".into(), value: "c = d".into() }));
        assert!("clock".parse::<Override>().is_err());
        assert!("=1".parse::<Override>().is_err());
    }
}
