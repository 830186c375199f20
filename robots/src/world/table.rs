//! The table of a world as it is read: which keys are there is known here alone.

use std::path::PathBuf;

use serde::{Deserialize, Deserializer};

use super::{Connection, Ground, Object, World, copies};
use crate::{Appearance, Terrain};

#[derive(Deserialize)]
#[serde(rename = "World", deny_unknown_fields, default)]
struct WorldTable {
    file: Option<PathBuf>,
    gravity: Option<[f64; 3]>,
    wind: [f64; 3],
    air_density: f64,
    ground: Option<Ground>,
    terrain: Option<Terrain>,
    #[serde(deserialize_with = "copies::expanded")]
    objects: Vec<Object>,
    connections: Vec<Connection>,
    appearance: Appearance,
}

impl Default for WorldTable {
    fn default() -> Self {
        let World { file, wind, air_density, ground, terrain, objects, connections, appearance, .. } =
            World::default();
        Self { file, gravity: None, wind, air_density, ground, terrain, objects, connections, appearance }
    }
}

impl<'de> Deserialize<'de> for World {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let table = WorldTable::deserialize(deserializer)?;
        let WorldTable {
            file,
            gravity,
            wind,
            air_density,
            ground,
            terrain,
            objects,
            connections,
            appearance,
        } = table;
        let states_gravity = gravity.is_some();
        let gravity = gravity.unwrap_or(Self::default().gravity);
        Ok(Self {
            file,
            gravity,
            states_gravity,
            wind,
            air_density,
            ground,
            terrain,
            objects,
            connections,
            appearance,
        })
    }
}
