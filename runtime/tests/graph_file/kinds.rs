//! Stand-ins for built-in kinds, for graph files that are only checked, because the runtime itself has no
//! kinds. Their ports and configurations are chosen for these tests; the real kinds are in `components/`.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::{JointCommand, JointState, Phase, PoseTarget, Wrench};
use motorium::worker::{Kind, Registry, RobotSource};
use schemars::JsonSchema;
use serde::Deserialize;

/// Returns all kinds, and two robots: `panda` and `ur5`.
pub(crate) fn registry() -> Registry {
    Registry::new(
        RobotSource { check },
        [
            Kind::of::<Physics>(),
            Kind::of::<Encoder>(),
            Kind::of::<Controller>(),
            Kind::of::<Policy>(),
            Kind::of::<Console>(),
            Kind::of::<Recorder>(),
            Kind::of::<OldController>(),
            Kind::of::<PhaseOnly>(),
            Kind::of::<Web>(),
            Kind::of::<Datagrams>(),
        ],
    )
}

fn check(robot: &RobotReference) -> Result<Vec<String>, ConfigError> {
    let (urdf, folder) = (robot.urdf.as_str(), &robot.base);
    if matches!(urdf, "panda" | "ur5") {
        return Ok(Vec::new());
    }
    if !folder.join(urdf).exists() {
        return Err(
            ConfigError::new(format!("no model at `{urdf}`")).advise("the catalogue has `panda` and `ur5`")
        );
    }
    Err(ConfigError::new(format!("`{urdf}` is not a URDF model: it has no `<robot>` element")))
}

/// Implements the methods that are not needed for checks.
macro_rules! never_run {
    ($config:ident) => {
        type Config = $config;

        fn configure(_: $config, _: &mut Setup) -> Result<Self, ConfigureError> {
            Err(ConfigureError::failed("this kind is only there to be checked"))
        }

        fn step(&mut self, _: &Tick) -> Result<(), StepError> {
            Err(StepError::failed("this kind is only there to be checked"))
        }
    };
}

fn needs_robot(declare: &Declare) -> Result<(), ConfigError> {
    match declare.robot() {
        Some(_) => Ok(()),
        None => Err(ConfigError::new("it works on a robot, but the component names none")
            .advise("add `robot = \"panda\"`")),
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct PhysicsConfig {
    /// Gravity, m/s^2.
    gravity: [f64; 3],
    /// Steps of the engine in one step of the component.
    substeps: u32,
}

impl Default for PhysicsConfig {
    fn default() -> Self {
        Self { gravity: [0.0, 0.0, -9.81], substeps: 1 }
    }
}

struct Physics;

impl Component for Physics {
    const KIND: &'static str = "physics.articulated";
    const SUMMARY: &'static str = "simulates a robot with rapier";
    never_run!(PhysicsConfig);

    fn declare(config: &PhysicsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        needs_robot(declare)?;
        if config.gravity.iter().any(|g| g.abs() > 100.0) {
            return Err(ConfigError::key("gravity", "no planet pulls so hard").advise("use m/s^2"));
        }
        if config.substeps == 0 {
            return Err(ConfigError::key("substeps", "0 steps, expected at least 1"));
        }
        declare.actuator();
        declare.input::<JointCommand>("joint_command", "setpoints that the drives follow");
        declare.optional_input::<Wrench>("wrench", "force and torque on the hand");
        declare.output::<JointState>("joint_state", "true state of the joints");
        Ok(())
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
struct EncoderConfig {
    /// Standard deviation of the position noise, rad.
    position_noise: f64,
    /// Standard deviation of the velocity noise, rad/s.
    velocity_noise: f64,
}

struct Encoder;

impl Component for Encoder {
    const KIND: &'static str = "sensor.joint_encoder";
    const SUMMARY: &'static str = "measures joints as an encoder does";
    never_run!(EncoderConfig);

    fn declare(config: &EncoderConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        needs_robot(declare)?;
        if config.position_noise < 0.0 {
            let found = format!("is {}, expected 0 or more", config.position_noise);
            return Err(ConfigError::key("position_noise", found));
        }
        declare.input::<JointState>("joint_state", "true state of the joints");
        declare.output::<JointState>("measured", "what the encoders say");
        Ok(())
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Task {
    /// Controlled frame.
    frame: String,
    /// Weight relative to the other tasks.
    weight: f64,
}

#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct ControllerConfig {
    /// Tasks, solved simultaneously.
    tasks: Vec<Task>,
    /// Weight of all joint velocities.
    damping: f64,
}

struct Controller;

fn declare_controller(config: &ControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
    needs_robot(declare)?;
    if config.damping < 0.0 {
        return Err(ConfigError::key("damping", format!("is {}, expected 0 or more", config.damping)));
    }
    for (index, task) in config.tasks.iter().enumerate() {
        if task.weight <= 0.0 {
            return Err(ConfigError::key(
                format!("tasks.{index}.weight"),
                format!("is {}, expected more than 0 for the task of `{}`", task.weight, task.frame),
            ));
        }
    }
    declare.input::<JointState>("joint_state", "measured joint state");
    declare.input::<PoseTarget>("target", "where the hand should be");
    declare.float("gain", 4.0, 0.0..=50.0, "1/s", "how fast errors go to zero");
    declare.integer("iterations", 20, 1..=200, "most iterations of the solver");
    declare.boolean("posture", true, "whether the posture task is active");
    Ok(())
}

impl Component for Controller {
    const KIND: &'static str = "control.qp";
    const SUMMARY: &'static str = "differential inverse kinematics as a quadratic program";
    never_run!(ControllerConfig);

    fn declare(config: &ControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare_controller(config, declare)?;
        declare.output::<JointCommand>("joint_command", "setpoints for the joints");
        Ok(())
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Goal {
    /// Offset from the previous goal, m.
    offset: [f64; 3],
    /// Duration of the motion.
    duration: String,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PolicyConfig {
    /// Goals, one after the other.
    goals: Vec<Goal>,
}

struct Policy;

impl Component for Policy {
    const KIND: &'static str = "policy.dmp";
    const SUMMARY: &'static str = "reaches goals along movement primitives";
    never_run!(PolicyConfig);

    fn declare(config: &PolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        needs_robot(declare)?;
        for (index, goal) in config.goals.iter().enumerate() {
            if goal.offset.iter().any(|x| x.abs() > 2.0) || goal.duration.is_empty() {
                return Err(ConfigError::key(format!("goals[{index}].offset"), "is out of reach"));
            }
        }
        declare.input::<JointState>("joint_state", "joint state, read once to find where the hand starts");
        declare.output::<PoseTarget>("target", "where the hand should be");
        declare.stream_output::<Phase>("episodes", 16, "phase at the end of each movement");
        declare.float("speed", 1.0, 0.0..=2.0, "", "speed in relation to the demonstration");
        Ok(())
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ConsoleConfig {}

struct Console;

impl Component for Console {
    const KIND: &'static str = "log.console";
    const SUMMARY: &'static str = "prints the newest samples of topics";
    never_run!(ConsoleConfig);

    fn declare(_: &ConsoleConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.optional_input::<JointState>("joint_state", "joint state to print");
        declare.optional_input::<JointCommand>("joint_command", "joint command to print");
        declare.optional_input::<PoseTarget>("target", "target to print");
        declare.optional_input::<Phase>("phase", "phase to print");
        Ok(())
    }
}

struct Recorder;

impl Component for Recorder {
    const KIND: &'static str = "log.recorder";
    const SUMMARY: &'static str = "keeps every sample";
    never_run!(ConsoleConfig);

    fn declare(_: &ConsoleConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.stream_input::<Phase>("episodes", 64, "phases to keep");
        Ok(())
    }
}

/// An older version of the type of setpoints.
mod old {
    motorium::state_buffer! {
        /// Setpoints without gains.
        pub struct JointCommand as "motorium.JointCommand" {
            pub count: u32,
            pub reserved: u32,
            pub position: [f64; 64],
            pub effort: [f64; 64],
        }
    }
}

struct OldController;

impl Component for OldController {
    const KIND: &'static str = "control.qp_of_last_year";
    const SUMMARY: &'static str = "built when setpoints had no gains";
    never_run!(ControllerConfig);

    fn declare(config: &ControllerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare_controller(config, declare)?;
        declare.output::<old::JointCommand>("joint_command", "setpoints for the joints");
        Ok(())
    }
}

struct PhaseOnly;

impl Component for PhaseOnly {
    const KIND: &'static str = "policy.phase";
    const SUMMARY: &'static str = "publishes a phase";
    never_run!(ConsoleConfig);

    fn declare(_: &ConsoleConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Phase>("phase", "the phase");
        Ok(())
    }
}

struct Web;

impl Component for Web {
    const KIND: &'static str = "bridge.web";
    const SUMMARY: &'static str = "has no ports";
    never_run!(ConsoleConfig);

    fn declare(_: &ConsoleConfig, _: &mut Declare) -> Result<(), ConfigError> {
        Ok(())
    }
}

struct Datagrams;

impl Component for Datagrams {
    const KIND: &'static str = "sensor.udp";
    const SUMMARY: &'static str = "waits for datagrams";
    never_run!(ConsoleConfig);

    fn declare(_: &ConsoleConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("value", "newest datagram");
        declare.output::<Phase>("phase", "phase in the newest datagram");
        declare.wakes_on_descriptor();
        Ok(())
    }
}
