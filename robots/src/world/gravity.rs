//! Gravity in the configuration of what reckons with it.

use std::path::PathBuf;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::file::read;
use super::{EARTH, World};

/// The file of a world.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfFile {
    file: PathBuf,
}

/// Reads a key `gravity`: three numbers (m/s2), or `{ file = "/PATH" }`, a file that holds a [world](World::file), for that of the
/// file: 9.81 downwards where it states none.
///
/// The graph hands the file of its `[world]` to all components that reckon with gravity, so that these have that of the simulation.
///
/// # Errors
///
/// Neither of the two, or a file that cannot be read as a world.
///
/// ```
/// #[derive(serde::Deserialize)]
/// struct Config {
///     #[serde(deserialize_with = "motorium_robots::deserialize_gravity")]
///     gravity: [f64; 3],
/// }
///
/// let config: Config = toml::from_str("gravity = [0.0, 0.0, -1.62]").unwrap();
/// assert_eq!(config.gravity[2], -1.62);
/// ```
pub fn deserialize_gravity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    struct Stated;

    impl<'de> Visitor<'de> for Stated {
        type Value = [f64; 3];

        fn expecting(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            formatter.write_str("3 numbers (m/s2)")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, numbers: A) -> Result<Self::Value, A::Error> {
            <[f64; 3]>::deserialize(SeqAccessDeserializer::new(numbers))
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Self::Value, A::Error> {
            let OfFile { file } = OfFile::deserialize(MapAccessDeserializer::new(table))?;
            let read = read(&file).map_err(|error| A::Error::custom(error.to_string()))?;
            let World { gravity, .. } = read.world;
            Ok(if read.states_gravity { gravity } else { EARTH })
        }
    }

    deserializer.deserialize_any(Stated)
}
