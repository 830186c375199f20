//! Keeps the centre of mass, or the capture point, above the support.

use motorium::declare::ConfigError;
use motorium_robots::{Model, convex_corners};
use nalgebra::{Matrix3xX, Vector2, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::{LimitRows, RowLimit};
use crate::RobotState;
use crate::checks::in_range;

/// Point that a [`SupportLimit`] keeps above the support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Supported {
    /// Centre of mass. The number is the fraction of the remaining distance to an edge that may be covered
    /// per second \[1/s\].
    CentreOfMass(f64),
    /// Capture point `c + c' / o`, with `o = sqrt(gravity / h)` and the height `h` of the centre of mass
    /// above the ground. While it is above the support, the robot can come to rest without a step.
    CapturePoint {
        /// Magnitude of the gravitational acceleration \[m/s2\].
        gravity: f64,
        /// Height of the ground \[m\].
        ground: f64,
    },
}

/// Keeps the centre of mass `c` of the robot, or its capture point, above the convex hull of points on the
/// ground, reduced by a margin. For each edge of the hull, with its outward unit normal `n` and its offset
/// `d = n' p`,
///
/// ```text
/// n' J_com v  <=  rate max(d - margin - n' c, 0)       x and y of the world; rate of the centre of mass, 1/s
/// ```
///
/// OpenSoT has the same constraint for the convex hull. Its constraint for the capture point,
/// `n' (c + c' / o) <= d - margin`, is equivalent to this constraint with the rate `o`. Rates are limited so
/// that one step does not cross an edge. A point outside the hull may stay or return.
///
/// ```
/// use motorium_control::limits::{SupportLimit, Supported};
/// use nalgebra::Vector2;
///
/// let robot = motorium_robots::load("humanoid", std::path::Path::new("."))?;
/// let mut limit = SupportLimit::new(&robot.model, 8, Supported::CentreOfMass(5.0)).margin(0.01);
/// let corners = [(0.1, 0.1), (-0.1, 0.1), (0.0, 0.0), (-0.1, -0.1), (0.1, -0.1)];
/// limit.set_support(&corners.map(|(x, y)| Vector2::new(x, y)));
/// assert_eq!(limit.edges().len(), 4, "the point in the middle is no corner");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SupportLimit {
    supported: Supported,
    margin: f64,
    most: usize,
    /// Points in order, and the corners of their hull, counter-clockwise.
    points: Vec<Vector2<f64>>,
    corners: Vec<Vector2<f64>>,
    /// Outward normals and offsets of the edges.
    edges: Vec<(Vector2<f64>, f64)>,
    jacobian: Matrix3xX<f64>,
}

impl SupportLimit {
    /// Creates a limit for `model` with up to `most` support points. The limit has no effect until support
    /// points are set.
    pub fn new(model: &Model, most: usize, supported: Supported) -> Self {
        Self {
            supported,
            margin: 0.0,
            most,
            points: Vec::with_capacity(most),
            corners: Vec::with_capacity(2 * most + 2),
            edges: Vec::with_capacity(most),
            jacobian: Matrix3xX::zeros(model.nv()),
        }
    }

    /// Sets the distance kept from the edges \[m\].
    #[must_use]
    pub fn margin(mut self, margin: f64) -> Self {
        self.margin = margin;
        self
    }

    /// Sets the points of the support \[x and y of the world, m\] in any order. The limit is disabled if
    /// there are fewer than three points or all points are collinear. Does not allocate.
    ///
    /// # Panics
    /// If there are more points than the capacity.
    pub fn set_support(&mut self, points: &[Vector2<f64>]) {
        assert!(points.len() <= self.most, "{} support points, expected at most {}", points.len(), self.most);
        self.points.clear();
        self.points.extend_from_slice(points);
        let corners = &mut self.corners;
        convex_corners(&mut self.points, |point| *point, corners);
        self.edges.clear();
        if corners.len() < 3 {
            return;
        }
        for (corner, next) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let along = (next - corner).normalize();
            let outward = Vector2::new(along.y, -along.x);
            self.edges.push((outward, outward.dot(corner)));
        }
    }

    /// Returns the edges, each as its outward normal and its offset along this normal \[m\].
    pub fn edges(&self) -> &[(Vector2<f64>, f64)] {
        &self.edges
    }
}

impl RowLimit for SupportLimit {
    fn rows(&self) -> usize {
        self.most
    }

    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>) {
        let centre = state.kinematics.centre_of_mass(state.model).position;
        let rate = match self.supported {
            Supported::CentreOfMass(rate) => rate,
            Supported::CapturePoint { gravity, ground } => {
                (gravity / (centre.z - ground).max(f64::MIN_POSITIVE)).sqrt()
            }
        };
        let rate = rate.min(dt.recip());
        state.kinematics.com_jacobian(state.model, &mut self.jacobian);
        for (normal, place) in &self.edges {
            let left = (place - self.margin - normal.dot(&centre.xy())).max(0.0);
            let row = self.jacobian.column_iter().map(|column| normal.x * column[0] + normal.y * column[1]);
            rows.push(row, f64::NEG_INFINITY, rate * left);
        }
    }
}

with_defaults! {
    /// Limit that keeps a point of the robot above the convex hull of its support points, enforced at every
    /// level.
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct SupportConfig;

    /// Point to keep above the support. Default "centre_of_mass".
    pub of: SupportedPoint = SupportedPoint::CentreOfMass;
    /// Distance kept from the edges of the hull, m, at least 0. Default 0.01.
    pub margin: f64 = 0.01;
    /// For the centre of mass: fraction of the remaining distance to an edge that may be covered per second,
    /// 1/s, at least 1e-3. Default 5.
    pub rate: f64 = 5.0;
    /// For the capture point: height of the ground, m. Default 0.
    pub ground: f64 = 0.0;
    /// Points of the support, x and y of the world, m. Default: the points of the active contacts of
    /// `inverse_dynamics`.
    pub points: Option<Vec<[f64; 2]>> = None;
}

/// Point to keep above the support.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SupportedPoint {
    /// The centre of mass.
    CentreOfMass,
    /// The capture point. While it is above the support, the robot can come to rest without a step.
    CapturePoint,
}

/// A limit whose support polygon may follow the contacts.
pub(crate) struct HeldSupport {
    pub(crate) limit: SupportLimit,
    /// `true` if the contacts form the support.
    pub(crate) follows: bool,
    points: Vec<Vector2<f64>>,
}

impl SupportConfig {
    /// Builds and checks the limit, for contacts with `contact_points` points in total.
    pub(crate) fn build(
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
            let message = format!("{} points that span no area", points.len());
            return Err(ConfigError::key(key("points"), message).advise("give at least three corners"));
        }
        if follows && most < 3 {
            let message = format!("the contacts have {most} points, which span no area");
            return Err(ConfigError::key(key("points"), message)
                .advise("give at least three `points`, or add contacts to `inverse_dynamics`"));
        }
        Ok(HeldSupport { limit, follows, points: Vec::with_capacity(most) })
    }
}

impl HeldSupport {
    /// Sets the support to the points passed by `visit`.
    pub(crate) fn follow(&mut self, each: impl FnOnce(&mut dyn FnMut(Vector3<f64>))) {
        self.points.clear();
        each(&mut |point| self.points.push(point.xy()));
        self.limit.set_support(&self.points);
    }
}
