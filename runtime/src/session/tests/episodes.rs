//! Real-time episodes, begun by the session or by a component, and entered by every worker at its next step.

use std::time::Duration;

use crate::component::{Component, ConfigureError, Episode, EpisodeDriver, EpisodeEnd, Setup, Tick};
use crate::declare::{ConfigError, Declare, StepError};
use crate::graph::{self, GraphError, Machine, Override};
use crate::launcher::{Exit, Options};
use crate::region::EventKind;
use crate::session::{Session, SessionError};
use crate::state::{StateBuffer as _, Wrench};
use crate::transport::Output;
use crate::worker::{Kind, Registry, RobotSource};

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct CounterConfig {
    /// Number of steps after which it begins or ends an episode, if the graph grants it the right.
    #[serde(default)]
    every: u64,
}

/// Publishes the number of its step in the episode, and reports the episodes that it entered.
struct Counter {
    every: u64,
    driver: Option<EpisodeDriver>,
    end: Option<EpisodeEnd>,
    step: u64,
    /// Index, seed, and index of the first step of each episode.
    episodes: Vec<[u64; 3]>,
    begun: Option<Episode>,
    count: Output<Wrench>,
}

impl Component for Counter {
    const KIND: &'static str = "test.counter";
    const SUMMARY: &'static str = "counts steps of episodes";
    type Config = CounterConfig;

    fn declare(_: &CounterConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("count", "the step in its episode, as a force along x");
        declare.may_begin_episodes();
        declare.may_end_episodes();
        Ok(())
    }

    fn configure(config: CounterConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            every: config.every,
            driver: setup.episode_driver(),
            end: setup.episode_end(),
            step: 0,
            episodes: Vec::with_capacity(64),
            begun: Some(Episode { index: 0, seed: setup.seed() }),
            count: setup.output("count")?,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        assert_eq!(tick.begins_episode, self.begun.is_some());
        if let Some(Episode { index, seed }) = self.begun.take() {
            assert_eq!(index, tick.episode);
            self.episodes.push([index, seed, tick.index]);
        }
        self.step += 1;
        if self.every > 0 && self.step >= self.every {
            if let Some(driver) = &self.driver {
                driver.begin(tick.episode + 100);
            }
            if let Some(end) = &self.end {
                end.end();
            }
        }
        self.count.send(&Wrench { force: [self.step as f64, 0.0, 0.0], ..Wrench::default() })
    }

    fn begin_episode(&mut self, episode: &Episode) -> Result<(), StepError> {
        (self.step, self.begun) = (0, Some(*episode));
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!(self.episodes))
    }
}

/// Launches a run in lockstep whose slow component is replaced by the session.
fn standing_in() -> Session<'static> {
    let options = Options::inline().standing_in_for("slow");
    launched("", &[("clock", "lockstep")], &options).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn graph(more: &str, settings: &[(&str, &str)]) -> Result<Session<'static>, GraphError> {
    launched(more, settings, &Options::threads().leaving_signals())
}

fn launched(
    more: &str,
    settings: &[(&str, &str)],
    options: &Options,
) -> Result<Session<'static>, GraphError> {
    let text = format!(
        "name = \"episodes\"\nclock = \"realtime\"\nseed = 7\n{more}\n\
         [component.fast]\nkind = \"test.counter\"\nrate = \"500 Hz\"\nschedule = \"normal\"\n\
         publish = {{ count = \"fast\" }}\n\
         [component.slow]\nkind = \"test.counter\"\nrate = \"100 Hz\"\nschedule = \"normal\"\n\
         publish = {{ count = \"slow\" }}\n"
    );
    let overrides: Vec<Override> = settings
        .iter()
        .map(|(path, value)| Override { path: (*path).to_string(), value: (*value).to_string() })
        .collect();
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Counter>()]);
    let checked = graph::check("e.toml".as_ref(), text, &overrides, &registry, &Machine::detect())?;
    Ok(Session::launch(checked.plan, &registry, options).expect("it starts"))
}

pub(super) fn launch(more: &str, settings: &[(&str, &str)]) -> Session<'static> {
    graph(more, settings).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

/// Steps until a topic was published in an episode, and returns the newest number.
pub(super) fn await_episode(session: &mut Session<'_>, topic: &str, episode: u64) -> f64 {
    loop {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
        let newest = session.read::<Wrench>(topic).unwrap();
        if let Some(newest) = newest.filter(|newest| newest.stamp.episode == episode) {
            return newest.value.force[0];
        }
    }
}

#[test]
fn every_worker_enters_an_episode_at_its_next_step() {
    let mut session = launch("", &[]);
    for topic in ["fast", "slow"] {
        await_episode(&mut session, topic, 0);
    }
    for (episode, seed) in [(1, 11), (2, 12)] {
        let before = session.time();
        assert_eq!(session.begin_episode(seed).unwrap(), episode);
        assert!(session.time() < before, "time restarts");
        assert_eq!(session.episode(), episode);
        for topic in ["fast", "slow"] {
            await_episode(&mut session, topic, episode);
        }
    }
    let report = session.stop();
    assert_eq!(report.exit, Exit::Finished);
    let found: Vec<_> = report.episodes.iter().map(|each| (each.index, each.seed)).collect();
    assert_eq!(found, [(0, 7), (1, 11), (2, 12)]);
    assert!(report.episodes.iter().all(|each| each.state_hash.is_none() && each.duration_s > 0.0));
    let steps: u64 = report.components.iter().map(|each| each.steps).sum();
    assert_eq!(report.episodes.iter().map(|each| each.steps).sum::<u64>(), steps);
    for name in ["fast", "slow"] {
        let seen: Vec<[u64; 3]> = serde_json::from_value(report.results[name].clone()).unwrap();
        let numbers: Vec<u64> = seen.iter().map(|[number, ..]| *number).collect();
        assert_eq!(numbers, [0, 1, 2], "{name}");
        assert_eq!(seen[1][1], crate::plan::component_seed(11, name), "{name} has its own seed");
        assert!(seen[0][2] == 0 && seen[0][2] < seen[1][2] && seen[1][2] < seen[2][2], "steps count on");
    }
    let began = report.events.iter().filter(|event| event.kind == EventKind::EpisodeBegan);
    assert_eq!(
        began.map(|event| (event.value, event.episode)).collect::<Vec<_>>(),
        [(1.0, Some(1)), (2.0, Some(2))]
    );
}

#[test]
fn real_time_run_is_divided_into_three_episodes() {
    let mut session = launch("duration = \"60 ms\"\n[episodes]\ncount = 3\nvary_seed = true", &[]);
    session.run().unwrap();
    let report = session.stop();
    let found: Vec<_> = report.episodes.iter().map(|each| (each.index, each.seed)).collect();
    assert_eq!(found, [(0, 7), (1, 8), (2, 9)]);
    assert!(report.episodes.iter().all(|each| each.duration_s >= 0.06), "{:?}", report.episodes);
}

#[test]
fn component_ends_an_episode_early() {
    let settings = [("component.fast.ends_episode", "true"), ("component.fast.config.every", "5")];
    let mut session = launch("duration = \"60 min\"\n[episodes]\ncount = 2", &settings);
    session.run().unwrap();
    let report = session.stop();
    assert_eq!((report.episodes.len(), report.exit), (2, Exit::Finished));
}

#[test]
fn component_begins_episodes() {
    let settings = [("component.slow.begins_episodes", "true"), ("component.slow.config.every", "2")];
    let mut session = launch("", &settings);
    while session.episode() < 3 {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
    }
    let error = session.begin_episode(1).unwrap_err();
    assert!(matches!(&error, SessionError::EpisodeDriver { component } if component == "slow"), "{error}");
    let report = session.stop();
    let found: Vec<_> = report.episodes.iter().map(|each| (each.index, each.seed)).take(4).collect();
    assert_eq!(found, [(0, 7), (1, 100), (2, 101), (3, 102)]);
}

#[test]
fn episode_needs_a_reset_in_lockstep() {
    let mut session = launch("", &[("clock", "lockstep")]);
    let error = session.begin_episode(1).unwrap_err();
    assert!(error.to_string().contains("use `Session::reset`"), "{error}");
    session.step().unwrap();
}

#[test]
fn session_writes_a_topic_by_its_layout() {
    let mut session = standing_in();
    let value = Wrench { force: [1.5, 0.0, 0.0], ..Wrench::default() };
    let mut bytes = vec![0; Wrench::layout().size];
    bytes[..8].copy_from_slice(&1.5_f64.to_ne_bytes());
    let mut writer = session.writer("slow").unwrap();
    assert_eq!(*writer.layout(), Wrench::layout());
    writer.publish(&bytes).unwrap();
    assert!(writer.publish(&bytes[1..]).unwrap_err().to_string().contains("bytes"));
    let read = session.read::<Wrench>("slow").unwrap().unwrap();
    assert_eq!((read.value, read.stamp.sequence, read.stamp.publish_time), (value, 1, 0));
    session.step_until(Duration::from_millis(4)).unwrap();
    session.writer("slow").unwrap().publish(&bytes).unwrap();
    assert_eq!(session.read::<Wrench>("slow").unwrap().unwrap().stamp.publish_time, 4_000_000);
    assert!(matches!(session.writer("fast"), Err(SessionError::NotOurs { .. })));
    let error = session.publish("slow", &value).unwrap_err().to_string();
    assert!(error.contains("a different type"), "{error}");
}

#[test]
fn replaced_component_never_counts_as_hung() {
    let options = Options::threads().leaving_signals().standing_in_for("slow");
    let settings = [("component.slow.hang_after", "30 ms")];
    let mut session =
        launched("", &settings, &options).unwrap_or_else(|error| panic!("{}", error.render(false)));
    // three times as long, without a publication on its topic
    let steps = |session: &mut Session<'_>| session.read::<Wrench>("fast").unwrap();
    while steps(&mut session).is_none_or(|newest| newest.stamp.sequence < 50) {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
    }
    let bytes = vec![0; Wrench::layout().size];
    session.writer("slow").unwrap().publish(&bytes).unwrap();
    assert_eq!(session.read::<Wrench>("slow").unwrap().unwrap().value, Wrench::default());
    let report = session.stop();
    assert_eq!(report.exit, Exit::Finished);
    assert!(report.warnings.iter().all(|warning| !warning.contains("slow")), "{:?}", report.warnings);
}

#[test]
fn check_refuses_conflicting_divisions_into_episodes() {
    let refused = |more: &str, settings: &[(&str, &str)]| graph(more, settings).unwrap_err().render(false);
    let begins = ("component.slow.begins_episodes", "true");
    let both = refused("duration = \"1 s\"\n[episodes]\ncount = 2", &[begins]);
    assert!(both.contains("both divide the run"), "{both}");
    let ended = refused("", &[begins, ("component.fast.ends_episode", "true")]);
    assert!(ended.contains("`slow` begins episodes and `fast` ends them"), "{ended}");
    let twice = refused("", &[begins, ("component.fast.begins_episodes", "true")]);
    assert!(twice.contains("both begin episodes"), "{twice}");
    let simulated = refused("", &[begins, ("clock", "lockstep")]);
    assert!(simulated.contains("begins episodes in lockstep"), "{simulated}");
    let endless = refused("[episodes]\ncount = 2", &[]);
    assert!(endless.contains("episodes without an end"), "{endless}");
}
