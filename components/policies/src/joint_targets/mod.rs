//! `policy.joint_targets`: converts the actions of a policy to joint commands at the rate of the loop.

mod config;
mod source;

pub use config::{ActionTable, ChunksConfig, JointTargetsConfig, PolicySource, WhenStale};

use std::path::Path;

use motorium::component::{Component, ConfigureError, Episode, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::{Action, ActionChunk, MAX_ACTION};
use motorium::units::TimeSpan;
use motorium_learners::task::Rhythm;
use motorium_models::policy::{Action as PolicyAction, ActionKind, Numbers, PolicyError, PolicyFolder};
use motorium_primitives::dmp::{Jet, Quintic};
use motorium_primitives::profile::Follower;
use motorium_robots::{Gains, Model, Profile};

use crate::joint_command::{
    CommandedJoints, GainsError, JointCommandConfig, JointCommandWriter, profile_gains,
};
use crate::motion_limits::MotionLimitsConfig;
use crate::network::refused;
use crate::robot::required;
use source::{Actions, Chunks, PatternActions, Source};

/// A policy that commands the joints of a robot from the newest action of another policy, or from chunks of
/// actions.
///
/// The joints of the policy are found by name; joints that the policy does not command hold their initial
/// positions. An action is followed while it is younger than `hold`. Afterwards the joints ease to the
/// default pose, hold, or receive no more commands. If the policy has a pattern, its actions command a
/// pattern generator, which moves the joints. With limits, setpoints keep their velocity and acceleration
/// limits even if actions change abruptly; chunks always use limits.
#[derive(Debug)]
pub struct JointTargetsPolicy {
    writer: JointCommandWriter,
    clock: RunClock,
    source: Source,
    kind: ActionKind,
    default_pose: Vec<f64>,
    when_stale: WhenStale,
    /// Age from which an action is stale, ns.
    hold: u64,
    follower: Option<Follower>,
    state: State,
    /// Fraction of a transition over time, and its duration, s; time since the last transition began, s,
    /// infinite before the first; the targets at its start.
    ease: Quintic,
    ease_duration: f64,
    elapsed: f64,
    from: Vec<f64>,
    /// Targets of the policy before and after transitions, and the rates after transitions; zero without
    /// limits.
    target: Vec<f64>,
    setpoint: Vec<f64>,
    rate: Vec<f64>,
    stale: u64,
}

/// The current behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// No joint state has been read yet.
    Start,
    /// No action has arrived.
    Waiting,
    /// A fresh action is followed.
    Following,
    /// Actions are stale.
    Stale,
}

/// A configuration checked against a robot.
struct Checked {
    action: PolicyAction,
    rhythm: Option<Rhythm>,
    /// Number of outputs of the network.
    outputs: usize,
    rate: f64,
    joints: CommandedJoints,
    follower: Option<Follower>,
    when_stale: WhenStale,
    hold: u64,
}

impl Component for JointTargetsPolicy {
    const KIND: &'static str = "policy.joint_targets";
    const SUMMARY: &'static str = "commands joints by the actions of a policy, one at a time or in chunks";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = JointTargetsConfig;

    fn declare(config: &JointTargetsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        check(config, declare.folder(), declare.robot())?;
        CommandedJoints::declare(declare);
        match config.chunks {
            Some(_) => declare.input::<ActionChunk>("chunk", "actions of the policy, with their time"),
            None => declare.input::<Action>("action", "action of the policy"),
        }
        Ok(())
    }

    fn configure(config: JointTargetsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let Checked { action, rhythm, outputs, rate, joints, follower, when_stale, hold } =
            check(&config, setup.folder(), Some(&robot))?;
        let count = action.joints.len();
        // the writer uses the order of the policy and converts it to the order of the robot
        let targets =
            action.joint_targets(&action.joints).map_err(|error| ConfigError::new(error.to_string()))?;
        let source = match (config.chunks, rhythm) {
            (Some(chunks), _) => Source::Chunks(Chunks::new(setup.input("chunk")?, targets, chunks)),
            (None, Some(rhythm)) => Source::Pattern(Box::new(PatternActions::new(
                setup.input("action")?,
                targets,
                rhythm,
                outputs,
            ))),
            (None, None) => {
                Source::Actions(Actions::new(setup.input("action")?, targets, config.interpolate, rate))
            }
        };
        let command = JointCommandConfig {
            ease: TimeSpan { ns: 0 },
            gravity_compensation: config.gravity_compensation,
            ..JointCommandConfig::default()
        };
        let zeros = vec![0.0; count];
        Ok(Self {
            writer: JointCommandWriter::new(joints, &command, setup)?,
            clock: setup.clock(),
            source,
            kind: action.kind,
            default_pose: action.default_pose,
            when_stale,
            hold,
            follower,
            state: State::Start,
            ease: Quintic::new(0.0, config.ease.as_secs_f64(), Jet::default(), 1.0),
            ease_duration: config.ease.as_secs_f64(),
            elapsed: 0.0,
            from: zeros.clone(),
            target: zeros.clone(),
            setpoint: zeros.clone(),
            rate: zeros,
            stale: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.writer.read()? {
            return Ok(());
        }
        if self.state == State::Start {
            self.measure();
            self.source.start(&self.setpoint);
            if let Some(follower) = &mut self.follower {
                follower.start(&self.setpoint);
            }
            (self.state, self.elapsed) = (State::Waiting, f64::INFINITY);
        }
        let now = self.clock.grid_ns(tick, self.writer.state_ns());
        let newest = self.source.poll(now, &self.clock)?;
        let is_fresh = newest.is_some_and(|time| now.saturating_sub(time) <= self.hold);
        let next = match (newest, is_fresh) {
            (None, _) => State::Waiting,
            (Some(_), true) => State::Following,
            (Some(_), false) => State::Stale,
        };
        if next != self.state {
            self.enter(next);
        }
        self.elapsed += tick.dt();
        self.source.advance(tick.dt());
        match self.kind {
            ActionKind::Position => self.command_positions(now, tick.dt()),
            _ if next != State::Following => Ok(()),
            ActionKind::Velocity => {
                self.source.sample(now, &mut self.target);
                self.writer.command_velocities(&self.target)
            }
            ActionKind::Effort => {
                self.source.sample(now, &mut self.target);
                self.writer.command_efforts(&self.target)
            }
            // refused by `check`
            ActionKind::BaseTwist => Ok(()),
        }
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.writer.reset();
        self.source.reset();
        (self.state, self.elapsed, self.stale) = (State::Start, 0.0, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.source.result();
        result["stale"] = self.stale.into();
        Some(result)
    }
}

impl JointTargetsPolicy {
    /// Sets the setpoints to the measured positions.
    fn measure(&mut self) {
        for (joint, setpoint) in self.setpoint.iter_mut().enumerate() {
            *setpoint = self.writer.position(joint);
        }
    }

    fn enter(&mut self, next: State) {
        let was_stopped = self.state == State::Stale && self.when_stale == WhenStale::Stop;
        if was_stopped {
            // the safe state may have moved the robot
            self.measure();
            if let Some(follower) = &mut self.follower {
                follower.start(&self.setpoint);
            }
        }
        // chunks fade in and out themselves
        if was_stopped
            || !matches!(self.source, Source::Chunks(_))
            || self.when_stale == WhenStale::DefaultPose
        {
            self.from.copy_from_slice(&self.setpoint);
            self.elapsed = 0.0;
        }
        self.stale += u64::from(next == State::Stale);
        self.state = next;
    }

    fn command_positions(&mut self, now: u64, dt: f64) -> Result<(), StepError> {
        match (self.state, self.when_stale) {
            (State::Start, _) => return Ok(()),
            (State::Waiting, _) => return self.writer.hold(),
            (State::Stale, WhenStale::Stop) => return Ok(()),
            (State::Stale, WhenStale::DefaultPose) => self.target.copy_from_slice(&self.default_pose),
            (State::Stale, WhenStale::Hold) | (State::Following, _) => {
                self.source.sample(now, &mut self.target);
            }
        }
        let ease = if self.elapsed < self.ease_duration { self.ease.sample(self.elapsed).value } else { 1.0 };
        let eased = |from: f64, target: f64| from + ease * (target - from);
        let targets = self.from.iter().zip(&self.target);
        let Some(follower) = &mut self.follower else {
            // the rates remain zero
            for (setpoint, (from, target)) in self.setpoint.iter_mut().zip(targets) {
                *setpoint = eased(*from, *target);
            }
            return self.writer.command(dt, &self.setpoint, &self.rate);
        };
        for ((setpoint, rate), (from, target)) in self.setpoint.iter_mut().zip(&mut self.rate).zip(targets) {
            let eased = eased(*from, *target);
            *rate = (eased - *setpoint) / dt;
            *setpoint = eased;
        }
        follower.step(dt, &self.setpoint, &self.rate);
        self.writer.command(dt, follower.position(), follower.velocity())
    }
}

fn check(
    config: &JointTargetsConfig,
    base: &Path,
    robot: Option<&RobotReference>,
) -> Result<Checked, ConfigError> {
    let robot = required(robot, "joints")?;
    let Read { action, rate, rhythm, outputs } = read(&config.policy, base)?;
    let period = rate.recip();
    let hold = config.hold.map_or(1.5 * period, TimeSpan::as_secs_f64);
    if !(period..3600.0).contains(&hold) {
        let message = format!("{hold} s, expected at least a period of the policy, {period} s");
        return Err(ConfigError::key("hold", message));
    }
    if action.kind == ActionKind::BaseTwist {
        let message = "the action is a base twist, expected an action for joints";
        return Err(ConfigError::key("policy", message)
            .advise("wire the output `twist` of `policy.network` to a `control.wheels` instead"));
    }
    let is_position = action.kind == ActionKind::Position;
    let when_stale = match (config.when_stale, is_position, config.chunks) {
        (Some(WhenStale::DefaultPose | WhenStale::Hold), false, _) => {
            let message = "actions are not positions, expected \"stop\"";
            return Err(ConfigError::key("when_stale", message));
        }
        (Some(given), ..) => given,
        (None, true, None) => WhenStale::DefaultPose,
        (None, true, Some(_)) => WhenStale::Hold,
        (None, false, _) => WhenStale::Stop,
    };
    for (key, is_given) in [("chunks", config.chunks.is_some()), ("limits", config.limits.is_some())] {
        if is_given && !is_position {
            return Err(ConfigError::key(key, "it requires position actions; leave it out"));
        }
    }
    for (key, is_given) in [
        ("chunks", config.chunks.is_some()),
        ("limits", config.limits.is_some()),
        ("interpolate", config.interpolate),
    ] {
        if is_given && rhythm.is_some() {
            let message = "it cannot be combined with the policy's `pattern`; leave it out";
            return Err(ConfigError::key(key, message));
        }
    }
    if config.chunks.is_some() && config.interpolate {
        return Err(ConfigError::key("interpolate", "chunks are always interpolated; leave it out"));
    }
    let loaded = crate::robot::load(robot)?;
    if config.limits.as_ref().is_some_and(|limits| limits.jerk.is_some()) {
        return Err(ConfigError::key("limits.jerk", "setpoints that follow actions have no jerk limit")
            .advise("remove `jerk`; `acceleration` limits how fast setpoints change"));
    }
    let limits = match (&config.limits, config.chunks) {
        (Some(limits), _) => Some(limits.resolve(&loaded.model, loaded.profile.as_ref())?),
        (None, Some(_)) => {
            Some(MotionLimitsConfig::default().resolve(&loaded.model, loaded.profile.as_ref())?)
        }
        (None, None) => None,
    };
    let (lower, upper) = (loaded.model.lower().clone(), loaded.model.upper().clone());
    let indices: Vec<Option<usize>> =
        action.joints.iter().map(|name| loaded.model.joint_index(name)).collect();
    let named = action.joints.iter().map(|name| (name.as_str(), "policy".to_string()));
    let joints =
        CommandedJoints::with_gains(loaded, &robot.name, config.gravity, named, |model, profile| {
            gains(&action, &robot.name, model, profile).map_err(|error| match error {
                GainsError::Missing { .. } => ConfigError::key("policy", error.to_string())
                    .advise("give `action.kp` and `action.kd` in the policy, for all joints of the robot"),
                GainsError::Profile(error) => ConfigError::new(error.to_string()),
            })
        })?;
    // all joints have been found at this point
    let indices: Vec<usize> = indices.into_iter().flatten().collect();
    let follower = limits.map(|limits| {
        let ranges = indices.iter().map(|joint| [lower[*joint], upper[*joint]]).collect();
        Follower::new(indices.iter().map(|joint| limits[*joint]).collect(), ranges)
    });
    let hold = (hold * 1e9) as u64;
    Ok(Checked { action, rhythm, outputs, rate, joints, follower, when_stale, hold })
}

/// The parts of a policy that command joints.
struct Read {
    action: PolicyAction,
    rate: f64,
    rhythm: Option<Rhythm>,
    outputs: usize,
}

/// Reads the action, the rate and the pattern of a policy.
fn read(source: &PolicySource, base: &Path) -> Result<Read, ConfigError> {
    let read = match source {
        PolicySource::Folder(folder) => {
            let folder = PolicyFolder::read(&base.join(folder)).map_err(|error| refused("policy", &error))?;
            let policy = folder.policy;
            let rhythm =
                Rhythm::new(&policy).map_err(|error| ConfigError::key("policy", error.to_string()))?;
            let outputs = policy.outputs();
            Read { action: policy.action, rate: policy.rate, rhythm, outputs }
        }
        PolicySource::Table(table) => {
            let ActionTable { rate, action } = &**table;
            action.check("policy.action.").map_err(|error| match error {
                PolicyError::Value { key, message } => ConfigError::key(key, message),
                other => ConfigError::key("policy", other.to_string()),
            })?;
            let outputs = action.joints.len();
            Read { action: action.clone(), rate: *rate, rhythm: None, outputs }
        }
    };
    let Read { rate, outputs, .. } = &read;
    if !(0.1..=1e4).contains(rate) {
        return Err(ConfigError::key("policy", format!("a rate of {rate} Hz, expected 0.1 to 10000 Hz")));
    }
    if *outputs > MAX_ACTION {
        let message = format!("{outputs} joints, but an action has at most {MAX_ACTION} numbers");
        return Err(ConfigError::key("policy", message));
    }
    Ok(read)
}

/// Returns the gains of all joints: the policy's, or the profile's if the policy has none.
fn gains(
    action: &PolicyAction,
    robot: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, GainsError> {
    let commands_all = action.joints.len() == model.joint_count();
    let mut gains = match (&action.kp, &action.kd) {
        (Some(_), Some(_)) if commands_all => Gains {
            kp: nalgebra::DVector::zeros(model.joint_count()),
            kd: nalgebra::DVector::zeros(model.joint_count()),
        },
        _ => profile_gains(robot, model, profile)?,
    };
    let replace = |numbers: &Option<Numbers>, values: &mut nalgebra::DVector<f64>| {
        let Some(numbers) = numbers else { return };
        for (index, joint) in action.joints.iter().enumerate() {
            if let Some(joint) = model.joint_index(joint) {
                values[joint] = numbers.get(index);
            }
        }
    };
    replace(&action.kp, &mut gains.kp);
    replace(&action.kd, &mut gains.kd);
    Ok(gains)
}
