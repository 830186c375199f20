//! The component `learner.task`, which evaluates a task in a graph, and the topic with the progress of a
//! training run.

mod config;
mod images;
mod progress;
mod score;

pub use config::LearnerTaskConfig;
pub use images::ImageInputs;
pub use progress::{FeedError, LearningProgress, PROGRESS_TOPIC, ProgressFeed};

use std::path::Path;

use motorium::component::{Component, ConfigureError, Episode, EpisodeEnd, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::{
    Action, BaseState, Contacts, JointState, MAX_ACTION, MAX_OBSERVATION, Observation, PoseTarget, Reward,
    StateBuffer, TwistTarget,
};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use motorium_models::policy::{BaseMotion, projected_gravity};
use motorium_robots::{BasePose, RobotSource};
use motorium_worlds::{Object, World};
use score::Score;
use serde_json::json;

use crate::files;
use crate::random::Counter;
use crate::task::{RobotState, Task, TaskError, Terms, Trial};

/// Maximum number of unread values in a stream.
const CAPACITY: usize = 16;

/// Evaluates a policy on a task: publishes the observation and the reward of every policy step, and can end
/// the episode when the task ends.
///
/// The component evaluates the same terms as training, so a graph and a training environment yield the same
/// values. The component runs at the rate of the policy. The reward of a step depends on the state at the
/// next step and on the action published in between. The first observation of an episode is the last
/// observation before the first action of the policy. With `ends_episode = true` the component ends the
/// episode when the task ends; otherwise it publishes nothing between the end of the task and the start of
/// the next episode.
pub struct LearnerTask {
    terms: Terms,
    trial: Trial,
    inputs: Inputs,
    observation: Output<Observation>,
    reward: Output<Reward>,
    command: Option<Output<TwistTarget>>,
    target: Option<Output<PoseTarget>>,
    episode_end: Option<EpisodeEnd>,
    clock: RunClock,
    /// Maximum age of a measurement \[ns\].
    state_timeout: u64,
    /// Number of joints of the robot.
    joints: usize,
    /// Index of each measured link in the robot's model, and a buffer for the force on it.
    links: Vec<u32>,
    forces: Vec<f64>,
    /// Buffer for an observation.
    numbers: Vec<f32>,
    /// The two newest actions, the newest first.
    actions: [Held; 2],
    episode: u64,
    seed: u64,
    phase: Phase,
    score: Score,
    waiting: u64,
}

/// The inputs that the task's terms need.
struct Inputs {
    joints: Input<JointState>,
    action: Input<Action>,
    base: Option<Input<BaseState>>,
    contacts: Option<Input<Contacts>>,
    images: ImageInputs,
}

/// An action and its publication time \[ns\]; `None` before the first action of the episode.
#[derive(Clone, Debug)]
struct Held {
    time: Option<u64>,
    value: Vec<f64>,
}

/// Progress of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No state has been measured.
    Before,
    /// The trial has been running since the step that was due at this time \[ns\].
    Running { since: u64 },
    /// The task has ended.
    Over,
}

/// A task validated for a robot.
struct Loaded {
    task: Task,
    /// World of the task, with its files loaded.
    world: World,
    terms: Terms,
    joints: usize,
    links: Vec<u32>,
}

fn load(
    config: &LearnerTaskConfig,
    base: &Path,
    robot: Option<&RobotReference>,
) -> Result<Loaded, ConfigError> {
    let robot = robot.ok_or_else(|| {
        ConfigError::new("the component needs the joints of a robot, but names no robot")
            .advise("add `robot = \"NAME\"` to the component")
    })?;
    if config.state_timeout.ns < 1_000_000 {
        let message = format!("{}, expected at least 1 ms", config.state_timeout);
        return Err(ConfigError::key("state_timeout", message));
    }
    let file = base.join(&config.task);
    let text = files::read_text(&file).map_err(|error| {
        ConfigError::key("task", error.to_string()).advise("name a task file, relative to the graph file")
    })?;
    let invalid = |error: TaskError| ConfigError::key("task", format!("{}: {error}", file.display()));
    let task = Task::parse(&text).map_err(invalid)?;
    let mut world = task.world.clone();
    world
        .locate(file.parent().unwrap_or(base))
        .map_err(|error| ConfigError::key("task", format!("{}: `world`: {error}", file.display())))?;
    let loaded = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    }
    .load()
    .map_err(|error| ConfigError::new(error.to_string()))?;
    let terms = Terms::new(&task, &loaded.model).map_err(invalid)?;
    if let Some(object) = terms.objects().first() {
        let message = format!("\"{object}\" is an object, and rewards can use objects only in training");
        return Err(
            ConfigError::key("task", message).advise("evaluate the policy with `motorium learn evaluate`")
        );
    }
    for (what, found, most) in
        [("observation", terms.inputs(), MAX_OBSERVATION), ("action", terms.actions(), MAX_ACTION)]
    {
        if found > most {
            let message = format!("the {what} has {found} numbers, expected at most {most}");
            return Err(ConfigError::key("task", message)
                .advise("evaluate the policy with `motorium learn evaluate`"));
        }
    }
    let index = |name: &String| loaded.model.frames().iter().position(|frame| frame.name == *name);
    let links = terms.links().iter().filter_map(index).map(|index| index as u32).collect();
    Ok(Loaded { joints: loaded.model.joint_count(), links, task, world, terms })
}

/// Returns a ground or an object of the task's world that is missing in the graph's world.
fn missing(task: &World, graph: &World) -> Option<String> {
    let has_ground = |world: &World| world.ground.is_some() || world.terrain.is_some();
    if has_ground(task) && !has_ground(graph) {
        return Some("a ground".to_owned());
    }
    let names = |object: &Object| graph.objects.iter().any(|other| other.name == object.name);
    let object = task.objects.iter().find(|object| !names(object))?;
    Some(format!("an object `{}`", object.name))
}

impl Component for LearnerTask {
    const KIND: &'static str = "learner.task";
    const SUMMARY: &'static str =
        "evaluates a policy on a learning task: observations, rewards, episode ends";
    const READS_WORLD: bool = true;
    const RESETS: bool = true;
    type Config = LearnerTaskConfig;

    fn declare(config: &LearnerTaskConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let Loaded { task, terms, world: task_world, .. } = load(config, declare.folder(), declare.robot())?;
        if let Some(period) = declare.period() {
            let found = period.as_secs_f64().recip();
            if (found / task.rate() - 1.0).abs() > 1e-3 {
                let message =
                    format!("the component runs at {found} Hz, but the task runs at {} Hz", task.rate());
                return Err(ConfigError::key("task", message)
                    .advise(format!("write `rate = \"{} Hz\"` for the component", task.rate())));
            }
        }
        let mut world = config.world.clone();
        world.locate(declare.folder()).map_err(|error| ConfigError::key("world", error.to_string()))?;
        if let Some(missing) = missing(&task_world, &world) {
            declare
                .warn(format!("the task's world has {missing}, but the graph's world does not"))
                .key("task")
                .advise("add it to the `[world]` of the graph, unless the robot is real");
        }
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        declare.input::<Action>("action", "action of the policy");
        if terms.needs_base() {
            declare.input::<BaseState>("base_state", "pose and velocity of the base");
        }
        if !terms.links().is_empty() {
            declare.input::<Contacts>("contacts", "contact points on the robot");
        }
        ImageInputs::declare(terms.policy(), declare);
        let doc = "observation after each step, the first one before the first action";
        declare.stream_output::<Observation>("observation", CAPACITY, doc);
        declare.stream_output::<Reward>(
            "reward",
            CAPACITY,
            "reward of each step, and the end of the episode",
        );
        if terms.has_velocity_commands() {
            declare.output::<TwistTarget>("command", "desired velocity of the base, in its own axes");
        }
        if terms.has_target() {
            declare.output::<PoseTarget>("target", "position of the target in the world");
        }
        declare.may_end_episodes();
        Ok(())
    }

    fn configure(config: LearnerTaskConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let Loaded { terms, joints, links, .. } = load(&config, setup.folder(), Some(&robot))?;
        let inputs = Inputs {
            joints: setup.input("joint_state")?,
            action: setup.input("action")?,
            base: terms.needs_base().then(|| setup.input("base_state")).transpose()?,
            contacts: (!links.is_empty()).then(|| setup.input("contacts")).transpose()?,
            images: ImageInputs::open(terms.policy(), setup)?,
        };
        let held = Held { time: None, value: vec![0.0; terms.actions()] };
        Ok(Self {
            inputs,
            observation: setup.output("observation")?,
            reward: setup.output("reward")?,
            command: terms.has_velocity_commands().then(|| setup.output("command")).transpose()?,
            target: terms.has_target().then(|| setup.output("target")).transpose()?,
            episode_end: setup.episode_end(),
            clock: setup.clock(),
            state_timeout: config.state_timeout.ns,
            joints,
            forces: vec![0.0; links.len()],
            links,
            numbers: vec![0.0; terms.inputs()],
            actions: [held.clone(), held],
            episode: 0,
            seed: setup.seed(),
            phase: Phase::Before,
            score: Score::default(),
            waiting: 0,
            trial: Trial::new(&terms),
            terms,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let release = self.clock.stamp_ns(tick.time_ns);
        self.read_action()?;
        if self.phase == Phase::Over {
            return Ok(());
        }
        if !self.inputs.are_fresh(self.state_timeout)? {
            self.waiting += 1;
            return Ok(());
        }
        let (base, height) = self.inputs.base()?;
        self.inputs.add_forces(&self.links, &mut self.forces);
        let Some(joints) = self.inputs.joints.current() else { return Ok(()) };
        if joints.count() < self.joints {
            return Err(StepError::failed(
                "the joint state and the robot's model differ in their number of joints",
            ));
        }
        let state = RobotState {
            positions: joints.position(),
            velocities: joints.velocity(),
            efforts: joints.effort(),
            base,
            height,
            forces: &self.forces,
            objects: &[],
            images: self.inputs.images.pixels(),
        };
        let (terms, trial) = (&self.terms, &mut self.trial);
        let since = if let Phase::Running { since } = self.phase { since } else { u64::MAX };
        // an action of this time answers the present state, which the one in force brought about
        let in_force = |held: &&Held| held.time.is_some_and(|time| (since..release).contains(&time));
        match self.actions.iter().find(in_force) {
            Some(action) => {
                trial.act(terms, action.value.iter().copied());
                let step = trial.judge(terms, &state, true);
                let is_terminal = step.end.is_some_and(|end| end.is_terminal());
                self.reward.send(&Reward {
                    episode: self.episode,
                    step: (trial.step() - 1) as u64,
                    reward: step.reward,
                    total: trial.total(),
                    terminal: u64::from(is_terminal),
                    truncated: u64::from(step.end.is_some() && !is_terminal),
                })?;
                if let Some(end) = step.end {
                    self.score.add(trial.total(), trial.step(), end);
                    self.phase = Phase::Over;
                    if let Some(episode_end) = &self.episode_end {
                        episode_end.end();
                    }
                }
            }
            None if trial.step() > 0 && self.phase != Phase::Before => {
                self.waiting += 1;
                return Ok(());
            }
            None => {
                let counter = Counter { seed: self.seed, ..Counter::default() };
                trial.begin(terms, (counter, 1.0), &state);
                self.waiting += u64::from(self.phase != Phase::Before);
                self.phase = Phase::Running { since: release };
            }
        }
        self.publish()
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.begin(episode);
        Ok(())
    }

    fn begin_episode(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.begin(episode);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let is_running = matches!(self.phase, Phase::Running { .. });
        let steps = [if is_running { self.trial.step() } else { 0 }, self.terms.steps()];
        let mut result = self.score.report(steps.map(|steps| self.terms.time(steps)));
        result["steps_without_measurements_or_actions"] = json!(self.waiting);
        Some(result)
    }
}

impl LearnerTask {
    fn begin(&mut self, episode: &Episode) {
        (self.episode, self.seed, self.phase) = (episode.index, episode.seed, Phase::Before);
        self.actions.iter_mut().for_each(|held| held.time = None);
        self.inputs.images.reset();
    }

    /// Stores an action published since the last step.
    fn read_action(&mut self) -> Result<(), StepError> {
        let Some(action) = self.inputs.action.next_unread() else { return Ok(()) };
        if action.count() != self.terms.actions() {
            return Err(StepError::failed("the action and the task's action differ in length"));
        }
        if action.episode == self.episode {
            self.actions.swap(0, 1);
            self.actions[0].time = Some(action.stamp().publish_time);
            self.actions[0].value.copy_from_slice(action.value());
        }
        Ok(())
    }

    /// Publishes the observation and the command after a step.
    fn publish(&mut self) -> Result<(), StepError> {
        if let Some(output) = &mut self.command {
            let [forward, left, turn] = self.trial.command();
            let linear = [forward, left, 0.0];
            output.send(&TwistTarget { linear, angular: [0.0, 0.0, turn] })?;
        }
        if let Some(output) = &mut self.target {
            let (position, orientation) = (self.trial.command(), [0.0, 0.0, 0.0, 1.0]);
            output.send(&PoseTarget { position, orientation, ..PoseTarget::default() })?;
        }
        self.trial.write(&mut self.numbers);
        let mut observation = self.observation.loan()?;
        (observation.episode, observation.step) = (self.episode, self.trial.step() as u64);
        observation.set_count(self.numbers.len());
        for (slot, number) in observation.value_mut().iter_mut().zip(&self.numbers) {
            *slot = f64::from(*number);
        }
        observation.publish()
    }
}

/// Returns `true` if the newest value of an input is at most `longest` old \[ns\].
fn is_fresh<T: StateBuffer>(input: &mut Input<T>, longest: u64) -> bool {
    input.latest().is_some_and(|reading| reading.age_ns() <= longest)
}

impl Inputs {
    /// Reads all measurements. Returns `false` if one is missing or older than `longest` \[ns\].
    fn are_fresh(&mut self, longest: u64) -> Result<bool, StepError> {
        let Self { joints, base, contacts, images, .. } = self;
        Ok(images.read(longest)?
            && is_fresh(joints, longest)
            && base.as_mut().is_none_or(|input| is_fresh(input, longest))
            && contacts.as_mut().is_none_or(|input| is_fresh(input, longest)))
    }

    /// Returns the motion and height \[m\] of the base; zero if no term needs them.
    fn base(&self) -> Result<(BaseMotion, f64), StepError> {
        let Some(state) = self.base.as_ref().and_then(Input::current) else {
            return Ok((BaseMotion::default(), 0.0));
        };
        let Some(gravity) = projected_gravity(state.orientation) else {
            return Err(StepError::failed("the orientation of the base is not a unit quaternion"));
        };
        let (linear_velocity, angular_velocity) = (state.linear_velocity, state.angular_velocity);
        Ok((BaseMotion { linear_velocity, angular_velocity, gravity }, state.position[2]))
    }

    /// Sums the contact forces on each link \[N\].
    fn add_forces(&self, links: &[u32], forces: &mut [f64]) {
        let Some(contacts) = self.contacts.as_ref().and_then(Input::current) else { return };
        forces.fill(0.0);
        let axes = [contacts.force_x(), contacts.force_y(), contacts.force_z()];
        for (point, link) in contacts.link().iter().enumerate() {
            let force = axes.iter().map(|axis| axis[point].powi(2)).sum::<f64>().sqrt();
            let measured = forces.iter_mut().zip(links).filter(|(_, measured)| *measured == link);
            measured.for_each(|(sum, _)| *sum += force);
        }
    }
}

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_learners::kinds().iter().map(|kind| kind.name).collect();
/// assert_eq!(names, ["learner.task"]);
/// ```
// Not inlined, as `Kind::of` asks for.
#[inline(never)]
pub fn kinds() -> [Kind; 1] {
    [Kind::of::<LearnerTask>()]
}
