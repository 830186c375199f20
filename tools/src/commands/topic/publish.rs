//! `motorium topic pub`: publishes values on a topic of a running graph from outside.

use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use motorium::plan::{Plan, Program, TopicPlan};
use motorium::state::encode;
use motorium::units::TimeSpan;
use motorium_bridges::{Feed, Iceoryx2Bridge};

use super::find::find;
use super::pose;
use super::watch::{End, Look, Watch};
use crate::out::errln;
use crate::runs::RunArg;

/// Time limit for the bridge to publish a value that was sent once.
const ARRIVAL: Duration = Duration::from_secs(3);
/// Interval between two polls for the publication.
const POLL: Duration = Duration::from_millis(2);

/// Publish values on a topic that accepts them from outside, through a bridge of the graph.
///
/// The topic must be published by `bridge.iceoryx2`: outside programs never replace a component. Omitted
/// fields are zero, and counts are derived from the lengths of arrays. A PoseTarget without an orientation
/// keeps the orientation of the topic's newest value.
///
/// Example: motorium topic pub panda/target 'position=[0.4, 0.0, 0.5] orientation=[1, 0, 0, 0]' --rate 100
/// --for 2s
#[derive(Debug, clap::Args)]
pub(super) struct Pub {
    /// The topic
    #[arg(add = crate::complete::topics())]
    topic: String,
    /// Fields of the value: 'name=number', 'name=[number, ...]', 'name="text"' for bytes
    #[arg(required = true, value_name = "FIELD=VALUE")]
    fields: Vec<String>,
    #[command(flatten)]
    run: RunArg,
    /// Publish at this rate, in Hz, until Ctrl-C or the end of `--for` [default: once]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Time for which to publish
    #[arg(long = "for", value_name = "TIME", requires = "rate", allow_hyphen_values = true)]
    time: Option<TimeSpan>,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1e-3..=1e3).contains(&rate) => Ok(rate),
        _ => Err("expected a number of values a second, from 0.001 to 1000".to_string()),
    }
}

impl Pub {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let (index, topic) = find(&run.plan, &self.topic)?;
        // errors in the value are reported first, because they can be fixed immediately
        let mut bytes = encode(&topic.layout, &self.fields.join(" "))?;
        fed_from_outside(&run.plan, topic)?;
        let watch = Watch::open(&run, topic)?;
        pose::complete(topic, &mut bytes, &mut watch.reader()?)?;
        let feed = Feed::open(&run.folder.domain()?, topic).with_context(|| {
            format!("values cannot be published on `{}` of run {}", topic.name, run.folder.id())
        })?;
        let (mut tap, begin) = (watch.tap()?, Instant::now());
        let Some(rate) = self.rate else {
            // publications from before this command do not confirm it
            while tap.read(|_, _| {}) {}
            feed.send(&bytes)?;
            let end = watch.follow(POLL, Some(ARRIVAL), || {
                let mut look = Look::Nothing;
                while look != Look::Enough
                    && tap.read(|_, found| look = if found == bytes { Look::Enough } else { Look::Seen })
                {
                }
                Ok(look)
            })?;
            return match end {
                End::Enough => {
                    errln!("published on `{}`", topic.name);
                    Ok(ExitCode::SUCCESS)
                }
                End::Interrupted => bail!("interrupted before the value was published"),
                End::RunOver => bail!("run {} ended before the value was published", run.folder.id()),
                End::Time => bail!(
                    "the bridge did not publish the value within {} s: does another program publish on `{}`?",
                    ARRIVAL.as_secs(),
                    topic.name
                ),
            };
        };
        let (interval, mut sent) = (Duration::from_secs_f64(1.0 / rate), 0u32);
        let published = || run.region.topics()[index].published.load(Relaxed);
        let before = published();
        let poll = interval.min(Duration::from_millis(20));
        let end = watch.follow(poll, self.time.map(|time| Duration::from_nanos(time.ns)), || {
            if begin.elapsed() >= interval * sent {
                feed.send(&bytes)?;
                sent += 1;
            }
            let mut look = Look::Nothing;
            while tap.read(|_, _| look = Look::Seen) {}
            Ok(look)
        })?;
        if end == End::RunOver {
            errln!("run {} is over", run.folder.id());
        }
        let published = published().saturating_sub(before);
        errln!("{sent} values sent, {published} published in {:.1} s", begin.elapsed().as_secs_f64());
        Ok(ExitCode::SUCCESS)
    }
}

/// Checks that a bridge publishes the topic; every other topic is published by a component.
pub(crate) fn fed_from_outside(plan: &Plan, topic: &TopicPlan) -> anyhow::Result<()> {
    let is_bridge = |program: &Program| matches!(program, Program::Builtin { kind } if kind == <Iceoryx2Bridge as motorium::component::Component>::KIND);
    let writer = &plan.components[topic.writer];
    if is_bridge(&writer.program) {
        return Ok(());
    }
    let fed: Vec<String> = plan
        .topics
        .iter()
        .filter(|topic| is_bridge(&plan.components[topic.writer].program))
        .map(|topic| format!("`{}`", topic.name))
        .collect();
    let advice = match fed.as_slice() {
        [] => "the graph has no `bridge.iceoryx2` for outside values".to_string(),
        fed => format!("only {} can be published from outside", fed.join(", ")),
    };
    bail!(
        "`{}` is published by component `{}`, and cannot be published from outside; {advice}",
        topic.name,
        writer.name
    )
}
