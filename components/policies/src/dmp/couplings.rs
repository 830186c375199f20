//! Couplings of the primitives to tracking errors, obstacles and forces.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare};
use motorium::state::Wrench;
use motorium::transport::Input;
use motorium_primitives::dmp::{ObstacleAvoidance, PhaseStop, Yielding};
use motorium_primitives::reach::{PoseReach, ReachPhase};
use nalgebra::Vector3;

use super::config::{DmpPolicyConfig, ObstaclesConfig, YieldingConfig};

/// The couplings of a policy.
#[derive(Debug)]
pub(super) struct Couplings {
    stop: Option<PhaseStop>,
    avoidance: Option<(ObstacleAvoidance, Vec<Vector3<f64>>)>,
    yielding: Option<(Yielding, Input<Wrench>)>,
    /// Smallest rate of the movement so far.
    slowest: f64,
    /// Largest acceleration by obstacles and forces so far, m/s^2.
    largest: f64,
}

impl Couplings {
    /// Checks the configuration and declares the required input.
    pub(super) fn declare(config: &DmpPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        check(config)?;
        if config.yielding.is_some() {
            declare.input::<Wrench>("wrench", "force on the end effector, in its axes");
        }
        Ok(())
    }

    pub(super) fn open(config: &DmpPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        check(config)?;
        let yielding = match config.yielding {
            Some(YieldingConfig { inertia, deadband }) => {
                Some((Yielding { inertia, deadband }, setup.input("wrench")?))
            }
            None => None,
        };
        Ok(Self {
            stop: config.phase_stop.map(|stop| PhaseStop::Quadratic { gain: stop.distance.powi(-2) }),
            avoidance: config.obstacles.as_ref().map(|obstacles| {
                let ObstaclesConfig { points, gamma, beta, reach } = obstacles;
                let avoidance = ObstacleAvoidance { gamma: *gamma, beta: *beta, reach: *reach };
                (avoidance, points.iter().map(|point| Vector3::from(*point)).collect())
            }),
            yielding,
            slowest: 1.0,
            largest: 0.0,
        })
    }

    /// Returns `true` if the end effector must be measured.
    pub(super) fn needs_end_effector(&self) -> bool {
        self.stop.is_some()
    }

    /// Applies obstacles and forces to the next step, and returns the rate of the movement for this position
    /// of the end effector.
    pub(super) fn apply(&mut self, reach: &mut PoseReach, end_effector: Option<Vector3<f64>>) -> f64 {
        let pose = reach.pose();
        let mut acceleration = Vector3::zeros();
        if reach.phase() == ReachPhase::Moving
            && let Some((avoidance, points)) = &self.avoidance
        {
            let place = pose.translation.vector;
            acceleration += avoidance.acceleration_from(place, reach.twist().linear, points);
        }
        if let Some((yielding, wrench)) = &mut self.yielding
            && let Some(wrench) = wrench.latest()
        {
            let force = pose.rotation * Vector3::from(wrench.force);
            yielding.add(force.as_slice(), acceleration.as_mut_slice());
        }
        reach.push(acceleration);
        self.largest = self.largest.max(acceleration.norm());
        let rate = match (self.stop, end_effector) {
            (Some(stop), Some(place)) => stop.rate((place - pose.translation.vector).norm()),
            _ => 1.0,
        };
        self.slowest = self.slowest.min(rate);
        rate
    }

    pub(super) fn reset(&mut self) {
        (self.slowest, self.largest) = (1.0, 0.0);
    }

    /// Returns the effect of the couplings so far; `None` without a coupling.
    pub(super) fn result(&self) -> Option<serde_json::Value> {
        let any = self.stop.is_some() || self.avoidance.is_some() || self.yielding.is_some();
        any.then(|| serde_json::json!({ "slowest_rate": self.slowest, "largest_acceleration": self.largest }))
    }
}

fn check(config: &DmpPolicyConfig) -> Result<(), ConfigError> {
    let positive = |key: &str, value: f64| {
        let message = format!("{value}, expected a positive number");
        if value.is_finite() && value > 0.0 { Ok(()) } else { Err(ConfigError::key(key, message)) }
    };
    if let Some(stop) = &config.phase_stop {
        positive("phase_stop.distance", stop.distance)?;
        if config.start.is_some() {
            let message = "the end effector is not measured where `start` is configured";
            return Err(ConfigError::key("phase_stop", message).advise("remove `start`, or `phase_stop`"));
        }
    }
    if let Some(obstacles) = &config.obstacles {
        positive("obstacles.gamma", obstacles.gamma)?;
        positive("obstacles.beta", obstacles.beta)?;
        positive("obstacles.reach", obstacles.reach)?;
        if obstacles.points.is_empty() {
            return Err(ConfigError::key("obstacles.points", "no point is given, expected at least one"));
        }
        if let Some(number) = obstacles.points.iter().flatten().find(|number| !number.is_finite()) {
            let message = format!("{number}, expected a finite number");
            return Err(ConfigError::key("obstacles.points", message));
        }
    }
    if let Some(yielding) = &config.yielding {
        positive("yielding.inertia", yielding.inertia)?;
        if !(yielding.deadband.is_finite() && yielding.deadband >= 0.0) {
            let message = format!("{}, expected at least 0", yielding.deadband);
            return Err(ConfigError::key("yielding.deadband", message));
        }
    }
    Ok(())
}
