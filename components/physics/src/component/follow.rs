//! Robots that are moved along a measured, estimated or recorded state instead of by commands.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, RobotReference};
use motorium::state::{self, BaseState, JointState};
use motorium::transport::Input;

use super::build::BuiltRobot;
use super::config::PhysicsConfig;
use crate::{Articulation, Engine, Simulation, Simulator};

/// Command input of a robot that is moved by its drives.
pub(super) const COMMAND: &str = "joint_command";

/// Inputs of a robot that follows: joint states, and states of its floating base.
const JOINTS: &str = "follow";
const BASE: &str = "follow_base";

/// Largest deviation of a followed quaternion's squared norm from 1.
const UNIT: f64 = 1e-6;

/// Returns one entry per robot of a component: true if the robot follows a state. `subscribes` reports the
/// wired inputs. `robots` is empty for a component with a single robot.
pub(super) fn followers(robots: &[RobotReference], subscribes: impl Fn(&str) -> bool) -> Vec<bool> {
    let follows = |prefix: &str| [JOINTS, BASE].iter().any(|port| subscribes(&format!("{prefix}{port}")));
    match robots {
        [] => vec![follows("")],
        several => several.iter().map(|robot| follows(&format!("{}.", robot.name))).collect(),
    }
}

/// Declares the inputs that move the robots, and returns `true` if commands move any of them.
pub(super) fn declare(
    config: &PhysicsConfig,
    robots: &[BuiltRobot],
    declare: &mut Declare,
) -> Result<bool, ConfigError> {
    if config.follow_stale_after.is_some_and(|time| time.ns == 0) {
        let message = "0, expected a time such as \"20 ms\"";
        return Err(ConfigError::key("follow_stale_after", message));
    }
    for robot in robots {
        let [command, joints, base] = [COMMAND, JOINTS, BASE].map(|port| robot.port(port));
        let floating = robot.loaded.model.base().floating;
        if robot.follows && declare.subscribes(&command) {
            let wired = if declare.subscribes(&joints) { &joints } else { &base };
            let message = format!("`{wired}` and `{command}` both move the robot");
            return Err(ConfigError::new(message).advise(format!(
                "a robot that follows a state accepts no commands; remove `{wired}` or `{command}`"
            )));
        }
        if robot.follows {
            let name = robot.name.as_ref().map_or_else(String::new, |name| format!(" `{name}`"));
            declare.note(format!(
                "moves its robot{name} along followed states, without actuator, command gate or safe state"
            ));
        } else {
            declare.input::<state::JointCommand>(&command, "commands of the drives");
        }
        let doc = "joint states along which the robot is moved, in place of commands";
        declare.optional_input::<JointState>(&joints, doc);
        if floating {
            let doc = "base states along which the robot is moved, in place of commands";
            declare.optional_input::<BaseState>(&base, doc);
        }
    }
    let driven = robots.iter().any(|robot| !robot.follows);
    if config.plant && !driven {
        return Err(ConfigError::key("plant", "all robots follow states, so no robot has simulated drives")
            .advise("remove `plant`, or wire the efforts of the drives to `joint_command`"));
    }
    Ok(driven)
}

/// A robot that is moved along the states of its inputs.
pub(super) struct Follower {
    articulation: usize,
    joints: Input<JointState>,
    /// `None` with a fixed base.
    base: Option<Input<BaseState>>,
    stale_after_ns: u64,
    /// Configuration (nq) and velocity (nv) of the articulation in this step.
    q: Vec<f64>,
    v: Vec<f64>,
    /// Followed efforts of the drives.
    efforts: Vec<f64>,
    /// Steps in which an input had no fresh and valid state.
    held: u64,
    /// Steps in which a state had the wrong number of joints or no unit quaternion.
    refused: u64,
}

/// A state of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Found {
    /// The input is not wired: this part of the robot stays at its start.
    Unwired,
    Fresh,
    /// Missing, or older than `follow_stale_after`.
    Stale,
    Refused,
}

impl Follower {
    /// Opens the inputs of a robot that follows. The robot stays in its current state until the first
    /// message.
    pub(super) fn open<E: Engine>(
        robot: &BuiltRobot,
        (simulation, stale_after_ns): (&Simulation<E>, u64),
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let base = match robot.loaded.model.base().floating {
            true => Some(setup.input(&robot.port(BASE))?),
            false => None,
        };
        let own = &simulation.articulations()[robot.articulation];
        Ok(Self {
            articulation: robot.articulation,
            joints: setup.input(&robot.port(JOINTS))?,
            base,
            stale_after_ns,
            q: simulation.configuration()[own.q()].to_vec(),
            v: vec![0.0; own.v().len()],
            efforts: vec![0.0; robot.drives.len()],
            held: 0,
            refused: 0,
        })
    }

    /// Moves the robot along the newest states in the next step. A part without a fresh and valid state holds
    /// its last pose with zero velocity.
    pub(super) fn apply<E: Engine>(&mut self, simulation: &mut Simulation<E>, settling: bool) {
        let own = &simulation.articulations()[self.articulation];
        let found = [self.read_joints(own), self.read_base()];
        if !settling {
            let any = |state: &[Found]| found.iter().any(|found| state.contains(found));
            self.held += u64::from(any(&[Found::Stale, Found::Refused]));
            self.refused += u64::from(any(&[Found::Refused]));
        }
        let placed = simulation.place_at(self.articulation, &self.q, &self.v);
        debug_assert!(placed.is_ok(), "{placed:?}: topics contain finite numbers, and the rest was checked");
    }

    fn read_joints(&mut self, own: &Articulation) -> Found {
        let joints = own.model().joint_count();
        let (first_q, first_v) = (self.q.len() - joints, self.v.len() - joints);
        let count = self.efforts.len();
        if !self.joints.is_wired() {
            return Found::Unwired;
        }
        let state = self.joints.latest();
        let found = match &state {
            None => Found::Stale,
            Some(state) if state.age_ns() > self.stale_after_ns => Found::Stale,
            Some(state) if state.count() != count => Found::Refused,
            Some(_) => Found::Fresh,
        };
        match state.filter(|_| found == Found::Fresh) {
            Some(state) => {
                // The entries of rotors follow the joints'; they have no position.
                self.q[first_q..].copy_from_slice(&state.position()[..joints]);
                self.v[first_v..].copy_from_slice(&state.velocity()[..joints]);
                self.efforts.copy_from_slice(state.effort());
            }
            None => {
                self.v[first_v..].fill(0.0);
                self.efforts.fill(0.0);
            }
        }
        found
    }

    fn read_base(&mut self) -> Found {
        let Some(input) = self.base.as_mut().filter(|input| input.is_wired()) else { return Found::Unwired };
        let state = input.latest().filter(|state| state.age_ns() <= self.stale_after_ns);
        let is_unit = |[x, y, z, w]: [f64; 4]| (x * x + y * y + z * z + w * w - 1.0).abs() <= UNIT;
        match state {
            Some(state) if is_unit(state.orientation) => {
                self.q[..3].copy_from_slice(&state.position);
                self.q[3..7].copy_from_slice(&state.orientation);
                self.v[..3].copy_from_slice(&state.linear_velocity);
                self.v[3..6].copy_from_slice(&state.angular_velocity);
                Found::Fresh
            }
            other => {
                self.v[..6].fill(0.0);
                if other.is_some() { Found::Refused } else { Found::Stale }
            }
        }
    }

    /// Returns the followed efforts of the drives; zero while the joints hold their last pose.
    pub(super) fn efforts(&self) -> &[f64] {
        &self.efforts
    }

    /// Starts an episode in the current state of the simulation.
    pub(super) fn reset<E: Engine>(&mut self, simulation: &Simulation<E>) {
        let own = &simulation.articulations()[self.articulation];
        self.q.copy_from_slice(&simulation.configuration()[own.q()]);
        self.v.fill(0.0);
        self.efforts.fill(0.0);
        (self.held, self.refused) = (0, 0);
    }

    /// Adds the counts of the episode to the report of the robot.
    pub(super) fn report(&self, into: &mut serde_json::Value) {
        into["steps_held"] = self.held.into();
        into["states_refused"] = self.refused.into();
    }
}
