//! The motorium runtime: a graph of components, each a real-time process, that share state buffers in memory.
//!
//! Start reading at [`component`], which defines the trait to implement; [`prelude`] imports everything for
//! authors of components. [`graph`] converts a graph file to a checked [`plan`], and [`schedule`] analyses
//! whether its timing is feasible. [`launcher`] starts the processes of a plan, and [`worker`] is the loop in
//! each of them. [`state`] defines the exchanged types, [`transport`] the shared memory between them.
//!
//! The modules form layers. Each uses only modules above it in this list, which a test checks:
//!
//! | modules | contents |
//! |---|---|
//! | `atomics` | the atomic operations of the protocols in shared memory, native or model-checked |
//! | [`units`], [`severity`], [`nearest`], [`state`], [`telemetry`] | plain types: time spans, state buffers, histograms |
//! | [`declare`], [`plan`] | the declaration of a component; the checked plan that all processes of a run read |
//! | [`os`], [`region`] | system calls; the control block of a run |
//! | `context`, `domain` | the clock, causality and deferred work of a component; the iceoryx2 domain of a run |
//! | `parameter`, [`transport`], [`run_folder`] | parameters; topics; the folder of a run in shared memory |
//! | [`component`] | the trait `Component` and its configuration |
//! | [`safety`] | the check of every command before it is applied |
//! | [`worker`] | the loop of a component |
//! | [`schedule`], [`graph`] | the timing analysis of a plan; conversion of a graph file to a plan |
//! | [`launcher`], [`session`] | starting, supervising and ending a run; a run driven by a program |
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
