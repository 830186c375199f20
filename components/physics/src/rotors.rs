//! Rotors: drives that pull on the robot instead of turning a joint.

use motorium_robots::{FrameId, Model, Profile, Spin, UnknownFrame};

use crate::JointSetpoint;

/// A rotor that applies thrust along the z axis of its frame. The effort in the drive's command is the thrust
/// \[N\], from zero to `max_thrust`.
#[derive(Clone, Debug, PartialEq)]
pub struct RotorDrive {
    /// Name of the drive.
    pub name: String,
    /// Frame to which the thrust is applied.
    pub frame: FrameId,
    /// Maximum thrust \[N\].
    pub max_thrust: f64,
    /// Drag torque about z per unit of thrust \[m\], positive if the torque rotates the robot
    /// counterclockwise.
    pub torque_per_thrust: f64,
}

impl RotorDrive {
    /// Returns the rotors of a profile, sorted by name.
    ///
    /// # Errors
    ///
    /// [`UnknownFrame`] if the profile names a frame that `model` does not have.
    pub fn from_profile(model: &Model, profile: &Profile) -> Result<Vec<Self>, UnknownFrame> {
        let rotors = profile.rotors.iter().map(|(name, rotor)| {
            let sign = if rotor.spin == Spin::Clockwise { 1.0 } else { -1.0 };
            Ok(Self {
                name: name.clone(),
                frame: model.frame(&rotor.frame)?,
                max_thrust: rotor.max_thrust,
                torque_per_thrust: sign * rotor.torque_per_thrust,
            })
        });
        rotors.collect()
    }

    /// Returns the thrust \[N\]: the commanded effort, clamped to the range of the rotor.
    pub(crate) fn thrust(&self, command: &JointSetpoint) -> f64 {
        command.effort.clamp(0.0, self.max_thrust)
    }
}
