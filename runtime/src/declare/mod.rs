//! Declarations of a component: its ports, its parameters and its needs, known before it runs.

mod declaration;
mod error;

pub use declaration::{
    BasePose, Declaration, Declare, Direction, ParameterDeclaration, ParameterKind, ParameterValue,
    PortDeclaration, RobotReference, TopicPattern,
};
pub use error::{ConfigError, StepError};
