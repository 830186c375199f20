//! Connections of parts besides the joints of robots.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A connection of two parts, links or objects, that no joint of a robot joins: it closes a loop of links, or fixes an object to a hand.
///
/// The two are held as they stand to one another when it is made. Parts that are connected do not collide with one another.
///
/// ```
/// use std::path::Path;
/// use motorium_physics::{ArticulatedSimulator, Connection, Object, Options, Simulator, World};
/// use motorium_robots::load;
///
/// let rod = load("pendulum", Path::new("."))?.model;
/// let link = rod.frames().last().ok_or("no links")?.name.clone();
/// let weight = Object { name: "weight".to_owned(), mass: Some(0.2), position: [0.0, 0.0, -0.6], ..Object::default() };
/// let world = World { objects: vec![weight], ..World::default() };
/// let mut simulation = ArticulatedSimulator::new(rod, world, &[0.3], Options::default())?;
/// simulation.attach(&link, "weight")?;
/// let weight = simulation.object("weight").ok_or("no weight")?;
/// let start = simulation.object_pose(weight).translation.vector;
/// for _ in 0..200 {
///     simulation.step(1e-3)?;
/// }
/// let end = simulation.object_pose(weight).translation.vector;
/// assert!((end - start).norm() > 0.01, "it swings with the rod");
/// assert!((end.norm() - start.norm()).abs() < 1e-4, "about its hinge");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Connection {
    /// The two parts: links of robots, objects, or `world`.
    pub parts: [String; 2],
    /// The kind of connection.
    #[serde(default)]
    pub kind: ConnectionKind,
    /// The point that they share, in the axes of the first (m). Default: its origin.
    #[serde(default)]
    pub point: [f64; 3],
}

/// The motions that a connection leaves free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ConnectionKind {
    /// They turn about the point, as in a ball joint, a pin of a planar linkage, or a rod end.
    #[default]
    Ball,
    /// They do not move relative to one another.
    Fixed,
}

/// A connection that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConnectError {
    /// The engine has no connections.
    #[error(
        "the {engine} engine connects nothing besides the joints of robots; use `physics.articulated` (`ArticulatedSimulator`)"
    )]
    Unable {
        /// The engine.
        engine: &'static str,
    },
    /// Nothing has this name.
    #[error("no link or object is called \"{name}\"{}", .nearest.as_ref().map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default())]
    Unknown {
        /// The name.
        name: String,
        /// The name most likely meant.
        nearest: Option<String>,
    },
    /// The two do not move relative to one another.
    #[error("\"{first}\" and \"{second}\" do not move relative to one another: there is nothing to connect")]
    Rigid {
        /// A part.
        first: String,
        /// The other.
        second: String,
    },
    /// A point that is nowhere.
    #[error("`point` is {0:?}, expected finite numbers")]
    Point([f64; 3]),
}
