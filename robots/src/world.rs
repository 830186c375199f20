//! The world around the robot, as a file describes it.

mod combine;
mod compound;
mod connection;
mod copies;
mod file;
mod gravity;
mod mesh;
mod numbers;
mod sdf;
mod surface;
mod table;
mod things;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::nearest::suggestion;
use crate::{Appearance, HeightField, MeshError, ModelWarning, Terrain, TerrainError};
pub use combine::FrictionCombine;
pub use compound::CompoundPart;
pub use connection::{Connection, ConnectionKind};
pub use copies::Copies;
pub use file::WorldFileError;
pub(crate) use file::unique;
pub use gravity::gravity_of_file;
pub use mesh::{MeshBody, MeshCollision, MeshShape};
pub(crate) use numbers::check;
use numbers::{finite, from_zero, positive};
pub use surface::{Grain, Softness};
pub use things::{Conveyor, Ground, Object, ObjectMass, ObjectShape};

/// Gravity, air, a ground, simple objects and their looks. Lengths in metres, angles in radians, masses in kilograms; poses in the
/// world, which is the base frame of the robot, z up.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct World {
    /// A file that holds a world: MJCF, URDF or SDF. Its gravity, ground and objects are those of the world, to which the keys
    /// beside it add; gravity that they state wins. A relative path begins at the folder of the graph. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"))]
    pub file: Option<PathBuf>,
    /// Acceleration of free fall (m/s2).
    pub gravity: [f64; 3],
    /// True where `gravity` was written: it wins against that of a `file` then, also where it is Earth's.
    #[serde(skip)]
    pub states_gravity: bool,
    /// Velocity of the air (m/s). It pushes objects that have a `drag`. Default: it stands still.
    pub wind: [f64; 3],
    /// Density of the air (kg/m3). Default 1.225, that at sea level and 15 degrees Celsius.
    #[schemars(range(min = 0.0))]
    pub air_density: f64,
    /// A horizontal plane. Default: no ground.
    pub ground: Option<Ground>,
    /// An uneven ground, instead of the plane.
    pub terrain: Option<Terrain>,
    /// Objects, fixed or free to move. Names must differ.
    #[serde(deserialize_with = "copies::expanded")]
    pub objects: Vec<Object>,
    /// Connections of objects with one another or with the `world`, as they stand at the start. Links are connected by
    /// `connections` of the physics component.
    pub connections: Vec<Connection>,
    /// The looks of it all, for cameras.
    pub appearance: Appearance,
}

/// Acceleration of free fall on Earth \[m/s2\].
const EARTH: [f64; 3] = [0.0, 0.0, -9.81];

impl Default for World {
    /// Earth's gravity, air that stands still, no ground, no objects.
    fn default() -> Self {
        Self {
            file: None,
            gravity: EARTH,
            states_gravity: false,
            wind: [0.0; 3],
            air_density: 1.225,
            ground: None,
            terrain: None,
            objects: Vec::new(),
            connections: Vec::new(),
            appearance: Appearance::default(),
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
    /// A mesh that cannot be used.
    #[error("{owner}: {error}")]
    Mesh {
        /// The object.
        owner: String,
        /// The fault of its file.
        error: MeshError,
    },
    /// A mesh without volume where one is needed.
    #[error(
        "{name}: its mesh is flat, and has no convex hull; let it touch by its triangles: collision = \"triangles\""
    )]
    FlatMesh {
        /// The object.
        name: String,
    },
    /// Neighbouring triangles that face opposite sides.
    #[error(
        "{name}: the triangles at the edge from {:?} to {:?} of its mesh face opposite sides, so that nobody knows which side is \
         solid; let all face outward (a mesh editor recalculates normals), or let it touch by convex parts, such as \
         collision = {{ parts = 16 }}", .edge[0], .edge[1]
    )]
    TwistedMesh {
        /// The object.
        name: String,
        /// Ends of the edge, in the axes of the mesh \[m\].
        edge: [[f64; 3]; 2],
    },
    /// Triangles that move.
    #[error(
        "{name}: it moves, and cannot touch by its triangles; cut it into convex parts, such as collision = {{ parts = 16 }}, or \
         leave `mass` and `density` out"
    )]
    MovingTriangles {
        /// The object.
        name: String,
    },
    /// Properties or parts of an object that do not go together.
    #[error("{name}: {problem}")]
    Parts {
        /// The object.
        name: String,
        /// The problem.
        problem: &'static str,
    },
    /// A connection of what is not there.
    #[error("`connections` names the object \"{name}\", which the world does not have{}", suggestion(.nearest.as_deref()))]
    NothingToConnect {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// A connection of what does not move.
    #[error(
        "`connections`: \"{first}\" and \"{second}\" do not move relative to one another: there is nothing to connect"
    )]
    RigidConnection {
        /// A part.
        first: String,
        /// The other.
        second: String,
    },
    /// Two statements of a mass.
    #[error("{name}: both `mass` and `density` are given; leave one out")]
    TwoMasses {
        /// The object.
        name: String,
    },
    /// A file that holds no world.
    #[error(transparent)]
    File(#[from] WorldFileError),
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
    /// Lets the relative paths of its files begin at a folder, and takes over the world of its [`file`](Self::file). Returns what was left out of
    /// that.
    ///
    /// ```
    /// # use motorium_robots::World;
    /// let text = "terrain = { size = [4.0, 4.0], layers = [{ image = { file = \"hills.png\", height = [0.0, 0.2] } }] }";
    /// let mut world: World = toml::from_str(text).unwrap();
    /// world.locate("/nowhere".as_ref()).unwrap();
    /// assert!(world.height_field().unwrap_err().to_string().contains("/nowhere/hills.png"));
    /// ```
    ///
    /// # Errors
    ///
    /// [`WorldError::File`].
    pub fn locate(&mut self, folder: &Path) -> Result<Vec<ModelWarning>, WorldError> {
        if let Some(terrain) = &mut self.terrain {
            terrain.locate(folder);
        }
        for object in &mut self.objects {
            object.shape.locate(folder);
        }
        match self.file.take() {
            Some(file) => Ok(self.add_file(&folder.join(file))?),
            None => Ok(Vec::new()),
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
        for value in self.wind {
            finite("world", "wind", value)?;
        }
        from_zero("world", "air_density", self.air_density)?;
        self.ground.as_ref().map_or(Ok(()), Ground::check_numbers)?;
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
            if name == "world" {
                return taken("the world itself");
            }
            if links.clone().any(|link| link == name) {
                return taken("a link of the robot");
            }
            if self.objects[..index].iter().any(|other| other.name == name) {
                return taken("an object before it");
            }
            object.check_numbers()?;
            object.check_shape()?;
        }
        connection::check(self)?;
        self.appearance.check(self)
    }
}
