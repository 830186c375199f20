//! Skeletons of motion-capture files: joint positions from joint angles, and directions of limbs.

use nalgebra::{DMatrix, Rotation3, Unit, UnitQuaternion, Vector3};

use crate::{Recording, RecordingError};

/// A motion of a joint, driven by one value of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// Translation along an axis, in the unit of length of the file.
    Translate(usize),
    /// Rotation about an axis, degrees.
    Rotate(usize),
}

/// A joint of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SkeletonJoint {
    pub(crate) name: String,
    /// Index of the parent, which precedes this joint; `None` for the root.
    pub(crate) parent: Option<usize>,
    /// Offset from the parent to this joint, rotated with the parent.
    pub(crate) before: Vector3<f64>,
    /// Offset added to the position, rotated with this joint.
    pub(crate) after: Vector3<f64>,
    /// Orientation of the joint's rotation axes.
    pub(crate) axes: UnitQuaternion<f64>,
    /// Motions, in the order in which the rotations are multiplied from the left, each with its channel.
    pub(crate) motions: Vec<(Motion, usize)>,
}

/// A skeleton: a tree of joints, and the channels that move them.
///
/// Channels are named `JOINT_rx`, `JOINT_ty` and so on. Rotations are in degrees, translations in the file's
/// unit of length.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    pub(crate) joints: Vec<SkeletonJoint>,
    pub(crate) channels: Vec<String>,
}

/// A limb of a skeleton: the straight line from one joint to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Name, such as `right_forearm`.
    pub name: String,
    /// Joint at the start of the limb.
    pub from: String,
    /// Joint at the end of the limb.
    pub to: String,
}

/// Frame of the trunk, in which the directions of limbs are expressed.
#[derive(Clone, Debug, PartialEq)]
pub struct Trunk {
    /// Joint that defines the frame, such as `thorax`.
    pub joint: String,
    /// Forward axis of the skeleton in its rest pose, such as `z`.
    pub forward: Vector3<f64>,
    /// Upward axis of the skeleton in its rest pose, such as `y`. The third axis points left.
    pub up: Vector3<f64>,
}

impl Skeleton {
    /// Returns the names of the joints.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().map(|joint| joint.name.as_str())
    }

    /// Returns the names of the channels in order.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    fn joint(&self, name: &str) -> Result<usize, RecordingError> {
        self.joints.iter().position(|joint| joint.name == name).ok_or_else(|| RecordingError::NoJoint {
            name: name.to_string(),
            known: self.joint_names().collect::<Vec<_>>().join(", "),
        })
    }

    /// Poses of all joints for a sample of the channels.
    fn pose(&self, values: &[f64], out: &mut Vec<(UnitQuaternion<f64>, Vector3<f64>)>) {
        out.clear();
        for joint in &self.joints {
            let (above, origin) = joint
                .parent
                .map_or_else(|| (UnitQuaternion::identity(), Vector3::zeros()), |parent| out[parent]);
            let (mut turned, mut moved) = (UnitQuaternion::identity(), Vector3::zeros());
            for (motion, channel) in &joint.motions {
                match *motion {
                    Motion::Translate(axis) => moved[axis] += values[*channel],
                    Motion::Rotate(axis) => {
                        let axis = Unit::new_unchecked(Vector3::ith(axis, 1.0));
                        turned *= UnitQuaternion::from_axis_angle(&axis, values[*channel].to_radians());
                    }
                }
            }
            let rotation = above * joint.axes * turned * joint.axes.inverse();
            out.push((rotation, origin + above * (joint.before + moved) + rotation * joint.after));
        }
    }

    /// Computes unit directions of limbs in the frame of the trunk (x forward, y left, z up). The channels
    /// are `LIMB_x`, `LIMB_y` and `LIMB_z`. Skeleton channels missing from the recording are 0.
    ///
    /// # Errors
    /// A joint does not exist, a limb has no length, or the axes of the trunk are parallel.
    pub fn directions(
        &self,
        recording: &Recording,
        trunk: &Trunk,
        limbs: &[Limb],
    ) -> Result<Recording, RecordingError> {
        let centre = self.joint(&trunk.joint)?;
        let up = trunk.up.try_normalize(1e-9);
        let forward = up.and_then(|up| (trunk.forward - up * up.dot(&trunk.forward)).try_normalize(1e-9));
        let (Some(up), Some(forward)) = (up, forward) else {
            let expected = "not parallel to the upward axis";
            return Err(RecordingError::OutOfRange {
                name: "forward",
                value: trunk.forward.norm(),
                expected,
            });
        };
        let axes = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[
            forward,
            up.cross(&forward),
            up,
        ]));
        let ends: Vec<(usize, usize)> = limbs
            .iter()
            .map(|limb| Ok((self.joint(&limb.from)?, self.joint(&limb.to)?)))
            .collect::<Result<_, RecordingError>>()?;
        let places: Vec<Option<usize>> = self
            .channels
            .iter()
            .map(|channel| recording.names().iter().position(|name| name == channel))
            .collect();
        let mut values = DMatrix::zeros(recording.samples(), 3 * limbs.len());
        let (mut sample, mut poses) = (vec![0.0; self.channels.len()], vec![]);
        for row in 0..recording.samples() {
            for (value, place) in sample.iter_mut().zip(&places) {
                *value = place.map_or(0.0, |column| recording.values()[(row, column)]);
            }
            self.pose(&sample, &mut poses);
            let trunk = poses[centre].0 * axes;
            for (index, (from, to)) in ends.iter().enumerate() {
                let along = trunk.inverse() * (poses[*to].1 - poses[*from].1);
                let Some(direction) = along.try_normalize(1e-9) else {
                    let name = limbs[index].name.clone();
                    return Err(RecordingError::NoLength { name });
                };
                for axis in 0..3 {
                    values[(row, 3 * index + axis)] = direction[axis];
                }
            }
        }
        let names = limbs.iter().flat_map(|limb| ["x", "y", "z"].map(|axis| format!("{}_{axis}", limb.name)));
        let mut made = Recording::new(names.collect(), recording.times().to_vec(), values)?;
        (made.id, made.label) = (recording.id.clone(), recording.label.clone());
        Ok(made)
    }
}
