//! `motorium can log`: what goes over buses, line by line.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use motorium::units::TimeSpan;
use motorium_can::Listener;

use super::{interrupted, refused};
use crate::exit;
use crate::out::{errln, outln};

/// Print what goes over CAN buses, in the format of `candump -L`, or keep it in a file.
///
/// Reports of controllers are kept as error frames, as candump does. The exit code is 1 if nothing was received.
///
/// Example: motorium can log can0 can1 --for 10s --output ride.log
#[derive(Debug, clap::Args)]
pub(super) struct Log {
    /// The interfaces
    #[arg(required = true)]
    interfaces: Vec<String>,
    /// Duration; until Ctrl-C if not given
    #[arg(long = "for", value_name = "TIME")]
    time: Option<TimeSpan>,
    /// End after so many frames
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// File to write to; standard output if not given
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Log {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let listener = Listener::open(self.interfaces.iter().map(String::as_str)).map_err(refused)?;
        let interrupted = interrupted()?;
        let mut file = match &self.output {
            Some(path) => {
                let file = File::create(path).with_context(|| format!("writing {}", path.display()))?;
                Some(BufWriter::new(file))
            }
            None => None,
        };
        let until = self.time.map(|time| Instant::now() + Duration::from(time));
        let mut count = 0;
        while !interrupted.load(Relaxed)
            && self.count.is_none_or(|most| count < most)
            && until.is_none_or(|until| Instant::now() < until)
        {
            let Some(record) = listener.next(Duration::from_millis(50))? else { continue };
            count += 1;
            match &mut file {
                Some(file) => writeln!(file, "{record}").context("writing the log")?,
                None => outln!("{record}"),
            }
        }
        if let Some(mut file) = file {
            file.flush().context("writing the log")?;
            errln!("{count} frames");
        }
        Ok(if count == 0 { exit::FAILED } else { ExitCode::SUCCESS })
    }
}
