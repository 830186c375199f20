//! The terms of a task at the joints of a simulation.

use motorium_models::policy::{ActionKind, JointTargets, Numbers, Policy, Term};
use motorium_physics::randomise::{Draws, RandomiseConfig};
use motorium_physics::{Engine, JointCommand, Simulation, Simulator as _};

use super::{Quantity, Reward, Task, TaskError, Termination, Verdict};

/// Reward and end of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Reward of the state after the step.
    pub reward: f64,
    /// Verdict of the first termination that is met.
    pub end: Option<Verdict>,
}

/// The terms of a task with their joints resolved: what an environment evaluates in every step, without
/// allocation.
#[derive(Debug)]
pub struct Terms {
    policy: Policy,
    targets: JointTargets,
    /// Index of each joint of the action in the simulation, and its default position.
    joints: Vec<(usize, f64)>,
    kind: ActionKind,
    /// Gains of each joint of the action.
    gains: Vec<[f64; 2]>,
    clip: [f64; 2],
    observations: Vec<ObservationTerm>,
    inputs: usize,
    rewards: Vec<(Measured, Reward)>,
    terminations: Vec<(Measured, Termination)>,
    draws: Option<Draws>,
    start: [Vec<f64>; 2],
    velocity_spread: f64,
    step: f64,
    decimation: usize,
    steps: usize,
}

/// An observation term: its first number in the observation, the numbers of a step, and the steps.
#[derive(Clone, Debug)]
struct ObservationTerm {
    term: Term,
    first: usize,
    width: usize,
    history: usize,
    scale: Vec<f32>,
    clip: Option<[f32; 2]>,
}

/// A quantity and the joints that it measures.
#[derive(Clone, Debug)]
struct Measured {
    quantity: Quantity,
    joints: Vec<usize>,
}

/// Actions of an episode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Actions<'a> {
    pub(crate) newest: &'a [f32],
    pub(crate) before: &'a [f32],
}

impl Terms {
    /// Resolves the terms of a task at the joints of a simulation, which stands as episodes start without
    /// randomisation.
    ///
    /// # Errors
    ///
    /// [`TaskError`] where the robot lacks a joint, or a term is unavailable in a simulation without a graph.
    pub fn new<E: Engine>(task: &Task, simulation: &mut Simulation<E>) -> Result<Self, TaskError> {
        let policy = task.policy()?;
        let names = simulation.joint_names().to_vec();
        let targets = policy.joint_targets(&names)?;
        let index = |key: &str, name: &str| {
            names.iter().position(|joint| joint == name).ok_or_else(|| {
                TaskError::value(key, format!("\"{name}\""), format!("a joint of {}", names.join(", ")))
            })
        };
        let action = &policy.action;
        let joints = action.joints.iter().zip(&action.default_pose);
        let joints = joints
            .map(|(name, default)| Ok((index("action.joints", name)?, *default)))
            .collect::<Result<Vec<_>, TaskError>>()?;
        let gains = gains(&policy)?;
        let inputs = policy.inputs()?;
        let mut observations = Vec::new();
        let mut first = 0;
        for (number, observation) in policy.observations.iter().enumerate() {
            let width = policy.width(observation);
            if !matches!(observation.term, Term::JointPositions | Term::JointVelocities | Term::LastAction) {
                let expected =
                    "joint_positions, joint_velocities or last_action, which need no other component";
                let key = format!("observations[{number}].term");
                return Err(TaskError::value(key, observation.term.name(), expected));
            }
            observations.push(ObservationTerm {
                term: observation.term,
                first,
                width,
                history: observation.history,
                scale: each(&observation.scale, width),
                clip: observation.clip.map(|clip| clip.map(|bound| bound as f32)),
            });
            first += width * observation.history;
        }
        let measured = |key: String, term, joint: Option<&String>, many: Option<&Vec<String>>| {
            let names = joint.into_iter().chain(many.into_iter().flatten());
            let joints = names.map(|name| index(&key, name)).collect::<Result<Vec<_>, _>>()?;
            Ok::<_, TaskError>(Measured { quantity: term, joints })
        };
        let mut rewards = Vec::new();
        for (k, reward) in task.rewards.iter().enumerate() {
            let key = format!("rewards[{k}].joint");
            let found = measured(key, reward.term, reward.joint.as_ref(), reward.joints.as_ref())?;
            rewards.push((found, reward.clone()));
        }
        let mut terminations = Vec::new();
        for (k, termination) in task.terminations.iter().enumerate() {
            let key = format!("terminations[{k}].joint");
            let found =
                measured(key, termination.term, termination.joint.as_ref(), termination.joints.as_ref())?;
            terminations.push((found, termination.clone()));
        }
        let (nq, nv) = (simulation.configuration().len(), simulation.velocity().len());
        let position = task.start.position.clone();
        let velocity = task.start.velocity.clone().unwrap_or_else(|| vec![0.0; nv]);
        for (key, found, expected) in
            [("start.position", position.len(), nq), ("start.velocity", velocity.len(), nv)]
        {
            if found != expected {
                return Err(TaskError::value(key, format!("{found} numbers"), expected.to_string()));
            }
        }
        simulation
            .reset(&position, &velocity)
            .map_err(|error| TaskError::value("start", error, "a state of the robot"))?;
        let draws = (task.randomise != RandomiseConfig::default())
            .then(|| Draws::for_one_robot(&task.randomise, simulation))
            .transpose()
            .map_err(TaskError::Range)?;
        let clip = action.clip.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        Ok(Self {
            targets,
            joints,
            kind: action.kind,
            gains,
            clip,
            observations,
            inputs,
            rewards,
            terminations,
            draws,
            start: [position, velocity],
            velocity_spread: task.start.velocity_spread,
            step: task.step,
            decimation: task.decimation,
            steps: task.steps(),
            policy,
        })
    }

    /// Observations and action of the task.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// Numbers of an observation.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Numbers of an action.
    pub fn actions(&self) -> usize {
        self.joints.len()
    }

    /// For each number of an action, true if it moves a joint: its scale is not 0.
    pub fn active_actions(&self) -> Vec<bool> {
        self.targets.targets().iter().map(|target| target.scale != 0.0).collect()
    }

    /// Steps of the policy in the longest episode.
    pub fn steps(&self) -> usize {
        self.steps
    }

    pub(crate) fn draws(&self) -> Option<&Draws> {
        self.draws.as_ref()
    }

    /// Configuration, velocity and spread of the velocity at the start of an episode.
    pub(crate) fn start(&self) -> (&[f64], &[f64], f64) {
        (&self.start[0], &self.start[1], self.velocity_spread)
    }

    /// Physics steps in a step of the policy, and their duration \[s\].
    pub(crate) fn physics_steps(&self) -> (usize, f64) {
        (self.decimation, self.step)
    }

    /// Sets the commands of the drives from an action. `values` is memory for the numbers of the action,
    /// `joints` for the drives.
    pub(crate) fn command<E: Engine>(
        &self,
        simulation: &mut Simulation<E>,
        action: &[f32],
        (values, joints): (&mut [f64], &mut [f64]),
    ) {
        values.iter_mut().zip(action).for_each(|(value, action)| *value = f64::from(*action));
        self.targets.apply(values, joints);
        let commands = simulation.commands_mut();
        for ((joint, _), [kp, kd]) in self.joints.iter().zip(&self.gains) {
            let value = joints[*joint];
            commands[*joint] = match self.kind {
                ActionKind::Effort => JointCommand::effort(value),
                ActionKind::Velocity => JointCommand { velocity: value, kd: *kd, ..JointCommand::default() },
                ActionKind::Position => JointCommand::hold(value, *kp, *kd),
            };
        }
    }

    /// Moves the histories by one step and writes the newest numbers, the newest last. At the start of an
    /// episode all steps of a history are the first.
    pub(crate) fn observe<E: Engine>(
        &self,
        simulation: &Simulation<E>,
        action: &[f32],
        is_first: bool,
        out: &mut [f32],
    ) {
        for term in &self.observations {
            let all = &mut out[term.first..][..term.width * term.history];
            let newest = term.width * (term.history - 1);
            all.copy_within(term.width.., 0);
            for (k, out) in all[newest..].iter_mut().enumerate() {
                let (joint, default) = self.joints[k];
                let value = match term.term {
                    Term::JointPositions => (simulation.positions()[joint] - default) as f32,
                    Term::JointVelocities => simulation.velocities()[joint] as f32,
                    _ => action[k],
                };
                let value = term.clip.map_or(value, |[low, high]| value.clamp(low, high));
                *out = value * term.scale[k];
            }
            if is_first {
                for step in 0..term.history - 1 {
                    all.copy_within(newest.., step * term.width);
                }
            }
        }
    }

    fn measure<E: Engine>(
        &self,
        measured: &Measured,
        simulation: &Simulation<E>,
        actions: Actions<'_>,
    ) -> f64 {
        let [low, high] = self.clip;
        let clipped = |value: &f32| f64::from(*value).clamp(low, high);
        let mean = |sum: f64| (sum / self.joints.len() as f64).sqrt();
        match measured.quantity {
            Quantity::Alive => 1.0,
            Quantity::JointPosition => simulation.positions()[measured.joints[0]],
            Quantity::JointVelocity => simulation.velocities()[measured.joints[0]],
            Quantity::JointEffort => simulation.efforts()[measured.joints[0]],
            Quantity::JointCosine => {
                measured.joints.iter().map(|joint| simulation.positions()[*joint]).sum::<f64>().cos()
            }
            Quantity::Action => mean(actions.newest.iter().map(|a| clipped(a).powi(2)).sum()),
            Quantity::ActionChange => {
                let pairs = actions.newest.iter().zip(actions.before);
                mean(pairs.map(|(a, b)| (clipped(a) - clipped(b)).powi(2)).sum())
            }
        }
    }

    /// Reward and end in the state after a step.
    pub(crate) fn evaluate<E: Engine>(&self, simulation: &Simulation<E>, actions: Actions<'_>) -> Outcome {
        let mut outcome = Outcome::default();
        for (measured, reward) in &self.rewards {
            outcome.reward += reward.evaluate(self.measure(measured, simulation, actions));
        }
        let mut terminations = self.terminations.iter();
        let met = terminations
            .find(|(measured, termination)| termination.is_met(self.measure(measured, simulation, actions)));
        outcome.end = met.map(|(_, termination)| termination.verdict);
        outcome
    }
}

/// One number for each of `count`.
fn each(numbers: &Numbers, count: usize) -> Vec<f32> {
    match numbers {
        Numbers::All(value) => vec![*value as f32; count],
        Numbers::Each(values) => values.iter().map(|value| *value as f32).collect(),
    }
}

/// Gains of each joint of an action.
fn gains(policy: &Policy) -> Result<Vec<[f64; 2]>, TaskError> {
    let action = &policy.action;
    let count = action.joints.len();
    let numbers = |key: &str, numbers: Option<&Numbers>, is_used: bool| match numbers {
        Some(Numbers::All(value)) => Ok(vec![*value; count]),
        Some(Numbers::Each(values)) => Ok(values.clone()),
        None if is_used => Err(TaskError::value(key, "none", "gains of the drives")),
        None => Ok(vec![0.0; count]),
    };
    let kp = numbers("action.kp", action.kp.as_ref(), action.kind == ActionKind::Position)?;
    let kd = numbers("action.kd", action.kd.as_ref(), action.kind != ActionKind::Effort)?;
    Ok(kp.into_iter().zip(kd).map(|(kp, kd)| [kp, kd]).collect())
}
