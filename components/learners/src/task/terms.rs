//! The terms of a task, resolved for the joints and links of a robot.

use motorium_models::policy::{
    ActionKind, BaseMotion, JointTargets, Numbers, Observer, Policy, Term, TwistRanges,
};
use motorium_robots::Model;

use super::points::Pair;
use super::quantity::Subject;
use super::rhythm::Rhythm;
use super::{
    Choices, CommandRanges, MeasurementNoise, Mirror, PointMotion, Points, Quantity, Reward, Task, TaskError,
    Termination, Verdict,
};
use crate::random::Counter;

/// Reward of a step, and the verdict if the step ends the episode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Reward of the state after the step.
    pub reward: f64,
    /// Verdict of the first termination whose condition is met; `None` if the episode continues.
    pub end: Option<Verdict>,
}

/// Measured state of a robot, from which the terms of a task are evaluated.
#[derive(Clone, Copy, Debug, Default)]
pub struct RobotState<'a> {
    /// Positions of the joints in the robot's order \[rad or m\].
    pub positions: &'a [f64],
    /// Velocities of the joints \[rad/s or m/s\].
    pub velocities: &'a [f64],
    /// Efforts of the drives \[Nm or N\].
    pub efforts: &'a [f64],
    /// Motion of the base.
    pub base: BaseMotion,
    /// Height of the base in the world \[m\].
    pub height: f64,
    /// Sum of the forces of contacts on each link of [`Terms::links`] \[N\].
    pub forces: &'a [f64],
    /// Motion of each object of [`Terms::objects`].
    pub objects: &'a [PointMotion],
    /// Pixels of the images that the task observes, as in
    /// [`Measurements`](motorium_models::policy::Measurements).
    pub images: &'a [f32],
}

/// The terms of a task, with joints and links resolved for one robot. The terms need no simulation: an
/// environment and a component of a graph evaluate the same terms. Evaluation does not allocate.
#[derive(Debug)]
pub struct Terms {
    policy: Policy,
    observer: Observer,
    targets: JointTargets,
    /// Gains of each joint of the action.
    gains: Vec<[f64; 2]>,
    inputs: usize,
    choices: Option<Choices>,
    rhythm: Option<Rhythm>,
    /// Factors of each reward term, starting with its own quantity.
    rewards: Vec<Vec<(Measured, Reward)>>,
    /// Conditions of each termination, starting with its own.
    terminations: Vec<Vec<(Measured, Termination)>>,
    /// Links whose contacts are measured.
    links: Vec<String>,
    points: Points,
    commands: Option<CommandRanges>,
    noise: Option<MeasurementNoise>,
    /// Number of joints of the robot.
    joints: usize,
    /// Number of policy steps between commands.
    command_steps: usize,
    steps: usize,
    mirror: Option<Mirror>,
}

/// A quantity, and the indices of the joints or links or the points that it measures.
#[derive(Clone, Debug)]
struct Measured {
    quantity: Quantity,
    parts: Vec<usize>,
    pair: Option<Pair>,
}

/// Actions of an episode within their bounds, and the command and the points of the step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Actions<'a> {
    pub(super) newest: &'a [f64],
    pub(super) before: &'a [f64],
    pub(super) command: [f64; 3],
    pub(super) points: &'a Points,
}

impl Terms {
    /// Creates the terms of a task for the joints and links of a robot.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if the robot lacks a joint, a link or a floating base, or a term is unavailable.
    pub fn new(task: &Task, robot: &Model) -> Result<Self, TaskError> {
        let policy = task.policy()?;
        let names = robot.joint_names();
        let mut points = Points::new(&policy, robot)?;
        let has_velocities = task.command.as_ref().is_some_and(|command| command.target.is_none());
        let has_base = robot.base().floating;
        let has_joints = !policy.action.joints.is_empty();
        for (number, observation) in policy.observations.iter().enumerate() {
            let (key, found) = (format!("observations[{number}].term"), observation.term.name());
            let expected = match observation.term {
                Term::BaseLinearVelocity | Term::BaseAngularVelocity | Term::ProjectedGravity
                    if !has_base =>
                {
                    "a term that a robot with a fixed base has"
                }
                Term::Command if !has_velocities => {
                    "a term that the task has, or a table `[command]` with velocities"
                }
                Term::HeightScan => "a term that needs no other component",
                _ => continue,
            };
            return Err(TaskError::value(key, found, expected));
        }
        let mut links: Vec<String> = Vec::new();
        let mut resolve = |key: String, subject: Subject<'_>| {
            if subject.term.needs_base() && !has_base {
                let expected = "a quantity that a robot with a fixed base has";
                return Err(TaskError::value(key + ".term", subject.term.name(), expected));
            }
            if subject.term.needs_command() && !has_velocities {
                let expected = "a quantity that the task has, or a table `[command]` with velocities";
                return Err(TaskError::value(key + ".term", subject.term.name(), expected));
            }
            if matches!(subject.term, Quantity::Effort | Quantity::PoseError) && !has_joints {
                let expected = "a quantity of a base twist, which has no joints";
                return Err(TaskError::value(key + ".term", subject.term.name(), expected));
            }
            let joint = |name: &String| {
                robot.joint_index(name).ok_or_else(|| {
                    let expected = format!("a joint of {}", names.join(", "));
                    TaskError::value(format!("{key}.joint"), format!("\"{name}\""), expected)
                })
            };
            let link = |name: &String| {
                if robot.frame(name).is_err() {
                    let frames: Vec<&str> = robot.frames().iter().map(|frame| frame.name.as_str()).collect();
                    let expected = format!("a link of {}", frames.join(", "));
                    return Err(TaskError::value(format!("{key}.links"), format!("\"{name}\""), expected));
                }
                let known = links.iter().position(|known| known == name);
                Ok(known.unwrap_or_else(|| {
                    links.push(name.clone());
                    links.len() - 1
                }))
            };
            let joints = subject.joints.into_iter().flatten();
            let mut parts =
                subject.joint.into_iter().chain(joints).map(joint).collect::<Result<Vec<_>, _>>()?;
            for part in subject.links.into_iter().flatten().map(link) {
                parts.push(part?);
            }
            let pair =
                subject.points.map(|names| points.pair(&format!("{key}.points"), names)).transpose()?;
            Ok(Measured { quantity: subject.term, parts, pair })
        };
        let rewards = task.rewards.iter().enumerate().map(|(index, reward)| {
            let key = format!("rewards[{index}]");
            let own = (resolve(key.clone(), reward.subject())?, reward.clone());
            let factors = reward.times.iter().enumerate().map(|(number, factor)| {
                Ok((resolve(format!("{key}.times[{number}]"), factor.subject())?, factor.clone()))
            });
            core::iter::once(Ok(own)).chain(factors).collect::<Result<Vec<_>, TaskError>>()
        });
        let rewards = rewards.collect::<Result<Vec<_>, TaskError>>()?;
        let terminations = task.terminations.iter().enumerate().map(|(index, termination)| {
            let key = format!("terminations[{index}]");
            let own = (resolve(key.clone(), termination.subject())?, termination.clone());
            let others = termination.and.iter().enumerate().map(|(number, other)| {
                Ok((resolve(format!("{key}.and[{number}]"), other.subject())?, other.clone()))
            });
            core::iter::once(Ok(own)).chain(others).collect::<Result<Vec<_>, TaskError>>()
        });
        let terminations = terminations.collect::<Result<Vec<_>, TaskError>>()?;
        if points.has_target() && task.command.as_ref().is_none_or(|command| command.target.is_none()) {
            let expected = "points that the task has, or a table `[command]` with a `target`";
            return Err(TaskError::value("points", "\"target\"", expected));
        }
        let command_steps = task.command.as_ref().map_or(0.0, |ranges| ranges.interval * task.rate());
        Ok(Self {
            observer: Observer::new(&policy, names)?,
            targets: policy.joint_targets(names)?,
            gains: gains(&policy)?,
            inputs: policy.inputs()?,
            choices: task.choices()?,
            rhythm: Rhythm::new(&policy)?,
            mirror: task.symmetry.as_ref().map(|symmetry| task.mirror(&policy, symmetry)).transpose()?,
            rewards,
            terminations,
            links,
            points,
            commands: task.command.clone(),
            noise: task.noise,
            joints: names.len(),
            command_steps: (command_steps.round() as usize).max(1),
            steps: task.steps(),
            policy,
        })
    }

    /// Returns the observations and the action of the task.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// Returns the length of an observation.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Returns the length of an action.
    pub fn actions(&self) -> usize {
        self.policy.outputs()
    }

    /// Returns the actions among which a discrete policy chooses; `None` if actions are continuous.
    pub fn choices(&self) -> Option<&Choices> {
        self.choices.as_ref()
    }

    /// Returns the ranges of a base twist; `None` if the action commands joints.
    pub fn twist(&self) -> Option<TwistRanges> {
        self.policy.action.twist
    }

    /// Returns, for each element of an action, `true` if the element has an effect: the scale of the
    /// element's joint is not 0, or the element commands the pattern or the base.
    pub fn active_actions(&self) -> Vec<bool> {
        let joints = self.targets.targets();
        (0..self.actions()).map(|index| joints.get(index).is_none_or(|joint| joint.scale != 0.0)).collect()
    }

    pub(super) fn noise(&self) -> Option<MeasurementNoise> {
        self.noise
    }

    /// Returns the number of joints of the robot.
    pub(super) fn joints(&self) -> usize {
        self.joints
    }

    /// Returns the maximum number of policy steps of an episode.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the names of the links whose contacts are measured.
    pub fn links(&self) -> &[String] {
        &self.links
    }

    /// Returns the names of the objects whose motion is measured.
    pub fn objects(&self) -> &[String] {
        self.points.objects()
    }

    /// Returns the number of pixels of all images that the task observes.
    pub fn pixels(&self) -> usize {
        self.observer.pixels()
    }

    /// Returns `true` if a term needs the motion or the pose of the base.
    pub fn needs_base(&self) -> bool {
        let observes = |term| {
            matches!(term, Term::BaseLinearVelocity | Term::BaseAngularVelocity | Term::ProjectedGravity)
        };
        self.policy.observations.iter().any(|observation| observes(observation.term))
            || self.rewards.iter().flatten().any(|(measured, _)| measured.quantity.needs_base())
            || self.terminations.iter().flatten().any(|(measured, _)| measured.quantity.needs_base())
    }

    /// Returns `true` if the task commands velocities of the base.
    pub fn has_velocity_commands(&self) -> bool {
        self.commands.as_ref().is_some_and(|ranges| ranges.target.is_none())
    }

    /// Returns `true` if the task has a target.
    pub fn has_target(&self) -> bool {
        self.commands.as_ref().is_some_and(|ranges| ranges.target.is_some())
    }

    /// Returns the conversion of actions to joint targets.
    pub fn targets(&self) -> &JointTargets {
        &self.targets
    }

    /// Returns the quantity that the action commands, and the stiffness and damping of the drive of each
    /// joint of the action.
    pub fn drives(&self) -> (ActionKind, &[[f64; 2]]) {
        (self.policy.action.kind, &self.gains)
    }

    /// Returns the mirror of observations and actions, if the task has a symmetry.
    pub fn mirror(&self) -> Option<&Mirror> {
        self.mirror.as_ref()
    }

    /// Returns the pattern generator at the start of an episode, if the task has one.
    pub(crate) fn rhythm(&self) -> Option<Rhythm> {
        self.rhythm.clone()
    }

    pub(super) fn observer(&self) -> Observer {
        self.observer.clone()
    }

    /// Returns the points of all terms, before they are located.
    pub(super) fn points(&self) -> Points {
        self.points.clone()
    }

    /// Returns the factor of the ranges of commands after some steps of a training run.
    pub(crate) fn level(&self, steps: u64) -> f64 {
        self.commands.as_ref().map_or(1.0, |ranges| ranges.level(steps))
    }

    /// Returns the new command if one starts in this step: at the start of an episode and after each
    /// interval. The counter identifies the episode.
    pub(super) fn new_command(&self, counter: Counter, level: f64, step: usize) -> Option<[f64; 3]> {
        let ranges = self.commands.as_ref().filter(|_| step.is_multiple_of(self.command_steps))?;
        let number = (step / self.command_steps) as u64;
        Some(ranges.sample(Counter { step: number, ..counter }, level))
    }

    /// Returns the time of a step in its episode \[s\].
    pub(crate) fn time(&self, step: usize) -> f64 {
        step as f64 / self.policy.rate
    }

    fn measure(&self, measured: &Measured, state: &RobotState<'_>, actions: Actions<'_>) -> f64 {
        let parts = &measured.parts;
        let joints = self.targets.targets().iter().map(|target| target.joint);
        let root_mean = |sum: f64, count: usize| (sum / count as f64).sqrt();
        let (numbers, count) = (self.actions(), self.targets.targets().len());
        let [forward, left, turn] = actions.command;
        let motion = || measured.pair.map_or_else(PointMotion::default, |pair| actions.points.motion(pair));
        let norm = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt();
        let BaseMotion { linear_velocity: [vx, vy, vz], angular_velocity: [wx, wy, wz], gravity } =
            state.base;
        match measured.quantity {
            Quantity::Alive => 1.0,
            Quantity::JointPosition => state.positions[parts[0]],
            Quantity::JointVelocity => state.velocities[parts[0]],
            Quantity::JointEffort => state.efforts[parts[0]],
            Quantity::JointCosine => parts.iter().map(|joint| state.positions[*joint]).sum::<f64>().cos(),
            Quantity::Action => root_mean(actions.newest.iter().map(|a| a.powi(2)).sum(), numbers),
            Quantity::ActionChange => {
                let pairs = actions.newest.iter().zip(actions.before);
                root_mean(pairs.map(|(a, b)| (a - b).powi(2)).sum(), numbers)
            }
            Quantity::Effort => root_mean(joints.map(|joint| state.efforts[joint].powi(2)).sum(), count),
            Quantity::PoseError => {
                let pairs = joints.zip(&self.policy.action.default_pose);
                root_mean(pairs.map(|(joint, pose)| (state.positions[joint] - pose).powi(2)).sum(), count)
            }
            Quantity::VelocityError => ((vx - forward).powi(2) + (vy - left).powi(2)).sqrt(),
            Quantity::TurnError => (wz - turn).abs(),
            Quantity::VerticalVelocity => vz,
            Quantity::RollPitchRate => (wx.powi(2) + wy.powi(2)).sqrt(),
            Quantity::Tilt => (-gravity[2]).clamp(-1.0, 1.0).acos(),
            Quantity::BaseHeight => state.height,
            Quantity::ContactForce => parts.iter().map(|link| state.forces[*link]).sum(),
            Quantity::Distance => norm(motion().position),
            Quantity::Height => motion().position[2],
            Quantity::Speed => norm(motion().velocity),
        }
    }

    /// Evaluates the reward and the end in the state after a step.
    pub(super) fn evaluate(&self, state: &RobotState<'_>, actions: Actions<'_>) -> Outcome {
        let mut outcome = Outcome::default();
        let value =
            |(measured, factor): &(Measured, Reward)| factor.evaluate(self.measure(measured, state, actions));
        for factors in &self.rewards {
            outcome.reward +=
                factors.iter().map(value).reduce(|product, factor| product * factor).unwrap_or(0.0);
        }
        let is_met = |(measured, condition): &(Measured, Termination)| {
            condition.is_met(self.measure(measured, state, actions))
        };
        let met = self.terminations.iter().find(|conditions| conditions.iter().all(is_met));
        outcome.end = met.and_then(|conditions| conditions.first()).map(|(_, first)| first.verdict);
        outcome
    }
}

/// Returns the gains of each joint of an action.
fn gains(policy: &Policy) -> Result<Vec<[f64; 2]>, TaskError> {
    let action = &policy.action;
    let count = action.joints.len();
    let numbers = |key: &str, numbers: Option<&Numbers>, is_used: bool| match numbers {
        Some(numbers) => Ok((0..count).map(|index| numbers.get(index)).collect()),
        None if is_used => Err(TaskError::value(key, "none", "gains of the drives")),
        None => Ok(vec![0.0; count]),
    };
    let is_used = matches!(action.kind, ActionKind::Position | ActionKind::Velocity);
    let kp: Vec<f64> = numbers("action.kp", action.kp.as_ref(), action.kind == ActionKind::Position)?;
    let kd: Vec<f64> = numbers("action.kd", action.kd.as_ref(), is_used)?;
    Ok(kp.into_iter().zip(kd).map(|(kp, kd)| [kp, kd]).collect())
}
