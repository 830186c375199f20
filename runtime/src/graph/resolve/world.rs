//! Insertion of the graph's world into the configuration of kinds that read it.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::DeValue;

use super::context::Context;
use super::doubts;
use super::draft::Draft;
use super::siblings::Home;
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::Value;
use crate::graph::values::AnyTable;

/// Inserts the graph's world, or only its gravity, into the configuration of a kind that reads it. Gravity
/// has three numbers, from the world file if the world does not set it.
pub(super) fn insert<'i>(
    value: &mut Value<'i>,
    kind: &Home<'_>,
    draft: &Draft<'_, 'i>,
    graph: &GraphTable<'i>,
    context: &'i Context<'_>,
    report: &mut Report,
) {
    let (Some(at), DeValue::Table(table)) = (&graph.world, value.get_mut()) else { return };
    let Some(AnyTable(world)) = at.get() else { return };
    if kind.reads_gravity()
        && !table.contains_key("gravity")
        && let DeValue::Table(world) = world.get_ref()
    {
        match (world.get_key_value("gravity"), world.get_key_value("file")) {
            (Some((key, gravity)), _) => {
                table.insert(key.clone(), gravity.clone());
            }
            (None, Some((key, file))) => {
                if let Some(gravity) = of_file((key, file), draft, context, report) {
                    table.insert(Spanned::new(key.span(), Cow::Borrowed("gravity")), gravity);
                }
            }
            (None, None) => {}
        }
    }
    if kind.reads_world() {
        match table.get_key_value("world") {
            Some((key, _)) => {
                report
                    .error(format!(
                        "the graph has a `[world]`, and component `{}` has its own world",
                        draft.name
                    ))
                    .label(&key.span(), "a second world")
                    .and(&at.key, "the world of the graph")
                    .advise("keep `[world]`, which all components share");
            }
            None => {
                table.insert(Spanned::new(at.key.clone(), Cow::Borrowed("world")), world.clone());
            }
        }
    }
}

/// Returns the gravity of the world file, which is read once for all components.
fn of_file<'i>(
    (key, file): (&Spanned<Cow<'i, str>>, &Value<'i>),
    draft: &Draft<'_, 'i>,
    context: &'i Context<'_>,
    report: &mut Report,
) -> Option<Value<'i>> {
    let DeValue::String(name) = file.get_ref() else { return None };
    let Some(read) = context.registry.gravity_of_file() else {
        report
            .warning(format!("component `{}` cannot read the gravity from the file of `[world]`", draft.name))
            .label(&key.span(), "this program cannot read it")
            .advise("write `gravity = [0.0, 0.0, -9.81]` into `[world]`, or give the `Registry` a reader, `with_gravity_of_file`");
        return None;
    };
    let numbers = context.gravity.get_or_init(|| {
        let path = context.sources.folder(&file.span()).join(name.as_ref());
        let path = std::path::absolute(&path).unwrap_or(path);
        match read(&path) {
            Ok(gravity) => Some(gravity.map(|number| format!("{number:?}"))),
            Err(error) => {
                let found =
                    report.error(format!("`world`: {}", error.message)).label(&file.span(), doubts::IN_WORLD);
                error.advice.into_iter().for_each(|advice| _ = found.advise(advice));
                None
            }
        }
    });
    let number = |text: &'i String| {
        let number = DeValue::parse(text).ok()?.into_inner();
        Some(Spanned::new(file.span(), number))
    };
    let numbers: Option<Vec<_>> = numbers.as_ref()?.iter().map(number).collect();
    Some(Spanned::new(file.span(), DeValue::Array(numbers?.into_iter().collect())))
}
