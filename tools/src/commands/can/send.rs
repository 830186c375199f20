//! `motorium can send`: sends frames from the command line, or a log, to a bus.

use std::io::{BufRead as _, Read as _};
use std::num::NonZeroU64;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use motorium::units::TimeSpan;
use motorium_can::{Record, RecordError, Sender};

use super::interface::refused;
use crate::exit;
use crate::interrupt::interrupted;
use crate::out::errln;

/// Send frames onto a CAN bus, or play a log.
///
/// A frame is written as candump does: `123#0102`, `123##10102` (CAN FD), `00000123#01` (29 bits), `123#R`
/// (remote). A log is played with its original timing. Enabled drives follow commands addressed to them, so
/// the robot may move.
///
/// The exit code is 3 if a frame or a line of the log is invalid.
///
/// Example: motorium can send can0 001#FFFFFFFFFFFFFFFD
#[derive(Debug, clap::Args)]
pub(super) struct Send {
    /// The interface, such as `can0`, or `unix:NAME` of a simulated bus
    interface: String,
    /// The frames
    #[arg(required_unless_present = "log")]
    frames: Vec<String>,
    /// A log in the format of `candump -L` to play instead; `-` for standard input
    #[arg(long, value_name = "FILE", conflicts_with = "frames")]
    log: Option<PathBuf>,
    /// Repeat all frames after this time, `--count` times or until Ctrl-C
    #[arg(long, value_name = "TIME", conflicts_with = "log", allow_hyphen_values = true)]
    every: Option<TimeSpan>,
    /// Number of repetitions
    #[arg(long, value_name = "N", requires = "every")]
    count: Option<NonZeroU64>,
}

impl Send {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(
            self.every.is_none_or(|every| every.ns > 0),
            "`--every` is 0, so the frames would occupy the whole bus: write a time such as \"10 ms\""
        );
        let records = match self.records()? {
            Ok(records) => records,
            Err((place, error)) => {
                errln!("{} {place}{error}\n  {}", crate::style::error("error:"), RecordError::ADVICE);
                return Ok(exit::invalid());
            }
        };
        let mut sender = Sender::open(&self.interface).map_err(refused)?;
        let interrupted = interrupted()?;
        let is_over = || interrupted.load(std::sync::atomic::Ordering::Relaxed);
        let began = Instant::now();
        let first_us = records.first().map_or(0, Record::time_us);
        for round in 0_u64.. {
            for record in &records {
                if self.log.is_some() {
                    wait_until(
                        began + Duration::from_micros(record.time_us().saturating_sub(first_us)),
                        &is_over,
                    );
                }
                if is_over() {
                    return Ok(ExitCode::SUCCESS);
                }
                sender.send(record)?;
            }
            let Some(every) = self.every else { break };
            if self.count.is_some_and(|count| round + 1 == count.get()) {
                break;
            }
            wait_until(began + Duration::from(every) * (round as u32 + 1), &is_over);
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Returns the frames, or the position of the first invalid one with the reason.
    fn records(&self) -> anyhow::Result<Result<Vec<Record>, (String, RecordError)>> {
        let Some(path) = &self.log else {
            let frame = |frame: &String| {
                Record::of_frame(frame, &self.interface).map_err(|error| (String::new(), error))
            };
            return Ok(self.frames.iter().map(frame).collect());
        };
        let mut text = String::new();
        if path.as_os_str() == "-" {
            std::io::stdin().lock().read_to_string(&mut text).context("reading standard input")?;
        } else {
            text = crate::input::text(path)?;
        }
        let line = |(index, line): (usize, String)| {
            let read = Record::of_log(&line);
            read.map_err(|error| (format!("{}:{}: ", path.display(), index + 1), error)).transpose()
        };
        let lines = text.as_bytes().lines().map_while(Result::ok).enumerate();
        Ok(lines.filter_map(line).collect())
    }
}

/// Sleeps until then, in intervals short enough to be interrupted.
fn wait_until(then: Instant, is_over: &impl Fn() -> bool) {
    while !is_over() {
        let left = then.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return;
        }
        std::thread::sleep(left.min(Duration::from_millis(50)));
    }
}
