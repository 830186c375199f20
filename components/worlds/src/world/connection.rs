//! Connections between the objects of a world.

use motorium_robots::nearest;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::checks::finite;
use super::{Object, WorldError};

/// A connection of two links or objects in addition to the robot's joints, for example to close a kinematic
/// loop or to fix an object to a hand.
///
/// The connection maintains the initial relative pose of both parts, except for the motions that its `kind`
/// permits. Connected parts do not collide with each other. Connections in the description of a world refer
/// to objects of that world.
///
/// ```
/// use motorium_worlds::{ConnectionKind, World};
///
/// let text = r#"
/// objects = [
///     { name = "beam", shape = { box = { size = [2.0, 0.1, 0.1] } }, position = [0.0, 0.0, 1.5] },
///     { name = "bob", shape = { sphere = { radius = 0.1 } }, mass = 2.0, position = [0.0, 0.0, 0.9] },
/// ]
/// connections = [{ parts = ["bob", "beam"], point = [0.0, 0.0, 0.6] }]
/// "#;
/// let world: World = toml::from_str(text).unwrap();
/// world.check(std::iter::empty()).unwrap();
/// assert_eq!(world.connections[0].kind, ConnectionKind::Ball);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// The two connected parts: links of robots, objects, or `world`.
    pub parts: [String; 2],
    /// Relative motions that the connection permits.
    #[serde(default)]
    pub kind: ConnectionKind,
    /// Connection point, in the axes of the first part (m). Default: the origin of the first part.
    #[serde(default)]
    pub point: [f64; 3],
}

/// Relative motions that a connection permits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConnectionKind {
    /// Rotation about the connection point, as in a ball joint, a pin of a planar linkage, or a rod end.
    #[default]
    Ball,
    /// No relative motion.
    Fixed,
}

/// Checks the connections of a world: they refer to its objects, at least one of which moves.
pub(super) fn check(connections: &[Connection], objects: &[Object]) -> Result<(), WorldError> {
    for Connection { parts, point, .. } in connections {
        let object = |name: &String| objects.iter().find(|object| object.name == *name);
        if let Some(name) = parts.iter().find(|name| *name != "world" && object(name).is_none()) {
            let names = objects.iter().map(|object| object.name.as_str());
            let nearest = nearest(name, names).map(str::to_owned);
            return Err(WorldError::NothingToConnect { name: name.clone(), nearest });
        }
        let [first, second] = parts;
        if first == second || !parts.iter().filter_map(object).any(Object::is_dynamic) {
            return Err(WorldError::RigidConnection { first: first.clone(), second: second.clone() });
        }
        for value in point {
            finite(first, "point of a connection", *value)?;
        }
    }
    Ok(())
}
