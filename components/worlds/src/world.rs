//! Worlds: descriptions of the surroundings of robots.

mod checks;
mod colours;
mod connection;
mod copies;
mod doubts;
mod error;
mod file;
mod gravity;
mod mesh;
mod mjcf;
mod numbers;
mod reading;
mod sdf;
mod shape;
mod surface;
mod table;
mod things;

use std::path::{Path, PathBuf};

use motorium_robots::ModelWarning;
use schemars::JsonSchema;
use serde::Serialize;

use crate::{Appearance, HeightField, Terrain, TerrainError};
use checks::{finite, from_zero};
pub use connection::{Connection, ConnectionKind};
pub use error::{WorldError, WorldFileError};
pub use gravity::gravity_of_file;
pub use mesh::{MeshBody, MeshCollision, MeshShape};
pub use mjcf::{MjcfWorld, parse_mjcf_world};
pub use shape::{CompoundPart, ObjectMass, ObjectShape};
pub use things::{Conveyor, Copies, Ground, Object};

/// The surroundings of robots: gravity, air, ground, objects and their appearance. Units are metres, radians
/// and kilograms. Poses are in the world frame, which is also the base frame of the robot, z up.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct World {
    /// A file that describes a world, in MJCF, URDF or SDF. The file's objects are added to `objects`. The
    /// file's gravity, wind and ground apply unless they are also specified here. Relative paths start at the
    /// graph's folder. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"))]
    pub file: Option<PathBuf>,
    /// Gravitational acceleration (m/s2).
    pub gravity: [f64; 3],
    /// `true` if `gravity` is stated explicitly. An explicit gravity overrides the gravity of a `file`, even
    /// if the explicit value equals Earth's gravity.
    #[serde(skip)]
    pub states_gravity: bool,
    /// Velocity of the air (m/s), which pushes objects with a `drag`. Default: still air.
    pub wind: [f64; 3],
    /// Density of the air (kg/m3). Default 1.225, as at sea level and 15 degrees Celsius.
    #[schemars(range(min = 0.0))]
    pub air_density: f64,
    /// Horizontal plane as the ground. Default: no ground.
    pub ground: Option<Ground>,
    /// Uneven ground, as an alternative to the plane `ground`. Default: no terrain.
    pub terrain: Option<Terrain>,
    /// Objects, fixed or free to move. Names must differ.
    #[serde(deserialize_with = "copies::expanded")]
    pub objects: Vec<Object>,
    /// Connections between two objects, or between an object and the fixed `world`, in their initial poses.
    /// To connect links of robots, use the key `connections` of the physics component.
    pub connections: Vec<Connection>,
    /// Appearance for cameras.
    pub appearance: Appearance,
}

/// Gravitational acceleration on Earth \[m/s2\].
const EARTH: [f64; 3] = [0.0, 0.0, -9.81];

impl Default for World {
    /// Earth's gravity, still air, no ground, no objects.
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

impl World {
    /// Resolves relative file paths from a folder, and adds the content of [`file`](Self::file) to this
    /// world. Returns warnings about skipped elements, and about values that are probably in another unit,
    /// such as degrees or millimetres.
    ///
    /// ```
    /// # use motorium_worlds::World;
    /// let text = r#"[terrain]
    ///     size = [4.0, 4.0]
    ///     layers = [{ image = { file = "hills.png", height = [0.0, 0.2] } }]"#;
    /// let mut world: World = toml::from_str(text).unwrap();
    /// world.locate("/nowhere".as_ref()).unwrap();
    /// assert!(world.height_field().unwrap_err().to_string().contains("/nowhere/hills.png"));
    /// ```
    ///
    /// # Errors
    ///
    /// [`WorldError::File`] if the file cannot be read as a world.
    pub fn locate(&mut self, folder: &Path) -> Result<Vec<ModelWarning>, WorldError> {
        if let Some(terrain) = &mut self.terrain {
            terrain.locate(folder);
        }
        for object in &mut self.objects {
            object.shape.locate(folder);
        }
        let mut warnings = Vec::new();
        self.warn_of_angles(&mut warnings);
        if let Some(file) = self.file.take() {
            warnings.extend(self.add_file(&folder.join(file))?);
        }
        self.warn_of_sizes(&mut warnings);
        self.warn_of_units(&mut warnings);
        Ok(warnings)
    }

    /// Returns the height field of the terrain; `None` without a terrain.
    ///
    /// # Errors
    ///
    /// [`TerrainError`] if a value is out of range or an image cannot be read.
    pub fn height_field(&self) -> Result<Option<HeightField>, TerrainError> {
        self.terrain.as_ref().map(Terrain::height_field).transpose()
    }

    /// Checks every value and name. `links` are the link names of the robot, which objects must not use.
    ///
    /// # Errors
    ///
    /// [`WorldError`] describes the first mistake found.
    pub fn check<'a>(&self, links: impl Iterator<Item = &'a str> + Clone) -> Result<(), WorldError> {
        for value in self.gravity {
            checks::gravity(value)?;
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
            if name.is_empty() {
                return Err(WorldError::Parts {
                    name: format!("object {index}"),
                    problem: "its `name` is empty",
                });
            }
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
        connection::check(&self.connections, &self.objects)?;
        self.appearance.check(self)
    }
}
