//! `motorium bench`: measures motorium on this machine.

mod compare;
mod latency;
mod peers;
mod ratchet;
mod table;

use std::process::ExitCode;

/// Measure motorium on this machine, and compare two such measurements.
///
/// Example: motorium bench latency --quick
#[derive(Debug, clap::Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Latency(latency::Latency),
    Compare(compare::Compare),
}

impl Bench {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.what {
            What::Latency(latency) => latency.run(),
            What::Compare(compare) => compare.run(),
        }
    }
}
