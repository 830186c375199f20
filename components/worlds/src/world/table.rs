//! The keys that describe a world in TOML.

use std::path::PathBuf;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::{Connection, Ground, Object, World, WorldError, copies};
use crate::{Appearance, Terrain};

#[derive(Deserialize)]
#[serde(rename = "World", deny_unknown_fields, default)]
struct WorldTable {
    file: Option<PathBuf>,
    gravity: Option<[f64; 3]>,
    wind: [f64; 3],
    air_density: f64,
    #[serde(deserialize_with = "ground")]
    ground: Option<Ground>,
    #[serde(deserialize_with = "terrain")]
    terrain: Option<Terrain>,
    #[serde(deserialize_with = "copies::expanded")]
    objects: Vec<Object>,
    connections: Vec<Connection>,
    appearance: Appearance,
}

/// Reads a ground and checks its numbers.
fn ground<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Ground>, D::Error> {
    let ground = Option::<Ground>::deserialize(deserializer)?;
    ground.as_ref().map_or(Ok(()), Ground::check_numbers).map_err(D::Error::custom)?;
    Ok(ground)
}

/// Parses a terrain and checks everything except its images.
fn terrain<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Terrain>, D::Error> {
    let terrain = Option::<Terrain>::deserialize(deserializer)?;
    let checked = terrain.as_ref().map_or(Ok(()), Terrain::check_numbers);
    checked.map_err(|error| D::Error::custom(WorldError::Terrain(error)))?;
    Ok(terrain)
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
