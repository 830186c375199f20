//! Motion of a mobile base through planar poses, with feedback of its pose.
//!
//! A base that cannot move sideways turns on the spot to face its goal, drives to the goal and turns to the
//! goal's angle. An omnidirectional base drives straight to the goal while it turns. Each of these stages
//! follows its own [`Profile`], planned from the pose at the start of the stage. On a straight line the
//! control law is by Kanayama et al. (*A stable tracking control method for an autonomous mobile robot*, ICRA
//! 1990), with the errors `e` of the pose in the axes of the base and the speed `v` of the profile:
//!
//! ```text
//! ahead = v cos e_yaw + gain e_x
//! turn  = v e_y / l^2 + max(turn_gain, 2 |v| / l) sin e_yaw
//! ```
//!
//! A base off its line returns to the line within a few lengths `l`, without overshoot.
//!
//! ```
//! use motorium_primitives::route::{Place, Route, RouteSettings, Stop};
//!
//! let stop = Stop { position: [1.0, 0.0], yaw: Some(1.57), dwell: 0.0 };
//! let mut route = Route::new(vec![stop], RouteSettings::default());
//! let (mut place, dt) = (Place::default(), 0.001);
//! while !route.is_finished() {
//!     let speed = route.step(place, dt).command;
//!     // a base that follows its commands exactly
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

/// A planar pose or velocity. For a velocity in base axes, x points ahead and y to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Position or velocity along x \[m, m/s\].
    pub x: f64,
    /// Position or velocity along y \[m, m/s\].
    pub y: f64,
    /// Angle or angular velocity about z \[rad, rad/s\].
    pub yaw: f64,
}

/// A pose to be reached by a wheeled base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Position in the world \[m\].
    pub position: [f64; 2],
    /// Angle about z \[rad\]. With `None`, the base keeps its angle of arrival.
    pub yaw: Option<f64>,
    /// Dwell time \[s\].
    pub dwell: f64,
}

/// Limits, gains and tolerances of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteSettings {
    /// Limits of the driving motion \[m\].
    pub drive: MotionLimits,
    /// Limits of rotation \[rad\].
    pub turn: MotionLimits,
    /// `true` for a base that can move sideways.
    pub sideways: bool,
    /// Gain of the position correction \[1/s\].
    pub gain: f64,
    /// Gain of the angle correction \[1/s\].
    pub turn_gain: f64,
    /// Distance within which a base that cannot move sideways returns to its line \[m\].
    pub length: f64,
    /// Tolerances of position \[m\] and angle \[rad\]. A stage of the route ends once its motion profile has
    /// ended and the base is within both tolerances.
    pub arrival: [f64; 2],
    /// Maximum time that a stage waits for the tolerances after its profile has ended \[s\]. The route then
    /// continues in any case.
    pub grace: f64,
    /// `true` if the route repeats after its last stop.
    pub forever: bool,
}

impl Default for RouteSettings {
    /// A base with 0.2 m/s and 1 rad/s that cannot move sideways.
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

/// Result of one step of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteStep {
    /// Commanded velocity in the axes of the base.
    pub command: Place,
    /// Desired pose of the stop whose dwell time ended in this step; `None` in all other steps.
    pub stopped: Option<Place>,
    /// Distance of the base from the straight line to the stop \[m\]; `None` unless the base is driving.
    pub beside: Option<f64>,
}

/// Returns the turn from the angle `from` to the angle `to` in the shorter direction, -pi to pi \[rad\].
pub fn turn_between(from: f64, to: f64) -> f64 {
    let turn = (to - from).rem_euclid(std::f64::consts::TAU);
    if turn > std::f64::consts::PI { turn - std::f64::consts::TAU } else { turn }
}
