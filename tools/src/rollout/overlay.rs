//! Numbers of a graph as an overlay file.

use std::collections::BTreeMap;

use motorium::graph;
use motorium::plan::Plan;
use motorium::worker::Registry;
use serde_json::Value as Json;
use toml::{Table, Value};

/// Numbers that cannot be written as an overlay.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OverlayError {
    /// The key is an entry of a list outside of a `config` table.
    #[error(
        "`{0}` is an entry of a list, which an overlay replaces as a whole; help: tune a key of a table, or of a \
         list in the `config` of a component"
    )]
    List(String),
    /// The key is missing in the configuration.
    #[error("`{0}` is not in the configuration of its component")]
    Missing(String),
    /// A value has no form in TOML.
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
}

/// Returns the keys at the top of a graph file.
fn top_keys(registry: &Registry) -> Vec<String> {
    let schema = graph::schema(registry);
    let properties = schema.get("properties").and_then(Json::as_object);
    properties.map(|properties| properties.keys().cloned().collect()).unwrap_or_default()
}

/// Returns the text of an overlay that gives keys of a graph their values. Keys are written as in `--set`. An
/// overlay replaces whole lists: for a key in a list of a component's configuration, the whole list is
/// written.
pub(crate) fn overlay(
    plan: &Plan,
    registry: &Registry,
    settings: &[(&str, f64)],
) -> Result<String, OverlayError> {
    let top = top_keys(registry);
    let mut configs: BTreeMap<String, Json> = BTreeMap::new();
    let mut table = Table::new();
    let mut lists: Vec<(Vec<String>, String)> = Vec::new();
    for (key, value) in settings {
        let mut path: Vec<String> = key.split('.').map(|step| step.trim().to_owned()).collect();
        // the name of a component may replace `component.NAME`
        if path[0] != "component" && path.len() > 1 && !top.contains(&path[0]) {
            path.insert(0, "component".to_owned());
        }
        let Some(first) = path.iter().position(|step| step.parse::<usize>().is_ok()) else {
            insert(&mut table, &path, Value::Float(*value));
            continue;
        };
        if first < 4 || path[0] != "component" || path[2] != "config" {
            return Err(OverlayError::List((*key).to_owned()));
        }
        let missing = || OverlayError::Missing((*key).to_owned());
        let component = plan.components.iter().find(|component| component.name == path[1]);
        let component = component.ok_or_else(missing)?;
        let config = configs.entry(path[1].clone()).or_insert_with(|| component.config.clone());
        *entry(config, &path[3..]).ok_or_else(missing)? = Json::from(*value);
        let list = path[..first].to_vec();
        if !lists.iter().any(|(other, _)| *other == list) {
            lists.push((list, (*key).to_owned()));
        }
    }
    for (path, key) in lists {
        let config = configs.get_mut(&path[1]).and_then(|config| entry(config, &path[3..]));
        let list = config.ok_or(OverlayError::Missing(key))?;
        insert(&mut table, &path, Value::try_from(&*list)?);
    }
    Ok(toml::to_string(&table)?)
}

/// Returns the value at a path of keys and indices.
fn entry<'v>(value: &'v mut Json, path: &[String]) -> Option<&'v mut Json> {
    path.iter().try_fold(value, |value, step| match value {
        Json::Array(list) => list.get_mut(step.parse::<usize>().ok()?),
        value => value.get_mut(step.as_str()),
    })
}

/// Sets a value; missing tables are created.
fn insert(table: &mut Table, path: &[String], value: Value) {
    let Some((last, before)) = path.split_last() else { return };
    let mut inner = table;
    for step in before {
        let next = inner.entry(step.clone()).or_insert_with(|| Value::Table(Table::new()));
        if !next.is_table() {
            *next = Value::Table(Table::new());
        }
        match next {
            Value::Table(next) => inner = next,
            _ => return,
        }
    }
    inner.insert(last.clone(), value);
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use motorium::graph::{Machine, Override, load_with};

    use super::*;
    use crate::registry::registry;

    fn graph() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/quadruped-trot.toml")
    }

    fn loaded(overlays: &[PathBuf], settings: &[(&str, f64)]) -> Plan {
        let set = |(key, value): &(&str, f64)| Override { path: (*key).into(), value: format!("{value:?}") };
        let set: Vec<Override> = settings.iter().map(set).collect();
        let plan = load_with(&graph(), overlays, &set, &registry(), &Machine::with_cores(vec![0, 1]));
        plan.unwrap_or_else(|error| panic!("{}", error.render(false))).plan
    }

    #[test]
    fn overlay_gives_the_plan_of_the_overrides() {
        let settings = [
            ("policy.config.frequency", 1.0 / 3.0),
            ("component.policy.config.joint_command.kp", 20.0),
            ("policy.config.legs.0.joints.1.amplitude", 0.1),
            ("policy.config.legs.3.joints.0.phase", -1e-7),
            ("world.ground.friction", 0.7),
        ];
        let text = overlay(&loaded(&[], &[]), &registry(), &settings).expect("an overlay");
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("best.toml");
        std::fs::write(&file, &text).expect("a file");
        assert_eq!(loaded(&[file], &[]), loaded(&[], &settings), "{text}");
    }

    #[test]
    fn entries_of_other_lists_are_refused() {
        let plan = loaded(&[], &[]);
        let refused = |key| overlay(&plan, &registry(), &[(key, 1.0)]).expect_err(key);
        assert!(matches!(refused("latency.0.max"), OverlayError::List(_)));
        assert!(matches!(refused("policy.config.legs.9.joints.0.phase"), OverlayError::Missing(_)));
    }
}
