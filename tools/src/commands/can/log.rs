//! `motorium can log`: frames of buses, line by line.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use motorium::units::TimeSpan;
use motorium_can::{Listener, Record, RecordError};

use super::interface::refused;
use super::words::{Interpreter, Words};
use crate::failure::{Failure, Kind};
use crate::interrupt::interrupted;
use crate::out::{errln, outln};
use crate::output::refuse_existing;

/// Print the frames of CAN buses, in the format of `candump -L`, or write them to a file.
///
/// Controller reports are written as error frames, as by candump. With `--dbc`, each printed line ends with
/// the decoded signals, after `::`. The exit code is 1 if nothing was received, and 3 if a line of the log or
/// the database is invalid.
///
/// Example: motorium can log can0 can1 --for 10s --output ride.log
#[derive(Debug, clap::Args)]
pub(super) struct Log {
    /// The interfaces, such as `can0`, or `unix:NAME` of a simulated bus
    #[arg(required_unless_present = "read")]
    interfaces: Vec<String>,
    /// Print an existing log instead; `-` for standard input
    #[arg(long, value_name = "FILE", conflicts_with_all = ["interfaces", "time", "output"])]
    read: Option<PathBuf>,
    /// Duration [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", allow_hyphen_values = true)]
    time: Option<TimeSpan>,
    /// Stop after this number of frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// File to write to [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    overwrite: bool,
    #[command(flatten)]
    words: Words,
}

impl Log {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let interpreter = match self.words.interpreter() {
            Ok(interpreter) => interpreter,
            Err(code) => return Ok(code),
        };
        if let Some(path) = &self.read {
            return self.print_log(path, &interpreter);
        }
        self.output.iter().try_for_each(|output| refuse_existing(output, self.overwrite))?;
        let mut listener = Listener::open(self.interfaces.iter().map(String::as_str)).map_err(refused)?;
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
                None => print(&record, &interpreter),
            }
        }
        if let Some(mut file) = file {
            file.flush().context("writing the log")?;
            errln!("{count} frames");
        }
        if count == 0 {
            let advice = "`motorium can monitor` shows the state of an interface";
            let words =
                format!("received no frames on {}, expected at least one", self.interfaces.join(", "));
            return Ok(Failure::new(Kind::Failed, format!("{words}; {advice}")).help(advice).report());
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Prints an existing log.
    fn print_log(&self, path: &Path, interpreter: &Interpreter) -> anyhow::Result<ExitCode> {
        let reading = || format!("reading {}", path.display());
        let lines: Box<dyn BufRead> = if path == Path::new("-") {
            Box::new(std::io::stdin().lock())
        } else {
            // A pipe or a device may never end.
            let metadata = std::fs::metadata(path).with_context(reading)?;
            anyhow::ensure!(
                metadata.is_file(),
                "reading {}: it is a folder, a device or a pipe, expected a regular file; standard input is `-`",
                path.display()
            );
            Box::new(BufReader::new(File::open(path).with_context(reading)?))
        };
        let mut count = 0;
        for (index, line) in lines.lines().enumerate() {
            let line = line.with_context(reading)?;
            if line.trim().is_empty() {
                continue;
            }
            if self.count.is_some_and(|most| count >= most) {
                break;
            }
            match Record::of_log(&line) {
                Ok(Some(record)) => print(&record, interpreter),
                Ok(None) => continue,
                Err(error) => {
                    let place = format!("{}, line {}, column {}", path.display(), index + 1, error.column);
                    let advice = RecordError::LOG_ADVICE;
                    let failure = Failure::new(Kind::Invalid, format!("{place}: {error}; {advice}"));
                    return Ok(failure.help(advice).report());
                }
            }
            count += 1;
        }
        if count == 0 {
            let advice = RecordError::LOG_ADVICE;
            let words = format!("{}: found no frames, expected at least one; {advice}", path.display());
            return Ok(Failure::new(Kind::Failed, words).help(advice).report());
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Prints a record, decoded if the database contains its message.
fn print(record: &Record, interpreter: &Interpreter) {
    match interpreter.decode(record) {
        Some(words) => outln!("{record} :: {words}"),
        None => outln!("{record}"),
    }
}
