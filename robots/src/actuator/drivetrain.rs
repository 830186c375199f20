//! A compliant drivetrain: series elasticity and backlash between motor and joint.

use super::{Actuator, EffortLaw};

/// A compliant drivetrain: a motor with its own inertia moves the joint through a spring and a damper,
/// optionally with backlash.
///
/// With `backlash = 0`, the drivetrain is a series-elastic actuator. With a stiff spring and backlash, it is
/// a gear (the dead-zone model of Nordin and Gutman 2002): within the gap, motor and joint do not act on each
/// other; at the ends of the gap, the teeth push but never pull. All values are converted to the joint side
/// of the gear. The motor inertia is therefore the rotor inertia times the square of the gear ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drivetrain {
    /// Inertia of the motor reflected to the joint \[kg m2 or kg\].
    pub motor_inertia: f64,
    /// Stiffness of the spring \[Nm/rad or N/m\].
    pub stiffness: f64,
    /// Damping parallel to the spring \[Nms/rad or Ns/m\].
    pub damping: f64,
    /// Backlash: total width of the gap between motor and joint \[rad or m\].
    pub backlash: f64,
}

/// Position and velocity of a motor, converted to the joint side of the gear.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motor {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[rad/s or m/s\].
    pub velocity: f64,
}

/// Command of a drive that closes its loops on the motor position `theta`: `kp (position - theta) + kd
/// (velocity - theta') + effort`.
///
/// Beyond `velocity_limits`, the available effort in the direction of motion decreases by `braking` per unit
/// of velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand {
    /// Position setpoint \[rad or m\].
    pub position: f64,
    /// Velocity setpoint \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[Nm or N\].
    pub effort: f64,
    /// Position gain \[Nm/rad or N/m\].
    pub kp: f64,
    /// Velocity gain \[Nms/rad or Ns/m\].
    pub kd: f64,
    /// Minimum and maximum velocity, beyond which the drive brakes \[rad/s or m/s\].
    pub velocity_limits: [f64; 2],
    /// Slope of the available effort beyond `velocity_limits` \[Nms/rad or Ns/m\]; 0 for no braking.
    pub braking: f64,
}

impl DriveCommand {
    /// Creates a command of pure `effort` \[Nm or N\], with zero gains and without velocity limits.
    pub fn effort(effort: f64) -> Self {
        let velocity_limits = [f64::NEG_INFINITY, f64::INFINITY];
        Self { position: 0.0, velocity: 0.0, effort, kp: 0.0, kd: 0.0, velocity_limits, braking: 0.0 }
    }
}

/// Effort on a joint in one step as a function of the joint velocity `x` at the end of the step:
/// `clamp(effort - slope * x, low, high)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLaw {
    /// Effort at zero joint velocity \[Nm or N\].
    pub effort: f64,
    /// Decrease of the effort per unit of velocity \[Nms/rad or Ns/m\].
    pub slope: f64,
    /// Minimum effort \[Nm or N\].
    pub low: f64,
    /// Maximum effort \[Nm or N\].
    pub high: f64,
}

impl JointLaw {
    const NOTHING: Self = Self { effort: 0.0, slope: 0.0, low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Returns the effort \[Nm or N\] if `x` is the joint velocity \[rad/s or m/s\] at the end of the step.
    ///
    /// ```
    /// # use motorium_robots::JointLaw;
    /// let law = JointLaw { effort: 2.0, slope: 4.0, low: 0.0, high: f64::INFINITY };
    /// assert_eq!([law.at(0.25), law.at(3.0)], [1.0, 0.0]);
    /// ```
    pub fn at(&self, x: f64) -> f64 {
        (self.effort - self.slope * x).clamp(self.low, self.high)
    }
}

/// Motor effort `constant - slope * w` as a function of its velocity `w` at the end of the step.
#[derive(Clone, Copy)]
struct Line {
    constant: f64,
    slope: f64,
}

/// A step of a motor: everything that changes its velocity except the load.
struct MotorStep {
    /// Inertia divided by the length of the step.
    inertia: f64,
    velocity: f64,
    wanted: Line,
    /// Maximum and minimum effort, each decreasing with velocity where the drive brakes.
    high: [Line; 2],
    low: [Line; 2],
}

impl MotorStep {
    fn new(
        drivetrain: &Drivetrain,
        motor: &Motor,
        command: &DriveCommand,
        (law, h): (&EffortLaw, f64),
    ) -> Self {
        let EffortLaw { share, carried, low, high } = *law;
        let DriveCommand { position, velocity, effort, kp, kd, velocity_limits: [slowest, fastest], braking } =
            *command;
        let flat = |constant| Line { constant, slope: 0.0 };
        let beyond = |constant: f64, limit: f64| {
            let brakes = braking > 0.0 && limit.is_finite() && constant.is_finite();
            if brakes {
                Line { constant: constant + braking * limit, slope: braking }
            } else {
                flat(constant)
            }
        };
        let asked = kp * (position - motor.position) + kd * velocity + effort;
        Self {
            inertia: drivetrain.motor_inertia / h,
            velocity: motor.velocity,
            wanted: Line { constant: share * asked + carried, slope: share * (kd + h * kp) },
            high: [flat(high), beyond(high, fastest)],
            low: [flat(low), beyond(low, slowest)],
        }
    }

    /// Returns the velocity at the end of the step under a load `constant + slope * w`, and the active line
    /// of the effort. The effort is a monotone function of the velocity, built from lines by minima and
    /// maxima; the solution has the same structure.
    fn solve(&self, (constant, slope): (f64, f64)) -> (f64, Line) {
        let root = |line: Line| {
            let push = self.inertia * self.velocity + line.constant - constant;
            (push / (self.inertia + line.slope + slope), line)
        };
        let least = |a: (f64, Line), b: (f64, Line)| if b.0 < a.0 { b } else { a };
        let most = |a: (f64, Line), b: (f64, Line)| if b.0 > a.0 { b } else { a };
        let (high, low) = (self.high.map(root), self.low.map(root));
        let upper = most(least(high[0], high[1]), low[0]);
        let lower = least(most(low[0], low[1]), high[0]);
        most(lower, least(upper, root(self.wanted)))
    }
}

impl Actuator {
    /// Returns the compliant drivetrain, or `None` for a rigid drivetrain.
    pub fn drivetrain(&self) -> Option<&Drivetrain> {
        self.drivetrain.as_ref()
    }

    /// Returns the motor state behind a compliant drivetrain. `None` for a rigid drivetrain, whose motor
    /// moves with the joint, and before [`begin`](Self::begin).
    pub fn motor(&self) -> Option<Motor> {
        self.motor
    }

    /// Begins the motion of a compliant drivetrain: the motor starts at the joint's position and velocity,
    /// with the spring relaxed. Has no effect if the motor already has a state.
    pub fn begin(&mut self, joint: Motor) {
        if self.drivetrain.is_some() && self.motor.is_none() {
            self.motor = Some(joint);
        }
    }

    /// Returns the effort on the joint, as a function of the joint velocity, in a step of `h` \[s\] that
    /// starts at the joint state `joint`; `None` for a rigid drivetrain.
    ///
    /// ```
    /// use motorium_robots::{Actuator, ActuatorSettings, DriveCommand, Drivetrain, Motor};
    ///
    /// let drivetrain = Drivetrain { motor_inertia: 0.1, stiffness: 200.0, damping: 2.0, backlash: 0.0 };
    /// let settings = ActuatorSettings { drivetrain: Some(drivetrain), ..ActuatorSettings::default() };
    /// let mut actuator = Actuator::new(&settings, 50.0)?;
    /// let (blocked, command) = (Motor::default(), DriveCommand::effort(3.0));
    /// for _ in 0..5000 {
    ///     actuator.begin(blocked);
    ///     let law = actuator.joint_law(&command, blocked, 1e-3).expect("a drivetrain");
    ///     actuator.apply_load(&command, law.at(blocked.velocity), 1e-3);
    /// }
    /// // the spring is wound up until it carries the effort
    /// assert!((actuator.motor().unwrap().position - 3.0 / 200.0).abs() < 1e-9);
    /// # Ok::<(), motorium_robots::ActuatorError>(())
    /// ```
    pub fn joint_law(&self, command: &DriveCommand, joint: Motor, h: f64) -> Option<JointLaw> {
        let drivetrain = self.drivetrain.as_ref()?;
        let motor = self.motor.unwrap_or(joint);
        let Drivetrain { stiffness, damping, backlash, .. } = *drivetrain;
        let step = MotorStep::new(drivetrain, &motor, command, (&self.law(motor.velocity, h), h));
        let half = 0.5 * backlash;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut twist = motor.position - joint.position;
        if backlash > 0.0 {
            // The sides of the gap touch if the free motion would close it.
            let (free, _) = step.solve((0.0, 0.0));
            let end = twist + h * (free - joint.velocity);
            if end > half {
                (twist, low) = (twist - half, 0.0);
            } else if end < -half {
                (twist, high) = (twist + half, 0.0);
            } else {
                return Some(JointLaw::NOTHING);
            }
        }
        // The load is `tension + give (w - x)` at the end of the step; the line of the effort is chosen by
        // the current velocity.
        let (tension, give) = (stiffness * twist, stiffness * h + damping);
        let (_, line) = step.solve((tension - give * joint.velocity, give));
        let yielding = 1.0 / (step.inertia + line.slope);
        let free = (step.inertia * step.velocity + line.constant) * yielding;
        let share = 1.0 / (1.0 + give * yielding);
        Some(JointLaw { effort: share * (tension + give * free), slope: share * give, low, high })
    }

    /// Advances the motor by a step of `h` \[s\], in which the joint loads the motor with the effort `load`
    /// \[Nm or N\].
    pub fn apply_load(&mut self, command: &DriveCommand, load: f64, h: f64) {
        let (Some(drivetrain), Some(mut motor)) = (self.drivetrain, self.motor) else { return };
        let step = MotorStep::new(&drivetrain, &motor, command, (&self.law(motor.velocity, h), h));
        let (velocity, line) = step.solve((load, 0.0));
        motor.velocity = velocity;
        motor.position += h * velocity;
        self.motor = Some(motor);
        self.apply(line.constant - line.slope * velocity, h);
    }
}
