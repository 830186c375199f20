//! The table of a robot: its model and its place.

use schemars::JsonSchema;

use crate::declare::BasePose;
use crate::graph::diagnostic::Report;
use crate::graph::read::{At, Keys, Read, Value, good};
use crate::graph::values::Triple;

/// A robot.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Robot")]
pub(in crate::graph) struct RobotTable {
    /// Its model: a name of the catalogue, a folder, or a URDF file (relative to the graph file).
    #[schemars(required)]
    pub urdf: Option<At<String>>,
    /// Its profile, a TOML file (relative to the graph file). If left out: that of the catalogue, or the `.toml` of the same
    /// name beside its file.
    pub profile: Option<At<String>>,
    /// Folders in which `package://` files of its model are searched first (relative to the graph file). Default none.
    pub package_path: Option<At<Vec<At<String>>>>,
    /// Pose of its base in the world. If left out: at the origin, or, for a floating base, where its profile has it.
    pub base: Option<At<BaseTable>>,
    /// Known keys that misspelt ones probably mean.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for RobotTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("robot.{key}"), value, report)?;
        let mut table = take_fields!(keys, urdf, profile, package_path, base; meant: Vec::new());
        table.meant = keys.finish(&format!("robot `{key}`"));
        Some(table)
    }
}

/// The pose of a robot's base in the world.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Base")]
pub(in crate::graph) struct BaseTable {
    /// Position of its origin (m).
    pub position: Option<At<Triple>>,
    /// Its roll, pitch, yaw about the fixed axes x, y, z, in this order (rad).
    pub rpy: Option<At<Triple>>,
}

impl BaseTable {
    /// The same without places.
    pub(in crate::graph) fn pose(&self) -> BasePose {
        let of = |key: &Option<At<Triple>>| good(key).map_or([0.0; 3], |triple| triple.0);
        BasePose { position: of(&self.position), rpy: of(&self.rpy) }
    }
}

impl<'i> Read<'i> for BaseTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, position, rpy);
        keys.finish("`base`");
        Some(table)
    }
}
