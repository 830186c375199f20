//! Key poses named by the SRDF of a robot: its `<group_state>` elements.

use std::path::{Path, PathBuf};

use nalgebra::{DVector, Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::Model;
use crate::file::read_bounded;
use crate::geometry::srdf::{GroupState, group_states};
use crate::model::configuration::write_pose;

/// Maximum size of an SRDF file, bytes.
const LONGEST: u64 = 16 * 1024 * 1024;

/// A named configuration (`<group_state>`) of an SRDF file. Joints that the state does not name are at zero.
/// Joints that the model does not have, such as the joints of a gripper variant, are ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct Posture {
    /// Name of the state, or `GROUP/NAME` if an earlier state has the same name.
    pub name: String,
    /// Pose of the base in the world; `None` if the state has no `root_joint`.
    pub base: Option<Isometry3<f64>>,
    /// Positions of the joints \[rad or m\], in the order of [`Model::joint_names`].
    pub joints: DVector<f64>,
}

impl Posture {
    /// Returns the whole configuration `q` (nq). A floating base is at the pose in the SRDF state or, if the
    /// state has none, at its neutral pose.
    pub fn configuration(&self, model: &Model) -> DVector<f64> {
        let mut q = DVector::from_vec(model.neutral());
        let offset = q.len() - self.joints.len();
        q.rows_mut(offset, self.joints.len()).copy_from(&self.joints);
        if let (Some(base), true) = (&self.base, model.base().floating) {
            write_pose(base, q.as_mut_slice());
        }
        q
    }

    /// Reads the states of a robot's SRDF. Empty if it is missing or malformed, because the states are
    /// optional.
    pub(crate) fn beside(file: &Path, model: &Model) -> Vec<Self> {
        srdf_beside(file, model).map(|text| Self::parse(&text, model)).unwrap_or_default()
    }

    /// Parses the states of an SRDF text; empty if it is malformed.
    fn parse(text: &str, model: &Model) -> Vec<Self> {
        let mut postures: Vec<Self> = Vec::new();
        for state in group_states(text).unwrap_or_default() {
            let GroupState { mut name, group, joints: values } = state;
            if postures.iter().any(|posture| posture.name == name) {
                name = format!("{group}/{name}");
            }
            let mut posture = Self { name, base: None, joints: DVector::zeros(model.joint_count()) };
            let mut known = false;
            for (joint, numbers) in &values {
                known |= posture.set_joint(model, joint, numbers);
            }
            if known {
                postures.push(posture);
            }
        }
        postures
    }

    /// Sets one joint of a state; returns `false` if the model does not have the joint.
    fn set_joint(&mut self, model: &Model, name: &str, numbers: &[f64]) -> bool {
        match (model.joint_index(name), numbers) {
            (Some(index), [position]) => self.joints[index] = *position,
            // Pinocchio writes a continuous joint as its cosine and sine.
            (Some(index), [cosine, sine]) => self.joints[index] = sine.atan2(*cosine),
            (None, [x, y, z, qx, qy, qz, qw]) if model.base().floating => {
                let Some(rotation) = UnitQuaternion::try_new(Quaternion::new(*qw, *qx, *qy, *qz), 1e-9)
                else {
                    return false;
                };
                self.base = Some(Isometry3::from_parts(Translation3::new(*x, *y, *z), rotation));
            }
            _ => return false,
        }
        true
    }
}

/// Returns the text of a robot's SRDF: `NAME.srdf` next to the file or in the folder `srdf` next to its
/// folder, where NAME is the file's or the robot's name.
pub(crate) fn srdf_beside(file: &Path, model: &Model) -> Option<String> {
    let names = [file.with_extension("srdf").file_name().map(PathBuf::from), {
        Some(PathBuf::from(format!("{}.srdf", model.name())))
    }];
    let folders = [file.parent().map(Path::to_owned), {
        file.parent().and_then(Path::parent).map(|folder| folder.join("srdf"))
    }];
    let mut places =
        folders.iter().flatten().flat_map(|folder| names.iter().flatten().map(|name| folder.join(name)));
    places.find_map(|path| String::from_utf8(read_bounded(&path, LONGEST).ok()?).ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BaseMode, LoadOptions, parse_urdf_with};

    const ROBOT: &str = r#"<robot name="leg"><link name="trunk"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="shank"><inertial>
        <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="wheel"/>
        <joint name="knee" type="revolute"><parent link="trunk"/><child link="shank"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" velocity="1" effort="1"/></joint><joint name="axle" type="continuous">
        <parent link="shank"/><child link="wheel"/><axis xyz="0 1 0"/></joint></robot>"#;

    #[test]
    fn srdf_states_are_postures_of_base_and_joints() {
        let srdf = r#"<robot name="leg"><group_state name="standing" group="all"><joint name="root_joint"
            value="0. 0. 0.7 0. 0. 0. 1."/><joint name="knee" value="-0.4"/><joint name="axle" value="0 1"/>
            <joint name="of another" value="1"/></group_state><group_state name="standing" group="knees">
            <joint name="knee" value="0.1"/></group_state><group_state name="open" group="hand"><joint name="finger"
            value="0.1"/></group_state></robot>"#;
        let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
        let model = parse_urdf_with(ROBOT, None, &options).unwrap().model;
        let postures = Posture::parse(srdf, &model);
        let names: Vec<_> = postures.iter().map(|posture| posture.name.as_str()).collect();
        assert_eq!(names, ["standing", "knees/standing"]);
        let q = postures[0].configuration(&model);
        let expected = [0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 1.0, -0.4, std::f64::consts::FRAC_PI_2];
        assert!((q - DVector::from_column_slice(&expected)).norm() < 1e-12);
        assert_eq!(postures[1].joints.as_slice(), [0.1, 0.0]);
        assert_eq!(Posture::parse("<robot", &model), []);
    }
}
