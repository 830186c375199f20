//! The viewer, built for the tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    motorium_view::main()
}
