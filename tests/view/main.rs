//! `motorium view` of running graphs: the protocol as used by third-party viewers, and the page in a headless
//! browser.

mod bundle;
mod client;
mod mjcf;
mod never_seen;
mod page;
mod pictures;
mod playback;
#[path = "../../tools/tests/command/program.rs"]
mod program;
mod protocol;
#[allow(dead_code, reason = "the tests of graphs use the rest of this file")]
#[path = "../graphs/support.rs"]
mod support;
mod viewer;

/// The `motorium` command under test.
const MOTORIUM: &str = env!("CARGO_BIN_EXE_motorium-under-test");
/// The viewer under test.
const VIEW: &str = env!("CARGO_BIN_EXE_view-under-test");
