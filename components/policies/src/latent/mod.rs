//! `policy.latent`: robots that imitate a human through a shared latent space.

mod config;
mod follower;

pub use config::LatentPolicyConfig;

use motorium::component::{Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::Observation;
use motorium::transport::{Input, Parameter};
use motorium_models::gplvm::{LatentModel, Scratch};
use motorium_primitives::reach::Repeat;

use crate::joint_command::{CommandedJoints, JointCommandWriter, JointPorts};
use config::{Loaded, load};
use follower::Follower;

/// A policy that moves several robots like a human, through a shared latent space ([`LatentModel`]).
///
/// A pose of the human, from a port or a recorded movement, is mapped to a latent point, and the latent point
/// to a pose of each robot. The novelty of the pose is the fraction of the predictive variance that the
/// training poses do not explain. A robot slows down above the novelty `slow_from`, and holds above
/// `hold_from`; it continues when the pose is familiar again. All robots hold while there is no fresh human
/// pose. If a robot's profile limits accelerations, setpoints stay within 0.9 times its velocity and
/// acceleration limits.
#[derive(Debug)]
pub struct LatentPolicy {
    model: LatentModel,
    source: Source,
    /// Pose of the human, standardised pose, latent point.
    pose: Vec<f64>,
    standard: Vec<f64>,
    x: Vec<f64>,
    /// `true` once a pose has been received.
    has_pose: bool,
    scratch: Scratch,
    robots: Vec<Robot>,
    slow_from: Parameter<f64>,
    hold_from: Parameter<f64>,
}

/// Source of the human's poses.
#[derive(Debug)]
enum Source {
    Port {
        input: Input<Observation>,
        /// Age of the newest pose, and the age beyond which the robots hold, s.
        age: f64,
        timeout: f64,
    },
    Motion {
        /// Times from the first sample, s.
        times: Vec<f64>,
        /// Samples, one after the other.
        samples: Vec<f64>,
        speed: Parameter<f64>,
        repeat: Repeat,
        /// Time within the movement, s, and the index of the sample before it.
        time: f64,
        index: usize,
    },
}

impl Source {
    /// Writes the current pose. Returns `None` before the first pose, otherwise `true` if the pose is fresh.
    fn read(&mut self, dt: f64, pose: &mut [f64]) -> Result<Option<bool>, StepError> {
        match self {
            Source::Port { input, age, timeout } => {
                *age += dt;
                if let Some(observation) = input.next_unread() {
                    if observation.count() != pose.len() {
                        let (expected, found) = (pose.len(), observation.count());
                        let message = format!("pose of the human: expected {expected} values, found {found}");
                        return Err(StepError::failed(message));
                    }
                    if observation.value().iter().any(|value| !value.is_finite()) {
                        return Err(StepError::failed("the pose of the human is not finite"));
                    }
                    pose.copy_from_slice(observation.value());
                    *age = 0.0;
                }
                Ok(age.is_finite().then_some(*age <= *timeout))
            }
            Source::Motion { times, samples, speed, repeat, time, index } => {
                let (last, n) = (times.len() - 1, pose.len());
                while *index + 1 < last && times[*index + 1] <= *time {
                    *index += 1;
                }
                let (from, to) = (times[*index], times[*index + 1]);
                let share = ((*time - from) / (to - from)).clamp(0.0, 1.0);
                let (before, after) = samples[*index * n..(*index + 2) * n].split_at(n);
                for ((pose, a), b) in pose.iter_mut().zip(before).zip(after) {
                    *pose = a + share * (b - a);
                }
                *time += speed.get() * dt;
                if *time > times[last] && *repeat == Repeat::Forever {
                    (*time, *index) = (*time % times[last], 0);
                }
                Ok(Some(true))
            }
        }
    }

    fn reset(&mut self) {
        match self {
            Source::Port { age, .. } => *age = f64::INFINITY,
            Source::Motion { time, index, .. } => (*time, *index) = (0.0, 0),
        }
    }
}

/// One robot.
#[derive(Debug)]
struct Robot {
    name: String,
    space: usize,
    writer: JointCommandWriter,
    follower: Follower,
    has_started: bool,
    target: Vec<f64>,
    variance: Vec<f64>,
    figures: Figures,
}

/// Statistics of a run.
#[derive(Clone, Copy, Debug, Default)]
struct Figures {
    steps: u64,
    novelty: f64,
    largest_novelty: f64,
    /// Time at a pace below 1, and at rest, s.
    slowed: f64,
    held: f64,
    /// Sum of squares and number of joint errors after the transition.
    squares: f64,
    errors: u64,
}

/// Returns the pace at a novelty: 1 up to `slow`, 0 from `hold` on.
fn pace(novelty: f64, slow: f64, hold: f64) -> f64 {
    if novelty >= hold {
        0.0
    } else if novelty <= slow {
        1.0
    } else {
        (hold - novelty) / (hold - slow)
    }
}

impl Component for LatentPolicy {
    const KIND: &'static str = "policy.latent";
    const SUMMARY: &'static str = "maps human motion to several robots through a shared latent space";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = LatentPolicyConfig;

    fn declare(config: &LatentPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robots = every_robot(declare.robots(), declare.robot());
        let loaded = load(config, &robots, declare.folder())?;
        if loaded.motion.is_some() {
            declare.float(
                "speed",
                1.0,
                0.0..=2.0,
                "",
                "speed factor of the movement; 0 stays at its present pose",
            );
        } else {
            declare
                .input::<Observation>("human", "pose of the human, in the columns of its space in the model");
        }
        for mimic in &loaded.mimics {
            JointPorts::for_robot(&mimic.name).declare(declare);
        }
        CommandedJoints::declare_scales(declare);
        let doc = "novelty of a pose from which a robot slows down";
        declare.float("slow_from", 0.5, 0.0..=1.0, "", doc);
        declare.float("hold_from", 0.8, 0.0..=1.0, "", "novelty of a pose from which a robot holds");
        Ok(())
    }

    fn configure(config: LatentPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robots = every_robot(setup.robots(), setup.robot().ok());
        let Loaded { model, human, motion, mimics } = load(&config, &robots, setup.folder())?;
        let source = match motion {
            Some(motion) => Source::Motion {
                times: motion.times().iter().map(|time| time - motion.times()[0]).collect(),
                samples: motion.values().transpose().as_slice().to_vec(),
                speed: setup.parameter("speed")?,
                repeat: config.repeat,
                time: 0.0,
                index: 0,
            },
            None => Source::Port {
                input: setup.input("human")?,
                age: f64::INFINITY,
                timeout: config.timeout.as_secs_f64(),
            },
        };
        let mut robots = Vec::new();
        for mimic in mimics {
            let joints = model.spaces()[mimic.space].dimensions();
            let ports = JointPorts::for_robot(&mimic.name);
            robots.push(Robot {
                writer: JointCommandWriter::with_ports(mimic.driven, &config.joint_command, &ports, setup)?
                    .within_limits(),
                name: mimic.name,
                space: mimic.space,
                follower: Follower::new(joints, config.follow.as_secs_f64()),
                has_started: false,
                target: vec![0.0; joints],
                variance: vec![0.0; joints],
                figures: Figures::default(),
            });
        }
        let columns = model.spaces()[human].dimensions();
        Ok(Self {
            source,
            pose: vec![0.0; columns],
            standard: vec![0.0; columns],
            x: vec![0.0; model.latents()],
            has_pose: false,
            scratch: model.scratch(),
            robots,
            slow_from: setup.parameter("slow_from")?,
            hold_from: setup.parameter("hold_from")?,
            model,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let dt = tick.dt();
        let fresh = self.source.read(dt, &mut self.pose)?;
        if fresh.is_some() {
            self.model.map_back(&self.pose, &mut self.standard, &mut self.x);
            self.has_pose = true;
        }
        let (slow, hold) = (self.slow_from.get(), self.hold_from.get());
        for robot in &mut self.robots {
            if !robot.writer.read()? {
                continue;
            }
            if !robot.has_started {
                let writer = &robot.writer;
                robot.follower.start((0..robot.target.len()).map(|joint| writer.position(joint)));
                robot.target.copy_from_slice(robot.follower.position());
                robot.has_started = true;
            }
            let mut target_pace = 0.0;
            if self.has_pose {
                let novelty = self.model.predict(
                    robot.space,
                    &self.x,
                    &mut robot.target,
                    &mut robot.variance,
                    &mut self.scratch,
                );
                robot.writer.limit(&mut robot.target);
                target_pace = if fresh == Some(true) { pace(novelty, slow, hold) } else { 0.0 };
                robot.figures.novelty += novelty;
                robot.figures.largest_novelty = robot.figures.largest_novelty.max(novelty);
                robot.figures.steps += 1;
            }
            robot.follower.step(dt, &robot.target, target_pace, robot.writer.velocity_limits());
            robot.figures.slowed += if self.has_pose && target_pace < 1.0 { dt } else { 0.0 };
            robot.figures.held += if robot.follower.pace() == 0.0 { dt } else { 0.0 };
            if robot.writer.is_eased_in() {
                for joint in 0..robot.target.len() {
                    let error = robot.writer.setpoint(joint) - robot.writer.position(joint);
                    robot.figures.squares += error.powi(2);
                }
                robot.figures.errors += robot.target.len() as u64;
            }
            robot.writer.command(dt, robot.follower.position(), robot.follower.rate())?;
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.source.reset();
        self.has_pose = false;
        for robot in &mut self.robots {
            robot.writer.reset();
            robot.has_started = false;
            robot.figures = Figures::default();
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let robots: serde_json::Map<String, serde_json::Value> = self
            .robots
            .iter()
            .map(|robot| {
                let figures = &robot.figures;
                let result = serde_json::json!({
                    "novelty": figures.novelty / figures.steps.max(1) as f64,
                    "largest_novelty": figures.largest_novelty,
                    "slowed_s": figures.slowed,
                    "held_s": figures.held,
                    "tracking_error": (figures.squares / figures.errors.max(1) as f64).sqrt(),
                    "limited_error": robot.writer.limited_error(),
                });
                (robot.name.clone(), result)
            })
            .collect();
        Some(serde_json::json!({ "robots": robots }))
    }
}

/// Returns the robots listed in `robots` of the graph, or the one in `robot`.
fn every_robot(several: &[RobotReference], one: Option<&RobotReference>) -> Vec<RobotReference> {
    if several.is_empty() { one.into_iter().cloned().collect() } else { several.to_vec() }
}
