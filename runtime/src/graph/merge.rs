//! Overlaying one graph file on another: tables are merged key by key, and all other values are replaced.

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::diagnostic::Report;
use super::read::{At, Read as _, Value};
use super::source::Span;
use crate::nearest::{list, nearest};

/// Overlays a file on the files below: applies its removals, merges its tables key by key, and replaces other
/// values.
pub(super) fn lay<'i>(below: &mut DeTable<'i>, mut file: DeTable<'i>, report: &mut Report) {
    if let Some(value) = file.remove("extends") {
        // the extended file has been loaded; its type is checked here
        String::read("extends", &value, report);
    }
    if let Some(value) = file.remove("remove") {
        for path in Vec::<At<String>>::read("remove", &value, report).iter().flatten() {
            if let Some(text) = path.get() {
                remove(below, text, &path.span, report);
            }
        }
    }
    merge(below, file);
}

fn merge<'i>(below: &mut DeTable<'i>, above: DeTable<'i>) {
    for (key, value) in above {
        let old = below.get_mut(key.get_ref().as_ref()).map(Spanned::get_mut);
        match (old, value) {
            (Some(DeValue::Table(old)), value) if value.get_ref().is_table() => {
                if let DeValue::Table(new) = value.into_inner() {
                    merge(old, new);
                }
            }
            (_, value) => {
                // replace the key as well, so that messages about it point to this file
                below.remove(key.get_ref().as_ref());
                below.insert(key, value);
            }
        }
    }
}

/// Removes the value at a dotted path.
fn remove(below: &mut DeTable<'_>, path: &str, span: &Span, report: &mut Report) {
    let mut table = below;
    let mut steps = path.split('.').peekable();
    while let Some(step) = steps.next() {
        if !table.contains_key(step) {
            let known = || table.keys().map(|key| key.get_ref().as_ref());
            let advice = match nearest(step, known()) {
                Some(near) => format!("did you mean `{near}`?"),
                None if table.is_empty() => "leave it out".to_string(),
                None => format!("its keys are {}", list(known())),
            };
            report
                .error(format!("`{path}` cannot be removed: the extended files have no `{step}`"))
                .label(span, "nothing to remove")
                .advise(advice);
            return;
        }
        if steps.peek().is_none() {
            table.remove(step);
            return;
        }
        let Some(value) = table.get_mut(step) else { return };
        let place = value.span();
        let DeValue::Table(next) = value.get_mut() else {
            report
                .error(format!("`{path}` cannot be removed: `{step}` has no keys"))
                .label(span, "not a table")
                .and(&place, "its value here")
                .advise(format!("remove `{step}` as a whole, or give it another value"));
            return;
        };
        table = next;
    }
}

/// Shifts every span of a table by `by`.
pub(super) fn shifted(table: DeTable<'_>, by: usize) -> DeTable<'_> {
    if by == 0 {
        return table;
    }
    let entry = |(key, value): (Spanned<_>, _)| {
        let span = moved(&key.span(), by);
        (Spanned::new(span, key.into_inner()), shifted_value(value, by))
    };
    table.into_iter().map(entry).collect()
}

fn shifted_value(value: Value<'_>, by: usize) -> Value<'_> {
    let span = moved(&value.span(), by);
    let value = match value.into_inner() {
        DeValue::Table(table) => DeValue::Table(shifted(table, by)),
        DeValue::Array(array) => {
            DeValue::Array(array.into_iter().map(|value| shifted_value(value, by)).collect::<DeArray<'_>>())
        }
        other => other,
    };
    Spanned::new(span, value)
}

fn moved(span: &Span, by: usize) -> Span {
    span.start + by..span.end + by
}
