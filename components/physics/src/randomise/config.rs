//! The `randomise` table: ranges of physical properties.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use super::RangeError;

/// Minimum and maximum of a quantity, which is sampled uniformly in between.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Interval(pub [f64; 2]);

/// Ranges of physical properties. Values are sampled from the seed at the start of every episode.
///
/// Masses, damping, friction and efforts are scaled relative to the nominal values of robot and world.
/// Restitution is absolute, and starts are displacements. Each body, joint and object is sampled separately.
///
/// ```toml
/// mass     = [0.9, 1.1]
/// friction = [0.6, 1.2]
/// start    = [-0.05, 0.05]
/// ground   = { friction = [0.5, 1.0], restitution = [0.0, 0.2] }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RandomiseConfig {
    /// Scales the gravitational acceleration, from 0 to 100.
    pub gravity: Option<Interval>,
    /// Scales the mass and inertia of each body of the robot, from 0.001 to 100.
    pub mass: Option<Interval>,
    /// Scales the friction of the robot's surface, with one value for the whole robot, from 0 to 100.
    pub friction: Option<Interval>,
    /// Restitution of the robot's surface, from 0 to 1.
    pub restitution: Option<Interval>,
    /// Range of a factor on the viscous damping of each joint. Both bounds must be between 0 and 100.
    pub damping: Option<Interval>,
    /// Range of a factor on the Coulomb friction of each joint. Both bounds must be between 0 and 100.
    pub joint_friction: Option<Interval>,
    /// Range of a factor on the effort limit of each joint. Both bounds must be between 0 and 100.
    pub effort_limit: Option<Interval>,
    /// Displacement of each joint's initial position, rad or m. The result stays within the joint's limits.
    pub start: Option<Interval>,
    /// Properties of the actuators.
    pub actuator: ActuatorIntervals,
    /// Interval at which all properties except starts, objects and terrain are sampled again within an
    /// episode. Default: once per episode.
    pub every: Option<TimeSpan>,
    /// Displacement of a floating base's initial pose.
    pub base: PlaceIntervals,
    /// Surface of the ground or the terrain.
    pub ground: SurfaceIntervals,
    /// Shape of the terrain.
    pub terrain: TerrainIntervals,
    /// Properties of objects by object name.
    pub objects: BTreeMap<String, ObjectIntervals>,
    /// Ranges of single robots by robot name, which replace the ranges above.
    pub robots: BTreeMap<String, RobotIntervals>,
}

/// Ranges of the properties of one of several robots, which replace the common ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotIntervals {
    /// Scales the mass and inertia of each body.
    pub mass: Option<Interval>,
    /// Scales the friction of the robot's surface.
    pub friction: Option<Interval>,
    /// Restitution of the robot's surface.
    pub restitution: Option<Interval>,
    /// Scales the viscous damping of each joint.
    pub damping: Option<Interval>,
    /// Scales the Coulomb friction of each joint.
    pub joint_friction: Option<Interval>,
    /// Scales the effort limit of each joint.
    pub effort_limit: Option<Interval>,
    /// Displacement of each joint's initial position, rad or m.
    pub start: Option<Interval>,
    /// Properties of the robot's actuators.
    pub actuator: ActuatorIntervals,
}

/// Ranges of actuator properties, which scale the settings in the graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorIntervals {
    /// Scales the commanded stiffness and damping of a drive, from 0 to 100.
    pub gain: Option<Interval>,
    /// Scales all efforts of a drive and its effort limit, from 0 to 100.
    pub strength: Option<Interval>,
    /// Scales the `delay` of an actuator, from 0.001 to 100.
    pub delay: Option<Interval>,
    /// Scales the `lag` of an actuator, from 0 to 100.
    pub lag: Option<Interval>,
    /// Scales the `rate_limit` of an actuator, from 0.001 to 100.
    pub rate_limit: Option<Interval>,
    /// Scales the `drivetrain.backlash` of an actuator, from 0 to 100.
    pub backlash: Option<Interval>,
    /// Scales the `drivetrain.stiffness` of an actuator, from 0.001 to 100.
    pub stiffness: Option<Interval>,
}

impl ActuatorIntervals {
    /// Returns these intervals, with missing ones replaced by the intervals of `other`.
    fn or(self, other: Self) -> Self {
        Self {
            gain: self.gain.or(other.gain),
            strength: self.strength.or(other.strength),
            delay: self.delay.or(other.delay),
            lag: self.lag.or(other.lag),
            rate_limit: self.rate_limit.or(other.rate_limit),
            backlash: self.backlash.or(other.backlash),
            stiffness: self.stiffness.or(other.stiffness),
        }
    }

    /// Returns the interval with this name.
    fn named(&self, key: &str) -> Option<Interval> {
        match key {
            "gain" => self.gain,
            "strength" => self.strength,
            "delay" => self.delay,
            "lag" => self.lag,
            "rate_limit" => self.rate_limit,
            "backlash" => self.backlash,
            _ => self.stiffness,
        }
    }
}

/// Ranges of a displacement in the world, in addition to the initial pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlaceIntervals {
    /// Displacement along x of the world, m.
    pub x: Option<Interval>,
    /// Displacement along y of the world, m.
    pub y: Option<Interval>,
    /// Displacement along z of the world, m. For a base without a configured position: height of the base
    /// above the ground, m.
    pub z: Option<Interval>,
    /// Rotation about z of the world, rad.
    pub yaw: Option<Interval>,
}

/// Ranges of the properties of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceIntervals {
    /// Scales the friction, from 0 to 100.
    pub friction: Option<Interval>,
    /// Restitution, from 0 to 1.
    pub restitution: Option<Interval>,
}

/// Ranges of the shape of a terrain. Its size and number of layers do not change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TerrainIntervals {
    /// Seed of the random features of the terrain: whole numbers from 0 to 1e15, both ends included.
    pub seed: Option<Interval>,
    /// Scales all heights, from 0 to 100.
    pub scale: Option<Interval>,
}

/// Ranges of the properties of an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectIntervals {
    /// Scales the mass and inertia, from 0.001 to 100.
    pub mass: Option<Interval>,
    /// Scales the friction, from 0 to 100.
    pub friction: Option<Interval>,
    /// Restitution, from 0 to 1.
    pub restitution: Option<Interval>,
    /// Displacement of the initial position along x of the world, m.
    pub x: Option<Interval>,
    /// Displacement of the initial position along y of the world, m.
    pub y: Option<Interval>,
    /// Displacement of the initial position along z of the world, m.
    pub z: Option<Interval>,
    /// Rotation of the initial pose about z of the world, rad.
    pub yaw: Option<Interval>,
}

/// The allowed values of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Allowed {
    /// A factor above 0.
    Positive,
    /// A factor from 0.
    Factor,
    /// A value from 0 to 1.
    Share,
    /// A displacement.
    Displacement,
    /// A whole number.
    Seed,
}

impl Allowed {
    fn range(self) -> (f64, f64, &'static str) {
        match self {
            Self::Positive => (1e-3, 100.0, "factors from 0.001 to 100"),
            Self::Factor => (0.0, 100.0, "factors from 0 to 100"),
            Self::Share => (0.0, 1.0, "numbers from 0 to 1"),
            Self::Seed => (0.0, 1e15, "whole numbers from 0 to 1e15"),
            Self::Displacement => (-1000.0, 1000.0, "numbers from -1000 to 1000"),
        }
    }
}

impl Interval {
    /// Checks the interval against the allowed values. `key` is dotted, without `randomise`.
    pub(super) fn check(self, key: &str, allowed: Allowed) -> Result<(), RangeError> {
        let Self([low, high]) = self;
        let (least, most, expected) = allowed.range();
        // Written so that NaN is rejected.
        if !((least..=most).contains(&low) && (least..=most).contains(&high)) {
            return Err(RangeError::new(key, format!("[{low}, {high}], expected {expected}")));
        }
        if allowed == Allowed::Seed && (low.fract() != 0.0 || high.fract() != 0.0) {
            return Err(RangeError::new(key, format!("[{low}, {high}], expected {expected}")));
        }
        if low > high {
            return Err(RangeError::new(key, format!("[{low}, {high}], expected the lower value first"))
                .advise(format!("write [{high}, {low}]")));
        }
        Ok(())
    }

    /// Returns the whole number at a fraction from 0 to 1 of the interval; each number is equally likely.
    pub(super) fn whole_at(self, share: f64) -> f64 {
        let Self([low, high]) = self;
        (low + (high + 1.0 - low) * share).floor().clamp(low, high)
    }

    /// Returns the value at a fraction from 0 to 1 of the interval.
    pub(super) fn interpolate(self, share: f64) -> f64 {
        let Self([low, high]) = self;
        (low + (high - low) * share).clamp(low, high)
    }
}

impl RandomiseConfig {
    /// Returns `true` if nothing is sampled.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the ranges of a robot, with the key of their table.
    pub(super) fn of_robot(&self, name: Option<&str>) -> RobotIntervals {
        let own = name.and_then(|name| self.robots.get(name)).copied().unwrap_or_default();
        RobotIntervals {
            mass: own.mass.or(self.mass),
            friction: own.friction.or(self.friction),
            restitution: own.restitution.or(self.restitution),
            damping: own.damping.or(self.damping),
            joint_friction: own.joint_friction.or(self.joint_friction),
            effort_limit: own.effort_limit.or(self.effort_limit),
            start: own.start.or(self.start),
            actuator: own.actuator.or(self.actuator),
        }
    }

    /// Returns the key of a robot's range.
    pub(super) fn key_of_robot(&self, name: Option<&str>, key: &str) -> String {
        let own = name.and_then(|name| Some((name, self.robots.get(name)?)));
        let Some((name, own)) = own else { return key.to_owned() };
        let there = match key {
            "mass" => own.mass,
            "friction" => own.friction,
            "restitution" => own.restitution,
            "damping" => own.damping,
            "joint_friction" => own.joint_friction,
            "effort_limit" => own.effort_limit,
            "start" => own.start,
            key => own.actuator.named(key.trim_start_matches("actuator.")),
        };
        if there.is_some() { format!("robots.{name}.{key}") } else { key.to_owned() }
    }
}
