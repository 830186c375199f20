//! `motorium can monitor`: a live table of bus traffic.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use motorium::units::TimeSpan;
use motorium_can::{Interface, Listener, Rates};

use super::interface::refused;
use super::traffic::{BusRow, Traffic};
use super::words::Words;
use crate::interrupt::interrupted;
use crate::out::{out, outln};
use crate::report::table;
use crate::screen::is_drawable;

/// Show the traffic of CAN buses: frames, rates, ages and errors, by identifier.
///
/// On a terminal, the table is redrawn in place; elsewhere, it is printed once per interval. With `--dbc`,
/// the newest frame of each identifier is decoded.
///
/// Example: motorium can monitor can0 --bitrate 1000000
#[derive(Debug, clap::Args)]
pub(super) struct Monitor {
    /// The interfaces, such as `can0`, or `unix:NAME` of a simulated bus [default: the kernel's interfaces
    /// that are up]
    interfaces: Vec<String>,
    /// Bits per second, for computing the load [default: the interface's]
    #[arg(long, value_name = "BITS")]
    bitrate: Option<u32>,
    /// Bits per second of the data of CAN FD frames
    #[arg(long, value_name = "BITS", requires = "bitrate")]
    data_bitrate: Option<u32>,
    /// Time between two tables
    #[arg(long, value_name = "TIME", default_value = "1s", allow_hyphen_values = true)]
    interval: TimeSpan,
    /// Duration [default: until Ctrl-C]
    #[arg(long = "for", value_name = "TIME", allow_hyphen_values = true)]
    time: Option<TimeSpan>,
    /// Print each table as a line of JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    words: Words,
}

impl Monitor {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let interpreter = match self.words.interpreter() {
            Ok(interpreter) => interpreter,
            Err(code) => return Ok(code),
        };
        let all = Interface::all()?;
        let mut names = self.interfaces.clone();
        if names.is_empty() {
            names.extend(
                all.iter().filter(|interface| interface.is_up).map(|interface| interface.name.clone()),
            );
            anyhow::ensure!(!names.is_empty(), "no CAN interface is up: `motorium can scan` lists them");
        }
        let mut listener = Listener::open(names.iter().map(String::as_str)).map_err(refused)?;
        let interrupted = interrupted()?;
        let mut traffic = Traffic::default();
        for name in &names {
            let interface = all.iter().find(|interface| interface.name == *name);
            let nominal = self.bitrate.or(interface.and_then(|interface| interface.bitrate));
            let fast = self.data_bitrate.or(interface.and_then(|interface| interface.data_bitrate));
            traffic.follow(name, nominal.map(|nominal| Rates { nominal, fast: fast.unwrap_or(nominal) }));
        }
        let interval = Duration::from(self.interval).max(Duration::from_millis(100));
        let until = self.time.map(|time| Instant::now() + Duration::from(time));
        let redraws = !self.json && std::io::stdout().is_terminal() && is_drawable();
        let mut drawn = Instant::now();
        loop {
            let is_over = interrupted.load(Relaxed) || until.is_some_and(|until| Instant::now() >= until);
            if drawn.elapsed() >= interval || is_over {
                let seconds = drawn.elapsed().as_secs_f64().max(1e-3);
                drawn = Instant::now();
                let rows = traffic.table(now_us(), seconds);
                if self.json {
                    outln!("{}", serde_json::to_string(&rows)?);
                } else {
                    if redraws {
                        // move the cursor to the upper left corner and clear everything below
                        out!("\x1b[H\x1b[2J");
                    }
                    out!("{}", describe(&rows));
                    let _ = std::io::stdout().flush();
                }
            }
            if is_over {
                return Ok(ExitCode::SUCCESS);
            }
            let left = interval.saturating_sub(drawn.elapsed()).min(Duration::from_millis(50));
            if let Some(record) = listener.next(left)? {
                traffic.take(&record, interpreter.decode(&record).as_ref());
            }
        }
    }
}

fn now_us() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |now| now.as_micros() as u64)
}

fn describe(buses: &[BusRow]) -> String {
    let mut text = String::new();
    for bus in buses {
        let load = bus.load.map_or_else(String::new, |load| format!(", load {:.1} %", 100.0 * load));
        let counters =
            bus.counters.map_or_else(String::new, |[tx, rx]| format!(", error counters tx {tx} rx {rx}"));
        text += &format!(
            "{}  {:.0} frames/s{load}, {} errors{counters}{}\n",
            bus.interface,
            bus.rate_hz,
            bus.errors,
            bus.error.as_ref().map_or_else(String::new, |error| format!(" ({error})"))
        );
        // decoded messages have a separate column
        let has_words = bus.ids.iter().any(|row| row.message.is_some());
        let mut rows = if has_words {
            table(["  id", "frames", "Hz", "age ms", "data", "says"])
        } else {
            table(["  id", "frames", "Hz", "age ms", "data"])
        };
        for row in &bus.ids {
            let mut cells = vec![
                format!("  {}", row.id),
                row.frames.to_string(),
                format!("{:.1}", row.rate_hz),
                format!("{:.1}", row.age_ms),
                row.data.clone(),
            ];
            if has_words {
                cells.push(row.text.clone());
            }
            rows.add_row(cells);
        }
        text += &format!("{}\n", rows.trim_fmt());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::traffic::IdRow;
    use super::*;

    #[test]
    fn table_shows_load_error_counters_and_latest_report() {
        let ids = vec![IdRow {
            id: "0x123".into(),
            frames: 7,
            rate_hz: 3.5,
            age_ms: 12.0,
            data: "01 02".into(),
            message: Some("Supply".into()),
            text: "Supply(Voltage: 24 V)".into(),
            ..IdRow::default()
        }];
        let bus = BusRow {
            interface: "can0".into(),
            frames: 7,
            rate_hz: 3.5,
            load: Some(0.452),
            errors: 2,
            error: Some("bus off".into()),
            counters: Some([255, 0]),
            ids,
        };
        let text = describe(&[bus]);
        for part in [
            "load 45.2 %",
            "2 errors",
            "tx 255 rx 0 (bus off)",
            "0x123",
            "12.0",
            "01 02",
            "says",
            "Voltage: 24 V",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}
