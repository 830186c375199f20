//! The viewer of motorium, started by `motorium view`.

use std::process::ExitCode;

fn main() -> ExitCode {
    motorium_view::main()
}
