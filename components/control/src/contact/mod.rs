//! Contacts of the robot with the world.

mod wrench_cone;

pub use wrench_cone::WrenchCone;

use motorium_robots::{Foot, FrameId, Model, UnknownFrame};
use nalgebra::{Matrix3, Vector3};

/// Shape of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactShape {
    /// The origin of the frame. The frame may have any orientation.
    Point,
    /// A ball about the origin of the frame, which rolls on the world.
    Ball {
        /// Radius of the ball \[m\].
        radius: f64,
    },
    /// A rectangle in the plane of x and y of the frame, centred at its origin; z points away from the
    /// ground.
    Sole {
        /// Side lengths along x and y \[m\].
        sides: [f64; 2],
    },
}

/// A contact of the robot with the static world.
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
    /// Name used in messages.
    pub name: String,
    /// Frame of the robot that makes contact.
    pub frame: FrameId,
    /// Shape of the contact.
    pub shape: ContactShape,
    /// Coefficient of friction. Default 0.6.
    pub friction: f64,
    /// Maximum normal force at each contact point \[N\]. Default infinite.
    pub max_force: f64,
    /// Minimum distance between the centre of pressure of a sole and its edges \[m\]. Forces act at the
    /// corners of a rectangle that is smaller by this distance on each side. Limited to half of the shorter
    /// side. Default 0: the centre of pressure may reach an edge, where the sole is about to tip.
    pub margin: f64,
    /// Limits of the total wrench of a sole, in addition to the limits at its points. Default `None`; ignored
    /// for other shapes.
    pub wrench: Option<WrenchCone>,
    /// Surface normal for a point or a ball; a sole uses the z axis of its frame. Default up.
    pub normal: Vector3<f64>,
}

/// Error returned when a foot cannot be a contact.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// The robot does not have the frame.
    #[error(transparent)]
    Frame(#[from] UnknownFrame),
}

impl Contact {
    /// Creates a contact of this frame and shape, with defaults for all other fields.
    pub fn new(name: impl Into<String>, frame: FrameId, shape: ContactShape) -> Self {
        let (friction, max_force, margin, normal) = (0.6, f64::INFINITY, 0.0, Vector3::z());
        Self { name: name.into(), frame, shape, friction, max_force, margin, wrench: None, normal }
    }

    /// Creates the contact of a foot from the robot's profile: a sole, a ball or a point.
    ///
    /// # Errors
    /// [`ContactError`] if the robot lacks the foot's frame.
    pub fn of_foot(model: &Model, name: &str, foot: &Foot) -> Result<Self, ContactError> {
        let shape = match (foot.sole, foot.radius) {
            (Some(sides), _) => ContactShape::Sole { sides },
            (None, Some(radius)) => ContactShape::Ball { radius },
            (None, None) => ContactShape::Point,
        };
        let contact = Self::new(name, model.frame(&foot.frame)?, shape);
        Ok(Self { friction: foot.friction.unwrap_or(contact.friction), ..contact })
    }

    /// Returns the number of points at which a force acts.
    pub fn points(&self) -> usize {
        match self.shape {
            ContactShape::Point | ContactShape::Ball { .. } => 1,
            ContactShape::Sole { .. } => 4,
        }
    }

    /// Returns the number of rows of the no-motion constraint, one per constrained direction of motion.
    pub fn rows(&self) -> usize {
        match self.shape {
            ContactShape::Point | ContactShape::Ball { .. } => 3,
            ContactShape::Sole { .. } => 6,
        }
    }

    /// Returns the position of a point relative to the origin of the frame, in world axes \[m\].
    pub(crate) fn arm(&self, point: usize, axes: &Matrix3<f64>) -> Vector3<f64> {
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
