//! `policy.dmp` with weights that arrive while it runs.

use std::path::Path;
use std::time::Duration;

use crate::support::{self, Nothing};
use motorium::component::{Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::graph::{self, Machine};
use motorium::launcher::{Exit, Options};
use motorium::session::Session;
use motorium::state::{PoseTarget, Weights};
use motorium::transport::{Input, Output};
use motorium::worker::{Kind, Registry, RobotSource};
use motorium_policies::DmpPolicy;
use serde_json::json;

const KERNELS: usize = 10;
/// Number of weights of the first goal's primitive: three dimensions.
const COUNT: usize = 3 * KERNELS;

/// Weights that push along y.
fn weights(version: u64, push: f64) -> Box<Weights> {
    let mut weights = Box::new(Weights::default());
    (weights.version, weights.blocks) = (version, 1);
    weights.set_count(COUNT);
    weights.value_mut().fill(0.0);
    weights.value_mut()[KERNELS..2 * KERNELS].fill(push);
    weights
}

/// Publishes weights at tick 500, and rejected ones after it.
struct Learner {
    output: Output<Weights>,
}

impl Component for Learner {
    const KIND: &'static str = "test.learner";
    const SUMMARY: &'static str = "sends weights";
    const RESETS: bool = true;
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Weights>("weights", "weights");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { output: setup.output("weights")? })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let mut loan = self.output.loan()?;
        let (version, push) = match tick.index {
            500 => (4, 30.0),
            600 => (3, 90.0),
            700 => (5, 90.0),
            _ => return Ok(()),
        };
        (loan.version, loan.block, loan.blocks) = (version, 0, 1);
        loan.set_count(if version == 5 { COUNT - 1 } else { COUNT });
        loan.value_mut().fill(0.0);
        loan.value_mut()[KERNELS..2 * KERNELS].fill(push);
        loan.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }
}

/// Records the displacement along y.
struct Recorder {
    target: Input<PoseTarget>,
    y: Vec<f64>,
}

impl Component for Recorder {
    const KIND: &'static str = "test.recorder";
    const SUMMARY: &'static str = "records the displacement along y";
    const RESETS: bool = true;
    type Config = Nothing;

    fn declare(_: &Nothing, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<PoseTarget>("target", "the target");
        Ok(())
    }

    fn configure(_: Nothing, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { target: setup.input("target")?, y: Vec::new() })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.y.extend(self.target.latest().map(|target| target.position[1]));
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.y.clear();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(json!(self.y))
    }
}

fn graph(config: &str) -> String {
    format!(
        r#"
name = "weights"
clock = "lockstep"
duration = "3 s"

[component.learner]
kind = "test.learner"
rate = "1 kHz"
publish = {{ weights = "weights" }}

[component.policy]
kind = "policy.dmp"
rate = "1 kHz"
subscribe = {{ weights = "weights" }}
publish = {{ target = "target" }}

[component.policy.config]
repeat = "forever"
start = {{ position = [0.0, 0.0, 0.0] }}
goals = [
    {{ position = [0.4, 0.0, 0.0], duration = "1 s", shape = {{ weights = {{ kernels = {KERNELS} }} }} }},
    {{ position = [0.0, 0.0, 0.0], duration = "1 s" }},
]
{config}

[component.recorder]
kind = "test.recorder"
trigger = "target"
subscribe = {{ target = "target" }}
"#
    )
}

fn kinds() -> [Kind; 3] {
    [Kind::of::<Learner>(), Kind::of::<DmpPolicy>(), Kind::of::<Recorder>()]
}

fn widest(y: &[f64]) -> f64 {
    y.iter().fold(0.0, |widest: f64, y| widest.max(y.abs()))
}

#[test]
fn new_weights_apply_to_the_next_movement() {
    let report = support::run(Path::new("weights.toml"), graph(""), kinds());
    let y: Vec<f64> = serde_json::from_value(report.results["recorder"].clone()).unwrap();
    assert_eq!(y.len(), 3000);
    assert_eq!(widest(&y[..2001]), 0.0, "the movement under way, and the one to the other goal");
    assert!(widest(&y[2001..]) > 0.01, "the next one to the first goal: {}", widest(&y[2001..]));
    assert!(y.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 2e-3), "without a jump");
    assert_eq!(
        report.results["policy"]["weights"],
        json!({ "version": 4, "taken": 1, "refused": { "place": 0, "count": 1, "version": 1, "not_finite": 0 } })
    );
    assert_eq!(support::faults(&report), (Some(0), 0), "it neither allocates nor fails");
    let again = support::run(Path::new("weights.toml"), graph(""), kinds());
    assert_eq!(report.state_hash, again.state_hash);
}

/// A session that publishes the weights.
fn session(config: &str) -> Session<'static> {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds());
    let checked = graph::check(Path::new("weights.toml"), graph(config), &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    Session::launch(plan, &registry, &Options::inline().standing_in_for("learner")).unwrap()
}

/// Runs the first movement. Returns the position along y halfway, and the digest of the episode.
fn half_way(session: &mut Session<'_>) -> (f64, String) {
    session.step_until(Duration::from_millis(500)).unwrap();
    let y = session.read::<PoseTarget>("target").unwrap().unwrap().value.position[1];
    session.step_until(Duration::from_millis(1000)).unwrap();
    (y, session.state_hash())
}

#[test]
fn equal_weights_give_equal_episodes() {
    let mut session = session("");
    let mut episode = |sent: Option<Box<Weights>>| {
        session.reset(1).unwrap();
        if let Some(weights) = sent {
            session.publish("weights", &*weights).unwrap();
        }
        half_way(&mut session)
    };
    let first = episode(Some(weights(1, 30.0)));
    assert!(first.0.abs() > 1e-3, "{first:?}");
    let straight = episode(None);
    assert_eq!(straight.0, 0.0, "an episode begins with the weights of the configuration");
    let other = episode(Some(weights(1, -30.0)));
    assert!((first.0 + other.0).abs() < 1e-12 && first.1 != other.1);
    assert_eq!(episode(Some(weights(1, 30.0))), first);
}

#[test]
fn episode_weights_wait_for_the_next_episode_and_persist() {
    let mut session = session("take_weights = \"episode\"");
    session.step().unwrap();
    session.publish("weights", &*weights(1, 30.0)).unwrap();
    assert_eq!(half_way(&mut session).0, 0.0, "not within the episode");
    session.reset(1).unwrap();
    let pushed = half_way(&mut session);
    assert!(pushed.0.abs() > 1e-3, "{pushed:?}");
    session.reset(1).unwrap();
    assert_eq!(half_way(&mut session).0, pushed.0, "they stay");
    session.reset(1).unwrap();
    session.publish("weights", &*weights(2, 0.0)).unwrap();
    assert_eq!(half_way(&mut session).0, 0.0, "before its first step");
    let result = &session.stop().results["policy"]["weights"];
    assert_eq!((&result["version"], &result["taken"]), (&json!(2), &json!(2)));
}

#[test]
fn weights_apply_from_the_next_real_time_episode() {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds());
    let text = graph("take_weights = \"episode\"")
        .replace("clock = \"lockstep\"", "clock = \"realtime\"")
        .replace("rate = \"1 kHz\"", "rate = \"500 Hz\"\nschedule = \"normal\"")
        .replace("trigger = \"target\"", "trigger = \"target\"\nschedule = \"normal\"")
        .replace("kind = \"test.learner\"", "kind = \"test.learner\"\nhang_after = \"20 ms\"");
    let checked = graph::check(Path::new("weights.toml"), text, &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let options = Options::threads().leaving_signals().standing_in_for("learner");
    let mut session = Session::launch(plan, &registry, &options).unwrap();
    // the newest target of an episode that meets a condition
    let newest = |session: &mut Session<'_>, episode: u64, is_met: fn(&PoseTarget) -> bool| loop {
        session.step_until(session.time() + Duration::from_millis(2)).unwrap();
        let read = session.read::<PoseTarget>("target").unwrap();
        let read = read.filter(|read| read.stamp.episode == episode && is_met(&read.value));
        if let Some(read) = read {
            break read.value;
        }
    };
    let target = newest(&mut session, 0, |target| target.position[0] > 0.2);
    assert_eq!((target.position[1], target.goal), (0.0, 1));
    session.publish("weights", &*weights(1, 30.0)).unwrap();
    session.begin_episode(2).unwrap();
    let first = newest(&mut session, 1, |_| true);
    assert!(
        first.position[0] > 0.2,
        "the motion starts from the current pose, not from the initial one: {first:?}"
    );
    assert_eq!(first.goal, 2, "the first goal again");
    newest(&mut session, 1, |target| target.position[1].abs() > 1e-4);
    let report = session.stop();
    assert_eq!(report.results["policy"]["weights"]["taken"], 1);
    assert_eq!((report.episodes.len(), report.exit), (2, Exit::Finished));
}

#[test]
fn relative_goals_are_equal_in_every_real_time_episode() {
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds());
    let text = r#"
name = "goals"
clock = "realtime"

[component.policy]
kind = "policy.dmp"
rate = "500 Hz"
schedule = "normal"
publish = { target = "target" }

[component.policy.config]
start = { position = [0.0, 0.0, 0.0] }
goals = [
    { offset = [0.1, 0.0, 0.0], duration = "20 ms" },
    { offset = [0.0, 0.2, 0.0], duration = "20 ms" },
]
"#;
    let checked = graph::check(Path::new("goals.toml"), text.to_owned(), &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let mut session = Session::launch(plan, &registry, &Options::threads().leaving_signals()).unwrap();
    for episode in 0..3 {
        if episode > 0 {
            assert_eq!(session.begin_episode(episode).unwrap(), episode);
        }
        let last = loop {
            session.step_until(session.time() + Duration::from_millis(2)).unwrap();
            let read = session.read::<PoseTarget>("target").unwrap();
            let arrived = |target: &PoseTarget| target.goal == 2 * (episode + 1) && target.at_goal == 1;
            if let Some(read) = read.filter(|read| read.stamp.episode == episode && arrived(&read.value)) {
                break read.value.position;
            }
        };
        for (found, goal) in last.iter().zip([0.1, 0.2, 0.0]) {
            assert!((found - goal).abs() < 1e-6, "episode {episode}: {last:?}");
        }
    }
    assert_eq!(session.stop().exit, Exit::Finished);
}

#[test]
fn weights_shape_requires_kernels_or_a_file() {
    let refuse = |shape: serde_json::Value| {
        let goal = json!({ "position": [0.1, 0.0, 0.0], "duration": "1 s", "shape": { "weights": shape } });
        let config = json!({ "start": { "position": [0.0, 0.0, 0.0] }, "goals": [goal] });
        let error = support::refusal::<DmpPolicy>(config, None, Path::new("."));
        (error.key.unwrap_or_default(), error.message)
    };
    let (key, message) = refuse(json!({ "kernels": 1 }));
    assert_eq!(key, "goals[0].shape");
    assert!(message.contains("1 kernels, expected 2 to 1000"), "{message}");
    let (_, message) = refuse(json!({ "kernels": 10, "file": "a.json" }));
    assert!(message.contains("both `kernels` and `file`"), "{message}");
}
