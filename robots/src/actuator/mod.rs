//! Actuator models: the stages between the effort commanded to a drive and the effort it delivers.
//!
//! Each stage is one equation with at most one state. [`Actuator`] composes the stages for a joint, in this
//! order:
//!
//! ```text
//! delay       command(t) = asked(t - delay)
//! envelope    highest(v) = clamp(stall (1 - v / no_load), 0, limit)
//!             lowest(v)  = clamp(stall (-1 - v / no_load), -limit, 0)
//! thermal     heat' = ((effort / continuous)^2 - heat) / time_constant
//!             limit falls to `continuous` as heat goes from 0.8 to 1
//! lag         effort' = (clamp(wanted, lowest, highest) - effort) / lag
//! rate limit  |effort'| <= rate
//! drivetrain  motor_inertia theta'' = effort - load
//!             load = dead_band(theta - q, backlash) stiffness + (theta' - q') damping
//! ```
//!
//! An [`ActuatorNetwork`] may replace the law of the drive.
//!
//! Lag and rate limit are discretised implicitly (backward Euler). Steps of any length are therefore stable,
//! and a simulator can solve for an effort that depends on the state at the end of the step: see
//! [`Actuator::law`]. The drivetrain, whose motor has its own coordinate, is discretised in the same way: see
//! [`Actuator::joint_law`].

mod delay;
mod drivetrain;
mod network;
mod table;

use std::sync::Arc;

pub use delay::Delay;
pub use drivetrain::{DriveCommand, Drivetrain, JointLaw, Motor};
pub use network::{Activation, ActuatorNetwork, InputOrder, NetworkError, NetworkSettings, NetworkWeights};
pub use table::{
    ActuatorTable, ActuatorTableError, DrivetrainTable, EnvelopeTable, NetworkTable, ThermalTable,
};

/// Torque-speed envelope of a motor at a limited voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Stall effort at the supply voltage \[Nm or N\]; the effort limit of the joint may be lower.
    pub stall_effort: f64,
    /// Velocity at which the available effort is zero \[rad/s or m/s\].
    pub no_load_velocity: f64,
}

/// Heating of the motor's winding. As the winding heats up, the effort limit falls to the continuous effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// Continuous effort \[Nm or N\].
    pub continuous_effort: f64,
    /// Time constant of the winding \[s\].
    pub time_constant: f64,
}

/// Settings of an actuator model. The default is an ideal actuator, which delivers each commanded effort
/// immediately.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActuatorSettings {
    /// Delay of commands \[s\].
    pub delay: f64,
    /// Torque-speed envelope; `None` if only the effort limit applies.
    pub envelope: Option<Envelope>,
    /// Heating of the winding; `None` if the effort limit can be sustained indefinitely.
    pub thermal: Option<Thermal>,
    /// Time constant of the first-order lag of the effort \[s\]; 0 for no lag.
    pub lag: f64,
    /// Maximum rate of change of the effort \[Nm/s or N/s\]; `None` if unlimited.
    pub rate_limit: Option<f64>,
    /// Shaft and gear between motor and joint; `None` for a rigid drivetrain.
    pub drivetrain: Option<Drivetrain>,
    /// Network that replaces the law of the drive; `None` if the law applies.
    pub network: Option<Arc<NetworkSettings>>,
}

/// An actuator setting is out of range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{setting} = {value}: expected {expected}")]
pub struct ActuatorError {
    /// Name of the setting.
    pub setting: &'static str,
    /// Actual value.
    pub value: f64,
    /// Valid values, as a phrase.
    pub expected: &'static str,
}

impl ActuatorSettings {
    /// Checks every setting.
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] for the first invalid value.
    pub fn check(&self) -> Result<(), ActuatorError> {
        let time = |setting, value: f64| {
            let expected = "a time from 0 to 10 s";
            if (0.0..=10.0).contains(&value) {
                Ok(())
            } else {
                Err(ActuatorError { setting, value, expected })
            }
        };
        let positive = |setting, value: f64| {
            let expected = "a positive number";
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(ActuatorError { setting, value, expected })
            }
        };
        let not_negative = |setting, value: f64| {
            let expected = "a number from 0 up";
            if value >= 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(ActuatorError { setting, value, expected })
            }
        };
        time("delay", self.delay)?;
        time("lag", self.lag)?;
        if let Some(Envelope { stall_effort, no_load_velocity }) = self.envelope {
            positive("envelope.stall_effort", stall_effort)?;
            positive("envelope.no_load_velocity", no_load_velocity)?;
        }
        if let Some(Thermal { continuous_effort, time_constant }) = self.thermal {
            positive("thermal.continuous_effort", continuous_effort)?;
            positive("thermal.time_constant", time_constant)?;
        }
        if let Some(Drivetrain { motor_inertia, stiffness, damping, backlash }) = self.drivetrain {
            positive("drivetrain.motor_inertia", motor_inertia)?;
            positive("drivetrain.stiffness", stiffness)?;
            not_negative("drivetrain.damping", damping)?;
            not_negative("drivetrain.backlash", backlash)?;
        }
        self.rate_limit.map_or(Ok(()), |rate| positive("rate_limit", rate))
    }
}

/// Effort of one step as a function of the desired effort `wanted`, which may depend on the state at the end
/// of the step: `clamp(share * wanted + carried, low, high)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffortLaw {
    /// Fraction of the desired effort, above 0 and at most 1.
    pub share: f64,
    /// Part of the effort that comes from the state before the step \[Nm or N\].
    pub carried: f64,
    /// Minimum effort \[Nm or N\].
    pub low: f64,
    /// Maximum effort \[Nm or N\].
    pub high: f64,
}

/// Heat above which the effort limit decreases.
const WARM: f64 = 0.8;

/// The actuator of one joint, without its delay ([`Delay`]) and its network ([`ActuatorNetwork`]).
///
/// ```
/// use motorium_robots::{Actuator, ActuatorSettings};
///
/// let settings = ActuatorSettings { lag: 0.02, ..ActuatorSettings::default() };
/// let mut actuator = Actuator::new(&settings, 50.0)?;
/// // after one time constant 63 % of what is wanted
/// let effort = (0..2000).map(|_| actuator.step(10.0, 0.0, 1e-5)).last().unwrap();
/// assert!((effort - 6.32).abs() < 0.01);
/// # Ok::<(), motorium_robots::ActuatorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    envelope: Option<Envelope>,
    thermal: Option<Thermal>,
    lag: f64,
    rate_limit: Option<f64>,
    drivetrain: Option<Drivetrain>,
    limit: f64,
    effort: f64,
    heat: f64,
    /// State of a motor that moves separately from the joint, from the first step.
    motor: Option<Motor>,
}

impl Actuator {
    /// Creates an actuator at rest for a joint with the effort limit `effort_limit` \[Nm or N\].
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] for the first setting out of range.
    pub fn new(settings: &ActuatorSettings, effort_limit: f64) -> Result<Self, ActuatorError> {
        settings.check()?;
        let ActuatorSettings { envelope, thermal, lag, rate_limit, drivetrain, .. } = *settings;
        let limit = effort_limit.abs();
        Ok(Self {
            envelope,
            thermal,
            lag,
            rate_limit,
            drivetrain,
            limit,
            effort: 0.0,
            heat: 0.0,
            motor: None,
        })
    }

    /// Returns the effort delivered by the motor \[Nm or N\].
    pub fn effort(&self) -> f64 {
        self.effort
    }

    /// Returns the heat of the winding: 0 is cold, 1 is the steady state at the continuous effort.
    pub fn heat(&self) -> f64 {
        self.heat
    }

    /// Sets the effort limit of the joint \[Nm or N\].
    pub fn set_limit(&mut self, effort_limit: f64) {
        self.limit = effort_limit.abs();
    }

    /// Replaces the settings, but keeps the current effort, temperature and motor state.
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] for the first setting out of range. In this case the actuator is unchanged.
    pub fn set_settings(&mut self, settings: &ActuatorSettings) -> Result<(), ActuatorError> {
        let Self { effort, heat, motor, limit, .. } = *self;
        *self = Self { effort, heat, motor, ..Self::new(settings, limit)? };
        Ok(())
    }

    /// Resumes from the state of `other`: copies its effort, temperature and motor state. This actuator keeps
    /// its effort limit and settings.
    pub fn resume(&mut self, other: &Self) {
        (self.effort, self.heat, self.motor) = (other.effort, other.heat, other.motor);
    }

    /// Resets to rest: zero effort, cold winding, motor at the joint.
    pub fn reset(&mut self) {
        (self.effort, self.heat, self.motor) = (0.0, 0.0, None);
    }

    /// Returns the minimum and maximum effort \[Nm or N\] that the motor can produce at the joint velocity
    /// `velocity` \[rad/s or m/s\].
    pub fn available(&self, velocity: f64) -> (f64, f64) {
        let mut limit = self.limit;
        if let Some(Thermal { continuous_effort, .. }) = self.thermal {
            let cold = ((1.0 - self.heat) / (1.0 - WARM)).clamp(0.0, 1.0);
            if cold < 1.0 && limit > continuous_effort {
                // An infinite limit decreases from four times the continuous effort.
                let above = limit.min(4.0 * continuous_effort) - continuous_effort;
                limit = continuous_effort + above * cold;
            }
        }
        match self.envelope {
            None => (-limit, limit),
            Some(Envelope { stall_effort, no_load_velocity }) => {
                let speed = velocity / no_load_velocity;
                (
                    (stall_effort * (-1.0 - speed)).clamp(-limit, 0.0),
                    (stall_effort * (1.0 - speed)).clamp(0.0, limit),
                )
            }
        }
    }

    /// Returns the effort law of a step of `h` \[s\] that starts at the joint velocity `velocity` \[rad/s or
    /// m/s\].
    pub fn law(&self, velocity: f64, h: f64) -> EffortLaw {
        let (low, high) = self.available(velocity);
        let share = h / (self.lag + h);
        let carried = if self.lag > 0.0 { (1.0 - share) * self.effort } else { 0.0 };
        let (mut low, mut high) = (carried + share * low, carried + share * high);
        if let Some(rate) = self.rate_limit {
            let (least, most) = (self.effort - rate * h, self.effort + rate * h);
            (low, high) = (low.clamp(least, most), high.clamp(least, most));
        }
        EffortLaw { share, carried, low, high }
    }

    /// Advances the actuator by a step of `h` \[s\] in which it delivers the effort `effort` \[Nm or N\].
    pub fn apply(&mut self, effort: f64, h: f64) {
        self.effort = effort;
        if let Some(Thermal { continuous_effort, time_constant }) = self.thermal {
            // exact for an effort that is constant during the step
            let heating = (effort / continuous_effort).powi(2);
            self.heat = heating + (self.heat - heating) * (-h / time_constant).exp();
        }
    }

    /// Advances the actuator by a step of `h` \[s\] at the joint velocity `velocity` \[rad/s or m/s\], with
    /// the constant desired effort `wanted` \[Nm or N\]. Returns the delivered effort \[Nm or N\].
    pub fn step(&mut self, wanted: f64, velocity: f64, h: f64) -> f64 {
        let law = self.law(velocity, h);
        let effort = (law.share * wanted + law.carried).clamp(law.low, law.high);
        self.apply(effort, h);
        effort
    }
}
