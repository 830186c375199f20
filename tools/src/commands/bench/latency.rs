//! `motorium bench latency`: measures the latencies of motorium next to the floors of the machine (the lowest
//! possible latencies) and to peers.

use std::fs::File;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use motorium::os::IdleLimit;
use motorium_benches::MeasureError;
use motorium_benches::host::{Loader, Machine};
use motorium_benches::latency::{Bench, Case, Measurement, Skipped, VERSION, Written, catalogue, targets};
use motorium_benches::timer::Places;
use motorium_pictures::chart::{Latencies, latencies};

use super::{peers, ratchet, table};
use crate::out::{err, errln, out};
use crate::output::Overwrite;
use crate::{exit, registry, style};

/// `SCHED_FIFO` priority of the measured processes, equal to the fastest component's in a graph.
const FIFO: u8 = 80;

/// Measure the floors of the machine, motorium and its peers side by side.
///
/// Measures the floors of this machine (a cache line, a futex, a timer) and motorium in one run, and reports
/// which targets are met. No sample is dropped, so the maximum is the longest time of all samples.
///
/// Example: motorium bench latency --output bench.json --plot bench.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Latency {
    /// Print the raw histograms, the machine and the table of targets as JSON (to the file of `--output`, if
    /// given); the tables are then printed to standard error
    #[arg(long)]
    json: bool,
    /// Write the JSON to this file; the tables stay on standard output
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Draw latency against percentile into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Measure only these cases: names from the table, or their beginnings up to a dot, such as
    /// `hop.blocking`
    #[arg(long, value_name = "NAME", num_args = 1..)]
    only: Vec<String>,
    /// Number of samples of each hop
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    samples: Option<u32>,
    /// Duration of each graph, s: 1000 samples of a chain or of the Panda loop in each second
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u32).range(1..=3_600))]
    seconds: Option<u32>,
    /// The tool that loads the machine for measurements under load [default: the first that is installed]
    #[arg(long, value_name = "TOOL", value_parser = ["stress-ng", "hackbench", "own"])]
    load: Option<String>,
    /// Take fewer and shorter measurements, in well under a minute: only for the targets of hops, releases
    /// and the chain of 4
    #[arg(long)]
    quick: bool,
    /// Also measure other systems that are installed (see benches/peers)
    #[arg(long)]
    peers: bool,
    /// Fail (exit code 6) when hops or releases exceed their bounds, as ratios to the floors of this run
    #[arg(long, conflicts_with_all = ["only", "peers", "json", "output", "plot", "samples", "seconds", "load", "quick"])]
    ratchet: bool,
}

impl Latency {
    /// Returns the load generator.
    fn loader(&self) -> anyhow::Result<Loader> {
        let Some(name) = &self.load else { return Ok(Loader::detect()) };
        Loader::named(name)
            .with_context(|| format!("{name} is not installed; `--load own` is always available"))
    }

    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let registry = registry::with_hidden();
        let bench = Bench {
            program: std::env::current_exe().context("finding this program's own file")?,
            registry: &registry,
            places: Places::detect(),
            fifo: FIFO,
            samples: self
                .samples
                .map_or(if self.quick { 20_000 } else { 100_000 }, |samples| samples as usize),
            paced: if self.quick { 2_000 } else { 6_000 },
            seconds: self.seconds.unwrap_or(if self.quick { 2 } else { 4 }),
            fast_seconds: self.seconds.unwrap_or(if self.quick { 2 } else { 25 }),
            panda_seconds: self.seconds.unwrap_or(if self.quick { 2 } else { 42 }),
            loader: self.loader()?,
        };
        // Same settings as in graphs, so that floors and peers run under the same conditions. The machine
        // line shows whether they were granted.
        let _idle_limit = IdleLimit::hold(Duration::ZERO);
        if self.ratchet {
            return ratchet::run(&bench);
        }
        self.overwrite.check(&[], self.output.iter().chain(&self.plot))?;
        let began = Instant::now();
        let cases = self.choose()?;
        // Report an unwritable file now rather than in five minutes; its content stays until then.
        let open = |file: &Option<PathBuf>| {
            let open = |file: &PathBuf| {
                let opened = File::options().write(true).create(true).truncate(false).open(file);
                opened.with_context(|| format!("writing {}", file.display()))
            };
            file.as_ref().map(open).transpose()
        };
        let (output, svg) = (open(&self.output)?, open(&self.plot)?);
        let text = Text { errors: self.json && output.is_none() };
        let machine = Machine::detect();
        text.line(format_args!("{} {machine}", style::strong("machine:")));
        if cases.iter().any(|case| case.loaded) {
            text.line(format_args!("{} {}, at normal priority", style::strong("load:"), bench.loader));
        }
        text.line(format_args!(""));
        let mut written = Written {
            version: VERSION,
            motorium: env!("CARGO_PKG_VERSION").to_string(),
            arguments: std::env::args_os().skip(1).map(|one| one.to_string_lossy().into_owned()).collect(),
            began_unix_s: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
            machine,
            load: bench.loader.to_string(),
            seconds: 0.0,
            denied: Vec::new(),
            measurements: Vec::new(),
            skipped: Vec::new(),
            targets: Vec::new(),
        };
        text.line(format_args!("{}", table::header()));
        let core = bench.places.realtime;
        for turns in cases.chunk_by(|one, next| one.group.is_some() && one.group == next.group) {
            let measured = match turns {
                [case] => vec![bench.measure(case)],
                cases => bench.measure_in_turns(cases),
            };
            for (case, measured) in turns.iter().zip(measured) {
                match measured {
                    Ok(measurement) => keep(&mut written.measurements, measurement, core, text),
                    Err(MeasureError::Interrupted) => anyhow::bail!("interrupted: nothing was written"),
                    Err(error) => written.skipped.push(skipped(&case.name, &error.to_string())),
                }
            }
        }
        if self.peers {
            peers::measure(core, |seen| match seen {
                Ok(measurement) => keep(&mut written.measurements, measurement, core, text),
                Err(missing) => written.skipped.push(skipped(&missing.name, &missing.reason)),
            });
        }
        written.seconds = began.elapsed().as_secs_f64();
        written.denied = denied(&written.measurements);
        written.targets = targets(&written.measurements);
        text.print(format_args!("{}", table::closing(&written)));
        if self.json || output.is_some() {
            let json = format!("{}\n", serde_json::to_string(&written)?);
            match output {
                Some(file) => fill(file, &json).context("writing the JSON file")?,
                None => out!("{json}"),
            }
        }
        if let Some(file) = svg {
            let drawn = drawn(&written.measurements, self.only.is_empty());
            let drawn = drawn.into_iter().map(|measurement| Latencies {
                name: &measurement.name,
                what: &measurement.what,
                count: measurement.ns.count,
                curve: measurement.ns.curve(),
            });
            let drawn: Vec<Latencies<'_>> = drawn.collect();
            let picture = latencies(&format!("{}; loaded by {}", written.machine, written.load), &drawn);
            fill(file, &picture).context("writing the picture")?;
        }
        Ok(if written.measurements.is_empty() { exit::FAILED } else { ExitCode::SUCCESS })
    }

    /// Cases to measure, in the order of the catalogue; cases that are compared are adjacent.
    fn choose(&self) -> anyhow::Result<Vec<Case>> {
        let all = catalogue();
        if let Some(word) = self.only.iter().find(|word| !all.iter().any(|case| case.is_meant_by(word))) {
            let names: Vec<&str> = all.iter().map(|case| case.name.as_str()).collect();
            anyhow::bail!("no measurement is named `{word}`; known: {}", names.join(", "));
        }
        let meant = |case: &Case| match self.only.as_slice() {
            [] => case.quick || !self.quick,
            words => words.iter().any(|word| case.is_meant_by(word)),
        };
        let mut cases: Vec<Case> = all.into_iter().filter(meant).collect();
        let firsts: Vec<usize> = cases
            .iter()
            .enumerate()
            .map(|(i, case)| {
                let first = cases.iter().position(|first| first.group == case.group);
                if case.group.is_some() { first.unwrap_or(i) } else { i }
            })
            .collect();
        let mut order: Vec<usize> = (0..cases.len()).collect();
        order.sort_by_key(|i| firsts[*i]);
        cases = order.into_iter().map(|i| cases[i].clone()).collect();
        Ok(cases)
    }
}

/// Writes a file, replacing its content.
fn fill(mut file: File, text: &str) -> std::io::Result<()> {
    // A pipe cannot be truncated, and has no content.
    if file.metadata()?.is_file() {
        file.set_len(0)?;
    }
    file.write_all(text.as_bytes())
}

/// Stream of the tables: standard output, or standard error if JSON uses standard output.
#[derive(Clone, Copy)]
struct Text {
    errors: bool,
}

impl Text {
    fn print(self, text: std::fmt::Arguments<'_>) {
        if self.errors { err!("{text}") } else { out!("{text}") }
    }

    fn line(self, text: std::fmt::Arguments<'_>) {
        self.print(format_args!("{text}\n"));
    }
}

fn keep(measurements: &mut Vec<Measurement>, mut measurement: Measurement, core: usize, text: Text) {
    measurement.compare_with_floor(measurements);
    text.line(format_args!("{}", table::row(&measurement, core)));
    measurements.push(measurement);
}

fn skipped(name: &str, reason: &str) -> Skipped {
    errln!("{} {name}: {reason}", style::warning("not measured:"));
    Skipped { name: name.to_string(), reason: reason.to_string() }
}

/// Privileges that the system denied: without real-time priority, the figures do not represent a robot.
fn denied(measurements: &[Measurement]) -> Vec<String> {
    let is_ours = |m: &&Measurement| !m.name.starts_with("peer.") && m.name != "floor.clock";
    let without: Vec<&str> = measurements
        .iter()
        .filter(is_ours)
        .filter(|measurement| measurement.fifo == 0)
        .map(|measurement| measurement.name.as_str())
        .collect();
    if without.is_empty() {
        return Vec::new();
    }
    vec![format!(
        "SCHED_FIFO {FIFO} was denied to {}: these figures are for normal time sharing; `motorium doctor` says \
         what to change",
        without.join(", ")
    )]
}

/// Returns the curves to draw: all requested ones, or those compared by the targets.
fn drawn(measurements: &[Measurement], choice: bool) -> Vec<&Measurement> {
    let compared = [
        "floor.cache-line",
        "floor.timer",
        "floor.futex.same",
        "floor.futex.across",
        "hop.polling.across.512",
        "hop.blocking.same.512",
        "hop.blocking.across.512",
        "iceoryx2.same.512",
        "iceoryx2.across.512",
        "release.1khz",
        "chain.4",
        "chain.17",
        "panda",
        "panda.loaded",
    ];
    let is_drawn =
        |m: &&Measurement| !choice || compared.contains(&m.name.as_str()) || m.name.starts_with("peer.");
    measurements.iter().filter(is_drawn).collect()
}
