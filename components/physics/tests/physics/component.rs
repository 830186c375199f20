//! `physics.articulated`, `physics.rapier` and `physics.mujoco` in a graph, in lockstep and hosted in this
//! process.

use std::path::PathBuf;

use motorium::component::{Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::graph;
use motorium::launcher::{Exit, Options, Report};
use motorium::region::{Refusal, Refused};
use motorium::session::run;
use motorium::state::{BaseState, JointCommand, JointState};
use motorium::transport::{Input, Output};
use motorium::worker::{Kind, Registry, RobotSource};
use motorium_physics::{ArticulatedPhysics, MujocoPhysics, RapierPhysics};

use crate::engines::has_mujoco;

const KINDS: [&str; 2] = ["physics.articulated", "physics.rapier"];

/// Commands every joint to a fixed offset from its first measured position, until step `until`.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct DriverConfig {
    offset: f64,
    until: u64,
    stiffness: f64,
}

struct Driver {
    config: DriverConfig,
    state: Input<JointState>,
    command: Output<JointCommand>,
    start: Option<Vec<f64>>,
    last: Vec<f64>,
}

impl Component for Driver {
    const KIND: &'static str = "test.driver";
    const SUMMARY: &'static str = "sends joints to an offset";
    const RESETS: bool = true;
    type Config = DriverConfig;

    fn declare(_: &DriverConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("state", "joint state");
        declare.output::<JointCommand>("command", "joint commands");
        Ok(())
    }

    fn configure(config: DriverConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (state, command) = (setup.input("state")?, setup.output("command")?);
        Ok(Self { config, state, command, start: None, last: Vec::new() })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(state) = self.state.latest() else { return Ok(()) };
        let start = self.start.get_or_insert_with(|| state.position().to_vec());
        self.last.clear();
        self.last.extend_from_slice(state.position());
        if tick.index < self.config.until {
            let mut command = self.command.loan()?;
            command.set_count(start.len());
            command.velocity_mut().fill(0.0);
            command.effort_mut().fill(0.0);
            command.kp_mut().fill(self.config.stiffness);
            command.kd_mut().fill(50.0);
            let goals =
                start.iter().enumerate().map(|(i, q)| if i < 7 { q + self.config.offset } else { *q });
            command.position_mut().iter_mut().zip(goals).for_each(|(position, goal)| *position = goal);
            command.publish()?;
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.start = None;
        self.last.clear();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "start": self.start, "last": self.last }))
    }
}

/// Records the received base states.
#[derive(Default, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct WatcherConfig {}

struct Watcher {
    base: Input<BaseState>,
    seen: u64,
    last: BaseState,
}

impl Component for Watcher {
    const KIND: &'static str = "test.watcher";
    const SUMMARY: &'static str = "watches a base";
    type Config = WatcherConfig;

    fn declare(_: &WatcherConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<BaseState>("base_state", "base state");
        Ok(())
    }

    fn configure(_: WatcherConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { base: setup.input("base_state")?, seen: 0, last: BaseState::default() })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        if let Some(base) = self.base.latest() {
            self.last = *base;
            self.seen += 1;
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let BaseState { position, orientation, linear_velocity, .. } = self.last;
        Some(serde_json::json!({
            "seen": self.seen, "position": position, "orientation": orientation, "velocity": linear_velocity,
        }))
    }
}

pub(crate) fn registry() -> Registry {
    let check = |robot: &RobotReference| {
        motorium_robots::load(&robot.urdf, &robot.base)
            .map(|_| Vec::new())
            .map_err(|error| ConfigError::new(error.to_string()))
    };
    Registry::new(
        RobotSource { check },
        [
            Kind::of::<ArticulatedPhysics>(),
            Kind::of::<RapierPhysics>(),
            Kind::of::<MujocoPhysics>(),
            Kind::of::<Driver>(),
            Kind::of::<Watcher>(),
        ],
    )
}

fn graph_text(kind: &str, driver: &str, physics: &str) -> String {
    format!(
        r#"
name = "physics-test"
clock = "lockstep"
seed = 1

[robot.panda]
urdf = "panda"

[component.physics]
kind = "{kind}"
robot = "panda"
rate = "1 kHz"
publish = {{ joint_state = "panda/joint_state" }}
subscribe = {{ joint_command = "panda/joint_command" }}
config = {{ {physics} }}

[component.driver]
kind = "test.driver"
trigger = "panda/joint_state"
subscribe = {{ state = "panda/joint_state" }}
publish = {{ command = "panda/joint_command" }}
config = {{ {driver} }}

[safety]
stale_after = "5 ms"
safe_state = "hold"
"#
    )
}

fn check(text: String) -> Result<graph::Checked, graph::GraphError> {
    graph::check(&PathBuf::from("physics-test.toml"), text, &[], &registry(), &graph::Machine::detect())
}

fn run_for(seconds: u64, kind: &str, driver: &str) -> Report {
    let mut plan = check(graph_text(kind, driver, "")).unwrap_or_else(|error| panic!("{error}")).plan;
    plan.duration_ns = Some(seconds * 1_000_000_000);
    let options = Options::threads();
    run(plan, &registry(), &options, &mut |_| ()).unwrap()
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn a_commanded_arm_arrives_identically_without_allocation() {
    for kind in KINDS.into_iter().chain(has_mujoco().then_some("physics.mujoco")) {
        let runs = [0, 1].map(|_| run_for(2, kind, "offset = 0.1, until = 100000, stiffness = 2000.0"));
        for report in &runs {
            assert_eq!(report.exit, Exit::Finished, "{report:?}");
            let driver = &report.results["driver"];
            for (i, (start, last)) in
                numbers(&driver["start"]).iter().zip(numbers(&driver["last"])).enumerate()
            {
                let goal = if i < 7 { start + 0.1 } else { *start };
                assert!((last - goal).abs() < 0.02, "{kind}: joint {i} at {last}, expected {goal}");
            }
            let physics = report.components.iter().find(|component| component.name == "physics").unwrap();
            assert_eq!(physics.allocations, Some(0), "{kind}");
            assert_eq!(physics.allocations_apart == Some(0), kind != "physics.rapier");
            assert!(report.results["physics"]["steps"].as_u64().unwrap() >= 1999);
        }
        assert!(runs[0].state_hash.is_some());
        assert_eq!(runs[0].state_hash, runs[1].state_hash, "{kind}");
    }
}

#[test]
fn arm_holds_its_position_when_commands_stop() {
    let report = run_for(2, KINDS[0], "offset = 0.3, until = 50, stiffness = 500.0");
    let physics = &report.results["physics"];
    assert!(physics["steps_in_safe_state"].as_u64().unwrap() > 1900, "{physics}");
    let driver = &report.results["driver"];
    // 50 ms are not enough to get halfway. Afterwards it must neither continue nor fall.
    for (start, last) in numbers(&driver["start"]).iter().zip(numbers(&driver["last"])) {
        assert!((last - start).abs() < 0.15, "{last}, started at {start}");
    }
}

#[test]
fn a_command_with_a_negative_gain_is_not_applied() {
    let report = run_for(1, KINDS[0], "offset = 0.5, until = 100000, stiffness = -10.0");
    let physics = report.components.iter().find(|component| component.name == "physics").unwrap();
    let refused = &physics.gate.as_ref().unwrap().refused;
    assert!(matches!(refused[..], [Refused { reason: Refusal::NegativeGain, count: 900.. }]), "{refused:?}");
    let driver = &report.results["driver"];
    for (start, last) in numbers(&driver["start"]).iter().zip(numbers(&driver["last"])) {
        assert!((last - start).abs() < 0.01, "{last}, started at {start}");
    }
}

#[test]
fn invalid_configurations_are_rejected_before_the_run() {
    for (config, expected) in [
        (r#"pose = "hom""#, "no pose is named"),
        ("position = [0.0, 1.0]", "2 numbers, expected 8: one per joint"),
        (r#"pose = "home", position = [0.0]"#, "both `pose` and `position`"),
        ("world = { gravty = [0.0, 0.0, 0.0] }", "gravty"),
        ("solver = { substeps = 0 }", "`substeps` is 0"),
        (
            r#"world = { objects = [{ name = "ground", shape = { sphere = { radius = 0.1 } }, position = [1.0, 0.0, 1.0] }] }"#,
            "the ground plane",
        ),
    ] {
        let driver = "offset = 0.1, until = 1, stiffness = 1.0";
        let error = check(graph_text(KINDS[0], driver, config)).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(expected), "{config}: {error}");
    }
}

fn legged_text(robot: &str, physics: &str, output: &str) -> String {
    format!(
        r#"
name = "legged-test"
clock = "lockstep"
seed = 1

[robot.walker]
urdf = "{robot}"

[component.physics]
kind = "physics.articulated"
robot = "walker"
rate = "1 kHz"
publish = {{ joint_state = "walker/joint_state"{output} }}
subscribe = {{ joint_command = "walker/joint_command" }}
config = {{ world = {{ ground = {{}} }}, {physics} }}

[component.driver]
kind = "test.driver"
trigger = "walker/joint_state"
subscribe = {{ state = "walker/joint_state" }}
publish = {{ command = "walker/joint_command" }}
config = {{ offset = 0.0, until = 0, stiffness = 1.0 }}

[component.watcher]
kind = "test.watcher"
rate = "1 kHz"
subscribe = {{ base_state = "walker/base_state" }}

[safety]
stale_after = "5 ms"
safe_state = "hold"
"#
    )
}

const BASE: &str = ", base_state = \"walker/base_state\"";

#[test]
fn a_floating_base_stands_and_publishes_its_pose() {
    for (physics, height) in [("", 0.2294), ("base = { position = [0.3, 0.0, 0.26] }", 0.2294)] {
        let mut plan =
            check(legged_text("quadruped", physics, BASE)).unwrap_or_else(|error| panic!("{error}")).plan;
        plan.duration_ns = Some(2_000_000_000);
        let options = Options::threads();
        let report = run(plan, &registry(), &options, &mut |_| ()).unwrap();
        assert_eq!(report.exit, Exit::Finished, "{report:?}");
        let (watcher, physics) = (&report.results["watcher"], &report.results["physics"]);
        assert!(watcher["seen"].as_u64().unwrap() > 1900, "{watcher}");
        let position = numbers(&watcher["position"]);
        assert!((position[2] - height).abs() < 3e-3, "{watcher}");
        assert!(numbers(&watcher["velocity"]).iter().all(|v| v.abs() < 1e-3), "{watcher}");
        assert!((numbers(&watcher["orientation"])[3] - 1.0).abs() < 1e-4, "{watcher}");
        assert!((numbers(&physics["base_position"])[2] - position[2]).abs() < 1e-4, "{physics}");
        let component = report.components.iter().find(|component| component.name == "physics").unwrap();
        assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    }
}

#[test]
fn quadruped_stands_equally_in_mujoco_and_articulated() {
    if !has_mujoco() {
        return;
    }
    let text = legged_text("quadruped", "", BASE).replace("physics.articulated", "physics.mujoco");
    let mut plan = check(text).unwrap_or_else(|error| panic!("{error}")).plan;
    plan.duration_ns = Some(2_000_000_000);
    let report = run(plan, &registry(), &Options::threads(), &mut |_| ()).unwrap();
    assert_eq!(report.exit, Exit::Finished, "{report:?}");
    let watcher = &report.results["watcher"];
    assert!((numbers(&watcher["position"])[2] - 0.2294).abs() < 3e-3, "{watcher}");
    assert!(numbers(&watcher["velocity"]).iter().all(|v| v.abs() < 1e-2), "{watcher}");
}

#[test]
fn base_start_is_rejected_for_a_fixed_base() {
    for (robot, physics, expected) in [
        ("panda", "base = { position = [0.0, 0.0, 0.5] }", "fixed to the world"),
        ("quadruped", "floating = false, base = { position = [0.0, 0.0, 0.5] }", "fixed to the world"),
        ("quadruped", "base = { position = [0.0, 0.0] }", "found 2 values, expected a list of 3"),
        ("quadruped", "pose = \"standin\"", "standing"),
    ] {
        let error = check(legged_text(robot, physics, "")).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(expected), "{physics}: {error}");
    }
    // A robot with a fixed base has no base state to publish.
    let error = check(legged_text("panda", "", BASE)).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("base_state"), "{error}");
}

#[test]
fn rapier_rejects_a_floating_base_and_names_the_kind() {
    let text = legged_text("quadruped", "", BASE).replace("physics.articulated", "physics.rapier");
    let error = check(text).map(|_| ()).unwrap_err();
    assert!(
        error.to_string().contains("has a floating base, which `physics.rapier` cannot simulate"),
        "{error}"
    );
    assert!(error.render(false).contains("use `kind = \"physics.articulated\"`"), "{}", error.render(false));
}
