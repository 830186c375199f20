//! Episodes: checks that all components of a graph can be reset, and finds the components that begin and end
//! episodes.

use super::draft::Draft;
use crate::declare::Declaration;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::{ComponentTable, GraphTable};
use crate::graph::read::{At, good, good_or};
use crate::graph::source::Span;
use crate::plan::ClockKind;

/// A right that one component of a graph may have.
struct Right {
    key: &'static str,
    verb: &'static str,
    table: for<'t> fn(&'t ComponentTable<'_>) -> Option<&'t At<bool>>,
    is_declared: fn(&Declaration) -> bool,
    advice: &'static str,
}

const ENDS: Right = Right {
    key: "ends_episode",
    verb: "end",
    table: |table| table.ends_episode.as_ref(),
    is_declared: |declaration| declaration.may_end_episodes,
    advice: "remove `ends_episode`: the episode ends after the `duration` of the graph",
};

const BEGINS: Right = Right {
    key: "begins_episodes",
    verb: "begin",
    table: |table| table.begins_episodes.as_ref(),
    is_declared: |declaration| declaration.may_begin_episodes,
    advice: "remove `begins_episodes`: the run is then divided by `[episodes]`, or by the program that drives it",
};

/// Checks the division of a graph into episodes.
pub(super) fn check(graph: &GraphTable<'_>, drafts: &[Draft<'_, '_>], report: &mut Report) {
    let ending = holder(&ENDS, drafts, report);
    let beginning = holder(&BEGINS, drafts, report);
    let clock = good_or(&graph.clock, defaults::CLOCK);
    if let Some((name, span)) = &beginning {
        if clock == ClockKind::Lockstep {
            report
                .error(format!("component `{name}` begins episodes in lockstep"))
                .label(span, "an episode of simulated time begins with a reset, which no component can order")
                .advise("add `clock = \"realtime\"`, or divide the run by `[episodes]`");
        }
        if let Some((other, end)) = &ending {
            report
                .error(format!("component `{name}` begins episodes and `{other}` ends them"))
                .label(end, "between its end and the next start no episode would run")
                .advise("remove `ends_episode`: each episode lasts until the next one begins");
        }
    }
    let Some(at) = graph.episodes.as_ref() else { return };
    let Some(table) = at.get() else { return };
    if let Some(count) = table.count.as_ref().filter(|count| count.get() == Some(&0)) {
        report.error("a run without episodes").label(&count.span, "expected at least 1");
    }
    if let Some((name, span)) = &beginning {
        report
            .error(format!("`[episodes]` and component `{name}` both divide the run"))
            .label(&at.span, "a fixed number of episodes")
            .and(span, "begins episodes at any time")
            .advise("remove one of them");
    } else if good(&graph.duration).is_none() && ending.is_none() {
        report
            .error("episodes without an end")
            .label(&at.span, "no `duration`, and no component that ends an episode")
            .advise("add `duration = \"10 s\"`, or `ends_episode = true` to a component that can");
    }
    for draft in drafts.iter().filter(|_| clock == ClockKind::Lockstep) {
        if draft.declaration.as_ref().is_some_and(|declaration| !declaration.resets) {
            report
                .error(format!("component `{}` cannot be reset for a new episode", draft.name))
                .label(&draft.place, format!("{} does not implement `Component::reset`", draft.what()))
                .and(&at.span, "the run has episodes")
                .advise("leave the component out, or remove `episodes`");
        }
    }
}

/// Returns the component with a right, and the position of that key in the graph. Reports a second component,
/// and a component that cannot use the right.
fn holder<'g>(right: &Right, drafts: &'g [Draft<'_, '_>], report: &mut Report) -> Option<(&'g str, Span)> {
    let mut holder: Option<(&str, Span)> = None;
    for draft in drafts {
        let Some(at) = (right.table)(draft.table).filter(|at| at.get() == Some(&true)) else { continue };
        if let Some((other, _)) = &holder {
            report
                .error(format!("components `{other}` and `{}` both {} episodes", draft.name, right.verb))
                .label(&at.span, "the second one")
                .advise(format!(
                    "only one component of a graph can {} its episodes; remove one `{}`",
                    right.verb, right.key
                ));
        } else if draft.declaration.as_ref().is_some_and(|declaration| !(right.is_declared)(declaration)) {
            report
                .error(format!("component `{}` cannot {} an episode", draft.name, right.verb))
                .label(&at.span, format!("{} does not declare this ability", draft.what()))
                .advise(right.advice);
        }
        holder = Some((draft.name, at.span.clone()));
    }
    holder
}
