//! The error of reading a policy.

/// Error of an invalid policy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The file is not valid TOML of the expected form.
    #[error("line {line}, column {column}: {message}")]
    Parse {
        /// Line, counted from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Description of the defect and of the expected syntax.
        message: String,
    },
    /// A value is out of range.
    #[error("`{key}`: {message}")]
    Value {
        /// Key of the value.
        key: String,
        /// Description of the value found and the value expected.
        message: String,
    },
    /// The robot lacks joints of the policy.
    #[error("{message}; help: rename the joints in `action.joints`, in the order of the network's outputs")]
    Joints {
        /// Description of the missing joints.
        message: String,
    },
}
