//! The world around the robot, as a file describes it.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::nearest::suggestion;
use crate::{Appearance, ConvexShape, Geometry, HeightField, Terrain, TerrainError};

/// Gravity, a ground, simple objects and their looks. Lengths in metres, angles in radians, masses in kilograms; poses in the
/// world, which is the base frame of the robot, z up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct World {
    /// Acceleration of free fall (m/s2).
    pub gravity: [f64; 3],
    /// A horizontal plane. Default: no ground.
    pub ground: Option<Ground>,
    /// An uneven ground, instead of the plane.
    pub terrain: Option<Terrain>,
    /// Objects, fixed or free to move. Names must differ.
    pub objects: Vec<Object>,
    /// The looks of it all, for cameras.
    pub appearance: Appearance,
}

impl Default for World {
    /// Earth's gravity, no ground, no objects.
    fn default() -> Self {
        Self {
            gravity: [0.0, 0.0, -9.81],
            ground: None,
            terrain: None,
            objects: Vec::new(),
            appearance: Appearance::default(),
        }
    }
}

/// A horizontal plane, solid below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Height of the plane (m).
    pub height: f64,
    /// Coefficient of friction. That of a contact is the mean of both surfaces'.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Share of the approach speed kept after an impact, from 0 to 1. That of a contact is the mean of both surfaces'.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
}

impl Default for Ground {
    fn default() -> Self {
        Self { height: 0.0, friction: 0.8, restitution: 0.0 }
    }
}

/// An object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Name, unique in the world; neither `ground` nor `terrain` nor that of a robot link.
    pub name: String,
    /// Its shape, centred on its origin, of uniform density.
    pub shape: ObjectShape,
    /// Mass (kg). Without it the object is fixed.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass: Option<f64>,
    /// Position of its centre (m).
    pub position: [f64; 3],
    /// Orientation: roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    #[serde(default)]
    pub rpy: [f64; 3],
    /// Coefficient of friction. That of a contact is the mean of both surfaces'.
    #[serde(default = "default_friction")]
    #[schemars(range(min = 0.0))]
    pub friction: f64,
    /// Share of the approach speed kept after an impact, from 0 to 1. That of a contact is the mean of both surfaces'.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub restitution: f64,
}

fn default_friction() -> f64 {
    0.8
}

/// Shapes of objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ObjectShape {
    /// A box.
    Box {
        /// Full sides along x, y and z (m).
        size: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Full length (m).
        length: f64,
    },
}

impl Object {
    /// Pose of the object at the start.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy;
        Isometry3::from_parts(
            Translation3::from(self.position),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }

    /// True when it has a mass, and so moves.
    pub fn is_dynamic(&self) -> bool {
        self.mass.is_some()
    }
}

impl ObjectShape {
    /// Principal moments of inertia of `mass` \[kg\] spread evenly over the shape, about its centre \[kg m2\].
    pub fn principal_inertia(&self, mass: f64) -> Vector3<f64> {
        match *self {
            Self::Box { size: [x, y, z] } => {
                Vector3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (mass / 12.0)
            }
            Self::Sphere { radius } => Vector3::from_element(0.4 * mass * radius * radius),
            Self::Cylinder { radius, length } => {
                let across = mass * (3.0 * radius * radius + length * length) / 12.0;
                Vector3::new(across, across, 0.5 * mass * radius * radius)
            }
        }
    }

    /// The shape as that of a collision model.
    pub fn geometry(&self) -> Geometry {
        match *self {
            Self::Box { size } => Geometry::Box { size: Vector3::from(size) },
            Self::Sphere { radius } => Geometry::Sphere { radius },
            Self::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
        }
    }

    /// The shape as a convex one.
    pub fn convex_shape(&self) -> ConvexShape {
        match *self {
            Self::Box { size } => ConvexShape::Box { half: Vector3::from(size) * 0.5 },
            Self::Sphere { radius } => ConvexShape::Sphere { radius },
            Self::Cylinder { radius, length } => ConvexShape::Cylinder { radius, half_length: 0.5 * length },
        }
    }

    fn dimensions(&self) -> [(&'static str, f64); 3] {
        match *self {
            Self::Box { size: [x, y, z] } => [("size", x), ("size", y), ("size", z)],
            Self::Sphere { radius } => [("radius", radius); 3],
            Self::Cylinder { radius, length } => [("radius", radius), ("length", length), ("length", length)],
        }
    }
}

/// A mistake in a world description.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A number outside its range.
    #[error("{owner}: `{field}` is {value}, expected {expected}")]
    Value {
        /// The object, `ground` or `world`.
        owner: String,
        /// The field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// The range expected.
        expected: &'static str,
    },
    /// A terrain that cannot be made.
    #[error("terrain: {0}")]
    Terrain(#[from] TerrainError),
    /// A plane and a terrain.
    #[error(
        "both `ground` and `terrain` are given, but there is one ground: a terrain goes on as at its edge; leave `ground` out"
    )]
    TwoGrounds,
    /// A colour for what is not there.
    #[error("`appearance.colours` names \"{name}\", which the world does not have{}", suggestion(.nearest.as_deref()))]
    NothingToColour {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// Two objects with one name, or a name that is already taken.
    #[error("the object name \"{name}\" is taken by {by}; give the object another name")]
    NameTaken {
        /// The name.
        name: String,
        /// The owner of the name.
        by: &'static str,
    },
}

impl World {
    /// Lets the relative paths of its files begin at a folder.
    ///
    /// ```
    /// # use motorium_robots::World;
    /// let text = "terrain = { size = [4.0, 4.0], layers = [{ image = { file = \"hills.png\", height = [0.0, 0.2] } }] }";
    /// let mut world: World = toml::from_str(text).unwrap();
    /// world.locate("/nowhere".as_ref());
    /// assert!(world.height_field().unwrap_err().to_string().contains("/nowhere/hills.png"));
    /// ```
    pub fn locate(&mut self, folder: &Path) {
        if let Some(terrain) = &mut self.terrain {
            terrain.locate(folder);
        }
    }

    /// The height field of its terrain, where it has one.
    ///
    /// # Errors
    ///
    /// [`TerrainError`].
    pub fn height_field(&self) -> Result<Option<HeightField>, TerrainError> {
        self.terrain.as_ref().map(Terrain::height_field).transpose()
    }

    /// Checks every value and name; `links` are the names the robot already uses.
    ///
    /// # Errors
    ///
    /// The first mistake found.
    pub fn check<'a>(&self, links: impl Iterator<Item = &'a str> + Clone) -> Result<(), WorldError> {
        for value in self.gravity {
            finite("world", "gravity", value)?;
        }
        if let Some(ground) = &self.ground {
            finite("ground", "height", ground.height)?;
            surface("ground", ground.friction, ground.restitution)?;
        }
        if self.ground.is_some() && self.terrain.is_some() {
            return Err(WorldError::TwoGrounds);
        }
        self.height_field()?;
        for (index, object) in self.objects.iter().enumerate() {
            let name = object.name.as_str();
            let taken = |by| Err(WorldError::NameTaken { name: name.to_owned(), by });
            if name == "ground" {
                return taken("the ground plane");
            }
            if name == "terrain" {
                return taken("the terrain");
            }
            if links.clone().any(|link| link == name) {
                return taken("a link of the robot");
            }
            if self.objects[..index].iter().any(|other| other.name == name) {
                return taken("an object before it");
            }
            for value in object.position {
                finite(name, "position", value)?;
            }
            for value in object.rpy {
                finite(name, "rpy", value)?;
            }
            for (field, value) in object.shape.dimensions() {
                positive(name, field, value)?;
            }
            if let Some(mass) = object.mass {
                positive(name, "mass", mass)?;
            }
            surface(name, object.friction, object.restitution)?;
        }
        self.appearance.check(self)
    }
}

pub(crate) fn check(
    owner: &str,
    field: &'static str,
    value: f64,
    good: bool,
    expected: &'static str,
) -> Result<(), WorldError> {
    if good { Ok(()) } else { Err(WorldError::Value { owner: owner.to_owned(), field, value, expected }) }
}

fn finite(owner: &str, field: &'static str, value: f64) -> Result<(), WorldError> {
    check(owner, field, value, value.is_finite(), "a finite number")
}

fn positive(owner: &str, field: &'static str, value: f64) -> Result<(), WorldError> {
    check(owner, field, value, value.is_finite() && value > 0.0, "a positive number")
}

fn surface(owner: &str, friction: f64, restitution: f64) -> Result<(), WorldError> {
    check(owner, "friction", friction, friction.is_finite() && friction >= 0.0, "a number from 0 up")?;
    check(owner, "restitution", restitution, (0.0..=1.0).contains(&restitution), "a number from 0 to 1")
}
