//! The `motorium` command.

use std::process::ExitCode;

use motorium::telemetry::CountingAllocator;

/// Counts heap allocations, so that built-in components can prove that their steps make none.
#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn main() -> ExitCode {
    motorium_tools::main()
}
