//! Forms of the pose error.

/// Form of the pose error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseError {
    /// Logarithm of the target's pose in the frame, with its exact derivative: the frame moves along a screw
    /// motion.
    #[default]
    Logarithm,
    /// Difference of the positions, and rotation vector, with the geometric Jacobian: the origin of the frame
    /// moves along a straight line.
    Geometric,
}
