//! Histories of topics, which are the numbers of older values kept for taps.

use super::draft::Draft;
use super::wiring::Wiring;
use crate::declare::{Direction, Taps, TopicPattern};
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::good;
use crate::nearest::{list, nearest};

/// Maximum history, number of values.
const LARGEST: usize = 10_000;
/// Maximum history caused by a component with taps, bytes.
const LARGEST_TAPPED: usize = 64 << 20;

/// Resolves the history of each topic, in the order of the topics.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    report: &mut Report,
) -> Vec<usize> {
    let mut histories = vec![0; wiring.topics.len()];
    for (name, at) in good(&graph.topic).iter().flat_map(|topics| &topics.0) {
        let Some(topic) = wiring.topics.iter().position(|topic| topic == name) else {
            let known = wiring.topics.iter().map(String::as_str);
            let advice = match nearest(name, known.clone()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the topics of this graph are {}", list(known)),
            };
            report
                .error(format!("no component of this graph reads or writes topic `{name}`"))
                .label(&at.key, "an unknown topic")
                .advise(advice);
            continue;
        };
        let Some(history) = at.get().and_then(|table| table.history.as_ref()) else { continue };
        let Some(values) = history.get().copied() else { continue };
        let written = wiring.writer(topic).and_then(|writer| {
            drafts[writer.component].ports(Direction::Output).nth(writer.index?).map(|port| port.pattern)
        });
        if values > LARGEST {
            report
                .error(format!("topic `{name}` has a history of {values} values"))
                .label(&history.span, format!("expected at most {LARGEST}"))
                .advise(
                    "a history only bridges the time until a tap reads; record the topic to keep more values",
                );
        } else if values > 0 && written.is_some_and(|pattern| pattern != TopicPattern::State) {
            report
                .error(format!("topic `{name}` is a stream and has no history"))
                .label(&history.span, "a stream keeps its values in the queues of its readers")
                .advise("remove `history`");
        } else {
            histories[topic] = values;
        }
    }
    for draft in drafts {
        if let Some(taps) = draft.declaration.as_ref().and_then(|declaration| declaration.taps.as_ref()) {
            tapped(draft, taps, drafts, wiring, &mut histories, report);
        }
    }
    histories
}

/// Extends the histories of tapped topics to the time that taps may go unread.
fn tapped(
    draft: &Draft<'_, '_>,
    taps: &Taps,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    histories: &mut [usize],
    report: &mut Report,
) {
    if let Some(pattern) = taps.unmatched(&wiring.topics)
        && !wiring.incomplete
    {
        let known = list(wiring.topics.iter().map(String::as_str));
        report
            .error(format!("component `{}` reads `{pattern}`, which no component publishes", draft.name))
            .label(&draft.place, "an unknown topic")
            .advise(format!("the topics of this graph are {known}; `*` stands for any characters"));
    }
    for (topic, history) in histories.iter_mut().enumerate() {
        let Some(writer) = wiring.writer(topic).filter(|_| taps.includes(&wiring.topics[topic])) else {
            continue;
        };
        let port =
            writer.index.and_then(|index| drafts[writer.component].ports(Direction::Output).nth(index));
        let period = drafts[writer.component].placement.period.filter(|period| !period.is_zero());
        let (Some(port), Some(period)) = (port, period) else { continue };
        if port.pattern == TopicPattern::State {
            let values = taps.bridges.as_nanos().div_ceil(period.as_nanos());
            let fitting = (LARGEST_TAPPED / port.layout.size.max(1)).clamp(1, LARGEST);
            *history = usize::try_from(values).unwrap_or(usize::MAX).min(fitting).max(*history);
        }
    }
}
