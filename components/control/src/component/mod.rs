//! `control.qp`: leads frames of a robot to their targets by differential inverse kinematics.

mod assembly;
mod config;
mod goals;
mod reach;

pub use config::{
    CartesianConfig, Feedback, LimitsConfig, PerJoint, PositionLimitConfig, PostureConfig,
    QpControllerConfig, TaskConfig, VelocityLimitConfig,
};

use motorium::component::{Checkpoint, Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{JointCommand, JointState};
use motorium::telemetry::set_apart;
use motorium::transport::{Input, Output, Parameter};
use motorium_robots::{Kinematics, Model};
use nalgebra::DVector;

use crate::{
    CommandComposer, DifferentialIk, IkSettings, JointSetpoint, RobotState,
    limits::{PositionLimit, VelocityLimit},
    solver::{ClarabelSettings, ClarabelSolver},
    tasks::{PostureSettings, PostureTask},
};
use assembly::{Assembly, GAINS, WEIGHTS};
use reach::Reach;

/// Turns pose targets into joint commands, once per step; see [`DifferentialIk`].
///
/// It begins with the first joint state, from where the robot is; after a crash with the setpoint of before, if the
/// robot is still near it. Without a fresh joint state it commands nothing, so that the drives reach their safe state by
/// themselves, and begins anew when one comes. If a tick has no solution the setpoint stands still for that tick.
pub struct QpController {
    joint_state: Input<JointState>,
    joint_command: Output<JointCommand>,
    model: Model,
    /// At the joint positions the tasks are evaluated at.
    kinematics: Kinematics,
    /// At the measured joint positions.
    measured: Kinematics,
    q: DVector<f64>,
    reaches: Vec<Reach>,
    postures: Vec<HeldPosture>,
    position: PositionLimit,
    velocity: VelocityLimit,
    ik: DifferentialIk,
    setpoint: JointSetpoint,
    composer: CommandComposer,
    feedback: Feedback,
    max_lead: f64,
    state_timeout_ns: u64,
    target_timeout_ns: u64,
    kp_scale: Parameter<f64>,
    kd_scale: Parameter<f64>,
    velocity_fraction: Parameter<f64>,
    memory: Checkpoint,
    /// The setpoint before a crash.
    remembered: Option<Vec<f64>>,
    /// Time of the last step that commanded something, ns.
    last_ns: Option<u64>,
    unsolved: u64,
    stale: u64,
}

struct HeldPosture {
    task: PostureTask,
    as_found: bool,
    gain: Parameter<f64>,
    weight: Parameter<f64>,
}

impl Component for QpController {
    const KIND: &'static str = "control.qp";
    const SUMMARY: &'static str =
        "differential inverse kinematics: pose targets to joint commands, within limits";
    type Config = QpControllerConfig;

    fn declare(config: &QpControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = declare.robot().ok_or_else(|| {
            ConfigError::new("it controls a robot, and the component names none")
                .advise("add `robot = \"NAME\"` to the component")
        })?;
        // the period is not known yet; it changes no more than a default
        let assembly = Assembly::new(config, robot, 0.0)?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        for cartesian in &assembly.cartesian {
            Reach::declare(cartesian, declare);
        }
        declare.output::<JointCommand>(
            "joint_command",
            "setpoints, feed-forward efforts and gains of all joints",
        );
        for posture in &assembly.postures {
            let PostureSettings { gain, weight } = *posture.task.settings();
            let name = |parameter: &str| format!("{}_{parameter}", posture.name);
            declare.float(&name("gain"), gain, GAINS, "1/s", "rate at which the posture is approached");
            declare.float(&name("weight"), weight, WEIGHTS, "1/(rad/s)", "cost of a joint velocity error");
        }
        declare.float("kp_scale", 1.0, 0.0..=2.0, "", "factor of the stiffness of all joints");
        declare.float("kd_scale", 1.0, 0.0..=2.0, "", "factor of the damping of all joints");
        let fraction = assembly.velocity.fraction;
        declare.float(
            "velocity_fraction",
            fraction,
            0.0..=1.0,
            "",
            "fraction of the velocity limits that is used",
        );
        Ok(())
    }

    fn configure(config: QpControllerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let assembly = Assembly::new(&config, &robot, setup.period().as_secs_f64())?;
        let model = assembly.model;
        let at_rest = vec![0.0; model.nv()];
        let reaches = assembly.cartesian.into_iter().map(|cartesian| Reach::new(cartesian, setup));
        let reaches = reaches.collect::<Result<_, _>>()?;
        let postures = assembly.postures.into_iter().map(|posture| {
            Ok(HeldPosture {
                gain: setup.parameter(&format!("{}_gain", posture.name))?,
                weight: setup.parameter(&format!("{}_weight", posture.name))?,
                task: posture.task,
                as_found: posture.as_found,
            })
        });
        let postures = postures.collect::<Result<_, ConfigureError>>()?;
        let mut memory = setup.checkpoint(model.nv())?;
        let solver = ClarabelSolver::new(DifferentialIk::structure(&model), ClarabelSettings::default());
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            joint_command: setup.output("joint_command")?,
            kinematics: Kinematics::new(&model),
            measured: Kinematics::new(&model),
            q: DVector::zeros(model.nv()),
            reaches,
            postures,
            position: assembly.position,
            velocity: assembly.velocity,
            ik: DifferentialIk::with_solver(solver, IkSettings { damping: config.damping }),
            setpoint: JointSetpoint::new(&model, &at_rest),
            composer: assembly.composer,
            feedback: config.feedback,
            max_lead: config.max_lead,
            state_timeout_ns: nanoseconds(config.state_timeout),
            target_timeout_ns: nanoseconds(config.target_timeout),
            kp_scale: setup.parameter("kp_scale")?,
            kd_scale: setup.parameter("kd_scale")?,
            velocity_fraction: setup.parameter("velocity_fraction")?,
            remembered: memory.resume(),
            memory,
            last_ns: None,
            unsolved: 0,
            stale: 0,
            model,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let dt = tick.dt();
        if !self.read_state()? {
            return Ok(());
        }
        let unbroken =
            |last| tick.time_ns.saturating_sub(last) <= self.state_timeout_ns.max(2 * period_ns(tick));
        if !self.last_ns.is_some_and(unbroken) {
            self.begin();
        }
        self.last_ns = Some(tick.time_ns);
        self.prepare(dt);
        self.solve(dt);
        for reach in &mut self.reaches {
            reach.judge(&self.model, &self.measured, dt);
        }
        self.memory.save(self.setpoint.position().iter().copied());
        self.publish(dt)
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut worst: Option<goals::PoseError> = None;
        let mut reached = 0;
        let mut tasks = serde_json::Map::new();
        for reach in &self.reaches {
            let (count, error) = reach.goals.summary();
            reached += count;
            worst = error.map(|error| worst.map_or(error, |worst| worst.worse(error))).or(worst);
            tasks.insert(reach.name.clone(), reach.result());
        }
        Some(serde_json::json!({
            "position_error_m": worst.map(|error| error.position),
            "orientation_error_rad": worst.map(|error| error.orientation),
            "goals_reached": reached,
            "tasks": tasks,
            "steps_without_solution": self.unsolved,
            "steps_without_fresh_state": self.stale,
        }))
    }
}

impl QpController {
    /// Takes over the newest joint state. False if there is none to act upon.
    fn read_state(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(false) };
        if state.age_ns() > self.state_timeout_ns {
            self.stale += 1;
            self.last_ns = None;
            return Ok(false);
        }
        if state.count() != self.model.nv() {
            return Err(StepError::failed(
                "the joint state has another number of joints than the robot's model",
            ));
        }
        self.q.copy_from_slice(state.position());
        self.measured.update(&self.model, self.q.as_slice());
        Ok(true)
    }

    /// Begins where the robot is, or with the setpoint of before a crash.
    fn begin(&mut self) {
        let near = |setpoint: &Vec<f64>| {
            setpoint.iter().zip(&self.q).all(|(setpoint, q)| (setpoint - q).abs() <= self.max_lead)
        };
        let remembered = self.remembered.as_ref().filter(|setpoint| near(setpoint));
        self.setpoint.reset(remembered.map_or(self.q.as_slice(), Vec::as_slice));
        // it is stale from now on; emptied in place, for its memory is not to be given back within a step
        if let Some(remembered) = &mut self.remembered {
            remembered.fill(f64::NAN);
        }
        self.composer.rest();
        for reach in &mut self.reaches {
            reach.stay(self.measured.pose(&self.model, reach.task.frame()));
        }
        for posture in self.postures.iter_mut().filter(|posture| posture.as_found) {
            posture.task.set_target(self.q.as_slice());
            posture.as_found = false;
        }
    }

    /// Takes over parameters and targets.
    fn prepare(&mut self, dt: f64) {
        let max_gain = 0.5 / dt;
        for reach in &mut self.reaches {
            reach.prepare(max_gain, self.target_timeout_ns);
        }
        for posture in &mut self.postures {
            let (gain, weight) = (posture.gain.get().min(max_gain), posture.weight.get());
            posture.task.set_settings(PostureSettings { gain, weight });
        }
        self.velocity.fraction = self.velocity_fraction.get();
    }

    /// Moves the setpoint by one tick.
    fn solve(&mut self, dt: f64) {
        let (kinematics, q) = match self.feedback {
            Feedback::Measured => (&self.measured, self.q.as_slice()),
            Feedback::Setpoint => {
                self.kinematics.update(&self.model, self.setpoint.position());
                (&self.kinematics, self.setpoint.position())
            }
        };
        let state = RobotState { model: &self.model, kinematics, q };
        self.ik.begin();
        for reach in &mut self.reaches {
            self.ik.add_task(&state, &mut reach.task);
        }
        for posture in &mut self.postures {
            self.ik.add_task(&state, &mut posture.task);
        }
        self.ik.add_limit(&state, &self.position, dt);
        self.ik.add_limit(&state, &self.velocity, dt);
        match set_apart(|| self.ik.solve()) {
            Ok(v) => self.setpoint.integrate(v, dt),
            Err(_) => {
                self.unsolved += 1;
                self.setpoint.hold();
            }
        }
        self.setpoint.limit_lead(self.q.as_slice(), self.max_lead);
    }

    fn publish(&mut self, dt: f64) -> Result<(), StepError> {
        self.composer.follow(&self.setpoint, dt);
        let composed = self.composer.compose(&self.model, self.q.as_slice(), &self.setpoint);
        let (kp_scale, kd_scale) = (self.kp_scale.get(), self.kd_scale.get());
        let mut command = self.joint_command.loan()?;
        command.set_count(composed.position.len());
        command.position_mut().copy_from_slice(composed.position.as_slice());
        command.velocity_mut().copy_from_slice(composed.velocity.as_slice());
        command.effort_mut().copy_from_slice(composed.effort.as_slice());
        for (scaled, kp) in command.kp_mut().iter_mut().zip(&composed.kp) {
            *scaled = kp_scale * kp;
        }
        for (scaled, kd) in command.kd_mut().iter_mut().zip(&composed.kd) {
            *scaled = kd_scale * kd;
        }
        command.publish()
    }
}

fn period_ns(tick: &Tick) -> u64 {
    nanoseconds(tick.period)
}

fn nanoseconds(time: std::time::Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
