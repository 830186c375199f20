//! Admittance: an external wrench becomes a compliant motion.

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_robots::{FrameId, Twist, lie::so3};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

use super::cartesian::{CartesianSettings, CartesianTask, SPRINGS};
use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::kind::{BuiltTask, GAINS, TaskKind, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::target::TargetInput;
use crate::{GoalTolerance, RobotState};

with_defaults! {
    /// Mass, damper and spring of an [`Admittance`]; isotropic in translation and in rotation.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct AdmittanceSettings;

    /// Apparent mass \[kg\], more than 0. Default 4.
    pub mass: f64 = 4.0;
    /// Damping \[N s/m\], at least 0. Default 40.
    pub damping: f64 = 40.0;
    /// Stiffness \[N/m\], at least 0. With 0 the frame stays where it was pushed. Default 100.
    pub stiffness: f64 = 100.0;
    /// Apparent moment of inertia \[kg m2\], more than 0. Default 0.1.
    pub inertia: f64 = 0.1;
    /// Rotational damping \[N m s/rad\], at least 0. Default 2.
    pub rotational_damping: f64 = 2.0;
    /// Rotational stiffness \[N m/rad\], at least 0. Default 10.
    pub rotational_stiffness: f64 = 10.0;
    /// Maximum displacement \[m\]. Default 0.2.
    pub max_displacement: f64 = 0.2;
    /// Maximum rotation \[rad\], less than pi. Default 0.8.
    pub max_rotation: f64 = 0.8;
}

/// A frame that yields to a wrench like a mass on a spring and a damper, independently of the robot's
/// inertia:
///
/// ```text
/// mass x'' + damping x' + stiffness x = f                            m, N
/// inertia t'' + rotational_damping t' + rotational_stiffness t = n   rotation vector t, rad; Nm
/// p = p* + x,   R = exp(t) R*                                        pose replacing the target (p*, R*)
/// v = v* + x',  o = J(t) t' + exp(t) o*                              J: left Jacobian of SO(3)
/// ```
///
/// All quantities are in world axes at the origin of the frame. The world exerts `f` and `n` on the robot, so
/// the frame moves with a push. The solution is exact for a wrench that is constant over a step of any
/// length. The motion stops at the maximum displacement or rotation; from there it can only return.
///
/// OpenSoT's Cartesian admittance is the case without a mass. Hogan, *Impedance control: an approach to
/// manipulation*, 1985.
///
/// ```
/// use motorium_control::{Admittance, AdmittanceSettings};
/// use nalgebra::Vector3;
///
/// let mut hand = Admittance::new(AdmittanceSettings { stiffness: 100.0, ..Default::default() });
/// for _ in 0..3000 {
///     hand.step(&Vector3::new(5.0, 0.0, 0.0), &Vector3::zeros(), 1e-3);
/// }
/// assert!((hand.displacement().x - 0.05).abs() < 1e-6, "5 N against 100 N/m");
/// ```
#[derive(Clone, Debug)]
pub struct Admittance {
    settings: AdmittanceSettings,
    /// Step length for which the transitions were computed, s.
    dt: f64,
    linear: Transition,
    angular: Transition,
    displacement: Vector3<f64>,
    velocity: Vector3<f64>,
    turn: Vector3<f64>,
    turn_rate: Vector3<f64>,
    /// `x''` and the rate of `J(t) t'` over the last step.
    acceleration: Twist,
}

/// Exact transition of one mass over a step: the next position and velocity as linear combinations of
/// position, velocity and force.
#[derive(Clone, Copy, Debug, Default)]
struct Transition {
    position: [f64; 3],
    velocity: [f64; 3],
}

impl Transition {
    /// The exponential of the system `(x, v, f)' = (v, (f - damping v - stiffness x) / mass, 0)`.
    fn new(mass: f64, damping: f64, stiffness: f64, dt: f64) -> Self {
        let system =
            Matrix3::new(0.0, 1.0, 0.0, -stiffness / mass, -damping / mass, 1.0 / mass, 0.0, 0.0, 0.0);
        let step = (system * dt).exp();
        let row = |row: usize| [step[(row, 0)], step[(row, 1)], step[(row, 2)]];
        Self { position: row(0), velocity: row(1) }
    }

    fn apply(&self, x: &mut Vector3<f64>, v: &mut Vector3<f64>, force: &Vector3<f64>) {
        let next = |of: &[f64; 3]| *x * of[0] + *v * of[1] + force * of[2];
        (*x, *v) = (next(&self.position), next(&self.velocity));
    }
}

/// Stops the motion of `x` at the length `most`.
fn stop(x: &mut Vector3<f64>, v: &mut Vector3<f64>, most: f64) {
    let length = x.norm();
    if length > most {
        let outward = *x / length;
        *x = outward * most;
        *v -= outward * v.dot(&outward).max(0.0);
    }
}

impl Admittance {
    /// Creates an admittance at rest at its target.
    pub fn new(settings: AdmittanceSettings) -> Self {
        Self {
            settings,
            dt: 0.0,
            linear: Transition::default(),
            angular: Transition::default(),
            displacement: Vector3::zeros(),
            velocity: Vector3::zeros(),
            turn: Vector3::zeros(),
            turn_rate: Vector3::zeros(),
            acceleration: Twist::zero(),
        }
    }

    /// Returns the settings.
    pub fn settings(&self) -> &AdmittanceSettings {
        &self.settings
    }

    /// Changes the settings from the next step on.
    pub fn set_settings(&mut self, settings: AdmittanceSettings) {
        if settings != self.settings {
            (self.settings, self.dt) = (settings, 0.0);
        }
    }

    /// Resets the frame to rest at the target.
    pub fn reset(&mut self) {
        *self = Self::new(self.settings);
    }

    /// Advances the motion by `dt` \[s\]. `force` \[N\] and `torque` \[Nm\] about the origin of the frame,
    /// both in world axes, are exerted by the world on the robot. A wrench that is not finite is ignored.
    pub fn step(&mut self, force: &Vector3<f64>, torque: &Vector3<f64>, dt: f64) {
        if dt != self.dt {
            let AdmittanceSettings { mass, damping, stiffness, .. } = self.settings;
            self.linear = Transition::new(mass, damping, stiffness, dt);
            let AdmittanceSettings { inertia, rotational_damping, rotational_stiffness, .. } = self.settings;
            self.angular = Transition::new(inertia, rotational_damping, rotational_stiffness, dt);
            self.dt = dt;
        }
        let number = |x: &Vector3<f64>| if x.iter().all(|x| x.is_finite()) { *x } else { Vector3::zeros() };
        let before = (self.velocity, self.angular_velocity());
        self.linear.apply(&mut self.displacement, &mut self.velocity, &number(force));
        self.angular.apply(&mut self.turn, &mut self.turn_rate, &number(torque));
        stop(&mut self.displacement, &mut self.velocity, self.settings.max_displacement);
        stop(&mut self.turn, &mut self.turn_rate, self.settings.max_rotation);
        self.acceleration = Twist {
            linear: (self.velocity - before.0) / dt,
            angular: (self.angular_velocity() - before.1) / dt,
        };
    }

    /// Returns the displacement `x` from the target \[m, world axes\].
    pub fn displacement(&self) -> &Vector3<f64> {
        &self.displacement
    }

    /// Returns the velocity `x'` of the displacement \[m/s, world axes\].
    pub fn velocity(&self) -> &Vector3<f64> {
        &self.velocity
    }

    /// Returns the rotation vector `t` from the target \[rad, world axes\].
    pub fn turn(&self) -> &Vector3<f64> {
        &self.turn
    }

    /// `J(t) t'` \[rad/s, world axes\].
    fn angular_velocity(&self) -> Vector3<f64> {
        so3::left_jacobian(&self.turn) * self.turn_rate
    }

    /// Returns the pose, velocity and acceleration of the displaced frame, in world axes, for a target with
    /// this pose and velocity.
    pub fn displace(&self, target: &Isometry3<f64>, velocity: &Twist) -> (Isometry3<f64>, Twist, Twist) {
        let turned: UnitQuaternion<f64> = so3::exp(&self.turn);
        let position = target.translation.vector + self.displacement;
        let pose = Isometry3::from_parts(position.into(), turned * target.rotation);
        let moving = Twist {
            linear: velocity.linear + self.velocity,
            angular: self.angular_velocity() + turned * velocity.angular,
        };
        (pose, moving, self.acceleration)
    }
}

/// Range of masses \[kg\] and moments of inertia \[kg m2\].
const MASSES: RangeInclusive<f64> = 1e-3..=1e6;

task_config! {
    /// An admittance task: a frame yields to a measured wrench like a mass on a spring and a damper.
    AdmittanceConfig "admittance" {
        /// Link whose frame yields. Default: the robot's only end effector.
        frame: Option<String> = None;
        /// Link in whose frame the wrench is measured. Default: `frame`.
        sensor: Option<String> = None;
        /// Name of the input port of the target, the pose of the frame without a wrench. The input is
        /// optional: without a target, the initial pose is used. Default "target".
        target: String = "target".to_owned() => target(
            optional PoseTarget, "pose and velocity of the frame without a wrench, in the world frame"
        );
        /// Name of the input port of the wrench that the world exerts on the robot. Default "wrench".
        wrench: String = "wrench".to_owned() => wrench(
            required Wrench,
            "wrench that the world exerts on the robot, at the origin and in the axes of the sensor's frame"
        );
        /// Rate at which the frame approaches the displaced pose, 1/s, 0 to 1000; limited to half the tick
        /// rate. Default 20.
        gain: f64 = 20.0 => live(GAINS, "1/s", "rate at which the frame approaches the displaced pose");
        /// Apparent mass, kg, 1e-3 to 1e6. Default 4.
        mass: f64 = AdmittanceSettings::default().mass => live(
            MASSES, "kg", "apparent mass of the frame"
        );
        /// Damping, N s/m, 0 to 1e6. Default 40.
        damping: f64 = AdmittanceSettings::default().damping => live(
            SPRINGS, "N s/m", "damping of the frame's motion"
        );
        /// Stiffness, N/m, 0 to 1e6. With 0 the frame stays where it was pushed. Default 100.
        stiffness: f64 = AdmittanceSettings::default().stiffness => live(
            SPRINGS, "N/m", "stiffness towards the target"
        );
        /// Apparent moment of inertia, kg m2, 1e-3 to 1e6. Default 0.1.
        inertia: f64 = AdmittanceSettings::default().inertia => within(MASSES);
        /// Rotational damping, N m s/rad, 0 to 1e6. Default 2.
        rotational_damping: f64 = AdmittanceSettings::default().rotational_damping => within(SPRINGS);
        /// Rotational stiffness, N m/rad, 0 to 1e6. Default 10.
        rotational_stiffness: f64 = AdmittanceSettings::default().rotational_stiffness => within(SPRINGS);
        /// Maximum displacement, m, 0 to 10. Default 0.2.
        max_displacement: f64 = AdmittanceSettings::default().max_displacement => within(0.0..=10.0);
        /// Maximum rotation, rad, 0 to 3. Default 0.8.
        max_rotation: f64 = AdmittanceSettings::default().max_rotation => within(0.0..=3.0);
        /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
        position_weight: f64 = CartesianSettings::default().position_weight => within(WEIGHTS);
        /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
        orientation_weight: f64 = CartesianSettings::default().orientation_weight => within(WEIGHTS);
    }
}

impl AdmittanceConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<(CartesianTask, FrameId, Admittance), ConfigError> {
        let frame = context.frame("admittance", self.frame.as_deref())?;
        let sensor = self.sensor.as_ref().map_or(Ok(frame), |name| context.named_frame("sensor", name))?;
        let law = Admittance::new(AdmittanceSettings {
            mass: self.mass,
            damping: self.damping,
            stiffness: self.stiffness,
            inertia: self.inertia,
            rotational_damping: self.rotational_damping,
            rotational_stiffness: self.rotational_stiffness,
            max_displacement: self.max_displacement,
            max_rotation: self.max_rotation,
        });
        let task = CartesianTask::new(context.model, frame).with(CartesianSettings {
            error: context.pose_error(),
            gain: self.gain,
            position_weight: self.position_weight,
            orientation_weight: self.orientation_weight,
            damping: context.damping(None, CartesianSettings::default().damping)?,
            ..CartesianSettings::default()
        });
        Ok((task, sensor, law))
    }
}

impl TaskKind for AdmittanceConfig {
    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, sensor, law) = self.build(context)?;
        Ok(Box::new(HeldAdmittance {
            task,
            law,
            sensor,
            target: TargetInput::new(setup.input(&self.target)?, GoalTolerance::default()),
            wrench: setup.input(&self.wrench)?,
            parameters: self.open(setup)?,
            goal: (Isometry3::identity(), Twist::zero()),
            origin: Vector3::zeros(),
            sensed: Isometry3::identity(),
            largest: 0.0,
            silent: 0,
        }))
    }
}

/// A running admittance task, driven by the wrenches of one input.
struct HeldAdmittance {
    task: CartesianTask,
    law: Admittance,
    sensor: FrameId,
    target: TargetInput,
    wrench: Input<Wrench>,
    /// Gain, mass, damping and stiffness.
    parameters: [Ramped; 4],
    /// The target without a wrench, and its velocity.
    goal: (Isometry3<f64>, Twist),
    /// Origin of the frame and pose of the sensor, last measured values.
    origin: Vector3<f64>,
    sensed: Isometry3<f64>,
    /// Largest displacement so far, m.
    largest: f64,
    /// Number of steps without a fresh wrench.
    silent: u64,
}

impl HeldAdmittance {
    fn measure(&mut self, state: &RobotState<'_>) {
        self.origin = state.kinematics.pose(state.model, self.task.frame()).translation.vector;
        self.sensed = state.kinematics.pose(state.model, self.sensor);
    }

    /// Returns the latest force and torque, in world axes about the origin of the frame; zero if the sensor
    /// is silent.
    fn push(&mut self, timeout_ns: u64) -> (Vector3<f64>, Vector3<f64>) {
        let reading = self.wrench.latest().filter(|reading| reading.age_ns() <= timeout_ns);
        let Some(reading) = reading else {
            self.silent += 1;
            return (Vector3::zeros(), Vector3::zeros());
        };
        let force = self.sensed.rotation * Vector3::from(reading.force);
        let torque = self.sensed.rotation * Vector3::from(reading.torque);
        (force, torque + (self.sensed.translation.vector - self.origin).cross(&force))
    }
}

impl HeldTask for HeldAdmittance {
    fn begin(&mut self, start: &RobotState<'_>) {
        self.measure(start);
        self.law.reset();
        if !self.target.is_set() {
            self.goal = (start.kinematics.pose(start.model, self.task.frame()), Twist::zero());
        }
    }

    fn reset(&mut self) {
        self.target.reset();
        (self.largest, self.silent) = (0.0, 0);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [gain, mass, damping, stiffness] =
            self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        let gain = gain.min(bounds.max_gain);
        self.task.set_settings(CartesianSettings { gain, ..*self.task.settings() });
        self.law.set_settings(AdmittanceSettings { mass, damping, stiffness, ..*self.law.settings() });
    }

    fn prepare(&mut self, bounds: &TaskBounds) {
        self.goal = self.target.pose(bounds).unwrap_or(self.goal);
        let (force, torque) = self.push(bounds.target_timeout_ns);
        self.law.step(&force, &torque, bounds.dt);
        let (pose, velocity, acceleration) = self.law.displace(&self.goal.0, &self.goal.1);
        self.task.set_moving_target(pose, velocity, acceleration);
        self.largest = self.largest.max(self.law.displacement().norm());
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Motion(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, _: f64) {
        self.measure(measured);
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "largest_displacement_m": self.largest,
            "last_displacement_m": self.law.displacement().as_slice(),
            "last_position_error_m": (self.task.target().translation.vector - self.origin).norm(),
            "steps_without_wrench": self.silent,
        }))
    }
}
