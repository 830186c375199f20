//! The `motorium` command, built for the tests.

use std::process::ExitCode;

use motorium::telemetry::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    motorium_tools::main()
}
