//! Models of actuators: what lies between the effort that a drive is asked for and the one that it gives.
//!
//! Each stage is one equation with one state at most; [`Actuator`] composes them for a joint, in this order:
//!
//! ```text
//! delay       command(t) = asked(t - delay)
//! envelope    highest(v) = clamp(stall (1 - v / no_load), 0, limit)      lowest(v) = clamp(stall (-1 - v / no_load), -limit, 0)
//! thermal     heat' = ((effort / continuous)^2 - heat) / time_constant   limit falls to `continuous` as heat goes from 0.8 to 1
//! lag         effort' = (clamp(wanted, lowest, highest) - effort) / lag
//! rate limit  |effort'| <= rate
//! ```
//!
//! Lag and rate limit are discretised implicitly (backward Euler), so that a step of any length is stable, and so that a simulator
//! can solve for an effort that depends on the state at the end of the step: [`Actuator::law`].

use std::collections::VecDeque;

/// A torque-speed envelope: a motor at a limited voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Effort at standstill that the voltage would give \[Nm or N\]; the effort limit of the joint may lie below it.
    pub stall_effort: f64,
    /// Velocity at which no effort is left \[rad/s or m/s\].
    pub no_load_velocity: f64,
}

/// A winding that warms up: the effort limit falls to what can be given for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// Effort that can be given for ever \[Nm or N\].
    pub continuous_effort: f64,
    /// Time constant of the winding \[s\].
    pub time_constant: f64,
}

/// The settings of an actuator. The default is an ideal one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActuatorSettings {
    /// Time from a command until it acts \[s\].
    pub delay: f64,
    /// Torque-speed envelope; `None`: the effort limit alone.
    pub envelope: Option<Envelope>,
    /// Warming up; `None`: the effort limit can be given for ever.
    pub thermal: Option<Thermal>,
    /// Time constant of the effort, a first-order lag \[s\].
    pub lag: f64,
    /// Largest rate of the effort \[Nm/s or N/s\].
    pub rate_limit: Option<f64>,
}

/// Settings that describe no actuator.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{setting} = {value}: expected {expected}")]
pub struct ActuatorError {
    /// The setting.
    pub setting: &'static str,
    /// The number found.
    pub value: f64,
    /// The numbers expected.
    pub expected: &'static str,
}

impl ActuatorSettings {
    /// Checks every number.
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] with the first that cannot be.
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
        self.rate_limit.map_or(Ok(()), |rate| positive("rate_limit", rate))
    }
}

/// The effort of one step: `clamp(share * wanted + carried, low, high)`, where `wanted` may depend on the state at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffortLaw {
    /// Share of the effort that is wanted, above 0 to 1.
    pub share: f64,
    /// The part that stays from before \[Nm or N\].
    pub carried: f64,
    /// Lowest effort \[Nm or N\].
    pub low: f64,
    /// Highest effort \[Nm or N\].
    pub high: f64,
}

/// Heat from which the effort limit falls.
const WARM: f64 = 0.8;

/// The actuator of one joint, all but its delay ([`Delay`]).
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
    settings: ActuatorSettings,
    limit: f64,
    effort: f64,
    heat: f64,
}

impl Actuator {
    /// An actuator at rest, for a joint with this effort limit \[Nm or N\].
    ///
    /// # Errors
    ///
    /// [`ActuatorError`].
    pub fn new(settings: &ActuatorSettings, effort_limit: f64) -> Result<Self, ActuatorError> {
        settings.check()?;
        Ok(Self { settings: *settings, limit: effort_limit.abs(), effort: 0.0, heat: 0.0 })
    }

    /// The effort that it gives \[Nm or N\].
    pub fn effort(&self) -> f64 {
        self.effort
    }

    /// The heat of its winding: 0 cold, 1 after the continuous effort for ever.
    pub fn heat(&self) -> f64 {
        self.heat
    }

    /// Sets the effort limit of the joint \[Nm or N\].
    pub fn set_limit(&mut self, effort_limit: f64) {
        self.limit = effort_limit.abs();
    }

    /// Goes back to rest: no effort, cold.
    pub fn reset(&mut self) {
        (self.effort, self.heat) = (0.0, 0.0);
    }

    /// The lowest and the highest effort that the motor can give at a velocity \[rad/s or m/s\].
    pub fn available(&self, velocity: f64) -> (f64, f64) {
        let mut limit = self.limit;
        if let Some(Thermal { continuous_effort, .. }) = self.settings.thermal {
            let cold = ((1.0 - self.heat) / (1.0 - WARM)).clamp(0.0, 1.0);
            if cold < 1.0 && limit > continuous_effort {
                // A limit without end falls from four times the continuous effort.
                let above = limit.min(4.0 * continuous_effort) - continuous_effort;
                limit = continuous_effort + above * cold;
            }
        }
        match self.settings.envelope {
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

    /// The law of a step of `h` \[s\] that begins at a velocity \[rad/s or m/s\].
    pub fn law(&self, velocity: f64, h: f64) -> EffortLaw {
        let (low, high) = self.available(velocity);
        let share = h / (self.settings.lag + h);
        let carried = if self.settings.lag > 0.0 { (1.0 - share) * self.effort } else { 0.0 };
        let (mut low, mut high) = (carried + share * low, carried + share * high);
        if let Some(rate) = self.settings.rate_limit {
            let (least, most) = (self.effort - rate * h, self.effort + rate * h);
            (low, high) = (low.clamp(least, most), high.clamp(least, most));
        }
        EffortLaw { share, carried, low, high }
    }

    /// Takes in the effort \[Nm or N\] of a step of `h` \[s\].
    pub fn apply(&mut self, effort: f64, h: f64) {
        self.effort = effort;
        if let Some(Thermal { continuous_effort, time_constant }) = self.settings.thermal {
            // exact for an effort that is constant in the step
            let heating = (effort / continuous_effort).powi(2);
            self.heat = heating + (self.heat - heating) * (-h / time_constant).exp();
        }
    }

    /// A step of `h` \[s\] at a velocity \[rad/s or m/s\] in which the effort `wanted` \[Nm or N\] does not change: the effort that the
    /// actuator gives.
    pub fn step(&mut self, wanted: f64, velocity: f64, h: f64) -> f64 {
        let law = self.law(velocity, h);
        let effort = (law.share * wanted + law.carried).clamp(law.low, law.high);
        self.apply(effort, h);
        effort
    }
}

/// A delay of commands: what is sent at `t` acts from `t + delay` on, and stays until the next acts.
///
/// ```
/// use motorium_robots::Delay;
///
/// let mut delay = Delay::new(2e-3, 0);
/// let mut acting = |command: i32| {
///     let now = delay.acting(command);
///     delay.advance(command, 1e-3);
///     now
/// };
/// assert_eq!([acting(1), acting(2), acting(3), acting(4)], [0, 0, 1, 2]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Delay<T> {
    delay_ns: u64,
    now_ns: u64,
    idle: T,
    /// Commands under way with the time from which they act, oldest first; the first may act already.
    queue: VecDeque<(u64, T)>,
}

impl<T: Copy> Delay<T> {
    /// A delay \[s\]; until the first command arrives `idle` acts. There is room for steps of 0.1 ms and longer.
    pub fn new(delay: f64, idle: T) -> Self {
        let delay_ns = nanoseconds(delay);
        let queue = VecDeque::with_capacity((delay_ns / 100_000) as usize + 3);
        Self { delay_ns, now_ns: 0, idle, queue }
    }

    /// The command that acts now, when `newest` is sent now.
    pub fn acting(&self, newest: T) -> T {
        if self.delay_ns == 0 {
            return newest;
        }
        let arrived = self.queue.iter().take_while(|(due, _)| *due <= self.now_ns);
        arrived.last().map_or(self.idle, |(_, command)| *command)
    }

    /// Sends `newest` now, and goes on by `dt` \[s\].
    pub fn advance(&mut self, newest: T, dt: f64) {
        if self.delay_ns == 0 {
            return;
        }
        self.queue.push_back((self.now_ns + self.delay_ns, newest));
        self.now_ns += nanoseconds(dt);
        // the one that acts stays
        while self.queue.get(1).is_some_and(|(due, _)| *due <= self.now_ns) {
            self.queue.pop_front();
        }
    }

    /// Goes back to the start: nothing is under way.
    pub fn reset(&mut self) {
        self.queue.clear();
        self.now_ns = 0;
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
