//! The graph's world in the configuration of the kinds that read it.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::siblings::Home;
use super::{Context, Draft};
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::Value;
use crate::graph::values::AnyTable;

/// Puts the graph's world, or its gravity alone, into the configuration of a kind that reads it. Where the world leaves gravity to
/// its file, so does the kind.
pub(super) fn insert<'i>(
    value: &mut Value<'i>,
    kind: &Home<'_>,
    draft: &Draft<'_, 'i>,
    graph: &GraphTable<'i>,
    context: &Context<'_>,
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
                let span = file.span();
                let gravity = Spanned::new(key.span(), Cow::Borrowed("gravity"));
                let of_file = of_file(key.clone(), file, context);
                table.insert(gravity, Spanned::new(span, DeValue::Table(of_file)));
            }
            (None, None) => {}
        }
    }
    if kind.reads_world() {
        match table.get_key_value("world") {
            Some((key, _)) => {
                report
                    .error(format!("the graph has a `[world]`, and `{}` another one of its own", draft.name))
                    .at(&key.span(), "a second world")
                    .and(&at.key, "the world of the graph")
                    .advise("keep `[world]`, which all components share");
            }
            None => {
                table.insert(Spanned::new(at.key.clone(), Cow::Borrowed("world")), world.clone());
            }
        }
    }
}

/// `{ file = "/PATH" }`: the gravity of the file of a world, which the component reads.
fn of_file<'i>(key: Spanned<Cow<'i, str>>, file: &Value<'i>, context: &Context<'_>) -> DeTable<'i> {
    let mut file = file.clone();
    let folder = context.sources.folder(&file.span());
    if let DeValue::String(name) = file.get_mut() {
        let path = folder.join(name.as_ref());
        let path = std::path::absolute(&path).unwrap_or(path);
        *name = path.to_string_lossy().into_owned().into();
    }
    DeTable::from_iter([(key, file)])
}
