//! `can.adapter` and `can.drive_sim`: drives on buses as components of a graph.

mod adapter;
mod drive_sim;
mod faults;
mod homing_load;
mod interfaces;
mod limits;
mod wire;

use std::collections::BTreeMap;
use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::worker::Kind;
use motorium_robots::{Loaded, RobotSource};

use crate::{BusEntry, DriveEntry, Table, TableError};
pub use adapter::{CanAdapter, CanAdapterConfig, JointHealth};
pub use drive_sim::{DriveSimulation, DriveSimulationConfig};

/// Robot with its drives.
struct Equipped {
    robot: Loaded,
    table: Table,
    /// Index of each joint's drive in the table.
    order: Vec<usize>,
}

/// Source of a configuration's drive table: a file, or inline entries.
struct Source<'a> {
    file: Option<&'a str>,
    buses: &'a [BusEntry],
    drives: &'a [DriveEntry],
    /// Interfaces of buses by name, replacing the table's.
    interfaces: &'a BTreeMap<String, String>,
}

impl Source<'_> {
    /// Reads the table; the path of a file is relative to `folder`.
    fn table(&self, folder: &Path) -> Result<Table, ConfigError> {
        let mut table = self.read(folder)?;
        if self.interfaces.is_empty() {
            return Ok(table);
        }
        for (name, interface) in self.interfaces {
            let names: Vec<&str> = table.buses.iter().map(|bus| bus.name.as_str()).collect();
            let Some(index) = names.iter().position(|known| known == name) else {
                let message = format!("no bus is named `{name}`; the buses are {}", names.join(", "));
                return Err(
                    ConfigError::key("interfaces", message).advise("use the bus names of the drive table")
                );
            };
            table.buses[index].interface = Some(interface.clone());
        }
        table
            .check()
            .map_err(|error| ConfigError::key("interfaces", error.to_string()).advise(error.advice))?;
        Ok(table)
    }

    fn read(&self, folder: &Path) -> Result<Table, ConfigError> {
        let inline = !self.buses.is_empty() || !self.drives.is_empty();
        let Some(file) = self.file else {
            if !inline {
                return Err(ConfigError::new("the component has no drives")
                    .advise("name a drive table: `drives = \"FILE\"`, or write `bus` and `drive` here"));
            }
            let mut table =
                Table { buses: self.buses.to_vec(), drives: self.drives.to_vec(), joint_places: Vec::new() };
            let read = |name: &str| read_sheet(&folder.join(name));
            table.complete(read).and_then(|()| table.check()).map_err(|error| refused(&error, None))?;
            return Ok(table);
        };
        if inline {
            return Err(ConfigError::key("drives", "both a drive table and inline entries are given")
                .advise("leave out `drives`, or leave out both `bus` and `drive`"));
        }
        let path = folder.join(file);
        let text = std::fs::read_to_string(&path).map_err(|error| {
            ConfigError::key("drives", format!("{}: {error}", path.display()))
                .advise("name a drive table, relative to the graph file")
        })?;
        let beside = path.parent().unwrap_or(folder);
        let read = |name: &str| read_sheet(&beside.join(name));
        Table::parse_with(&text, read).map_err(|error| refused(&error, Some(file)))
    }
}

/// Reads the text of a data sheet as UTF-8, or else as Latin-1, which many manufacturers' tools write.
fn read_sheet(path: &Path) -> std::io::Result<String> {
    let bytes = std::fs::read(path)?;
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().map(|byte| char::from(*byte)).collect()))
}

/// Converts the error of a table in a file, or in the configuration.
fn refused(error: &TableError, file: Option<&str>) -> ConfigError {
    let refused = match (file, error.entry) {
        (Some(file), _) => ConfigError::key("drives", format!("{file}: {error}")),
        (None, Some((entry, index))) => ConfigError::key(format!("{entry}[{index}]"), error.to_string()),
        (None, None) => ConfigError::new(error.to_string()),
    };
    refused.advise(error.advice)
}

/// Loads a robot and its drive table.
fn load(robot: Option<&RobotReference>, folder: &Path, source: &Source<'_>) -> Result<Equipped, ConfigError> {
    let robot = robot.ok_or_else(|| {
        ConfigError::new("the component needs the joints of a robot, but names no robot")
            .advise("add `robot = \"NAME\"` to the component")
    })?;
    let place = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(pose),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    };
    let robot = place.load().map_err(|error| ConfigError::new(error.to_string()))?;
    let joints = robot.model.joint_count();
    if joints == 0 || joints > MAX_JOINTS {
        return Err(ConfigError::new(format!("a robot with {joints} joints, expected 1 to {MAX_JOINTS}")));
    }
    let table = source.table(folder)?;
    let order = table.of_joints(robot.model.joint_names()).map_err(|error| refused(&error, source.file))?;
    Ok(Equipped { robot, table, order })
}

fn pose(pose: motorium::declare::BasePose) -> motorium_robots::BasePose {
    motorium_robots::BasePose { position: pose.position, rpy: pose.rpy }
}

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_can::kinds().iter().map(|kind| kind.name).collect();
/// assert_eq!(names, ["can.adapter", "can.drive_sim"]);
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<CanAdapter>(), Kind::of::<DriveSimulation>()]
}
