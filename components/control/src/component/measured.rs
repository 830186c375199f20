//! The robot of a controller, and its state read from topics.

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium_robots::{BasePose, Kinematics, Loaded, Model, RobotSource};

use crate::RobotState;
use crate::inverse_dynamics::MotionState;

/// Returns the robot that the graph assigns to a component.
///
/// # Errors
/// [`ConfigError`] if the graph assigns no robot.
pub fn required_robot(declare: &Declare) -> Result<&RobotReference, ConfigError> {
    declare.robot().ok_or_else(|| {
        ConfigError::new("the component requires a robot, but names none")
            .advise("add `robot = \"NAME\"` to the component")
    })
}

/// Loads the robot that the graph assigns to a component.
///
/// # Errors
/// [`ConfigError`] for the key `robot` if the robot does not load or has more than [`MAX_JOINTS`] joints.
pub fn load_robot(robot: &RobotReference) -> Result<Loaded, ConfigError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    };
    let loaded = source.load().map_err(|error| ConfigError::key("robot", error.to_string()))?;
    match loaded.model.joint_count() {
        joints if joints > MAX_JOINTS => {
            Err(ConfigError::key("robot", format!("{joints} joints, expected at most {MAX_JOINTS}")))
        }
        _ => Ok(loaded),
    }
}

/// Configuration, velocity and kinematics of a robot, from the latest states of its joints and its base.
pub struct MeasuredState {
    joint_state: Input<JointState>,
    /// State of a floating base.
    base_state: Option<Input<BaseState>>,
    pub(super) model: Model,
    pub(super) kinematics: Kinematics,
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
    clock: RunClock,
    timeout_ns: u64,
    /// Time of the last step with a fresh state, ns since the start of the run.
    last_ns: Option<u64>,
    /// Number of steps without a fresh state after the first fresh one.
    stale: u64,
    /// `true` if the kinematics include velocities.
    velocities: bool,
}

/// A step with a fresh state.
#[derive(Clone, Copy, Debug)]
pub struct FreshStep {
    /// `true` if this step begins a sequence of fresh states: the first step, or the first one after an
    /// interruption.
    pub begins: bool,
    /// Time since the last step with a fresh state, s. After missed steps, this time spans several periods,
    /// so that setpoints do not lag behind the robot.
    pub dt: f64,
}

/// Returns the period of a step, ns.
pub fn period_ns(tick: &Tick) -> u64 {
    u64::try_from(tick.period.as_nanos()).unwrap_or(u64::MAX)
}

/// Checks the number of joints in a message.
///
/// # Errors
/// [`StepError`] if the numbers differ.
pub fn check_joint_count(found: usize, expected: usize) -> Result<(), StepError> {
    if found == expected {
        return Ok(());
    }
    Err(StepError::failed(format!(
        "the joint state does not match the robot's model: expected {expected} joints, found {found}"
    )))
}

impl MeasuredState {
    /// Opens the state inputs. A state counts as fresh if it is no older than `timeout_ns`.
    ///
    /// # Errors
    /// [`ConfigureError`] if a topic cannot be opened.
    pub fn configure(model: Model, timeout_ns: u64, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let floating = model.base().floating;
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            base_state: if floating { Some(setup.input("base_state")?) } else { None },
            kinematics: Kinematics::new(&model),
            q: model.neutral(),
            v: vec![0.0; model.nv()],
            clock: setup.clock(),
            timeout_ns,
            last_ns: None,
            stale: 0,
            velocities: true,
            model,
        })
    }

    /// Sets whether [`motion`](Self::motion) and the kinematics include velocities.
    pub fn velocities(self, velocities: bool) -> Self {
        Self { velocities, ..self }
    }

    /// Reads the latest state at the start of a step. Returns `None` if no fresh state is available.
    ///
    /// # Errors
    /// [`StepError`] if a message does not fit the robot.
    pub fn step(&mut self, tick: &Tick) -> Result<Option<FreshStep>, StepError> {
        let Some(time_ns) = self.read()? else { return Ok(None) };
        let longest = self.timeout_ns.max(2 * period_ns(tick));
        let now_ns = self.clock.grid_ns(tick, time_ns);
        let last = self.last_ns.replace(now_ns).filter(|last| now_ns.saturating_sub(*last) <= longest);
        let dt = tick.dt() * f64::from(tick.periods_since(last, now_ns));
        Ok(Some(FreshStep { begins: last.is_none(), dt }))
    }

    /// Reads the latest state of joints and base. Returns the time of the joint state, ns, if it is fresh.
    fn read(&mut self) -> Result<Option<u64>, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(None) };
        let time_ns = state.time_ns();
        let mut stale = state.age_ns() > self.timeout_ns;
        check_joint_count(state.count(), self.model.joint_count())?;
        let base = self.model.nv() - self.model.joint_count();
        let base_q = self.model.nq() - self.model.joint_count();
        self.q[base_q..].copy_from_slice(state.position());
        self.v[base..].copy_from_slice(state.velocity());
        if let Some(input) = &mut self.base_state {
            let Some(state) = input.latest() else { return Ok(None) };
            stale |= state.age_ns() > self.timeout_ns;
            self.q[..3].copy_from_slice(&state.position);
            self.q[3..7].copy_from_slice(&state.orientation);
            self.v[..3].copy_from_slice(&state.linear_velocity);
            self.v[3..6].copy_from_slice(&state.angular_velocity);
            let length = self.q[3..7].iter().map(|part| part * part).sum::<f64>().sqrt();
            // a quaternion half as long as a unit quaternion is not a rounding error
            if !(0.5..2.0).contains(&length) {
                return Err(StepError::failed("the orientation of the base state is not a unit quaternion"));
            }
            self.q[3..7].iter_mut().for_each(|part| *part /= length);
        }
        if stale {
            self.stale += 1;
            self.last_ns = None;
            return Ok(None);
        }
        match self.velocities {
            true => self.kinematics.update_with_velocity(&self.model, &self.q, &self.v),
            false => self.kinematics.update(&self.model, &self.q),
        }
        Ok(Some(time_ns))
    }

    /// Returns the number of steps without a fresh state since the first state.
    pub fn stale(&self) -> u64 {
        self.stale
    }

    /// Discards the state; the next fresh state begins a new sequence.
    pub fn reset(&mut self) {
        (self.last_ns, self.stale) = (None, 0);
    }

    /// Returns the latest state.
    pub fn motion(&self) -> MotionState<'_> {
        MotionState { model: &self.model, kinematics: &self.kinematics, q: &self.q, v: &self.v }
    }

    /// Returns the latest state without its velocity.
    pub fn robot(&self) -> RobotState<'_> {
        RobotState { model: &self.model, kinematics: &self.kinematics, q: &self.q }
    }

    /// Returns the positions \[rad or m\] and velocities \[rad/s or m/s\] of the joints.
    pub fn joints(&self) -> (&[f64], &[f64]) {
        (self.model.joints_of_q(&self.q), self.model.joints_of_v(&self.v))
    }
}
