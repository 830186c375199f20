//! Histories of topics: how many values behind the newest are kept for taps.

use super::Draft;
use super::wiring::Wiring;
use crate::declare::{Direction, TopicPattern};
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::good;
use crate::nearest::{list, nearest};

/// The largest history, values.
const LARGEST: usize = 10_000;

/// The history of each topic, in the order of the topics.
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
                .at(&at.key, "an unknown topic")
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
                .at(&history.span, format!("expected at most {LARGEST}"))
                .advise("a history bridges the time until a tap reads; a recording holds the rest");
        } else if values > 0 && written.is_some_and(|pattern| pattern != TopicPattern::State) {
            report
                .error(format!("topic `{name}` is a stream and has no history"))
                .at(&history.span, "a stream keeps its values in the queues of its readers")
                .advise("remove `history`");
        } else {
            histories[topic] = values;
        }
    }
    histories
}
