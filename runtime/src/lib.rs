//! The motorium runtime: a graph of components, each its own real-time process, sharing state buffers in memory.
//!
//! Start reading at [`component`]: it holds the trait a user implements; [`prelude`] imports all that an author of a
//! component needs. [`graph`] turns a graph file into a checked [`plan`], [`schedule`] computes whether its times can
//! hold, [`launcher`] turns a plan into running processes, and [`worker`] is the loop inside each of them. [`state`]
//! holds the types they exchange, [`transport`] the shared memory they exchange them through.
//!
//! The modules form layers. Bottom up, each uses only those above it in this list; a test draws the arrows:
//!
//! | modules | contents |
//! |---|---|
//! | `atomics` | the atomic operations of the protocols in shared memory, native or model-checked |
//! | [`units`], [`severity`], [`nearest`], [`state`], [`telemetry`] | plain types: time spans, state buffers, histograms |
//! | [`declare`], [`plan`] | the declaration of a component; the checked plan that all processes of a run read |
//! | [`os`], [`region`] | system calls; the control block of a run |
//! | `context`, `domain` | the clock, causality and deferred work of a component; the iceoryx2 domain of a run |
//! | `parameter`, [`transport`], [`run_folder`] | parameters; topics; the folder of a run in shared memory |
//! | [`component`] | the trait `Component` and what it is configured with |
//! | [`safety`] | the check of every command before it is applied |
//! | [`worker`] | the loop of a component |
//! | [`schedule`], [`graph`] | the analysis of a plan's times; from a graph file to a plan |
//! | [`launcher`], [`session`] | starting, watching and ending a run; a run that a program drives |
//! | [`program`] | the main function of a component's program |
//! | `testing` | graphs in tests and benches (feature `testing`) |
//!
//! [`graph`], [`schedule`], [`launcher`] and [`session`] come with the feature `launcher`, which is on by default. A program
//! of components needs none of them: with `default-features = false` they are not compiled.

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
