//! The `randomise` table: ranges of physical properties.

use std::collections::BTreeMap;

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

use super::RangeError;

/// Range of a quantity: the minimum and the maximum between which values are sampled uniformly.
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
    /// Range of a factor on the gravitational acceleration. Both bounds must be between 0 and 100.
    pub gravity: Option<Interval>,
    /// Range of a factor on the mass and inertia of each body of the robot. Both bounds must be between 0.001
    /// and 100.
    pub mass: Option<Interval>,
    /// Range of a factor on the friction of the robot's surface. One factor is sampled for the whole robot.
    /// Both bounds must be between 0 and 100.
    pub friction: Option<Interval>,
    /// Range of the restitution of the robot's surface. Both bounds must be between 0 and 1.
    pub restitution: Option<Interval>,
    /// Range of a factor on the viscous damping of each joint. Both bounds must be between 0 and 100.
    pub damping: Option<Interval>,
    /// Range of a factor on the Coulomb friction of each joint. Both bounds must be between 0 and 100.
    pub joint_friction: Option<Interval>,
    /// Range of a factor on the effort limit of each joint. Both bounds must be between 0 and 100.
    pub effort_limit: Option<Interval>,
    /// Range of the displacement of each joint's initial position, rad or m. The displaced position stays
    /// within the joint's limits.
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
    /// Ranges of single robots by robot name. The ranges of a robot replace the common ranges of this table.
    pub robots: BTreeMap<String, RobotIntervals>,
}

/// Ranges of the properties of one of several robots, which replace the common ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RobotIntervals {
    /// Range of a factor on the mass and inertia of each body.
    pub mass: Option<Interval>,
    /// Range of a factor on the friction of the robot's surface.
    pub friction: Option<Interval>,
    /// Range of the restitution of the robot's surface.
    pub restitution: Option<Interval>,
    /// Range of a factor on the viscous damping of each joint.
    pub damping: Option<Interval>,
    /// Range of a factor on the Coulomb friction of each joint.
    pub joint_friction: Option<Interval>,
    /// Range of a factor on the effort limit of each joint.
    pub effort_limit: Option<Interval>,
    /// Range of the displacement of each joint's initial position, rad or m.
    pub start: Option<Interval>,
    /// Properties of the robot's actuators.
    pub actuator: ActuatorIntervals,
}

/// Ranges of factors on the actuator settings in the graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorIntervals {
    /// Range of a factor on the commanded stiffness and damping of a drive. Both bounds must be between 0 and
    /// 100.
    pub gain: Option<Interval>,
    /// Range of a factor on all efforts of a drive and its effort limit. Both bounds must be between 0 and
    /// 100.
    pub strength: Option<Interval>,
    /// Range of a factor on the `delay` of an actuator. Both bounds must be between 0.001 and 100.
    pub delay: Option<Interval>,
    /// Range of a factor on the `lag` of an actuator. Both bounds must be between 0 and 100.
    pub lag: Option<Interval>,
    /// Range of a factor on the `rate_limit` of an actuator. Both bounds must be between 0.001 and 100.
    pub rate_limit: Option<Interval>,
    /// Range of a factor on the `drivetrain.backlash` of an actuator. Both bounds must be between 0 and 100.
    pub backlash: Option<Interval>,
    /// Range of a factor on the `drivetrain.stiffness` of an actuator. Both bounds must be between 0.001 and
    /// 100.
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

/// Ranges of displacements in the world, which are added to the initial pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlaceIntervals {
    /// Range of the displacement along the world's x axis, m.
    pub x: Option<Interval>,
    /// Range of the displacement along the world's y axis, m.
    pub y: Option<Interval>,
    /// Range of the displacement along the world's z axis, m. For a base without a configured position, range
    /// of the height of the base above the ground, m.
    pub z: Option<Interval>,
    /// Range of the rotation about the world's z axis, rad.
    pub yaw: Option<Interval>,
}

/// Ranges of the properties of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceIntervals {
    /// Range of a factor on the friction. Both bounds must be between 0 and 100.
    pub friction: Option<Interval>,
    /// Range of the restitution. Both bounds must be between 0 and 1.
    pub restitution: Option<Interval>,
}

/// Ranges of properties that shape a terrain. The size of the terrain and the number of its layers do not
/// change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TerrainIntervals {
    /// Range of the seed of the terrain's random features. Seeds are whole numbers from 0 to 1e15, and both
    /// bounds are included.
    pub seed: Option<Interval>,
    /// Range of a factor on all heights. Both bounds must be between 0 and 100.
    pub scale: Option<Interval>,
}

/// Ranges of the properties of an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectIntervals {
    /// Range of a factor on the mass and inertia. Both bounds must be between 0.001 and 100.
    pub mass: Option<Interval>,
    /// Range of a factor on the friction. Both bounds must be between 0 and 100.
    pub friction: Option<Interval>,
    /// Range of the restitution. Both bounds must be between 0 and 1.
    pub restitution: Option<Interval>,
    /// Range of the displacement of the initial position along the world's x axis, m.
    pub x: Option<Interval>,
    /// Range of the displacement of the initial position along the world's y axis, m.
    pub y: Option<Interval>,
    /// Range of the displacement of the initial position along the world's z axis, m.
    pub z: Option<Interval>,
    /// Range of the rotation of the initial pose about the world's z axis, rad.
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
