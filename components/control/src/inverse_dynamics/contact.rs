//! Contacts of the robot with the world.

use motorium_robots::{Foot, FrameId, Kinematics, Model, Reference, UnknownFrame};
use nalgebra::{Matrix3, Matrix6xX, Vector3, Vector6};

use super::WrenchCone;

/// Shape of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactShape {
    /// The origin of the frame, with any orientation.
    Point,
    /// A ball about the origin of the frame, which rolls on the world.
    Ball {
        /// Its radius \[m\].
        radius: f64,
    },
    /// A rectangle in the plane of x and y of the frame, centred at its origin; z points away from the
    /// ground.
    Sole {
        /// Lengths along x and y \[m\].
        sides: [f64; 2],
    },
}

/// A contact of the robot with the fixed world.
///
/// ```
/// use motorium_control::inverse_dynamics::{Contact, ContactShape};
/// use motorium_robots::load;
///
/// let robot = load("quadruped", std::path::Path::new("."))?;
/// let foot = &robot.profile.unwrap().feet["front_left"];
/// let contact = Contact::of_foot(&robot.model, "front_left", foot)?;
/// assert_eq!(contact.shape, ContactShape::Ball { radius: 0.0165 });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Its name, for messages.
    pub name: String,
    /// Frame of the robot.
    pub frame: FrameId,
    /// Point of contact.
    pub shape: ContactShape,
    /// Coefficient of friction. Default 0.6.
    pub friction: f64,
    /// Largest normal force at each of its points \[N\]. Default infinite.
    pub max_force: f64,
    /// Distance that the centre of pressure of a sole keeps from its edges \[m\]: forces act at the corners
    /// of a rectangle that is smaller by it on each side. At most half of the shorter side counts. Default 0:
    /// the sole is about to tip at its edge.
    pub margin: f64,
    /// Limits of the total wrench of a sole, in addition to its points. Default none; ignored for other
    /// shapes.
    pub wrench: Option<WrenchCone>,
    /// Surface normal for a point or a ball; a sole uses its frame's. Default up.
    pub normal: Vector3<f64>,
}

/// A foot of a profile that cannot be a contact.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// The robot does not have the frame.
    #[error(transparent)]
    Frame(#[from] UnknownFrame),
}

impl Contact {
    /// A contact of this frame and shape, with the defaults of its other fields.
    pub fn new(name: impl Into<String>, frame: FrameId, shape: ContactShape) -> Self {
        let (friction, max_force, margin, normal) = (0.6, f64::INFINITY, 0.0, Vector3::z());
        Self { name: name.into(), frame, shape, friction, max_force, margin, wrench: None, normal }
    }

    /// The contact of a foot of the robot's profile: a sole, a ball, or a point.
    ///
    /// # Errors
    /// [`ContactError`].
    pub fn of_foot(model: &Model, name: &str, foot: &Foot) -> Result<Self, ContactError> {
        let shape = match (foot.sole, foot.radius) {
            (Some(sides), _) => ContactShape::Sole { sides },
            (None, Some(radius)) => ContactShape::Ball { radius },
            (None, None) => ContactShape::Point,
        };
        let contact = Self::new(name, model.frame(&foot.frame)?, shape);
        Ok(Self { friction: foot.friction.unwrap_or(contact.friction), ..contact })
    }

    /// Number of points at which a force acts.
    pub fn points(&self) -> usize {
        match self.shape {
            ContactShape::Point | ContactShape::Ball { .. } => 1,
            ContactShape::Sole { .. } => 4,
        }
    }

    /// Number of constrained motions.
    pub fn rows(&self) -> usize {
        match self.shape {
            ContactShape::Point | ContactShape::Ball { .. } => 3,
            ContactShape::Sole { .. } => 6,
        }
    }

    /// Place of a point relative to the origin of the frame, in world axes \[m\].
    fn arm(&self, point: usize, axes: &Matrix3<f64>) -> Vector3<f64> {
        match self.shape {
            ContactShape::Point => Vector3::zeros(),
            ContactShape::Ball { radius } => self.normal * -radius,
            ContactShape::Sole { sides } => {
                let [x, y] = sides.map(|side| (side - 2.0 * self.margin).max(0.0));
                let (x, y) = ([0.5, 0.5, -0.5, -0.5][point] * x, [0.5, -0.5, -0.5, 0.5][point] * y);
                axes * Vector3::new(x, y, 0.0)
            }
        }
    }
}

/// A contact at one state of the robot.
#[derive(Clone, Debug)]
pub(super) struct ContactPlace {
    pub(super) contact: Contact,
    /// `false` without contact: no motion is constrained and there is no force.
    pub(super) active: bool,
    /// Index of its first force among all contacts, in points.
    pub(super) first_point: usize,
    /// Index of its first row among all contacts.
    pub(super) first_row: usize,
    /// Two tangents and the normal as columns, in the world.
    pub(super) axes: Matrix3<f64>,
    /// Points relative to the origin of the frame, in world axes \[m\].
    pub(super) arms: Vec<Vector3<f64>>,
    /// Jacobian of the frame, world axes, 6 x nv.
    pub(super) jacobian: Matrix6xX<f64>,
    /// Velocity of the constrained motion, and its drift `Jdot v`; the first [`Contact::rows`] entries are
    /// used.
    pub(super) velocity: Vector6<f64>,
    pub(super) drift: Vector6<f64>,
}

impl ContactPlace {
    pub(super) fn new(contact: Contact, model: &Model, first_point: usize, first_row: usize) -> Self {
        Self {
            arms: vec![Vector3::zeros(); contact.points()],
            contact,
            active: true,
            first_point,
            first_row,
            axes: Matrix3::identity(),
            jacobian: Matrix6xX::zeros(model.nv()),
            velocity: Vector6::zeros(),
            drift: Vector6::zeros(),
        }
    }

    /// Evaluates places, Jacobian, velocity and drift.
    ///
    /// The contact point of a ball is at a constant `c` from its centre, in world axes: where it rolls, the
    /// velocity `v + w x c` of the point of the ball that touches is zero, and stays zero if `dv/dt + dw/dt x
    /// c` is.
    pub(super) fn update(&mut self, model: &Model, kinematics: &Kinematics) {
        let frame = self.contact.frame;
        kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut self.jacobian);
        let rotation = kinematics.pose(model, frame).rotation.to_rotation_matrix().into_inner();
        self.axes = match self.contact.shape {
            ContactShape::Sole { .. } => rotation,
            ContactShape::Point | ContactShape::Ball { .. } => tangents(&self.contact.normal),
        };
        for (point, arm) in self.arms.iter_mut().enumerate() {
            *arm = self.contact.arm(point, &rotation);
        }
        self.velocity = kinematics.velocity(model, frame).vector();
        self.drift = kinematics.acceleration(model, frame).vector();
        if let ContactShape::Ball { .. } = self.contact.shape {
            let arm = self.arms[0];
            for column in self.jacobian.as_mut_slice().chunks_exact_mut(6) {
                lever(column, &arm);
            }
            lever(self.velocity.as_mut_slice(), &arm);
            lever(self.drift.as_mut_slice(), &arm);
        }
    }

    /// Position of a point relative to the origin of `jacobian`, in world axes \[m\]. For a ball the origin
    /// is the contact point.
    pub(super) fn lever_arm(&self, point: usize) -> Vector3<f64> {
        match self.contact.shape {
            ContactShape::Ball { .. } => Vector3::zeros(),
            ContactShape::Point | ContactShape::Sole { .. } => self.arms[point],
        }
    }
}

/// Moves the point of a spatial motion by `arm`: `linear + angular x arm`.
fn lever(motion: &mut [f64], arm: &Vector3<f64>) {
    let angular = Vector3::new(motion[3], motion[4], motion[5]);
    let across = angular.cross(arm);
    for axis in 0..3 {
        motion[axis] += across[axis];
    }
}

/// Two tangents and the normal as columns: right-handed, the first tangent closest to the world's x.
fn tangents(normal: &Vector3<f64>) -> Matrix3<f64> {
    let near = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = (near - normal * normal.dot(&near)).normalize();
    Matrix3::from_columns(&[first, normal.cross(&first), *normal])
}
