//! The names that component authors need: `use motorium::prelude::*;`.

pub use crate::component::{Checkpoint, Component, ConfigureError, Episode, EpisodeEnd, Setup, Tick};
pub use crate::declare::{ConfigError, Declare, RobotReference, StepError};
pub use crate::state::{
    BaseState, EmergencyStop, ImuSample, JointCommand, JointState, MAX_JOINTS, Odometry, Phase, PoseTarget,
    Stamp, StateBuffer, TwistTarget, Wrench,
};
pub use crate::transport::{Input, Loan, Output, Parameter, Reading};
pub use crate::units::TimeSpan;
