//! Checks of episodes: every component can be reset, and something ends an episode.

use super::Draft;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::{good, good_or};
use crate::plan::ClockKind;

/// Checks the division of a graph into episodes.
pub(super) fn check(graph: &GraphTable<'_>, drafts: &[Draft<'_, '_>], report: &mut Report) {
    let mut ending: Option<&str> = None;
    for draft in drafts {
        let Some(at) = draft.table.ends_episode.as_ref().filter(|at| at.get() == Some(&true)) else {
            continue;
        };
        if let Some(other) = ending {
            report
                .error(format!("components `{other}` and `{}` both end episodes", draft.name))
                .at(&at.span, "the second one")
                .advise("one component of a graph ends its episodes: remove one `ends_episode`");
        } else if draft.declaration.as_ref().is_some_and(|declaration| !declaration.may_end_episodes) {
            report
                .error(format!("component `{}` cannot end an episode", draft.name))
                .at(&at.span, format!("{} does not declare that it can", draft.what()))
                .advise("remove `ends_episode`: the episode ends after the `duration` of the graph");
        }
        ending = Some(draft.name);
    }
    let Some(at) = graph.episodes.as_ref() else { return };
    let Some(table) = at.get() else { return };
    if let Some(count) = table.count.as_ref().filter(|count| count.get() == Some(&0)) {
        report.error("a run of no episodes").at(&count.span, "expected at least 1");
    }
    if good_or(&graph.clock, defaults::CLOCK) != ClockKind::Lockstep {
        report
            .error("episodes in real time")
            .at(&at.span, "a reset sets time back, which only simulated time can be")
            .advise("add `clock = \"lockstep\"`, or `--clock lockstep`");
    }
    if good(&graph.duration).is_none() && ending.is_none() {
        report
            .error("episodes without an end")
            .at(&at.span, "no `duration`, and no component that ends an episode")
            .advise("add `duration = \"10 s\"`, or `ends_episode = true` to a component that can");
    }
    for draft in drafts {
        if draft.declaration.as_ref().is_some_and(|declaration| !declaration.resets) {
            report
                .error(format!("component `{}` cannot be reset for a new episode", draft.name))
                .at(&draft.place, format!("{} does not implement `Component::reset`", draft.what()))
                .and(&at.span, "the run has episodes")
                .advise("leave the component out, or remove `episodes`");
        }
    }
}
