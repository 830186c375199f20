//! A graph for testing controllers: a simulated Panda and smooth targets, in the test's process.

use std::path::Path;

use motorium::launcher::{Exit, Options, Report};
use motorium::prelude::*;
use motorium::session::Session;
use motorium::testing::{Graph, Instance, Source};
use motorium::worker::{Kind, Registry, RobotSource};
use motorium_control::QpController;
use motorium_robots::{Dynamics, Kinematics, Model, load};
use nalgebra::{DMatrix, DVector, Point3, Vector3};
use serde::Deserialize;

/// A Panda with ideal drives, integrated implicitly. It reports the exact position of its hand and its centre
/// of mass.
struct Plant {
    command: Input<JointCommand>,
    state: Output<JointState>,
    model: Model,
    dynamics: Dynamics,
    q: DVector<f64>,
    v: DVector<f64>,
    mass: DMatrix<f64>,
    bias: DVector<f64>,
    config: PlantConfig,
    broken_limits: u64,
    largest_lead: f64,
    commands: u64,
    /// The last command.
    held: JointCommand,
}

#[derive(Clone, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PlantConfig {
    /// Actual gravity of the plant, m/s^2.
    gravity: f64,
    /// Time at which it stops publishing, s.
    silent_from: f64,
    /// Time at which it resumes publishing, s.
    silent_to: f64,
    /// Joint that is blocked.
    blocked: Option<usize>,
}

impl Default for PlantConfig {
    fn default() -> Self {
        Self { gravity: -9.81, silent_from: f64::INFINITY, silent_to: f64::INFINITY, blocked: None }
    }
}

impl Component for Plant {
    const KIND: &'static str = "test.plant";
    const SUMMARY: &'static str = "a Panda with ideal drives";
    type Config = PlantConfig;

    fn declare(_: &PlantConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.actuator();
        declare.input::<JointCommand>("joint_command", "command");
        declare.output::<JointState>("joint_state", "state");
        Ok(())
    }

    fn configure(config: PlantConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = load("panda", Path::new(".")).map_err(ConfigureError::failed)?;
        let q = robot.profile.unwrap().home(&robot.model).unwrap();
        let n = robot.model.nv();
        Ok(Self {
            command: setup.input("joint_command")?,
            state: setup.output("joint_state")?,
            dynamics: Dynamics::new(&robot.model),
            q,
            v: DVector::zeros(n),
            mass: DMatrix::zeros(n, n),
            bias: DVector::zeros(n),
            model: robot.model,
            config,
            broken_limits: 0,
            largest_lead: 0.0,
            commands: 0,
            held: JointCommand::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let (n, dt) = (self.model.nv(), tick.dt());
        let gravity = Vector3::new(0.0, 0.0, self.config.gravity);
        self.dynamics.crba(&self.model, self.q.as_slice(), &mut self.mass);
        self.dynamics.bias(
            &self.model,
            self.q.as_slice(),
            self.v.as_slice(),
            gravity,
            self.bias.as_mut_slice(),
        );
        let mut held = JointCommand::default();
        held.set_count(n);
        held.kd_mut().fill(100.0);
        if let Some(command) = self.command.latest() {
            if command.age_ns() < 5_000_000 {
                held = *command;
                self.commands += 1;
            }
            for joint in 0..n {
                let lead = (command.position()[joint] - self.q[joint]).abs();
                if command.age_ns() < 5_000_000 {
                    self.largest_lead = self.largest_lead.max(lead);
                }
                let (q, v) = (command.position()[joint], command.velocity()[joint]);
                let (lower, upper) = (self.model.lower()[joint], self.model.upper()[joint]);
                let fast = v.abs() > self.model.velocity_limit()[joint];
                self.broken_limits += u64::from(!(lower..=upper).contains(&q) || fast);
            }
        }
        self.held = held;
        // (M + dt Kd + dt^2 Kp) v' = M v + dt (Kp (q_d - q) + Kd v_d + tau - bias)
        let mut left = self.mass.clone();
        let mut right = &self.mass * &self.v - &self.bias * dt;
        for joint in 0..n {
            let (kp, kd) = (held.kp()[joint], held.kd()[joint]);
            left[(joint, joint)] += dt * kd + dt * dt * kp;
            let spring = kp * (held.position()[joint] - self.q[joint]);
            right[joint] += dt * (spring + kd * held.velocity()[joint] + held.effort()[joint]);
        }
        self.v = left.cholesky().expect("a mass matrix is positive definite").solve(&right);
        if let Some(joint) = self.config.blocked {
            self.v[joint] = 0.0;
        }
        self.q += &self.v * dt;
        if (self.config.silent_from..self.config.silent_to).contains(&tick.time()) {
            return Ok(());
        }
        let mut state = self.state.loan()?;
        state.set_count(n);
        state.position_mut().copy_from_slice(self.q.as_slice());
        state.velocity_mut().copy_from_slice(self.v.as_slice());
        state.effort_mut().fill(0.0);
        state.publish()
    }

    fn result(&self) -> Option<serde_json::Value> {
        let hand = self.model.frame("panda_hand_tcp").unwrap();
        let mut kinematics = Kinematics::new(&self.model);
        kinematics.update(&self.model, self.q.as_slice());
        let pose = kinematics.pose(&self.model, hand);
        let mut moment = Vector3::zeros();
        for (index, body) in self.model.bodies().iter().enumerate() {
            let centre = kinematics.body_pose(index) * Point3::from(body.inertia.com);
            moment += centre.coords * body.inertia.mass;
        }
        let mass: f64 = self.model.bodies().iter().map(|body| body.inertia.mass).sum();
        Some(serde_json::json!({
            "centre_of_mass": (moment / mass).as_slice(),
            "hand": pose.translation.vector.as_slice(),
            "q": self.q.as_slice(),
            "kp": self.held.kp(),
            "kd": self.held.kd(),
            "broken_limits": self.broken_limits,
            "largest_lead": self.largest_lead,
            "commands": self.commands,
        }))
    }
}

/// Targets that move along smooth segments to goals near the start, in sequence.
pub(crate) struct Targets {
    /// Offsets of the goals from the start, m.
    pub(crate) offsets: Vec<[f64; 3]>,
    /// Start, m; by default the position of the hand at the home pose.
    pub(crate) start: Option<[f64; 3]>,
    /// Duration of one segment, half of it at rest at the goal, s.
    pub(crate) segment: f64,
    /// Time at which publishing stops, s.
    pub(crate) silent_from: f64,
}

impl Default for Targets {
    fn default() -> Self {
        Self {
            offsets: vec![[0.1, 0.2, 0.1], [-0.1, -0.2, 0.2]],
            start: None,
            segment: 2.0,
            silent_from: f64::INFINITY,
        }
    }
}

impl From<Targets> for Source {
    fn from(targets: Targets) -> Self {
        let robot = load("panda", Path::new(".")).unwrap();
        let mut kinematics = Kinematics::new(&robot.model);
        kinematics.update(&robot.model, robot.profile.unwrap().home(&robot.model).unwrap().as_slice());
        let pose = kinematics.pose(&robot.model, robot.model.frame("panda_hand_tcp").unwrap());
        let home = PoseTarget {
            position: targets.start.unwrap_or(pose.translation.vector.into()),
            orientation: pose.rotation.coords.into(),
            ..Default::default()
        };
        Source::new("targets", "panda/target", move |tick| {
            (tick.time() < targets.silent_from).then(|| targets.target_at(tick.time(), home))
        })
    }
}

impl Targets {
    fn target_at(&self, time: f64, home: PoseTarget) -> PoseTarget {
        let segment = ((time / self.segment) as usize).min(self.offsets.len() - 1);
        let phase = 2.0 * (time / self.segment - segment as f64);
        let from = if segment == 0 { [0.0; 3] } else { self.offsets[segment - 1] };
        let to = self.offsets[segment];
        let s = phase.min(1.0);
        // minimum jerk
        let share = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
        let speed = 30.0 * s * s * (1.0 - s).powi(2) * 2.0 / self.segment;
        let mut target = home;
        for axis in 0..3 {
            target.position[axis] += from[axis] + share * (to[axis] - from[axis]);
            target.linear_velocity[axis] = speed * (to[axis] - from[axis]);
        }
        target.goal = segment as u64 + 1;
        target.at_goal = u64::from(phase >= 1.0);
        target
    }
}

fn table(config: &str) -> toml::Value {
    let table: toml::Table = format!("config = {config}").parse().unwrap();
    table["config"].clone()
}

/// A controller with this `config` table, without a robot and without a target.
pub(crate) fn bare_controller(config: &str) -> Instance {
    Instance::of::<QpController>("controller")
        .trigger("panda/joint_state")
        .subscribe("joint_state", "panda/joint_state")
        .publish("joint_command", "panda/joint_command")
        .set("config", table(config))
}

/// A controller of the Panda with this `config` table, which follows the targets.
pub(crate) fn controller(config: &str) -> Instance {
    bare_controller(config).robot("panda").subscribe("target", "panda/target")
}

/// A simulated Panda with this `config` table, targets, and a controller.
pub(crate) fn graph(plant: &str, targets: Targets, controller: Instance) -> Graph {
    Graph::new("control-test")
        .robot("panda", "panda")
        .with(
            Instance::of::<Plant>("plant")
                .rate("1 kHz")
                .subscribe("joint_command", "panda/joint_command")
                .publish("joint_state", "panda/joint_state")
                .set("config", table(plant)),
        )
        .with(Source::from(targets))
        .with(controller)
}

/// A simulated Panda and a controller without a target, stepped by the test. Commands go to
/// `panda/joint_command`.
pub(crate) fn session(config: &str) -> Session<'static> {
    let graph = Graph::new("control-test")
        .robot("panda", "panda")
        .with(
            Instance::of::<Plant>("plant")
                .rate("1 kHz")
                .subscribe("joint_command", "panda/joint_command")
                .publish("joint_state", "panda/joint_state"),
        )
        .with(bare_controller(config).robot("panda"));
    let kinds = [Kind::of::<Plant>(), Kind::of::<QpController>()];
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds);
    let plan = graph.check().unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    Session::launch(plan, &registry, &Options::threads()).unwrap()
}

/// A run of 4 s.
pub(crate) fn run(graph: Graph) -> Report {
    let report = graph.run("4 s").unwrap();
    assert_eq!(report.exit, Exit::Finished);
    report
}

/// Asserts that the controller did not allocate and found a solution in every step.
#[track_caller]
pub(crate) fn checked(report: Report) -> Report {
    let component = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    assert_eq!(report.results["controller"]["steps_without_solution"], 0, "{}", report.results["controller"]);
    report
}
