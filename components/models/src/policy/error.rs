//! The error of reading a policy.

/// The policy is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The file does not parse.
    #[error("line {line}, column {column}: {message}")]
    Parse {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The defect and the expected syntax.
        message: String,
    },
    /// A value is out of range.
    #[error("`{key}`: {message}")]
    Value {
        /// The key.
        key: String,
        /// The value found and the value expected.
        message: String,
    },
    /// The joints of the policy and the robot differ.
    #[error("{message}; help: rename the joints in `action.joints`, in the order of the network's outputs")]
    Joints {
        /// The missing joints.
        message: String,
    },
}
