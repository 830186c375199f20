//! A graph with a random walk, for tests of recordings.

use std::path::Path;

use motorium::graph::{self, Machine};
use motorium::launcher::{Exit, Options, Report};
use motorium::prelude::*;
use motorium::session;
use motorium::state::JointState;
use motorium::worker::{Kind, Registry, RobotSource};
use motorium_bridges::recording;

#[derive(serde::Deserialize, schemars::JsonSchema)]
struct NoConfig {}

/// Publishes a random walk that depends on the seed.
struct Walk {
    wrench: Output<Wrench>,
    state: u64,
}

impl Component for Walk {
    const KIND: &'static str = "test.walk";
    const SUMMARY: &'static str = "walks";
    const RESETS: bool = true;
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("wrench", "where it is");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { wrench: setup.output("wrench")?, state: setup.seed() | 1 })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.state =
            self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.wrench.send(&Wrench { force: [(self.state >> 11) as f64, -0.0, 1.0], ..Wrench::default() })
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.state = episode.seed | 1;
        Ok(())
    }
}

/// Publishes the sum of its inputs in the first of two joints.
struct Sum {
    wrench: Input<Wrench>,
    joints: Output<JointState>,
    sum: f64,
}

impl Component for Sum {
    const KIND: &'static str = "test.sum";
    const SUMMARY: &'static str = "adds";
    const RESETS: bool = true;
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<Wrench>("wrench", "what is added");
        declare.output::<JointState>("joints", "the sum");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { wrench: setup.input("wrench")?, joints: setup.output("joints")?, sum: 0.0 })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.sum += self.wrench.latest().map_or(0.0, |wrench| wrench.force[0]);
        let mut joints = self.joints.loan()?;
        joints.set_count(2);
        joints.position_mut().copy_from_slice(&[self.sum, 0.5]);
        joints.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.sum = 0.0;
        Ok(())
    }
}

/// Fails after 400 ms.
struct Failing {}

impl Component for Failing {
    const KIND: &'static str = "test.failing";
    const SUMMARY: &'static str = "fails";
    type Config = NoConfig;

    fn declare(_: &NoConfig, _: &mut Declare) -> Result<(), ConfigError> {
        Ok(())
    }

    fn configure(_: NoConfig, _: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {})
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if tick.time_ns < 400_000_000 { Ok(()) } else { Err(StepError::failed("as it should")) }
    }
}

pub(crate) fn registry() -> Registry {
    let own = [Kind::of::<Failing>(), Kind::of::<Walk>(), Kind::of::<Sum>(), recording::replay_kind()];
    Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, own.into_iter().chain(motorium_bridges::kinds()))
}

pub(crate) const GRAPH: &str = r#"
name     = "walk"
clock    = "lockstep"
duration = "1 s"
seed     = 7

[component.walk]
kind    = "test.walk"
rate    = "1 kHz"
publish = { wrench = "wrench" }

[component.sum]
kind      = "test.sum"
trigger   = "wrench"
subscribe = { wrench = "wrench" }
publish   = { joints = "sum" }
"#;

pub(crate) fn recorder(file: &Path) -> String {
    format!(
        "[component.recorder]\nkind = \"log.record\"\nrate = \"10 Hz\"\nschedule = \"normal\"\n\
         on_failure = \"ignore\"\nconfig = {{ output = {file:?} }}\n"
    )
}

pub(crate) fn run(text: &str, options: &Options) -> Report {
    let registry = registry();
    let checked = graph::check("walk.toml".as_ref(), text.to_string(), &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let report = session::run(plan, &registry, options, &mut |_| {}).unwrap();
    assert!(matches!(report.exit, Exit::Finished), "{:?}", report.exit);
    report
}
