//! Whole graphs: real processes, real signals, real faults. All tests are in one program, so that they share
//! their helpers and are linked once. Every real-time test uses the machine exclusively.

mod access;
mod bridge;
mod by_hand;
mod chunks;
mod commands;
mod corruption;
mod dashboard;
mod datasets;
mod driving;
mod emergencies;
mod events;
mod exhaustion;
mod exports;
mod exposition;
mod faults;
mod feeding;
mod forks;
mod gaits;
mod gotos;
mod gravity;
mod hangs;
mod installed;
mod latches;
mod looking_on;
mod moves;
mod official;
mod places;
#[path = "../../tools/tests/command/program.rs"]
mod program;
mod programs;
mod recorders;
mod recording;
mod replays;
mod runs;
mod safe_stops;
mod scores;
mod sessions;
mod shortfalls;
mod siblings;
mod sockets;
mod supervisors;
mod support;
mod top;
mod trace;

/// The `motorium` command under test.
const MOTORIUM: &str = env!("CARGO_BIN_EXE_motorium-under-test");
