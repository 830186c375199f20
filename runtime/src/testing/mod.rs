//! Graphs, sources and probes for tests of components. Requires the feature `testing`.
//!
//! A test builds a [`Graph`] in code, or extends the text of a graph file, and runs the graph in its own
//! process. Every component is a thread. By default the graph runs in lockstep, so that a simulated second
//! takes milliseconds and always gives identical numbers. [`Source`] publishes the values of a closure,
//! [`Function`] maps an input to an output, and [`Probe`] records its input. A test of a real-time graph
//! reserves the [`machine`].
//!
//! ```
//! use motorium::prelude::*;
//! use motorium::testing::{Graph, Instance, Probe, Source};
//! # #[derive(serde::Deserialize, schemars::JsonSchema)]
//! # struct MirrorConfig {}
//! # struct Mirror { state: Input<JointState>, mirrored: Output<JointState> }
//! # impl Component for Mirror {
//! #     const KIND: &'static str = "example.mirror";
//! #     const SUMMARY: &'static str = "reverses velocities";
//! #     type Config = MirrorConfig;
//! #     fn declare(_: &MirrorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
//! #         declare.input::<JointState>("state", "joint state to mirror");
//! #         declare.output::<JointState>("mirrored", "joint state, velocities reversed");
//! #         Ok(())
//! #     }
//! #     fn configure(_: MirrorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
//! #         Ok(Self { state: setup.input("state")?, mirrored: setup.output("mirrored")? })
//! #     }
//! #     fn step(&mut self, _: &Tick) -> Result<(), StepError> {
//! #         let Some(state) = self.state.latest() else { return Ok(()) };
//! #         let mut mirrored = self.mirrored.loan()?;
//! #         *mirrored = *state;
//! #         mirrored.velocity_mut().iter_mut().for_each(|v| *v = -*v);
//! #         mirrored.publish()
//! #     }
//! # }
//!
//! let mirrored = Probe::<JointState>::for_topic("mirrored");
//! let report = Graph::new("mirror")
//!     .with(Source::new("robot", "state", |tick| {
//!         let mut state = JointState::default();
//!         state.set_count(1);
//!         state.velocity_mut()[0] = tick.index as f64;
//!         Some(state)
//!     }))
//!     .with(
//!         Instance::of::<Mirror>("mirror")
//!             .trigger("state")
//!             .subscribe("state", "state")
//!             .publish("mirrored", "mirrored"),
//!     )
//!     .with(&mirrored)
//!     .run("10 ms")
//!     .unwrap();
//! assert_eq!(mirrored.samples().last().unwrap().value.velocity(), [-9.0]);
//! assert_eq!(report.components.len(), 3);
//! ```

mod allocations;
mod closure;
mod graph;
mod instance;
mod machine;
mod parts;
mod topics;

pub use allocations::allocations;
pub use graph::{Graph, RunError};
pub use instance::Instance;
pub use machine::machine;
pub use parts::{Function, Probe, Sample, Source};
pub use topics::{Endpoint, TopicSet, TopicSetError};
