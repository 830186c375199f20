//! `motorium top`: timing of a running graph, read from its shared memory and from `/proc`.

mod compare;
mod data;
#[cfg(test)]
mod example;
mod interval;
mod layout;
mod order;
mod plain;
mod screen;
mod view;

use std::io::IsTerminal as _;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context as _;
use motorium::units::TimeSpan;

use crate::interrupt::interrupted;
use crate::metrics::{Address, Sample, Server};
use crate::out::{errln, out, outln};
use crate::runs::{LivingRun, newest};
use data::Span;
pub(super) use data::Top as Data;
use interval::{End, LONGEST, SHORTEST, wait};
use order::Order;
use view::View;

/// Show the timing of a running graph: rates, lateness, latencies, misses and their causes, cores,
/// memory.
///
/// The command reads shared memory and /proc on the shared cores. It does not disturb the components.
///
/// Example: motorium top --once --json
#[derive(Debug, clap::Args)]
pub(crate) struct Top {
    /// Run to show: its id, a prefix of the id, or the name of its graph [default: the newest]
    #[arg(value_name = "RUN", add = crate::complete::runs())]
    name: Option<String>,
    /// Same as RUN, by the option of other commands
    #[arg(long = "run", value_name = "ID", conflicts_with = "name", add = crate::complete::runs())]
    run: Option<String>,
    /// Time between two readings
    #[arg(long, value_name = "TIME", default_value = "1s", allow_hyphen_values = true)]
    interval: TimeSpan,
    /// Show times and counts of the last interval instead of the whole run
    #[arg(long)]
    last: bool,
    /// Sort key of components
    #[arg(long, value_enum, default_value_t = Order::Graph)]
    sort: Order,
    /// Print one table, over one interval, and exit
    #[arg(long)]
    once: bool,
    /// Print JSON: one object per line and interval, or one indented object with --once. Each contains the
    /// whole run and the last interval, in the order of the graph
    #[arg(long, conflicts_with_all = ["sort", "last"])]
    json: bool,
    /// Serve Prometheus metrics, on a port of this machine (`9464`) or an address (`0.0.0.0:9464`)
    #[arg(long, value_name = "ADDR", conflicts_with = "once")]
    metrics: Option<Address>,
}

impl Top {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let interval = Duration::from_nanos(self.interval.ns);
        anyhow::ensure!(
            (SHORTEST..=LONGEST).contains(&interval),
            "--interval is {interval:?}, expected 100 ms to 1 h"
        );
        let run = open(self.name.as_deref().or(self.run.as_deref()))?;
        if let Some(address) = self.metrics {
            let server = Server::bind(address)?;
            errln!("metrics at {}", server.url());
            server.serve(open(Some(run.folder.id()))?).context("starting the thread that serves metrics")?;
        }
        run.stand_aside();
        let interrupted = interrupted()?;
        let span = if self.last { Span::Interval } else { Span::Run };
        let view = View { order: self.sort, reversed: false, span };
        if self.once {
            return once(&run, interval, self.json, view, &interrupted);
        }
        let end = if !self.json && std::io::stdout().is_terminal() {
            screen::follow(&run, interval, view, &interrupted)?
        } else {
            follow(&run, interval, self.json, view.order, &interrupted)?
        };
        if end == End::RunOver {
            errln!("run {} is over", run.folder.id());
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn open(run: Option<&str>) -> anyhow::Result<LivingRun> {
    let folder = newest(run)?;
    let (plan, region) = (folder.plan()?, folder.region()?);
    Ok(LivingRun { folder, plan, region })
}

fn once(
    run: &LivingRun,
    interval: Duration,
    json: bool,
    view: View,
    interrupted: &AtomicBool,
) -> anyhow::Result<ExitCode> {
    let before = Sample::take(run);
    match wait(run, interval, interrupted) {
        None => {}
        Some(End::Asked) => anyhow::bail!("interrupted before the interval was over"),
        Some(End::RunOver) => anyhow::bail!("run {} ended before the interval was over", run.folder.id()),
    }
    let top = Data::between(run, &before, &Sample::take(run));
    if json {
        outln!("{}", serde_json::to_string_pretty(&top)?);
    } else {
        out!("{}", plain::tables(&top, view));
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a line per interval until the run is over or interrupted.
fn follow(
    run: &LivingRun,
    interval: Duration,
    json: bool,
    order: Order,
    interrupted: &AtomicBool,
) -> anyhow::Result<End> {
    let mut before = Sample::take(run);
    loop {
        if let Some(end) = wait(run, interval, interrupted) {
            return Ok(end);
        }
        let now = Sample::take(run);
        let top = Data::between(run, &before, &now);
        before = now;
        let line = if json { serde_json::to_string(&top)? } else { plain::line(&top, order) };
        // The reader of a pipe may have ended (`| head -3`).
        let mut out = std::io::stdout().lock();
        let written = std::io::Write::write_all(&mut out, format!("{line}\n").as_bytes());
        match written.and_then(|()| std::io::Write::flush(&mut out)) {
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => return Ok(End::Asked),
            other => other?,
        }
    }
}
