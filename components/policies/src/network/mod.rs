//! `policy.network`: a trained network that maps measurements to actions.

mod config;

pub use config::{AttitudeSource, BaseVelocitySource, NetworkPolicyConfig};

use std::path::Path;

use motorium::component::{Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{
    Action, BaseEstimate, BaseState, HeightScan, ImuSample, JointState, MAX_ACTION, MAX_HEIGHTS, PoseTarget,
    TwistTarget,
};
use motorium::transport::{Input, Output, ParameterArray, Reading};
use motorium_learners::component::ImageInputs;
use motorium_learners::task::{Points, robot_difference};
use motorium_models::policy::{
    BaseMotion, JointTargets, Measurements, Observer, Policy, PolicyError, PolicyFolder, PolicyFolderError,
    PolicyNetwork, RobotDifference, Term, projected_gravity,
};
use nalgebra::{UnitQuaternion, Vector3};

use crate::robot::{required, too_few_joints};

/// A policy that runs the network of a policy folder at the rate of the policy, and publishes its actions.
///
/// Each observation term is read from its topic, clipped, scaled and stored in its history, as specified in
/// `policy.toml`. Actions are published only while every measurement has arrived and none is older than
/// `state_timeout`. Recurrent states and histories restart with each episode.
/// [`JointTargetsPolicy`](crate::JointTargetsPolicy) converts the actions to joint commands. An action that
/// is a base twist is also published as a target of `control.wheels`.
#[derive(Debug)]
pub struct NetworkPolicy {
    network: PolicyNetwork,
    observer: Observer,
    points: Points,
    policy: Policy,
    targets: JointTargets,
    inputs: Inputs,
    output: Output<Action>,
    /// Target velocity of the base, for a policy that commands the base.
    twist: Option<Output<TwistTarget>>,
    default_command: ParameterArray,
    config: NetworkPolicyConfig,
    imu_rotation: UnitQuaternion<f64>,
    last_action: Vec<f64>,
    episode: u64,
    /// Steps with an action in this episode.
    steps: u64,
    waiting: u64,
}

/// The inputs required by the policy's terms.
#[derive(Debug)]
struct Inputs {
    joints: Option<Input<JointState>>,
    base_state: Option<Input<BaseState>>,
    base_estimate: Option<Input<BaseEstimate>>,
    imu: Option<Input<ImuSample>>,
    command: Option<Input<TwistTarget>>,
    heights: Option<Input<HeightScan>>,
    target: Option<Input<PoseTarget>>,
    images: ImageInputs,
}

/// An input port.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Port {
    Joints,
    BaseState,
    BaseEstimate,
    Imu,
    Command,
    Heights,
}

impl NetworkPolicyConfig {
    /// Returns the port that a term reads.
    fn port(&self, term: Term) -> Option<Port> {
        Some(match term {
            Term::BaseLinearVelocity => match self.base_velocity {
                BaseVelocitySource::BaseState => Port::BaseState,
                BaseVelocitySource::BaseEstimate => Port::BaseEstimate,
            },
            Term::BaseAngularVelocity | Term::ProjectedGravity => match self.attitude {
                AttitudeSource::Imu => Port::Imu,
                AttitudeSource::BaseState => Port::BaseState,
                AttitudeSource::BaseEstimate => Port::BaseEstimate,
            },
            Term::Command => Port::Command,
            Term::JointPositions | Term::JointVelocities | Term::PointPosition | Term::PointVelocity => {
                Port::Joints
            }
            Term::HeightScan => Port::Heights,
            // images have a port each
            Term::LastAction | Term::Phase | Term::DepthImage | Term::GreyImage => return None,
        })
    }

    fn needs(&self, policy: &Policy, port: Port) -> bool {
        policy.observations.iter().any(|observation| self.port(observation.term) == Some(port))
    }
}

/// A policy and its network, checked against a robot.
struct Loaded {
    policy: Policy,
    network: PolicyNetwork,
    targets: JointTargets,
    observer: Observer,
    points: Points,
    /// Warning about differences of the robot's dynamics.
    warning: Option<String>,
}

pub(crate) fn refused(key: &str, error: &PolicyFolderError) -> ConfigError {
    let refusal = ConfigError::key(key, error.to_string());
    match error {
        PolicyFolderError::Read { .. } => {
            refusal.advise("name the folder with policy.toml, relative to the graph file")
        }
        _ => refusal.advise("`motorium model check` shows each term and joint"),
    }
}

fn load(
    config: &NetworkPolicyConfig,
    base: &Path,
    robot: Option<&motorium::declare::RobotReference>,
) -> Result<Loaded, ConfigError> {
    let robot = required(robot, "joints")?;
    for (key, span) in [("state_timeout", config.state_timeout), ("command_timeout", config.command_timeout)]
    {
        if span.ns < 1_000_000 {
            return Err(ConfigError::key(key, format!("{span}, expected at least 1 ms")));
        }
    }
    for (key, numbers) in [("imu_rpy", config.imu_rpy), ("command", config.command)] {
        if let Some(number) = numbers.into_iter().find(|number| !(-10.0..=10.0).contains(number)) {
            return Err(ConfigError::key(key, format!("{number}, expected -10 to 10")));
        }
    }
    let folder = PolicyFolder::read(&base.join(&config.policy)).map_err(|error| refused("policy", &error))?;
    let network = folder.network().map_err(|error| refused("policy", &error))?;
    let policy = folder.policy;
    let outputs = policy.outputs();
    if outputs > MAX_ACTION {
        let message = format!("{outputs} outputs, but an action has at most {MAX_ACTION} numbers");
        return Err(ConfigError::key("policy", message));
    }
    if let Some(rays) =
        policy.observations.iter().filter_map(|term| term.rays).find(|rays| *rays > MAX_HEIGHTS)
    {
        let message = format!("{rays} rays, but a height scan has at most {MAX_HEIGHTS}");
        return Err(ConfigError::key("policy", message));
    }
    let loaded = crate::robot::load(robot)?;
    let difference = robot_difference(&policy, &loaded);
    let model = loaded.model;
    let invalid = |error: PolicyError| match error {
        PolicyError::Joints { message } => ConfigError::key("policy", message)
            .advise("rename the joints in `action.joints`, in the order of the network's outputs"),
        other => ConfigError::key("policy", other.to_string()),
    };
    let targets = policy.joint_targets(model.joint_names()).map_err(invalid)?;
    if difference == Some(RobotDifference::Joints) {
        let message = format!(
            "joint axes or limits of `{}` differ from the policy's robot (`robot_digest.joints`)",
            robot.name
        );
        return Err(ConfigError::key("policy", message).advise(
            "train again, or remove `robot_digest` from policy.toml if the policy suits both robots",
        ));
    }
    let warning = difference.map(|_| {
        format!(
            "masses, drives or gains of `{}` differ from the policy's robot (`robot_digest.dynamics`)",
            robot.name
        )
    });
    let observer = Observer::new(&policy, model.joint_names()).map_err(invalid)?;
    let points =
        Points::new(&policy, &model).map_err(|error| ConfigError::key("policy", error.to_string()))?;
    if let Some(object) = points.objects().first() {
        let message =
            format!("\"{object}\" is not a link of the robot, and no topic has the motion of objects");
        return Err(ConfigError::key("policy", message).advise(
            "name links or \"target\" in `points`, or evaluate the policy with `motorium learn evaluate`",
        ));
    }
    Ok(Loaded { policy, network, targets, observer, points, warning })
}

impl Component for NetworkPolicy {
    const KIND: &'static str = "policy.network";
    const SUMMARY: &'static str = "runs a trained network: observation terms from topics to actions";
    const RESETS: bool = true;
    type Config = NetworkPolicyConfig;

    fn declare(config: &NetworkPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let Loaded { policy, points, warning, .. } = load(config, declare.folder(), declare.robot())?;
        if let Some(warning) = warning {
            declare.warn(warning).key("policy").advise(
                "evaluate the policy on this robot; `motorium model check` also reports the difference",
            );
        }
        if let Some(period) = declare.period() {
            let found = period.as_secs_f64().recip();
            if (found / policy.rate - 1.0).abs() > 1e-3 {
                let message = format!(
                    "the component runs at {found} Hz, but the policy was trained for {} Hz",
                    policy.rate
                );
                return Err(ConfigError::key("policy", message)
                    .advise(format!("write `rate = \"{} Hz\"` for the component", policy.rate)));
            }
        }
        if config.needs(&policy, Port::Joints) {
            declare.input::<JointState>("joint_state", "measured joint state of the robot");
        }
        if config.needs(&policy, Port::BaseState) {
            declare.input::<BaseState>("base_state", "pose and velocity of the base");
        }
        if config.needs(&policy, Port::BaseEstimate) {
            declare.input::<BaseEstimate>("base_estimate", "estimated pose and velocity of the base");
        }
        if config.needs(&policy, Port::Imu) {
            declare.input::<ImuSample>("imu", "inertial measurement on the base");
        }
        if config.needs(&policy, Port::Heights) {
            declare.input::<HeightScan>("heights", "heights of the surface around the robot");
        }
        if points.has_target() {
            declare.input::<PoseTarget>("target", "position of the target in the world");
        }
        ImageInputs::declare(&policy, declare);
        if config.needs(&policy, Port::Command) {
            declare.optional_input::<TwistTarget>("command", "desired velocity of the base, in its own axes");
        }
        declare.output::<Action>("action", "outputs of the network within their bounds");
        if policy.action.twist.is_some() {
            declare.output::<TwistTarget>("twist", "target velocity of the base, in its own axes");
        }
        declare.array(
            "command",
            &config.command,
            -10.0..=10.0,
            "",
            "command without the input `command`: forward, left, m/s, turn, rad/s",
        );
        Ok(())
    }

    fn configure(config: NetworkPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let Loaded { policy, network, targets, observer, points, .. } =
            load(&config, setup.folder(), Some(&robot))?;
        let needs = |port| config.needs(&policy, port);
        let inputs = Inputs {
            joints: needs(Port::Joints).then(|| setup.input("joint_state")).transpose()?,
            base_state: needs(Port::BaseState).then(|| setup.input("base_state")).transpose()?,
            base_estimate: needs(Port::BaseEstimate).then(|| setup.input("base_estimate")).transpose()?,
            imu: needs(Port::Imu).then(|| setup.input("imu")).transpose()?,
            command: needs(Port::Command).then(|| setup.input("command")).transpose()?,
            heights: needs(Port::Heights).then(|| setup.input("heights")).transpose()?,
            target: points.has_target().then(|| setup.input("target")).transpose()?,
            images: ImageInputs::open(&policy, setup)?,
        };
        let [roll, pitch, yaw] = config.imu_rpy;
        Ok(Self {
            inputs,
            output: setup.output("action")?,
            twist: policy.action.twist.map(|_| setup.output("twist")).transpose()?,
            default_command: setup.parameter_array("command")?,
            imu_rotation: UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            last_action: vec![0.0; policy.outputs()],
            episode: 0,
            steps: 0,
            waiting: 0,
            network,
            observer,
            points,
            policy,
            targets,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if tick.episode != self.episode {
            self.begin(tick.episode);
        }
        if !self.observe()? {
            self.waiting += 1;
            return Ok(());
        }
        self.observer.write(self.network.observation_mut());
        let outputs = self.network.run();
        for (last, output) in self.last_action.iter_mut().zip(outputs) {
            *last = self.targets.clipped(f64::from(*output));
        }
        if let (Some(output), Some(ranges)) = (&mut self.twist, self.policy.action.twist) {
            let [forward, left, turn] = ranges.twist(&self.last_action);
            output.send(&TwistTarget { linear: [forward, left, 0.0], angular: [0.0, 0.0, turn] })?;
        }
        let mut action = self.output.loan()?;
        (action.episode, action.step) = (self.episode, self.steps);
        action.set_count(self.last_action.len());
        action.value_mut().copy_from_slice(&self.last_action);
        self.steps += 1;
        action.publish()
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.begin(episode.index);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "actions": self.steps, "steps_without_measurements": self.waiting }))
    }
}

impl NetworkPolicy {
    fn begin(&mut self, episode: u64) {
        self.network.reset();
        self.observer.reset();
        self.last_action.fill(0.0);
        self.inputs.images.reset();
        (self.episode, self.steps, self.waiting) = (episode, 0, 0);
    }

    /// Reads all terms into the assembly. Returns `false` and leaves the assembly unchanged while a
    /// measurement is missing or too old.
    fn observe(&mut self) -> Result<bool, StepError> {
        let Self { inputs, policy, config, observer, points, .. } = self;
        let longest = config.state_timeout.ns;
        let is_ready = inputs.images.read(longest)?
            && is_fresh(&mut inputs.joints, longest)
            && is_fresh(&mut inputs.base_state, longest)
            && is_fresh(&mut inputs.base_estimate, longest)
            && is_fresh(&mut inputs.imu, longest)
            && is_fresh(&mut inputs.heights, longest)
            && is_fresh(&mut inputs.target, longest);
        if !is_ready {
            return Ok(false);
        }
        let command = match inputs.command.as_mut().filter(|input| input.is_wired()) {
            Some(input) => match input.latest().filter(|target| target.age_ns() <= config.command_timeout.ns)
            {
                Some(target) => [target.linear[0], target.linear[1], target.angular[2]],
                None => [0.0; 3],
            },
            None => {
                let mut command = [0.0; 3];
                command.iter_mut().zip(self.default_command.iter()).for_each(|(slot, value)| *slot = value);
                command
            }
        };
        let linear_velocity = base_velocity(inputs, config.base_velocity);
        let (angular_velocity, gravity) = attitude(inputs, config.attitude, &self.imu_rotation)?;
        let (joints, heights) = (current(&inputs.joints), current(&inputs.heights));
        if let Some(state) = joints.as_ref().filter(|state| state.count() < observer.joints()) {
            return Err(too_few_joints(observer.joints(), state.count()));
        }
        let heights = heights.as_ref().map_or(&[][..], |scan| scan.height());
        if let Some(rays) = observer.heights().filter(|rays| *rays != heights.len()) {
            let found = heights.len();
            return Err(StepError::failed(format!("height scan: expected {rays} heights, found {found}")));
        }
        let positions = joints.as_ref().map_or(&[][..], |state| state.position());
        let velocities = joints.as_ref().map_or(&[][..], |state| state.velocity());
        if let Some(target) = current(&inputs.target) {
            points.set_target(target.position);
        }
        if points.joints() > positions.len() {
            return Err(too_few_joints(points.joints(), positions.len()));
        }
        points.locate((positions, velocities), &[]);
        observer.observe(&Measurements {
            positions,
            velocities,
            base: BaseMotion { linear_velocity, angular_velocity, gravity },
            command,
            last_action: &self.last_action,
            heights,
            points: points.observed(),
            images: inputs.images.pixels(),
            time: self.steps as f64 / policy.rate,
        });
        Ok(true)
    }
}

/// Returns `true` if a required input has a value that is fresh enough.
fn is_fresh<T: motorium::state::StateBuffer>(input: &mut Option<Input<T>>, longest: u64) -> bool {
    input.as_mut().is_none_or(|input| input.latest().is_some_and(|reading| reading.age_ns() <= longest))
}

fn current<T: motorium::state::StateBuffer>(input: &Option<Input<T>>) -> Option<Reading<'_, T>> {
    input.as_ref().and_then(Input::current)
}

/// Returns the linear velocity of the base in base axes, m/s; zero if no term needs it.
fn base_velocity(inputs: &Inputs, source: BaseVelocitySource) -> [f64; 3] {
    let found = match source {
        BaseVelocitySource::BaseState => current(&inputs.base_state).map(|state| state.linear_velocity),
        BaseVelocitySource::BaseEstimate => {
            current(&inputs.base_estimate).map(|estimate| estimate.linear_velocity)
        }
    };
    found.unwrap_or_default()
}

/// Returns the angular velocity of the base, rad/s, and the direction of gravity, both in base axes; zero if
/// no term needs them.
fn attitude(
    inputs: &Inputs,
    source: AttitudeSource,
    imu: &UnitQuaternion<f64>,
) -> Result<([f64; 3], [f64; 3]), StepError> {
    let level = UnitQuaternion::identity();
    let found = match source {
        AttitudeSource::Imu => {
            current(&inputs.imu).map(|sample| (sample.angular_velocity, sample.orientation, *imu))
        }
        AttitudeSource::BaseState => {
            current(&inputs.base_state).map(|state| (state.angular_velocity, state.orientation, level))
        }
        AttitudeSource::BaseEstimate => current(&inputs.base_estimate)
            .map(|estimate| (estimate.angular_velocity, estimate.orientation, level)),
    };
    let Some((omega, orientation, sensor)) = found else { return Ok(([0.0; 3], [0.0; 3])) };
    let Some(gravity) = projected_gravity(orientation) else {
        return Err(StepError::failed("the orientation of the base is not a unit quaternion"));
    };
    let (omega, gravity) = (sensor * Vector3::from(omega), sensor * Vector3::from(gravity));
    Ok((omega.into(), gravity.into()))
}
