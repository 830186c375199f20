//! `motorium topic`: the topics of a running graph, seen and fed from outside.

mod content;
mod echo;
mod hz;
mod info;
mod json;
mod list;
mod log;
mod pace;
mod pose;
pub(crate) mod publish;
pub(crate) mod watch;

use std::process::ExitCode;

use motorium::declare::TopicPattern;
use motorium::nearest::suggest;
use motorium::plan::{Plan, TopicPlan};

/// Show the topics of a running graph, and feed topics that accept outside values.
///
/// No component ever waits for an observer.
///
/// Example: motorium topic echo panda/joint_state --rate 2
#[derive(Debug, clap::Args)]
pub(crate) struct Topic {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    List(list::List),
    Echo(echo::Echo),
    Hz(hz::Hz),
    Info(info::Info),
    Pub(publish::Pub),
}

impl Topic {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::List(command) => command.run(),
            Command::Echo(command) => command.run(),
            Command::Hz(command) => command.run(),
            Command::Info(command) => command.run(),
            Command::Pub(command) => command.run(),
        }
    }
}

/// The topic of this name and its index.
fn find<'a>(plan: &'a Plan, name: &str) -> anyhow::Result<(usize, &'a TopicPlan)> {
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

/// A pattern as text.
fn pattern(pattern: TopicPattern) -> String {
    match pattern {
        TopicPattern::State => "state".to_string(),
        TopicPattern::Stream { capacity } => format!("stream of {capacity}"),
        TopicPattern::Slices { capacity, longest } => format!("slices of {longest}, {capacity} deep"),
    }
}

/// Names of components by their indices.
fn names(plan: &Plan, components: &[usize]) -> Vec<String> {
    components.iter().map(|&index| plan.components[index].name.clone()).collect()
}

/// A time in the unit that suits it.
fn readable(ns: u64) -> String {
    let ns = ns as f64;
    match ns {
        _ if ns < 1e4 => format!("{ns:.0} ns"),
        _ if ns < 1e6 => format!("{:.1} us", ns * 1e-3),
        _ if ns < 1e9 => format!("{:.2} ms", ns * 1e-6),
        _ => format!("{:.2} s", ns * 1e-9),
    }
}

#[cfg(test)]
mod tests {
    use super::readable;

    #[test]
    fn times_come_in_the_unit_that_suits_them() {
        let texts = [850, 22_300, 1_500_000, 12_345_000_000].map(readable);
        assert_eq!(texts, ["850 ns", "22.3 us", "1.50 ms", "12.35 s"]);
    }
}
