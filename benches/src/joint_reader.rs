//! Component that measures the lowest cost (floor) of a triggered step: it only reads a joint state.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::JointState;
use motorium::transport::Input;
use motorium::worker::Kind;
use schemars::JsonSchema;
use serde::Deserialize;

/// Returns the kind of the component, for a host program.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub(crate) fn kind() -> Kind {
    Kind::of::<JointReader>()
}

/// The `config` table of `bench.joint_reader`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointReaderConfig {}

/// Reads the newest joint state.
pub(crate) struct JointReader {
    state: Input<JointState>,
}

impl Component for JointReader {
    const KIND: &'static str = "bench.joint_reader";
    const SUMMARY: &'static str = "reads a joint state and does nothing else, for benchmarks";
    type Config = JointReaderConfig;

    fn declare(_: &JointReaderConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("joint_state", "the joint state to read");
        Ok(())
    }

    fn configure(_: JointReaderConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { state: setup.input("joint_state")? })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        core::hint::black_box(self.state.latest().map(|state| state.count()));
        Ok(())
    }
}
