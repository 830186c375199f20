//! The declaration of each component, from its kind or program, its robot and its configuration.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value as Json;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::context::Context;
use super::draft::Draft;
use super::robots::Robot;
use super::siblings::Home;
use super::{doubts, exec, paths, periods, world};
use crate::declare::{
    Declaration, Declare, MAX_PARAMETER_NUMBERS, ParameterDeclaration, Placement, TopicPattern,
};
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::json::to_json;
use crate::graph::model::{ComponentTable, GraphTable};
use crate::graph::read::{At, Value, good, good_or};
use crate::graph::source::Span;
use crate::graph::values::{AnyTable, Named, check_name};
use crate::nearest::suggest;
use crate::plan::Program;
use crate::worker::{ConfigProblem, DescribeRequest};

/// Maximum number of components of a graph. More would not be a robot and would slow down the timing
/// analysis.
const MOST: usize = 512;

/// Duration of the declaration of one component.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct DeclareTime {
    /// Name of the component.
    pub component: String,
    /// Wall-clock time of the component's [`declare`](crate::component::Component::declare), ns. For a
    /// component in a separate program, this includes the time to start and end the program.
    pub wall_ns: u64,
}

/// Declaration time above which `motorium check` prints a warning, ns.
pub const DECLARE_BOUND_NS: u64 = 100_000_000;

/// Resolves all components of the file, in order.
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
            .label(&place, "nothing would run")
            .advise("add a table such as `[component.physics]` with a `kind` and a `rate`");
    }
    if let Some((_, at)) = components.get(MOST) {
        report
            .error(format!("the graph has {} components", components.len()))
            .label(&at.key, format!("expected at most {MOST}; this component exceeds the limit"))
            .advise("each component is a separate process: combine related parts in one component");
        return Vec::new();
    }
    let mut used = vec![false; robots.len()];
    let mut drafts = Vec::new();
    let clock = good_or(&graph.clock, defaults::CLOCK);
    for ((name, at), period_ns) in components.iter().zip(periods::component_periods(components)) {
        check_name("a component", name, &at.key, report);
        let Some(table) = at.get() else { continue };
        let mut find = |wanted: &At<String>| {
            let found = find_robot(wanted, robots, report);
            found.inspect(|index| used[*index] = true);
            found.and_then(|index| robots[index].reference.clone())
        };
        let robot = table.robot.as_ref().map(&mut find);
        let several: Option<Vec<_>> = good(&table.robots)
            .map(|names| names.iter().map(&mut find).collect())
            .unwrap_or(Some(Vec::new()));
        let robots_are_good = several_robots(table, report);
        let robot_is_known =
            robot.as_ref().is_none_or(Option::is_some) && several.is_some() && robots_are_good;
        let mut draft = Draft {
            name,
            place: at.key.clone(),
            table,
            robot: robot.flatten(),
            robots: several.unwrap_or_default(),
            placement: Placement {
                period: period_ns.map(Duration::from_nanos),
                clock,
                folder: context.sources.folder(&at.key).to_path_buf(),
                subscribed: subscribed(table),
            },
            program: None,
            config: Json::Object(serde_json::Map::new()),
            declaration: None,
            declare_ns: 0,
        };
        if let (true, Some(robot)) = (table.kind.is_some(), draft.robot.as_ref().or(draft.robots.first())) {
            // the folder that its paths are relative to, see `paths`
            draft.placement.folder = robot.base.clone();
        }
        let written = config_value(&draft, graph, context, report);
        let config = to_json(&written, report);
        if let Some(config) = &config {
            draft.config = config.clone();
        }
        let table_is_good = table.config.as_ref().is_none_or(|at| at.get().is_some());
        let ask = config.is_some() && table_is_good && robot_is_known;
        let declaration = identify(&mut draft, written, ask, context, report);
        for warning in declaration.iter().flat_map(|declaration| &declaration.warnings) {
            doubts::warning(&draft, warning, report);
        }
        draft.declaration = declaration.filter(|declaration| is_sane(declaration, &draft, report));
        drafts.push(draft);
    }
    unread_world(graph, &drafts, context, report);
    for (robot, _) in robots.iter().zip(used).filter(|(_, used)| !used) {
        report
            .warning(format!("no component works on robot `{}`", robot.name))
            .label(&robot.place, "unused")
            .advise(format!("add `robot = \"{}\"` to a component, or leave the robot out", robot.name));
    }
    drafts
}

/// Returns the ports in the `subscribe` table of a component.
fn subscribed(table: &ComponentTable<'_>) -> Vec<String> {
    let wired = good(&table.subscribe).map(|Named(wired)| wired.as_slice()).unwrap_or_default();
    wired.iter().map(|(port, _)| port.clone()).collect()
}

/// Warns if no component reads the `[world]` of the graph.
fn unread_world(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    context: &Context<'_>,
    report: &mut Report,
) {
    let Some(world) = &graph.world else { return };
    let reads = |draft: &Draft<'_, '_>| {
        good(&draft.table.kind)
            .is_some_and(|kind| context.registry.find(kind).is_none_or(|kind| kind.reads_world))
    };
    if !drafts.iter().any(reads) {
        report.warning("no component reads the `[world]` of the graph").label(&world.key, "not read").advise(
            "leave `[world]` out, or add a component that simulates it, such as `physics.articulated`",
        );
    }
}

/// Checks that `robots` lists each robot once and is not combined with `robot`.
fn several_robots(table: &ComponentTable<'_>, report: &mut Report) -> bool {
    let Some(robots) = &table.robots else { return true };
    let names = robots.get().map(Vec::as_slice).unwrap_or_default();
    let place = names.iter().enumerate().find(|(index, name)| {
        names[..*index].iter().any(|other| other.value.is_some() && other.value == name.value)
    });
    let (message, label, advice) = match (&table.robot, place) {
        (Some(robot), _) => {
            report
                .error("a component has both `robot` and `robots`")
                .label(&robots.key, "several robots")
                .and(&robot.key, "one robot")
                .advise("leave one of them out");
            return false;
        }
        (None, Some((_, name))) => {
            report
                .error(format!("`robots` names `{}` twice", name.get().map_or("", String::as_str)))
                .label(&name.span, "the same robot again")
                .advise("a second robot of the same model needs a separate `[robot.NAME]`");
            return false;
        }
        (None, None) if robots.get().is_some() && names.is_empty() => {
            ("`robots` is empty", "no robot", "name at least one, or leave it out")
        }
        (None, None) => return robots.get().is_some() && names.iter().all(|name| name.get().is_some()),
    };
    report.error(message).label(&robots.span, label).advise(advice);
    false
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
            .label(&wanted.span, "unknown robot")
            .advise(advice);
    }
    found
}

/// Finds the kind or program of a component and, if `ask`, queries its declaration.
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
                .error(format!("component `{}` has neither `kind` nor `exec`", draft.name))
                .label(&draft.place, "needs `kind` or `exec`")
                .advise("add `kind = \"...\"` for a built-in kind, or `exec = \"path/to/program\"`");
            None
        }
        (Some(kind), Some(exec)) => {
            report
                .error(format!("component `{}` has both `kind` and `exec`", draft.name))
                .label(&exec.key, "a component runs one program")
                .and(&kind.key, "the built-in kind here")
                .advise("leave one of them out");
            None
        }
        (Some(at), None) => {
            let name = at.get()?;
            let kind = match context.home(name) {
                Ok(Home::Here(kind)) => kind,
                Ok(Home::Sibling(program, _)) => {
                    let path = program.path.clone();
                    draft.program = Some(Program::Sibling { kind: name.clone(), path: path.clone() });
                    return if ask {
                        asked(draft, &config, &path, Some(name), &at.span, report)
                    } else {
                        None
                    };
                }
                Err(homeless) => {
                    homeless.report(name, draft, &at.span, context.registry, report);
                    return None;
                }
            };
            draft.program = Some(Program::Builtin { kind: name.clone() });
            if !ask {
                return None;
            }
            let declare = match draft.robots.as_slice() {
                [] => Declare::new(draft.robot.clone()),
                robots => Declare::of_robots(robots.to_vec()),
            };
            let declare = declare.placed(draft.placement.clone());
            let declared = timed(&mut draft.declare_ns, || kind.declare_in(draft.config.clone(), declare));
            declared.map_err(|problem| doubts::problem(draft, &config, &problem, report)).ok()
        }
        (None, Some(at)) => {
            let path = exec::find(at.get()?, context.sources.folder(&at.span))
                .map_err(|problem| problem.report(draft, &at.span, report))
                .ok()?;
            draft.program = Some(Program::Exec { path: path.clone() });
            if ask { asked(draft, &config, &path, None, &at.span, report) } else { None }
        }
    }
}

/// Returns the declaration of a component from its host program.
fn asked(
    draft: &mut Draft<'_, '_>,
    config: &Value<'_>,
    path: &Path,
    kind: Option<&str>,
    span: &Span,
    report: &mut Report,
) -> Option<Declaration> {
    let request = DescribeRequest {
        kind: kind.map(str::to_string),
        config: draft.config.clone(),
        robot: draft.robot.clone(),
        robots: draft.robots.clone(),
        placement: draft.placement.clone(),
    };
    match timed(&mut draft.declare_ns, || exec::describe(path, &request)) {
        Ok(Ok(declaration)) => Some(declaration),
        Ok(Err(error)) => {
            doubts::problem(draft, config, &ConfigProblem { unread: false, error }, report);
            None
        }
        Err(problem) => {
            problem.report(draft, span, report);
            None
        }
    }
}

/// Measures the wall time of a call, ns.
fn timed<T>(wall_ns: &mut u64, call: impl FnOnce() -> T) -> T {
    let began = Instant::now();
    let value = call();
    *wall_ns = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
    value
}

/// Returns the `config` table with its positions, with paths resolvable by the component, and the graph's
/// world if the kind reads it; an empty table at the component's name if missing.
fn config_value<'i>(
    draft: &Draft<'_, 'i>,
    graph: &GraphTable<'i>,
    context: &'i Context<'_>,
    report: &mut Report,
) -> Value<'i> {
    let mut value = match good(&draft.table.config) {
        Some(AnyTable(value)) => value.clone(),
        None => Spanned::new(draft.place.clone(), DeValue::Table(DeTable::new())),
    };
    let Some(Ok(kind)) = good(&draft.table.kind).map(|kind| context.home(kind)) else { return value };
    world::insert(&mut value, &kind, draft, graph, context, report);
    let known = draft.robot.as_ref().or(draft.robots.first());
    // a component without a robot has no folder, so all its paths are made absolute
    let folder = known.map_or(Path::new(""), |robot| &robot.base);
    paths::rebase(&mut value, &kind, folder, context.sources);
    value
}

/// Rejects declarations that this crate would not produce, because a user's program may declare anything.
fn is_sane(declaration: &Declaration, draft: &Draft<'_, '_>, report: &mut Report) -> bool {
    let ports = &declaration.ports;
    let twice = |index: usize| ports[..index].iter().any(|port| port.name == ports[index].name);
    let wrong = (0..ports.len()).find_map(|index| {
        let name = &ports[index].name;
        match ports[index].pattern {
            _ if twice(index) => Some(format!("declares the port `{name}` twice")),
            TopicPattern::Stream { capacity: 0 } | TopicPattern::Slices { capacity: 0, .. } => {
                Some(format!("declares the stream port `{name}` with a capacity of 0, expected at least 1"))
            }
            TopicPattern::Slices { longest: 0, .. }
                if ports[index].direction == crate::declare::Direction::Output =>
            {
                Some(format!(
                    "declares the output `{name}` of slices with a maximum length of 0, expected at least 1"
                ))
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
            let twice = |(at, choice)| parameters[index].choices[..at].contains(choice);
            if parameters[index].choices.iter().enumerate().any(twice) {
                return Some(format!("declares a choice of the parameter `{name}` twice"));
            }
            if parameters[index].numbers() == 0 {
                return Some(format!(
                    "declares the parameter `{name}` as an empty array, expected at least one number"
                ));
            }
            parameters[index]
                .admit(parameters[index].default.clone())
                .err()
                .map(|e| format!("has a default out of range: {e}"))
        })
    });
    let numbers: usize = parameters.iter().map(ParameterDeclaration::numbers).sum();
    let wrong = wrong.or_else(|| {
        (numbers > MAX_PARAMETER_NUMBERS).then(|| {
            format!("declares parameters with {numbers} numbers in total, expected at most {MAX_PARAMETER_NUMBERS}")
        })
    });
    if let Some(wrong) = &wrong {
        report
            .error(format!("{} {wrong}", draft.what()))
            .label(&draft.place, "this is a mistake in the component, not in the graph")
            .advise("correct its `declare` function");
    }
    wrong.is_none()
}
