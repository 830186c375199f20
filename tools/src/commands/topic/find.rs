//! The topic named on the command line.

use motorium::nearest::suggest;
use motorium::plan::{Plan, TopicPlan};

use super::log;

/// Returns the topic of this name and its index.
pub(super) fn find<'a>(plan: &'a Plan, name: &str) -> anyhow::Result<(usize, &'a TopicPlan)> {
    plan.topics.iter().enumerate().find(|(_, topic)| topic.name == name).ok_or_else(|| {
        if name == log::TOPIC {
            return anyhow::anyhow!(
                "`{name}` is the log of events; `motorium topic echo {name}` and `motorium events` show it"
            );
        }
        let names = plan.topics.iter().map(|topic| topic.name.as_str()).chain([log::TOPIC]);
        let advice = suggest(name, names, "it has");
        anyhow::anyhow!("graph `{}` has no topic `{name}`; {advice}", plan.name)
    })
}
