//! Declarations of a component: its ports, its parameters and its needs, known before it runs.

mod declaration;
mod error;
mod robot;

pub use declaration::{
    Declaration, Declare, Direction, ParameterDeclaration, ParameterKind, ParameterValue, PortDeclaration,
    TopicPattern,
};
pub use error::{ConfigError, StepError};
pub use robot::{BasePose, RobotReference};
