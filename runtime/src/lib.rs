//! The motorium runtime: graphs of components, each a real-time process, that share state in memory.
//!
//! Start reading at [`component`], which defines the trait to implement; [`prelude`] imports everything that
//! component authors need. [`graph`] converts a graph file to a checked [`plan`], and [`schedule`] checks
//! that its timing is feasible. [`launcher`] starts the processes of a plan, and [`worker`] is the loop in
//! each of them. [`state`] defines the exchanged types, [`transport`] the shared memory that carries them.
//!
//! The modules form layers. Each module only uses modules above it in this list; a test checks this.
//!
//! | modules | contents |
//! |---|---|
//! | `atomics` | the atomic operations of the protocols in shared memory, native or model-checked |
//! | [`units`], [`severity`], [`nearest`], [`state`], [`telemetry`] | times, messages, histograms |
//! | [`declare`], [`plan`] | declarations of components; the checked plan of a run |
//! | [`os`], [`region`] | system calls; the control block of a run |
//! | `context`, `domain` | clock, causality and deferred work of a component; the iceoryx2 domain of a run |
//! | `parameter`, [`transport`], [`run_folder`] | parameters; topics; the folder of a run in shared memory |
//! | [`component`] | the trait `Component` and the set-up of components |
//! | [`safety`] | checks of every command before it is applied |
//! | [`worker`] | the loop of a component |
//! | [`schedule`], [`graph`] | the timing analysis of a plan; conversion of a graph file to a plan |
//! | [`launcher`], [`session`] | starting, supervising and ending runs; runs driven by a program |
//! | [`program`] | the main function of a component's program |
//! | `testing` | graphs in tests and benches (feature `testing`) |
//!
//! [`graph`], [`schedule`], [`launcher`] and [`session`] require the feature `launcher`, which is enabled by
//! default. A component program does not need them and can use `default-features = false`.

#![cfg_attr(
    not(feature = "launcher"),
    allow(dead_code, unused_imports, reason = "parts that only the launcher uses")
)]

mod atomics;
pub mod component;
mod context;
pub mod declare;
mod domain;
#[cfg(feature = "launcher")]
pub mod graph;
#[cfg(feature = "launcher")]
pub mod launcher;
#[cfg(test)]
mod model;
pub mod nearest;
pub mod os;
mod parameter;
pub mod plan;
pub mod prelude;
pub mod program;
pub mod raw;
pub mod region;
pub mod run_folder;
pub mod safety;
#[cfg(feature = "launcher")]
pub mod schedule;
#[cfg(feature = "launcher")]
pub mod session;
pub mod severity;
pub mod state;
pub mod telemetry;
#[cfg(feature = "testing")]
pub mod testing;
pub mod transport;
pub mod units;
pub mod worker;
