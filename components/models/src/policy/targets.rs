//! Conversion of a policy's outputs to joint targets of a robot.

/// Conversion of one output of the network to the target of a robot joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTarget {
    /// Index of the joint among the robot's joints.
    pub joint: usize,
    /// Factor of the output.
    pub scale: f64,
    /// Target for an output of zero.
    pub offset: f64,
}

/// Conversion of a policy's actions to joint targets of a robot, whose joints may have a different order.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTargets {
    targets: Vec<JointTarget>,
    clip: [f64; 2],
}

impl JointTargets {
    pub(super) fn new(targets: Vec<JointTarget>, clip: [f64; 2]) -> Self {
        Self { targets, clip }
    }

    /// Returns the conversion of each output, in the order of the network's outputs.
    pub fn targets(&self) -> &[JointTarget] {
        &self.targets
    }

    /// Returns an output of the network clamped to its bounds.
    pub fn clipped(&self, action: f64) -> f64 {
        action.clamp(self.clip[0], self.clip[1])
    }

    /// Returns the joint target for the value `action` of output `index` of the policy.
    ///
    /// # Panics
    ///
    /// If `index` is out of range.
    pub fn target(&self, index: usize, action: f64) -> f64 {
        let JointTarget { scale, offset, .. } = self.targets[index];
        self.clipped(action).mul_add(scale, offset)
    }

    /// Writes the joint targets of an action to `joints`, in the robot's order. Joints that the policy does
    /// not command keep their values.
    pub fn apply(&self, action: &[f64], joints: &mut [f64]) {
        for (index, (JointTarget { joint, .. }, action)) in self.targets.iter().zip(action).enumerate() {
            joints[*joint] = self.target(index, *action);
        }
    }
}
