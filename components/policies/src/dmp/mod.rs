//! `policy.dmp`: moves the end effector of a robot through goals.

mod config;
mod couplings;
mod fingers;
mod imitation;
mod reachable;
mod start_pose;
mod waypoints;
mod weights;

pub use config::{
    DemonstrationConfig, DmpPolicyConfig, GoalConfig, ObstaclesConfig, PhaseStopConfig, PoseConfig,
    ShapeConfig, WeightsConfig, YieldingConfig,
};

use motorium::component::{
    Checkpoint, Component, ConfigureError, Episode, EpisodeEnd, RunClock, Setup, Tick,
};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::PoseTarget;
use motorium::transport::{Output, Parameter};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use couplings::Couplings;
use fingers::FingerOutput;
use imitation::PathRecord;
use motorium_primitives::reach::{PoseReach, ReachPhase, SteerError};
use start_pose::StartPose;
use waypoints::Waypoints;
pub(crate) use waypoints::orientation;
use weights::LiveWeights;

/// A policy that moves the end effector of a robot through goals, with one movement primitive per goal; see
/// [`PoseReach`].
///
/// With the first joint state, the policy starts at the measured pose of the end effector, or at a configured
/// pose. Before the first joint state, it publishes nothing. Time advances with the ticks: after a delay of
/// the component, the target continues from its last pose without a discontinuity. After a crash the policy
/// continues towards the current goal.
///
/// In real time a new episode interrupts the current movement. The target stops and starts from its current
/// pose towards the first goal, with the latest weights from the input `weights`. Relative goals keep the
/// positions of the first episode.
#[derive(Debug)]
pub struct DmpPolicy {
    target: Output<PoseTarget>,
    /// `None` if no goal has a gripper.
    fingers: Option<FingerOutput>,
    speed: Parameter<f64>,
    start_pose: StartPose,
    waypoints: Waypoints,
    reach: PoseReach,
    /// The movements as configured.
    start_reach: PoseReach,
    episode_end: Option<EpisodeEnd>,
    /// The selected primitive, and the primitive of each segment that follows the selection.
    primitive: Option<Parameter<i64>>,
    chosen: Vec<usize>,
    exchanges: u64,
    weights: Option<LiveWeights>,
    couplings: Couplings,
    /// Rate of the movement after the couplings.
    rate: f64,
    record: PathRecord,
    /// Number of goals started before a crash.
    goals_before: u64,
    memory: Checkpoint,
    clock: RunClock,
    /// Time of the previous step, ns since the run began.
    last_ns: Option<u64>,
    /// Target pose at the end of the last real-time episode, from which the next one starts.
    left_at: Option<Isometry3<f64>>,
}

impl Component for DmpPolicy {
    const KIND: &'static str = "policy.dmp";
    const SUMMARY: &'static str = "moves an end effector through goals by movement primitives";
    const RESETS: bool = true;
    type Config = DmpPolicyConfig;

    fn declare(config: &DmpPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let waypoints = Waypoints::new(config, declare.robot())?;
        waypoints.reach()?;
        config.warn_of_angles(declare);
        StartPose::declare(config, &waypoints, declare)?;
        Couplings::declare(config, declare)?;
        LiveWeights::declare(&waypoints, declare);
        FingerOutput::declare(&waypoints, declare);
        declare.may_end_episodes();
        declare.output::<PoseTarget>(
            "target",
            "target pose and velocity of the end effector, in the world frame",
        );
        declare.float("speed", 1.0, 0.0..=2.0, "", "speed factor; 0 holds the present pose");
        if !waypoints.primitives().is_empty() {
            let last = waypoints.primitives().len() as i64 - 1;
            declare.integer(
                "primitive",
                0,
                0..=last,
                "index of the primitive for goals with `selected`, from 0",
            );
        }
        Ok(())
    }

    fn configure(config: DmpPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let waypoints = Waypoints::new(&config, setup.robot().ok())?;
        let primitive = match waypoints.primitives() {
            [] => None,
            _ => Some(setup.parameter("primitive")?),
        };
        Ok(Self {
            primitive,
            chosen: vec![0; waypoints.selected().len()],
            exchanges: 0,
            weights: LiveWeights::open(&waypoints, config.take_weights, setup)?,
            couplings: Couplings::open(&config, setup)?,
            rate: 1.0,
            record: waypoints.record(),
            reach: waypoints.reach()?,
            start_reach: waypoints.reach()?,
            fingers: FingerOutput::open(&waypoints, setup)?,
            episode_end: setup.episode_end(),
            waypoints,
            start_pose: StartPose::new(&config, setup)?,
            target: setup.output("target")?,
            speed: setup.parameter("speed")?,
            goals_before: 0,
            memory: setup.checkpoint(Memory::NUMBERS)?,
            clock: setup.clock(),
            last_ns: None,
            left_at: None,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.reach
            .set_speed(self.speed.get())
            .map_err(|_| StepError::failed("the speed factor is negative or not finite"))?;
        self.select()?;
        if let Some(weights) = &mut self.weights {
            weights.apply(&mut self.reach, tick)?;
        }
        let state_ns = self.start_pose.state_ns().unwrap_or(tick.time_ns);
        let now_ns = self.clock.grid_ns(tick, state_ns);
        let last_ns = self.last_ns.replace(now_ns);
        if self.reach.phase() == ReachPhase::Waiting {
            match self.left_at.take() {
                // Relative goals keep their reference: each episode has the same goals.
                Some(pose) => self.reach.start(pose).map_err(refused)?,
                None => {
                    let Some(start) = self.start_pose.find()? else { return Ok(()) };
                    self.begin(start)?;
                }
            }
        } else {
            let measures = self.couplings.needs_end_effector();
            let end_effector = if measures { self.start_pose.end_effector() } else { None };
            self.rate = self.couplings.apply(&mut self.reach, end_effector);
            let elapsed = tick.period * tick.periods_since(last_ns, now_ns);
            self.reach.step(elapsed.mul_f64(self.rate));
        }
        let segment = self.reach.segment();
        if self.reach.phase() == ReachPhase::Moving && self.record.has_path(segment) {
            let end_effector = self.start_pose.end_effector();
            self.record.observe(
                segment,
                self.reach.progress(),
                self.reach.pose().translation.vector,
                end_effector,
            );
        }
        if self.reach.phase() == ReachPhase::Finished
            && let Some(end) = &self.episode_end
        {
            end.end();
        }
        self.publish()
    }

    fn begin_episode(&mut self, _: &Episode) -> Result<(), StepError> {
        if self.reach.phase() != ReachPhase::Waiting {
            self.left_at = Some(self.reach.pose());
            self.reach.halt();
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.reach = self.start_reach.clone();
        self.record = self.waypoints.record();
        self.chosen.fill(0);
        self.weights.iter_mut().for_each(LiveWeights::reset);
        self.couplings.reset();
        self.fingers.iter_mut().for_each(FingerOutput::reset);
        self.rate = 1.0;
        (self.exchanges, self.goals_before, self.last_ns, self.left_at) = (0, 0, None, None);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = serde_json::json!({
            "goals_started": self.goals(),
            "goals": self.reach.segments(),
            "finished": self.reach.phase() == ReachPhase::Finished,
        });
        if self.primitive.is_some() {
            result["exchanges"] = self.exchanges.into();
        }
        if let Some(weights) = &self.weights {
            result["weights"] = weights.result();
        }
        if let Some(couplings) = self.couplings.result() {
            result["couplings"] = couplings;
        }
        if let Some(imitation) = self.record.result() {
            result["imitation"] = imitation;
        }
        Some(result)
    }
}

impl DmpPolicy {
    /// Assigns the selected primitive to the segments that follow the selection; the current segment keeps
    /// its primitive.
    fn select(&mut self) -> Result<(), StepError> {
        let Some(primitive) = &self.primitive else { return Ok(()) };
        let primitives = self.waypoints.primitives();
        let wanted = usize::try_from(primitive.get()).unwrap_or(0).min(primitives.len() - 1);
        for (segment, has) in self.waypoints.selected().iter().zip(&mut self.chosen) {
            let under_way = *segment == self.reach.segment() && self.reach.phase() == ReachPhase::Moving;
            if *has != wanted && !under_way {
                self.reach
                    .reshape(*segment, &primitives[wanted])
                    .map_err(|_| StepError::failed("the settings of the primitives differ"))?;
                *has = wanted;
                self.exchanges += 1;
            }
        }
        Ok(())
    }

    /// Starts towards the first goal from `start`.
    fn begin_at(&mut self, start: Isometry3<f64>) -> Result<(), StepError> {
        self.waypoints.set_goals(&mut self.reach, &start).map_err(refused)?;
        self.reach.start(start).map_err(refused)
    }

    /// Starts from `start`, or continues the current movement after a crash.
    fn begin(&mut self, start: Isometry3<f64>) -> Result<(), StepError> {
        let memory = self.memory.resume().and_then(|numbers| Memory::read(&numbers));
        let Some(memory) = memory.filter(|memory| memory.segment < self.reach.segments()) else {
            return self.begin_at(start);
        };
        self.waypoints.set_goals(&mut self.reach, &memory.origin).map_err(refused)?;
        self.goals_before = memory.goals - 1;
        // a measured pose includes any motion in the meantime; a configured one does not
        let start = if self.start_pose.is_measured() { start } else { memory.pose };
        self.reach.start_with(memory.segment, start).map_err(refused)
    }

    fn goals(&self) -> u64 {
        self.goals_before + self.reach.goals_set()
    }

    fn publish(&mut self) -> Result<(), StepError> {
        let (pose, twist) = (self.reach.pose(), self.reach.twist() * self.rate);
        let at_goal = matches!(self.reach.phase(), ReachPhase::Dwelling | ReachPhase::Finished);
        let memory = Memory {
            segment: self.reach.segment(),
            goals: self.goals(),
            pose,
            origin: self.waypoints.origin(),
        };
        self.memory.save(memory.numbers());
        if let Some(fingers) = &mut self.fingers {
            fingers.publish(&self.waypoints, memory.segment, memory.goals, self.speed.get())?;
        }
        let mut target = self.target.loan()?;
        *target = PoseTarget {
            position: pose.translation.vector.into(),
            orientation: pose.rotation.coords.into(),
            linear_velocity: twist.linear.into(),
            angular_velocity: twist.angular.into(),
            goal: memory.goals,
            at_goal: u64::from(at_goal),
        };
        target.publish()
    }
}

fn refused(_: SteerError) -> StepError {
    StepError::failed("the end effector has no finite pose to start from")
}

/// State that is restored after a crash.
struct Memory {
    segment: usize,
    goals: u64,
    /// Target pose.
    pose: Isometry3<f64>,
    /// Pose at the start of the first segment, the reference of relative goals.
    origin: Isometry3<f64>,
}

impl Memory {
    const NUMBERS: usize = 16;

    fn numbers(&self) -> [f64; Self::NUMBERS] {
        let mut numbers = [0.0; Self::NUMBERS];
        numbers[0] = self.segment as f64;
        numbers[1] = self.goals as f64;
        for (place, pose) in [(2, &self.pose), (9, &self.origin)] {
            numbers[place..place + 3].copy_from_slice(pose.translation.vector.as_slice());
            numbers[place + 3..place + 7].copy_from_slice(pose.rotation.coords.as_slice());
        }
        numbers
    }

    fn read(numbers: &[f64]) -> Option<Self> {
        let pose = |place: usize| {
            let at = |i: usize| numbers.get(place + i).copied();
            let turn = Quaternion::new(at(6)?, at(3)?, at(4)?, at(5)?);
            let rotation = UnitQuaternion::try_new(turn, 0.5)?;
            Some(Isometry3::from_parts(Translation3::new(at(0)?, at(1)?, at(2)?), rotation))
        };
        let goals = *numbers.get(1)? as u64;
        (goals > 0).then_some(Self {
            segment: *numbers.first()? as usize,
            goals,
            pose: pose(2)?,
            origin: pose(9)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_and_origin_survive_a_restart() {
        let turned = |angle| UnitQuaternion::from_euler_angles(0.1, angle, -2.0);
        let memory = Memory {
            segment: 2,
            goals: 17,
            pose: Isometry3::from_parts(Translation3::new(0.1, -0.2, 0.3), turned(1.0)),
            origin: Isometry3::from_parts(Translation3::new(1.1, 1.2, -1.3), turned(-0.4)),
        };
        let back = Memory::read(&memory.numbers()).unwrap();
        assert_eq!((back.segment, back.goals), (2, 17));
        assert!((back.pose.to_homogeneous() - memory.pose.to_homogeneous()).norm() < 1e-15);
        assert!((back.origin.to_homogeneous() - memory.origin.to_homogeneous()).norm() < 1e-15);
    }

    #[test]
    fn unwritten_memory_is_ignored() {
        assert!(Memory::read(&[0.0; Memory::NUMBERS]).is_none());
        assert!(Memory::read(&[1.0; 3]).is_none());
    }
}
