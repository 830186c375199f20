//! `motorium bench`: measures motorium on this machine.

mod compare;
mod kill;
mod latency;
mod peers;
mod ratchet;
mod table;

use std::process::ExitCode;

/// Measure motorium on this machine, compare two such measurements, and make faults.
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
    Kill(kill::Kill),
}

impl Bench {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.what {
            What::Latency(latency) => latency.run(),
            What::Compare(compare) => compare.run(),
            What::Kill(kill) => kill.run(),
        }
    }
}
