//! The centre of mass, or the capture point, stays above the support.

use motorium_robots::{Model, convex_corners};
use nalgebra::{Matrix3xX, Vector2};

use super::{LimitRows, RowLimit};
use crate::RobotState;

/// Point kept above the support by a [`SupportLimit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Supported {
    /// Centre of mass, which may cover this fraction of the remaining distance to an edge per second \[1/s\].
    CentreOfMass(f64),
    /// The capture point `c + c' / o`, with `o = sqrt(gravity / h)` and the height `h` of the centre of mass
    /// above the ground: the robot can always come to rest without a step.
    CapturePoint {
        /// Acceleration of free fall \[m/s2\].
        gravity: f64,
        /// Height of the ground \[m\].
        ground: f64,
    },
}

/// The centre of mass `c` of the robot, or its capture point, stays above the convex hull of some points of
/// the ground, less a margin. For each edge of the hull, with its outward normal `n` of length 1 and its
/// place `d = n' p`,
///
/// ```text
/// n' J_com v  <=  rate max(d - margin - n' c, 0)       x and y of the world; rate of the centre of mass, 1/s
/// ```
///
/// (OpenSoT's convex hull and capture point: `n' (c + c' / o) <= d - margin` is the same with the rate `o`).
/// No rate is larger than one step allows. Outside of the hull it may stay or come back.
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
    /// Outward normals and places of the edges.
    edges: Vec<(Vector2<f64>, f64)>,
    jacobian: Matrix3xX<f64>,
}

impl SupportLimit {
    /// Creates a limit for `model` with up to `most` support points. Without a support it does not bound.
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

    /// Keeps a distance from the edges \[m\].
    #[must_use]
    pub fn margin(mut self, margin: f64) -> Self {
        self.margin = margin;
        self
    }

    /// Sets the points of the support \[m, x and y of the world\] in any order. Fewer than three points, or
    /// collinear points, do not bound. Does not allocate.
    ///
    /// # Panics
    /// If there are more points than the capacity.
    pub fn set_support(&mut self, points: &[Vector2<f64>]) {
        assert!(points.len() <= self.most, "{} points of a support of {}", points.len(), self.most);
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

    /// Outward normals of the edges, and their offsets \[m\].
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
