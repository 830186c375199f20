//! The declaration of each component, from its kind or program, its robot and its configuration.

use std::path::Path;

use serde_json::Value as Json;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::robots::Robot;
use super::{Context, Draft, exec, paths};
use crate::declare::{ConfigError, Declaration, TopicPattern};
use crate::graph::diagnostic::Report;
use crate::graph::json::{find, to_json};
use crate::graph::model::GraphTable;
use crate::graph::read::{At, Value, good};
use crate::graph::source::Span;
use crate::graph::values::{AnyTable, check_name};
use crate::nearest::{list, nearest, suggest};
use crate::plan::Program;
use crate::worker::{ConfigProblem, ConfigSource};

/// Most components of a graph: what is beyond is no robot, and would take the analysis of its times long.
const MOST: usize = 512;

/// All components of the file, in its order.
pub(super) fn resolve<'g, 'i>(
    graph: &'g GraphTable<'i>,
    robots: &[Robot],
    context: &Context<'_>,
    report: &mut Report,
) -> Vec<Draft<'g, 'i>> {
    let components = good(&graph.component).map(|components| components.0.as_slice()).unwrap_or_default();
    let empty = graph.component.as_ref().is_none_or(|at| at.get().is_some_and(|table| table.0.is_empty()));
    if empty && !graph.meant.contains(&"component") {
        let place = graph.component.as_ref().map_or_else(|| context.sources.top(), |at| at.key.clone());
        report
            .error("the graph has no components")
            .at(&place, "nothing would run")
            .advise("add a table such as `[component.physics]` with a `kind` and a `rate`");
    }
    if let Some((_, at)) = components.get(MOST) {
        report
            .error(format!("the graph has {} components", components.len()))
            .at(&at.key, format!("the first of those beyond {MOST}"))
            .advise("each component is a process of its own: put what belongs together into one of them");
        return Vec::new();
    }
    let mut used = vec![false; robots.len()];
    let mut drafts = Vec::new();
    for (name, at) in components {
        check_name("a component", name, &at.key, report);
        let Some(table) = at.get() else { continue };
        let (robot, robot_is_known) = match &table.robot {
            None => (None, true),
            Some(wanted) => {
                let found = find_robot(wanted, robots, report);
                found.inspect(|index| used[*index] = true);
                let reference = found.and_then(|index| robots[index].reference.clone());
                (reference.clone(), reference.is_some())
            }
        };
        let mut draft = Draft {
            name,
            place: at.key.clone(),
            table,
            robot,
            program: None,
            config: Json::Object(serde_json::Map::new()),
            declaration: None,
        };
        let written = config_value(&draft, context);
        let config = to_json(&written, report);
        if let Some(config) = &config {
            draft.config = config.clone();
        }
        let table_is_good = table.config.as_ref().is_none_or(|at| at.get().is_some());
        let ask = config.is_some() && table_is_good && robot_is_known;
        let declaration = identify(&mut draft, written, ask, context, report);
        draft.declaration = declaration.filter(|declaration| is_sane(declaration, &draft, report));
        drafts.push(draft);
    }
    for (robot, _) in robots.iter().zip(used).filter(|(_, used)| !used) {
        report
            .warning(format!("no component works on robot `{}`", robot.name))
            .at(&robot.place, "used by nobody")
            .advise(format!("add `robot = \"{}\"` to a component, or leave the robot out", robot.name));
    }
    drafts
}

fn find_robot(wanted: &At<String>, robots: &[Robot], report: &mut Report) -> Option<usize> {
    let name = wanted.get()?;
    let found = robots.iter().position(|robot| robot.name == *name);
    if found.is_none() {
        let names = robots.iter().map(|robot| robot.name.as_str());
        let advice = match robots {
            [] => format!("add `[robot.{name}]` with its `urdf`"),
            _ => suggest(name, names, "the robots of this graph are"),
        };
        report
            .error(format!("the graph has no robot named `{name}`"))
            .at(&wanted.span, "unknown robot")
            .advise(advice);
    }
    found
}

/// Finds the kind or program of a component and, if `ask`, asks it what it declares.
fn identify(
    draft: &mut Draft<'_, '_>,
    config: Value<'_>,
    ask: bool,
    context: &Context<'_>,
    report: &mut Report,
) -> Option<Declaration> {
    match (&draft.table.kind, &draft.table.exec) {
        (None, None) if draft.table.meant.iter().any(|key| matches!(*key, "kind" | "exec")) => None,
        (None, None) => {
            report
                .error(format!("component `{}` does not say what it runs", draft.name))
                .at(&draft.place, "needs `kind` or `exec`")
                .advise("add `kind = \"...\"` for a built-in kind, or `exec = \"path/to/program\"`");
            None
        }
        (Some(kind), Some(exec)) => {
            report
                .error(format!("component `{}` has both `kind` and `exec`", draft.name))
                .at(&exec.key, "a component runs one program")
                .and(&kind.key, "the built-in kind here")
                .advise("leave one of them out");
            None
        }
        (Some(at), None) => {
            let name = at.get()?;
            let Some(kind) = context.registry.find(name) else {
                let kinds = context.registry.kinds().iter().map(|kind| kind.name);
                let advice = match nearest(name, kinds.clone()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => "use one of them, or name a program of your own with `exec`".to_string(),
                };
                report
                    .error(format!("unknown kind `{name}`"))
                    .at(&at.span, "no such kind of component")
                    .note(format!("the built-in kinds are {}", list(kinds)))
                    .advise(advice);
                return None;
            };
            draft.program = Some(Program::Builtin { kind: name.clone() });
            if !ask {
                return None;
            }
            let source = ConfigSource::Toml(config);
            kind.declare(source, draft.robot.clone())
                .map_err(|problem| config_problem(draft, &problem, report))
                .ok()
        }
        (None, Some(at)) => {
            let path = exec::find(at.get()?, context.sources.folder(&at.span))
                .map_err(|problem| problem.report(draft, &at.span, report))
                .ok()?;
            draft.program = Some(Program::Exec { path: path.clone() });
            if !ask {
                return None;
            }
            match exec::describe(&path, &draft.config, draft.robot.as_ref()) {
                Ok(Ok(declaration)) => Some(declaration),
                Ok(Err(error)) => {
                    config_problem(draft, &ConfigProblem { span: None, error }, report);
                    None
                }
                Err(problem) => {
                    problem.report(draft, &at.span, report);
                    None
                }
            }
        }
    }
}

/// The `config` table with its places, and its paths as the component can find them; an empty one at the component's
/// name if there is none.
fn config_value<'i>(draft: &Draft<'_, 'i>, context: &Context<'_>) -> Value<'i> {
    let Some(AnyTable(value)) = good(&draft.table.config) else {
        return Spanned::new(draft.place.clone(), DeValue::Table(DeTable::new()));
    };
    let mut value = value.clone();
    let kind = good(&draft.table.kind).and_then(|kind| context.registry.find(kind));
    if let Some(kind) = kind {
        // a component without a robot knows no folder: all its paths are made absolute
        let folder = draft.robot.as_ref().map_or(Path::new(""), |robot| &robot.base);
        paths::rebase(&mut value, kind, folder, context.sources);
    }
    value
}

/// Reports a configuration that a component refused.
fn config_problem(draft: &Draft<'_, '_>, problem: &ConfigProblem, report: &mut Report) {
    let ConfigError { key, message, advice } = &problem.error;
    let by_key = key.as_deref().and_then(|key| place_of(key, draft));
    let whole = draft.table.config.as_ref().map_or(&draft.place, |config| &config.key);
    let place = problem.span.clone().or(by_key).unwrap_or_else(|| whole.clone());
    let subject = match key.as_deref() {
        Some("robot") => format!("`{}.robot`", draft.name),
        Some(key) => format!("`{}.config.{key}`", draft.name),
        None if problem.span.is_some() => format!("`{}.config`", draft.name),
        None => format!("component `{}`", draft.name),
    };
    let advice = advice.clone().or_else(|| near_field(message)).unwrap_or_else(|| match &draft.program {
        Some(Program::Exec { .. }) => "see the configuration of this program".to_string(),
        _ => "the JSON Schema of graph files describes every key of `config`: `motorium schema`".to_string(),
    });
    report
        .error(format!("{subject}: {message}"))
        .at(&place, format!("refused by {}", draft.what()))
        .advise(advice);
}

/// The place of a key that a component complained about: in its `config`, or `robot` of the component itself.
fn place_of(key: &str, draft: &Draft<'_, '_>) -> Option<Span> {
    let inside = good(&draft.table.config).and_then(|config| find(&config.0, key));
    inside.or_else(|| (key == "robot").then(|| draft.table.robot.as_ref().map(|robot| robot.span.clone()))?)
}

/// Advice on serde's message "unknown field `x`, expected one of `a`, `b`".
fn near_field(message: &str) -> Option<String> {
    let rest =
        message.strip_prefix("unknown field `").or_else(|| message.strip_prefix("unknown variant `"))?;
    let (written, known) = rest.split_once('`')?;
    let known: Vec<&str> = known.split('`').skip(1).step_by(2).collect();
    nearest(written, known).map(|near| format!("did you mean `{near}`?"))
}

/// A user's program may declare anything: what no component built with this crate would declare is refused.
fn is_sane(declaration: &Declaration, draft: &Draft<'_, '_>, report: &mut Report) -> bool {
    let ports = &declaration.ports;
    let twice = |index: usize| ports[..index].iter().any(|port| port.name == ports[index].name);
    let wrong = (0..ports.len()).find_map(|index| {
        let name = &ports[index].name;
        match ports[index].pattern {
            _ if twice(index) => Some(format!("declares the port `{name}` twice")),
            TopicPattern::Stream { capacity: 0 } | TopicPattern::Slices { capacity: 0, .. } => {
                Some(format!("declares the stream port `{name}` without room for a single sample"))
            }
            TopicPattern::Slices { longest: 0, .. }
                if ports[index].direction == crate::declare::Direction::Output =>
            {
                Some(format!("declares the output `{name}` of slices without the length of the longest"))
            }
            _ => None,
        }
    });
    let parameters = &declaration.parameters;
    let wrong = wrong.or_else(|| {
        (0..parameters.len()).find_map(|index| {
            let name = &parameters[index].name;
            if parameters[..index].iter().any(|parameter| parameter.name == *name) {
                return Some(format!("declares the parameter `{name}` twice"));
            }
            parameters[index]
                .admit(parameters[index].default)
                .err()
                .map(|e| format!("has a default out of range: {e}"))
        })
    });
    if let Some(wrong) = &wrong {
        report
            .error(format!("{} {wrong}", draft.what()))
            .at(&draft.place, "this is a mistake in the component, not in the graph")
            .advise("correct its `declare` function");
    }
    wrong.is_none()
}
