//! A base led through poses in the plane, by feedback on where it is.
//!
//! A base that cannot go sideways turns to its goal on the spot, drives there, and turns as the goal says; one that can goes
//! straight there while it turns. Each of these stages follows a [`Profile`] of its own, planned from where the base is when
//! it begins. On a straight line the law is that of Kanayama and others (*A stable tracking control method for an autonomous
//! mobile robot*, ICRA 1990), with the errors `e` of the pose in the axes of the base and the speed `v` of the profile:
//!
//! ```text
//! ahead = v cos e_yaw + gain e_x
//! turn  = v e_y / l^2 + max(turn_gain, 2 |v| / l) sin e_yaw
//! ```
//!
//! so that a base beside its line comes back to it within a few lengths `l`, without overshoot.
//!
//! ```
//! use motorium_primitives::route::{Place, Route, RouteSettings, Stop};
//!
//! let stop = Stop { position: [1.0, 0.0], yaw: Some(1.57), dwell: 0.0 };
//! let mut route = Route::new(vec![stop], RouteSettings::default());
//! let (mut place, dt) = (Place::default(), 0.001);
//! while !route.is_finished() {
//!     let speed = route.step(place, dt).command;
//!     // a base that does as it is told
//!     place = Place {
//!         x: place.x + dt * speed.x * place.yaw.cos(),
//!         y: place.y + dt * speed.x * place.yaw.sin(),
//!         yaw: place.yaw + dt * speed.yaw,
//!     };
//! }
//! assert!((place.x - 1.0).abs() < 2e-3 && (place.yaw - 1.57).abs() < 2e-3);
//! ```

mod follow;

pub use follow::Route;

use crate::profile::MotionLimits;

#[cfg(doc)]
use crate::profile::Profile;

/// A pose in the plane, or a velocity: x ahead and y to the left in the axes of the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Along x \[m, m/s\].
    pub x: f64,
    /// Along y \[m, m/s\].
    pub y: f64,
    /// About z \[rad, rad/s\].
    pub yaw: f64,
}

/// A place to come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Position in the world \[m\].
    pub position: [f64; 2],
    /// Angle about z \[rad\]; without it that at which the base arrives.
    pub yaw: Option<f64>,
    /// Time to stay there \[s\].
    pub dwell: f64,
}

/// Limits, gains and tolerances of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteSettings {
    /// Limits of the way ahead \[m\].
    pub drive: MotionLimits,
    /// Limits of the angle \[rad\].
    pub turn: MotionLimits,
    /// True for a base that can go sideways.
    pub sideways: bool,
    /// Correction of the position \[1/s\].
    pub gain: f64,
    /// Correction of the angle \[1/s\].
    pub turn_gain: f64,
    /// Length within which a base that cannot go sideways comes back to its line \[m\].
    pub length: f64,
    /// Distance \[m\] and angle \[rad\] within which a stage is over, once its profile is.
    pub arrival: [f64; 2],
    /// Time for which a stage waits for that after the end of its profile \[s\]. Then the route goes on all the same.
    pub grace: f64,
    /// True for a route that begins again after its last stop.
    pub forever: bool,
}

impl Default for RouteSettings {
    /// A base of 0.2 m/s and 1 rad/s that cannot go sideways.
    fn default() -> Self {
        Self {
            drive: MotionLimits { velocity: 0.2, acceleration: 0.5, jerk: 5.0 },
            turn: MotionLimits { velocity: 1.0, acceleration: 2.0, jerk: 20.0 },
            sideways: false,
            gain: 2.0,
            turn_gain: 4.0,
            length: 0.1,
            arrival: [2e-3, 2e-3],
            grace: 2.0,
            forever: false,
        }
    }
}

/// The answer of a route at each step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteStep {
    /// Velocity in the axes of the base.
    pub command: Place,
    /// The stop that the base is about to leave, or at the last of which it stays: where it should be now.
    pub stopped: Option<Place>,
    /// Distance of the base from the straight line that it drives on \[m\].
    pub beside: Option<f64>,
}

/// The difference of two angles, from -pi to pi.
pub fn turn_between(from: f64, to: f64) -> f64 {
    let turn = (to - from).rem_euclid(std::f64::consts::TAU);
    if turn > std::f64::consts::PI { turn - std::f64::consts::TAU } else { turn }
}
