//! `motorium bench`: measures motorium on this machine.

mod compare;
mod kill;
mod latency;
mod peers;
mod ratchet;
mod recording;
mod table;

use std::process::ExitCode;

/// Measure motorium on this machine, compare two measurements, inject faults, and measure the cost of
/// recording.
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
    Recording(recording::Recording),
}

impl Bench {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.what {
            What::Latency(latency) => latency.run(),
            What::Compare(compare) => compare.run(),
            What::Kill(kill) => kill.run(),
            What::Recording(recording) => recording.run(),
        }
    }
}
