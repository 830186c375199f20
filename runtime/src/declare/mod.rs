//! Declarations of a component: its ports, parameters and requirements, which are known before the component
//! runs.

mod declaration;
mod error;
mod parameter;
mod placement;
mod port;
mod robot;
mod taps;
mod warning;

pub use declaration::{Declaration, Declare};
pub use error::{ConfigError, StepError};
pub use parameter::{MAX_PARAMETER_NUMBERS, ParameterDeclaration, ParameterKind, ParameterValue};
pub use placement::{ClockKind, Placement};
pub use port::{Direction, PortDeclaration, TopicPattern};
pub use robot::{BasePose, RobotReference};
pub use taps::Taps;
pub use warning::DeclareWarning;
