//! `policy.trajectory` and `policy.home`: move joints through waypoints within limits.

mod config;
mod plan;

pub use config::{HomeConfig, JointDriveConfig, JointGoal, JointGoalConfig, JointNumbers, TrajectoryConfig};

use motorium::component::{Component, ConfigureError, Episode, EpisodeEnd, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::transport::Parameter;
use motorium::units::TimeSpan;
use motorium_primitives::profile::{Shape, StraightMove};
use motorium_primitives::reach::Repeat;

use crate::joint_command::{CommandedJoints, JointCommandConfig, JointCommandWriter};
use plan::{Goal, Plan};

/// Moves the joints of a robot through goals, from rest to rest along straight lines in joint space, within
/// limits of velocity, acceleration and jerk; see [`StraightMove`].
///
/// The movement starts with the first joint state, at the robot's current position. A goal counts as reached
/// if every measured joint is within the tolerance at the end of the dwell time.
#[derive(Debug)]
pub struct TrajectoryPolicy {
    writer: JointCommandWriter,
    speed: Parameter<f64>,
    episode_end: Option<EpisodeEnd>,
    goals: Vec<Goal>,
    joints: Vec<String>,
    repeat: Repeat,
    shape: Shape,
    tolerance: f64,
    motion: StraightMove,
    /// Index of the current goal; `None` before the first joint state.
    current: Option<usize>,
    /// Time since the motion to the goal began, s.
    elapsed: f64,
    from: Vec<f64>,
    to: Vec<f64>,
    setpoint: Vec<f64>,
    rate: Vec<f64>,
    is_finished: bool,
    record: Record,
}

/// Statistics of the goals.
#[derive(Debug, Default)]
struct Record {
    reached: u64,
    missed: u64,
    /// Largest error at a goal, and its joint.
    worst: Option<(f64, usize)>,
    /// Total duration of completed motions, s.
    moved: f64,
}

impl Component for TrajectoryPolicy {
    const KIND: &'static str = "policy.trajectory";
    const SUMMARY: &'static str =
        "moves joints through waypoints within velocity, acceleration and jerk limits";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = TrajectoryConfig;

    fn declare(config: &TrajectoryConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let plan = Plan::new(config, declare.robot())?;
        driven(config, &plan, declare.robot())?;
        CommandedJoints::declare(declare);
        declare.may_end_episodes();
        declare.float("speed", 1.0, 0.0..=1.0, "", "speed factor; 0 holds the present position");
        Ok(())
    }

    fn configure(config: TrajectoryConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let plan = Plan::new(&config, Some(&robot))?;
        let driven = driven(&config, &plan, Some(&robot))?;
        let zeros = vec![0.0; plan.joints.len()];
        Ok(Self {
            writer: JointCommandWriter::new(driven, &command(&config), setup)?,
            speed: setup.parameter("speed")?,
            episode_end: setup.episode_end(),
            motion: StraightMove::new(plan.limits),
            goals: plan.goals,
            joints: plan.joints,
            repeat: config.repeat,
            shape: config.profile,
            tolerance: config.tolerance,
            current: None,
            elapsed: 0.0,
            from: zeros.clone(),
            to: zeros.clone(),
            setpoint: zeros.clone(),
            rate: zeros,
            is_finished: false,
            record: Record::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.writer.read()? {
            return Ok(());
        }
        let speed = self.speed.get();
        match self.current {
            None => {
                for joint in 0..self.to.len() {
                    self.to[joint] = self.writer.position(joint);
                }
                self.set_out(0);
            }
            Some(_) => self.elapsed += speed * tick.dt(),
        }
        // at most once through all goals per step: the robot may already be at a goal, which then takes no
        // time
        for _ in 0..self.goals.len() {
            if !self.go_on() {
                break;
            }
        }
        self.motion.sample(self.elapsed, &mut self.setpoint, &mut self.rate);
        self.rate.iter_mut().for_each(|rate| *rate *= speed);
        self.writer.command(tick.dt(), &self.setpoint, &self.rate)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.writer.reset();
        (self.current, self.elapsed, self.is_finished) = (None, 0.0, false);
        self.record = Record::default();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Record { reached, missed, worst, moved } = &self.record;
        Some(serde_json::json!({
            "goals_reached": reached,
            "goals_missed": missed,
            "joint_error": worst.map(|worst| worst.0),
            "joint_of_the_error": worst.map(|worst| &self.joints[worst.1]),
            "moving_s": moved,
            "finished": self.is_finished,
        }))
    }
}

impl TrajectoryPolicy {
    fn set_out(&mut self, goal: usize) {
        self.from.copy_from_slice(&self.to);
        self.goals[goal].write(&self.from, &mut self.to);
        self.writer.limit(&mut self.to);
        self.motion.plan(&self.from, &self.to, self.shape, self.goals[goal].duration);
        (self.current, self.elapsed) = (Some(goal), 0.0);
    }

    /// Leaves a goal whose dwell time has passed. Returns `true` if it started towards another.
    fn go_on(&mut self) -> bool {
        let Some(current) = self.current.filter(|_| !self.is_finished) else { return false };
        let over = self.elapsed - self.motion.duration() - self.goals[current].dwell;
        if over < 0.0 {
            return false;
        }
        self.judge();
        let last = current + 1 == self.goals.len();
        if last && self.repeat == Repeat::Once {
            self.is_finished = true;
            if let Some(end) = &self.episode_end {
                end.end();
            }
            return false;
        }
        self.set_out(if last { 0 } else { current + 1 });
        self.elapsed = over;
        true
    }

    fn judge(&mut self) {
        let mut error = (0.0, 0);
        for (joint, to) in self.to.iter().enumerate() {
            let off = (self.writer.position(joint) - to).abs();
            if off > error.0 {
                error = (off, joint);
            }
        }
        let is_reached = error.0 <= self.tolerance;
        self.record.reached += u64::from(is_reached);
        self.record.missed += u64::from(!is_reached);
        self.record.moved += self.motion.duration();
        if self.record.worst.is_none_or(|worst| error.0 > worst.0) {
            self.record.worst = Some(error);
        }
    }
}

/// Returns the settings for all joints with the gains of their drives. The motion starts at the robot's
/// position, so no easing is needed.
fn command(config: &TrajectoryConfig) -> JointCommandConfig {
    let JointDriveConfig { kp, kd, gravity_compensation } = config.joint_command.clone();
    JointCommandConfig { kp, kd, gravity_compensation, ease: TimeSpan { ns: 0 } }
}

fn driven(
    config: &TrajectoryConfig,
    plan: &Plan,
    robot: Option<&motorium::declare::RobotReference>,
) -> Result<CommandedJoints, ConfigError> {
    let names = plan.joints.iter().map(|name| (name.as_str(), "robot".to_string()));
    CommandedJoints::new(&command(config), config.gravity, robot, names)
}

/// Moves the joints of a robot to a pose of its profile; see [`TrajectoryPolicy`].
#[derive(Debug)]
pub struct HomePolicy(TrajectoryPolicy);

impl Component for HomePolicy {
    const KIND: &'static str = "policy.home";
    const SUMMARY: &'static str = "moves joints to the home pose, or another pose of the robot's profile";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = HomeConfig;

    fn declare(config: &HomeConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        TrajectoryPolicy::declare(&config.clone().into(), declare).map_err(of_home)
    }

    fn configure(config: HomeConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        TrajectoryPolicy::configure(config.into(), setup).map(Self)
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.0.step(tick)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.0.reset(episode)
    }

    fn result(&self) -> Option<serde_json::Value> {
        self.0.result()
    }
}

/// Moves an error to the matching key of the table of `policy.home`.
fn of_home(error: ConfigError) -> ConfigError {
    match error.key.as_deref() {
        Some("goals[0]") => ConfigError { key: Some("pose".to_string()), ..error },
        _ => error,
    }
}
