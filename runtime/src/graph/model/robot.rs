//! The table of a robot: its model and its pose.

use schemars::JsonSchema;

use serde_json::{Value as Json, json};

use crate::declare::{BasePose, ParameterValue};
use crate::graph::diagnostic::Report;
use crate::graph::read::{At, Keys, Read, Value, good};
use crate::graph::values::{Named, Number, Triple};

/// A robot.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Robot", extend("anyOf" = [{ "required": ["urdf"] }, { "required": ["mjcf"] }]))]
pub(in crate::graph) struct RobotTable {
    /// Model of the robot: a catalogue name, a folder, or a URDF or MJCF file (relative to the graph file).
    /// Set either this or `mjcf`.
    pub urdf: Option<At<String>>,
    /// Model of the robot: an MJCF file, or a folder that contains one (relative to the graph file). Set
    /// either this or `urdf`.
    pub mjcf: Option<At<String>>,
    /// Profile of the robot, a TOML file (relative to the graph file). Default: the catalogue's profile, or
    /// the `.toml` file of the same name next to the model's file.
    pub profile: Option<At<String>>,
    /// Folders to search first for `package://` files of the model (relative to the graph file). Default:
    /// none.
    pub package_path: Option<At<Vec<At<String>>>>,
    /// Pose of the robot's base in the world. Default: the origin or, for a floating base, the pose in the
    /// profile.
    pub base: Option<At<BaseTable>>,
    /// Moving joints: names of joints, or names of end effectors in the profile, which stand for the joints
    /// that move them. The other joints are held in the `start` pose, or at their position in `fixed`, and
    /// are not part of states and commands. Default: all joints except those in `fixed`.
    pub joints: Option<At<Vec<At<String>>>>,
    /// Positions at which joints are held (rad or m), by joint name. Default: none.
    pub fixed: Option<At<Named<Number>>>,
    /// Link that tasks move. Default: the link of the only end effector in the profile.
    pub frame: Option<At<String>>,
    /// Start and home pose: the name of a pose in the profile, one number for all joints, or a list with one
    /// number per joint (rad or m). Default: the home pose of the profile.
    pub start: Option<At<ParameterValue>>,
    /// Gains of the robot's joints. Default: the gains of the profile.
    pub gains: Option<At<GainsTable>>,
    /// Known keys that are probably misspelt in the file.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for RobotTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("robot.{key}"), value, report)?;
        let mut table = take_fields!(keys, urdf, mjcf, profile, package_path, base, joints, fixed, frame, start, gains; meant: Vec::new());
        table.meant = keys.finish(&format!("robot `{key}`"));
        Some(table)
    }
}

impl RobotTable {
    /// Returns the settings that override a profile, for the robot loader; `None` without any.
    pub(in crate::graph) fn settings(&self) -> Option<Json> {
        let mjcf = self.mjcf.is_some().then_some(("mjcf", Json::Bool(true)));
        let names = |names: &Vec<At<String>>| names.iter().filter_map(At::get).cloned().collect::<Vec<_>>();
        let joints = good(&self.joints).map(|joints| ("joints", json!(names(joints))));
        let position = |(name, at): &(String, At<Number>)| Some((name.clone(), json!(at.get()?.0)));
        let fixed = good(&self.fixed)
            .map(|fixed| ("fixed", Json::Object(fixed.0.iter().filter_map(position).collect())));
        let frame = good(&self.frame).map(|frame| ("frame", json!(frame)));
        let start = good(&self.start).map(|start| ("start", json!(start)));
        let gains = good(&self.gains).map(|gains| ("gains", gains.settings()));
        let settings: serde_json::Map<String, Json> = [mjcf, joints, fixed, frame, start, gains]
            .into_iter()
            .flatten()
            .map(|(key, value)| (key.to_string(), value))
            .collect();
        (!settings.is_empty()).then_some(Json::Object(settings))
    }
}

/// Gains of a robot's joints: one number for all joints, or a list with one number per joint.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Gains")]
pub(in crate::graph) struct GainsTable {
    /// Stiffness (N m/rad or N/m).
    pub kp: Option<At<ParameterValue>>,
    /// Damping (N m s/rad or N s/m).
    pub kd: Option<At<ParameterValue>>,
}

impl GainsTable {
    fn settings(&self) -> Json {
        json!({ "kp": good(&self.kp), "kd": good(&self.kd) })
    }
}

impl<'i> Read<'i> for GainsTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, kp, kd);
        keys.finish("`gains`");
        Some(table)
    }
}

/// The pose of a robot's base in the world.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Base")]
pub(in crate::graph) struct BaseTable {
    /// Position of the base frame's origin (m).
    pub position: Option<At<Triple>>,
    /// Roll, pitch and yaw about the fixed axes x, y and z, in this order (rad).
    pub rpy: Option<At<Triple>>,
}

impl BaseTable {
    /// Returns the pose without its positions in the file.
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
