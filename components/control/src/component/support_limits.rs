//! The table `limits.support` of `control.qp`: a point that stays above the support.

use motorium::prelude::*;
use motorium_robots::Model;
use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::checks::in_range;
use crate::limits::{SupportLimit, Supported};

/// A point of the robot that stays above the convex hull of its support, in all levels.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SupportConfig {
    /// The point. Default "centre_of_mass".
    pub of: SupportedPoint,
    /// Distance kept from the edges of the hull, m, at least 0. Default 0.01.
    pub margin: f64,
    /// For the centre of mass: fraction of the remaining distance to an edge that may be covered per second,
    /// 1/s, at least 1e-3. Default 5.
    pub rate: f64,
    /// For the capture point: height of the ground, m. Default 0.
    pub ground: f64,
    /// Points of the support, x and y of the world, m. Default: the points of the contacts of
    /// `inverse_dynamics` that are switched on.
    pub points: Option<Vec<[f64; 2]>>,
}

/// A point that stays above the support.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SupportedPoint {
    /// The centre of mass.
    CentreOfMass,
    /// The capture point: the robot can always come to rest without a step.
    CapturePoint,
}

impl Default for SupportConfig {
    fn default() -> Self {
        let of = SupportedPoint::CentreOfMass;
        Self { of, margin: 0.01, rate: 5.0, ground: 0.0, points: None }
    }
}

/// A limit whose support polygon may follow the contacts.
pub(super) struct HeldSupport {
    pub(super) limit: SupportLimit,
    /// `true` if the contacts form the support.
    pub(super) follows: bool,
    points: Vec<Vector2<f64>>,
}

impl SupportConfig {
    /// Builds and checks the limit, for contacts with `contact_points` points in total.
    pub(super) fn build(
        &self,
        model: &Model,
        gravity: Vector3<f64>,
        contact_points: usize,
    ) -> Result<HeldSupport, ConfigError> {
        let key = |name: &str| format!("limits.support.{name}");
        let margin = in_range(&key("margin"), self.margin, 0.0..=1e3)?;
        let rate = in_range(&key("rate"), self.rate, 1e-3..=1e6)?;
        let ground = in_range(&key("ground"), self.ground, -1e3..=1e3)?;
        let points: Vec<_> = self.points.iter().flatten().copied().map(Vector2::from).collect();
        for point in points.iter().flat_map(Vector2::iter) {
            in_range(&key("points"), *point, -1e6..=1e6)?;
        }
        let follows = self.points.is_none();
        let most = if follows { contact_points } else { points.len() };
        let supported = match self.of {
            SupportedPoint::CentreOfMass => Supported::CentreOfMass(rate),
            SupportedPoint::CapturePoint => Supported::CapturePoint { gravity: gravity.norm(), ground },
        };
        let mut limit = SupportLimit::new(model, most, supported).margin(margin);
        limit.set_support(&points);
        if !follows && limit.edges().is_empty() {
            let message = format!("{} points without an area between them", points.len());
            return Err(ConfigError::key(key("points"), message).advise("give at least three corners"));
        }
        if follows && most < 3 {
            let message = format!("the contacts have {most} points, which support no area");
            return Err(ConfigError::key(key("points"), message)
                .advise("give at least three `points`, or add contacts to `inverse_dynamics`"));
        }
        Ok(HeldSupport { limit, follows, points: Vec::with_capacity(most) })
    }
}

impl HeldSupport {
    /// Sets the support to the points passed by `visit`.
    pub(super) fn follow(&mut self, each: impl FnOnce(&mut dyn FnMut(Vector3<f64>))) {
        self.points.clear();
        each(&mut |point| self.points.push(point.xy()));
        self.limit.set_support(&self.points);
    }
}
