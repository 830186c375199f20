//! `motorium can attach`: makes an adapter on a serial line an interface of the kernel.

use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::Context as _;
use motorium_can::Attached;

use super::interface::refused;
use crate::interrupt::interrupted;
use crate::out::outln;

/// Attach an slcan adapter on a serial line as a kernel interface, until Ctrl-C.
///
/// Sets the bitrate of the adapter, attaches the kernel driver to the line, brings the interface up, and
/// prints its name. Needs network administration rights (`sudo`), and the driver: `sudo modprobe slcan`.
///
/// Example: motorium can attach /dev/ttyACM0
#[derive(Debug, clap::Args)]
pub(super) struct Attach {
    /// The serial line, such as `/dev/ttyACM0`
    line: String,
    /// Bits per second of the bus
    #[arg(long, default_value_t = 1_000_000)]
    bitrate: u32,
}

impl Attach {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let stop = interrupted()?;
        let attached = Attached::open(&self.line, self.bitrate).map_err(refused)?;
        let name = attached.name();
        attached
            .bring_up()
            .with_context(|| format!("`{name}` cannot be brought up: run this with `sudo`"))?;
        outln!("{name}");
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(ExitCode::SUCCESS)
    }
}
