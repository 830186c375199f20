//! `policy.trajectory` and `policy.home`: move joints through waypoints within limits.

mod config;
mod live;
mod plan;
mod planner;

pub use config::{
    HomeConfig, JointDriveConfig, JointGoal, JointGoalConfig, JointNumbers, ToolPoseConfig, TrajectoryConfig,
};
pub use planner::{GoalPlanner, Planned, Refusal};

use motorium::component::{Component, ConfigureError, Episode, EpisodeEnd, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::transport::Parameter;
use motorium::units::TimeSpan;
use motorium_primitives::profile::{Shape, StraightMove};
use motorium_primitives::reach::Repeat;

use crate::gripper::Fingers;
use crate::joint_command::{CommandedJoints, JointCommandConfig, JointCommandWriter};
use live::LiveGoals;
use plan::{Goal, Plan};

/// Settling time after a motion in which the joints must come within the tolerance of a goal from the input
/// `goal`, s.
const SETTLING: f64 = 1.0;

/// A policy that moves the joints of a robot through goals, from rest to rest along straight lines in joint
/// space, within limits of velocity, acceleration and jerk; see [`StraightMove`].
///
/// The movement starts with the first joint state, at the robot's current position. A goal is reached if
/// every measured joint is within the tolerance at the end of the dwell time. A closed finger always counts
/// as within the tolerance, because an object may stop it.
///
/// A goal from the input `goal` replaces all configured goals. While the current motion continues, limits and
/// reach are checked, and the joint positions of a pose are computed over several steps. The motion then
/// brakes on its line and continues to the new goal: position, velocity and acceleration are continuous and
/// within the limits.
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
    fingers: Option<Fingers>,
    live: LiveGoals,
    course: Course,
    /// Duration of the motion to the goal from the input, and the requested one, s.
    live_duration: f64,
    requested: Option<f64>,
}

/// The source of the present motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// The configured goals.
    Configured,
    /// The motion comes to rest before it starts to a goal from the input.
    Braking,
    /// The motion to a goal from the input.
    Live,
    /// The goal from the input was reached or missed.
    Ended,
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
        config.warn_of_angles(declare);
        CommandedJoints::declare(declare);
        LiveGoals::declare(declare);
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
            fingers: plan.fingers,
            live: LiveGoals::open(plan.planner, setup)?,
            course: Course::Configured,
            live_duration: 0.0,
            requested: None,
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
        if self.live.poll(&self.to) {
            self.brake();
        }
        if self.course == Course::Configured {
            // each step passes through all goals at most once: the robot may already be at a goal, which then
            // needs no time
            for _ in 0..self.goals.len() {
                if !self.go_on() {
                    break;
                }
            }
        } else {
            self.follow_live();
        }
        self.live.publish()?;
        self.motion.sample(self.elapsed, &mut self.setpoint, &mut self.rate);
        self.rate.iter_mut().for_each(|rate| *rate *= speed);
        self.writer.command(tick.dt(), &self.setpoint, &self.rate)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.writer.reset();
        (self.current, self.elapsed, self.is_finished) = (None, 0.0, false);
        self.record = Record::default();
        self.live.reset();
        self.course = Course::Configured;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Record { reached, missed, worst, moved } = &self.record;
        let mut result = serde_json::json!({
            "goals_reached": reached,
            "goals_missed": missed,
            "joint_error": worst.map(|worst| worst.0),
            "joint_of_the_error": worst.map(|worst| &self.joints[worst.1]),
            "moving_s": moved,
            "finished": self.is_finished,
        });
        self.live.add_to(&mut result);
        Some(result)
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

    /// Counts the goal as reached or missed. Returns the largest error and its joint.
    fn judge(&mut self) -> (f64, usize) {
        let error = self.error();
        let is_reached = error.0 <= self.tolerance;
        self.record.reached += u64::from(is_reached);
        self.record.missed += u64::from(!is_reached);
        self.record.moved += self.motion.duration();
        if self.record.worst.is_none_or(|worst| error.0 > worst.0) {
            self.record.worst = Some(error);
        }
        error
    }

    /// Returns the largest distance of a measured joint from its goal, rad or m, and the joint.
    fn error(&self) -> (f64, usize) {
        let mut error = (0.0, 0);
        for (joint, to) in self.to.iter().enumerate() {
            let off = (self.writer.position(joint) - to).abs();
            let is_gripping = self.fingers.as_ref().is_some_and(|fingers| fingers.is_closed(joint, *to));
            if off > error.0 && !is_gripping {
                error = (off, joint);
            }
        }
        error
    }

    /// Brings the present motion to rest, before the motion to the goal from the input.
    fn brake(&mut self) {
        self.motion.brake(self.elapsed);
        let rest = self.motion.duration();
        self.motion.sample(rest, &mut self.from, &mut self.rate);
        self.to.copy_from_slice(self.live.target());
        let least = self.motion.least_duration(&self.from, &self.to, self.shape);
        self.requested = self.live.duration();
        self.live_duration = rest + least.max(self.requested.unwrap_or(0.0));
        (self.elapsed, self.course) = (0.0, Course::Braking);
    }

    /// Continues the motion to the goal from the input.
    fn follow_live(&mut self) {
        if self.course == Course::Braking && self.elapsed >= self.motion.duration() {
            self.elapsed -= self.motion.duration();
            self.motion.plan(&self.from, &self.to, self.shape, self.requested);
            self.course = Course::Live;
        }
        let left = match self.course {
            Course::Braking => self.live_duration - self.elapsed,
            Course::Live => self.motion.duration() - self.elapsed,
            Course::Configured | Course::Ended => return,
        };
        if left > 0.0 {
            self.live.advance(1.0 - left / self.live_duration, left);
        } else if self.error().0 <= self.tolerance || left < -SETTLING {
            let (error, joint) = self.judge();
            let missed = (error > self.tolerance).then(|| self.joints[joint].as_str());
            self.live.end(error, missed);
            self.course = Course::Ended;
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

/// A policy that moves the joints of a robot to a pose of its profile; see [`TrajectoryPolicy`].
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
