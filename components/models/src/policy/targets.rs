//! Conversion of a policy's outputs to joint targets of a robot.

/// Conversion of one output of the network to a robot joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTarget {
    /// Index of the joint in the robot.
    pub joint: usize,
    /// Factor of the action.
    pub scale: f64,
    /// Target of a zero action.
    pub offset: f64,
}

/// Conversion of actions in the order of a policy to joint targets in the order of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTargets {
    targets: Vec<JointTarget>,
    clip: [f64; 2],
}

impl JointTargets {
    pub(super) fn new(targets: Vec<JointTarget>, clip: [f64; 2]) -> Self {
        Self { targets, clip }
    }

    /// Returns the joint of each output, in the order of the policy.
    pub fn targets(&self) -> &[JointTarget] {
        &self.targets
    }

    /// Returns an output of the network, clamped to its bounds.
    pub fn clipped(&self, action: f64) -> f64 {
        action.clamp(self.clip[0], self.clip[1])
    }

    /// Returns the target of output `index` of the policy.
    ///
    /// # Panics
    ///
    /// If the index is out of range.
    pub fn target(&self, index: usize, action: f64) -> f64 {
        let JointTarget { scale, offset, .. } = self.targets[index];
        self.clipped(action).mul_add(scale, offset)
    }

    /// Writes the targets of an action to the joints of the robot; other joints keep their values.
    pub fn apply(&self, action: &[f64], joints: &mut [f64]) {
        for (index, (JointTarget { joint, .. }, action)) in self.targets.iter().zip(action).enumerate() {
            joints[*joint] = self.target(index, *action);
        }
    }
}
