//! `can.adapter` and `can.drive_sim`: drives on buses as components of a graph.

mod adapter;
mod drive_sim;
mod faults;
mod limits;
mod wire;

use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::state::MAX_JOINTS;
use motorium::worker::Kind;
use motorium_robots::{Loaded, RobotSource};

use crate::{Table, TableError};
pub use adapter::{CanAdapter, CanAdapterConfig, JointHealth};
pub use drive_sim::{DriveSimulation, DriveSimulationConfig};

/// A robot and its drives.
struct Equipped {
    robot: Loaded,
    table: Table,
    /// The drive of each joint, by its index in the table.
    order: Vec<usize>,
}

/// Loads a robot and its drive table, a file relative to `folder`.
fn load(robot: Option<&RobotReference>, folder: &Path, file: &str) -> Result<Equipped, ConfigError> {
    let robot = robot.ok_or_else(|| {
        ConfigError::new("the component names no robot, and needs its joints")
            .advise("add `robot = \"NAME\"` to the component")
    })?;
    let source =
        RobotSource { name: &robot.name, text: &robot.urdf, base: &robot.base, pose: robot.pose.map(pose) };
    let robot = source.load().map_err(|error| ConfigError::new(error.to_string()))?;
    let joints = robot.model.joint_count();
    if robot.model.base().floating || joints == 0 || joints > MAX_JOINTS {
        let message =
            format!("a robot with {joints} joints, expected a fixed base and 1 to {MAX_JOINTS} joints");
        return Err(ConfigError::new(message));
    }
    let path = folder.join(file);
    let text = std::fs::read_to_string(&path).map_err(|error| {
        ConfigError::key("drives", format!("{}: {error}", path.display()))
            .advise("name a drive table, relative to the graph file")
    })?;
    let refused =
        |error: TableError| ConfigError::key("drives", format!("{file}: {error}")).advise(error.advice);
    let table = Table::parse(&text).map_err(refused)?;
    let order = table.of_joints(robot.model.joint_names()).map_err(refused)?;
    Ok(Equipped { robot, table, order })
}

fn pose(pose: motorium::declare::BasePose) -> motorium_robots::BasePose {
    motorium_robots::BasePose { position: pose.position, rpy: pose.rpy }
}

/// The kinds of this crate, for a program that hosts them.
///
/// ```
/// let names: Vec<_> = motorium_can::kinds().iter().map(|kind| kind.name).collect();
/// assert_eq!(names, ["can.adapter", "can.drive_sim"]);
/// ```
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<CanAdapter>(), Kind::of::<DriveSimulation>()]
}
