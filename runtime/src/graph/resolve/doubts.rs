//! Errors and warnings of components about their configuration, with the positions of the affected keys.

use super::draft::Draft;
use super::wording::reworded;
use crate::declare::{ConfigError, DeclareWarning};
use crate::graph::diagnostic::Report;
use crate::graph::json::find;
use crate::graph::read::{Value, good};
use crate::graph::source::Span;
use crate::nearest::nearest;
use crate::plan::Program;
use crate::worker::ConfigProblem;

/// Key of the graph's world in the configuration of kinds that read it.
const WORLD: &str = "world";
/// Label of an error in the graph's world.
pub(super) const IN_WORLD: &str = "in the world of the graph";
/// Start of serde's message about an unknown key.
const UNKNOWN_KEY: &str = "unknown field `";

/// Reports a component's warning about its configuration.
pub(super) fn warning(draft: &Draft<'_, '_>, warning: &DeclareWarning, report: &mut Report) {
    let DeclareWarning { key, message, advice } = warning;
    let place = key.as_deref().and_then(|key| place_of(key, draft));
    let subject = subject(draft, key.as_deref());
    let diagnostic = report
        .warning(format!("{subject}: {message}"))
        .label(&place.unwrap_or_else(|| draft.place.clone()), format!("{} warns about this", draft.what()));
    if let Some(advice) = advice {
        diagnostic.advise(advice.as_str());
    }
}

/// Returns the part of a component that a message refers to.
fn subject(draft: &Draft<'_, '_>, key: Option<&str>) -> String {
    match key {
        Some(key @ ("robot" | "robots")) => format!("`{}.{key}`", draft.name),
        Some(key) => format!("`{}.config.{key}`", draft.name),
        None => format!("component `{}`", draft.name),
    }
}

/// Reports a configuration rejected by a component. `config` is the table passed to the component.
pub(super) fn problem(
    draft: &Draft<'_, '_>,
    config: &Value<'_>,
    problem: &ConfigProblem,
    report: &mut Report,
) {
    if of_world(draft, config, &problem.error, report) {
        return;
    }
    let ConfigError { key, message, advice } = &problem.error;
    let place = key.as_deref().and_then(|key| match message.starts_with(UNKNOWN_KEY) {
        true => find(config, key).map(|found| found.key),
        false if problem.unread => find(config, key).map(|found| found.value),
        false => place_of(key, draft),
    });
    let whole = match (problem.unread, &draft.table.config) {
        (true, _) => config.span(),
        (false, Some(table)) => table.key.clone(),
        (false, None) => draft.place.clone(),
    };
    let place = place.unwrap_or(whole);
    let subject = match problem.unread {
        true => format!("`{}.config`", draft.name),
        false => subject(draft, key.as_deref()),
    };
    let advice = advice.clone().or_else(|| near_field(message)).unwrap_or_else(|| match &draft.program {
        Some(Program::Exec { path }) => {
            format!("`motorium kinds --exec {}` describes every key of `config`", path.display())
        }
        Some(Program::Sibling { kind, .. } | Program::Builtin { kind }) => {
            format!("`motorium kinds {kind}` describes every key of `config`")
        }
        None => "`motorium kinds KIND` describes every key of `config`".to_string(),
    });
    report
        .error(format!("{subject}: {}", reworded(message)))
        .label(&place, format!("refused by {}", draft.what()))
        .advise(advice);
}

/// Reports an error in the graph's `[world]`, with the same text for each component that reads it, so that
/// the report contains it once. Returns `false` for other errors.
fn of_world(
    draft: &Draft<'_, '_>,
    config: &Value<'_>,
    ConfigError { key, message, advice }: &ConfigError,
    report: &mut Report,
) -> bool {
    let own = good(&draft.table.config).and_then(|table| find(&table.0, WORLD));
    let world = find(config, WORLD).filter(|_| own.is_none());
    let (Some(world), Some(key)) = (world, key.as_deref()) else { return false };
    let Some(inside) = key.strip_prefix(WORLD).filter(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    else {
        return false;
    };
    let is_unknown = message.starts_with(UNKNOWN_KEY);
    let subject = if inside.is_empty() || is_unknown { "`world`" } else { &format!("`{key}`") };
    let text = message.strip_prefix("world: ").unwrap_or(message);
    let found = report.error(format!("{subject}: {}", reworded(text)));
    // most errors without a key are in the file
    let place = find(config, if inside.is_empty() { "world.file" } else { key });
    let place = place.filter(|place| place.value != world.value).map(|place| match is_unknown {
        true => place.key,
        false => place.value,
    });
    found.label(&place.unwrap_or(world.key), IN_WORLD);
    if let Some(advice) = advice.clone().or_else(|| near_field(message)) {
        found.advise(advice);
    }
    true
}

/// Returns the position of a key that a component reported: a key of its `config`, or `robot` of the
/// component itself.
fn place_of(key: &str, draft: &Draft<'_, '_>) -> Option<Span> {
    let inside = good(&draft.table.config).and_then(|config| find(&config.0, key));
    inside.map(|found| found.value).or_else(|| match key {
        "robot" => draft.table.robot.as_ref().map(|robot| robot.span.clone()),
        "robots" => draft.table.robots.as_ref().map(|robots| robots.span.clone()),
        _ => None,
    })
}

/// Returns advice on serde's message "unknown field `x`, expected one of `a`, `b`".
fn near_field(message: &str) -> Option<String> {
    let rest = message.strip_prefix(UNKNOWN_KEY).or_else(|| message.strip_prefix("unknown variant `"))?;
    let (written, known) = rest.split_once('`')?;
    let known: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
    nearest(written, known).map(|near| format!("did you mean `{near}`?"))
}
