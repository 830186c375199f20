//! `motorium bench latency`: measurements, their order and their evaluation.

mod catalogue;
mod compare;
mod json;
mod miss;
mod seen;
mod targets;

use std::path::PathBuf;

use motorium::worker::Registry;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use catalogue::{Case, catalogue};
pub use compare::{Change, Comparison, Direction, compare};
pub use json::{ReadError, Skipped, VERSION, Written};
pub use targets::{Target, Verdict, targets};

use crate::host::{Causes, FloorShare, HostShare, Load, Loader, Watch};
use crate::timer::Places;
use crate::{Distribution, MeasureError};

/// Settings of the measurements.
#[derive(Debug)]
pub struct Bench<'a> {
    /// Program that hosts `bench.relay` and runs as a [`Role`](crate::Role), normally the current program.
    pub program: PathBuf,
    /// Component kinds of the program.
    pub registry: &'a Registry,
    /// Cores on which to measure.
    pub places: Places,
    /// `SCHED_FIFO` priority to request.
    pub fifo: u8,
    /// Number of samples of each hop.
    pub samples: usize,
    /// Number of paced round trips.
    pub paced: usize,
    /// Duration of each graph, s.
    pub seconds: u32,
    /// Duration of the graph with releases at 4 kHz, s.
    pub fast_seconds: u32,
    /// Duration of the Panda loop, s. It is a separate setting because the loop's p99.9 needs many samples.
    pub panda_seconds: u32,
    /// Generator of the background load.
    pub loader: Loader,
}

/// One finished measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Measurement {
    /// Name of the measurement, as in `--only`.
    pub name: String,
    /// Description of the measured value.
    pub what: String,
    /// Distribution of the samples, ns.
    pub ns: Distribution,
    /// Lowest `SCHED_FIFO` priority among the processes of the measurement, as read back from the kernel; 0
    /// for normal time sharing.
    pub fifo: u32,
    /// Time stolen by the host of a virtual machine, and interrupts during the measurement.
    pub host: HostShare,
    /// Median of each slice, ns, if compared measurements took turns in slices; empty if they did not. Only
    /// adjacent slices are comparable, because the host of a virtual machine moves virtual cores between
    /// physical cores and thereby changes the distance between them.
    pub slices_p50: Vec<u64>,
}

impl Measurement {
    /// Computes the share of this measurement's tail that the bare machine also shows. For timer releases,
    /// the bare machine is a sleeping thread; for chains, processes that wake each other by a futex. `all`
    /// contains the measurements of the bare machine.
    pub fn compare_with_floor(&mut self, all: &[Self]) {
        let floor = match self.name.as_str() {
            "release.1khz" | "release.4khz" => "floor.timer",
            "release.1khz.loaded" => "floor.timer.loaded",
            "chain.4" => "floor.chain.4",
            "chain.8" => "floor.chain.8",
            "joint-targets" => "floor.joint-targets",
            _ => return,
        };
        let tail = |ns: &Distribution| ns.p99_9.saturating_sub(ns.p50) as f64;
        let floor = all.iter().find(|measurement| measurement.name == floor);
        self.host.floor = floor.filter(|_| tail(&self.ns) > 0.0).map(|floor| FloorShare {
            name: floor.name.clone(),
            share: (tail(&floor.ns) / tail(&self.ns)).min(1.0),
        });
    }
}

/// Samples of a case: all of them, or a histogram.
#[derive(Debug)]
enum Samples {
    All(Vec<u64>),
    Histogram(Distribution),
}

/// Samples of a case, and the priority that was granted.
#[derive(Debug)]
struct Outcome {
    samples: Samples,
    fifo: u32,
    /// Causes of lateness of the components of a graph.
    causes: Option<Causes>,
}

impl Outcome {
    fn from_samples(samples: Vec<u64>, fifo: u32) -> Self {
        Self { samples: Samples::All(samples), fifo, causes: None }
    }
}

impl Samples {
    fn distribution(self) -> Distribution {
        match self {
            Self::All(samples) => Distribution::from_samples(samples),
            Self::Histogram(distribution) => distribution,
        }
    }

    fn p50(&self) -> u64 {
        match self {
            Self::All(samples) => Distribution::from_samples(samples.clone()).p50,
            Self::Histogram(distribution) => distribution.p50,
        }
    }
}

/// Number of turns for the cases of a group.
const SLICES: usize = 10;
/// Number of turns if each one starts a graph or a background load.
const SLOW_SLICES: usize = 3;

impl Bench<'_> {
    /// Measures one case.
    ///
    /// # Errors
    /// The measurement is not possible on this machine.
    pub fn measure(&self, case: &Case) -> Result<Measurement, MeasureError> {
        let (outcome, host) = self.turn(case)?;
        Ok(Measurement {
            name: case.name.clone(),
            what: case.what.clone(),
            ns: outcome.samples.distribution(),
            fifo: outcome.fifo,
            host: HostShare { causes: outcome.causes, ..host },
            slices_p50: Vec::new(),
        })
    }

    fn turn(&self, case: &Case) -> Result<(Outcome, HostShare), MeasureError> {
        let load = case.loaded.then(|| Load::start(&self.loader, &self.program)).transpose();
        let _load = load.map_err(|error| MeasureError::system("starting the load", error))?;
        let watch = Watch::start();
        let outcome = case.run(self)?;
        Ok((outcome, watch.stop()))
    }

    /// Measures cases that are compared with each other, in turns of one slice each.
    pub fn measure_in_turns(&self, cases: &[Case]) -> Vec<Result<Measurement, MeasureError>> {
        let is_slow = |case: &Case| case.is_graph() || case.loaded;
        let slices = if cases.iter().any(is_slow) { SLOW_SLICES } else { SLICES };
        let slice = Bench {
            program: self.program.clone(),
            registry: self.registry,
            places: self.places,
            fifo: self.fifo,
            samples: self.samples.div_ceil(slices),
            paced: self.paced.div_ceil(slices),
            seconds: self.seconds.div_ceil(SLOW_SLICES as u32),
            fast_seconds: self.fast_seconds.div_ceil(SLOW_SLICES as u32),
            panda_seconds: self.panda_seconds.div_ceil(SLOW_SLICES as u32),
            loader: self.loader.clone(),
        };
        let mut turns: Vec<Result<Turns, MeasureError>> =
            cases.iter().map(|_| Ok(Turns::default())).collect();
        for _ in 0..slices {
            for (case, turns) in cases.iter().zip(&mut turns) {
                let Ok(taken) = turns else { continue };
                match slice.turn(case) {
                    Ok((outcome, host)) => taken.add(outcome, host),
                    Err(error) => *turns = Err(error),
                }
            }
        }
        let finish = |(case, turns): (&Case, Result<Turns, MeasureError>)| {
            turns.map(|turns| Measurement {
                name: case.name.clone(),
                what: case.what.clone(),
                ns: match turns.histogram {
                    Some(histogram) => histogram,
                    None => Distribution::from_samples(turns.samples),
                },
                fifo: turns.fifo.unwrap_or(0),
                host: turns.host,
                slices_p50: turns.slices_p50,
            })
        };
        cases.iter().zip(turns).map(finish).collect()
    }
}

/// Samples of a case gathered in its turns.
#[derive(Debug, Default)]
struct Turns {
    samples: Vec<u64>,
    histogram: Option<Distribution>,
    slices_p50: Vec<u64>,
    fifo: Option<u32>,
    host: HostShare,
}

impl Turns {
    fn add(&mut self, outcome: Outcome, host: HostShare) {
        self.slices_p50.push(outcome.samples.p50());
        match outcome.samples {
            Samples::All(samples) => self.samples.extend(samples),
            Samples::Histogram(more) => self.histogram.get_or_insert_default().add(&more),
        }
        self.fifo = Some(self.fifo.map_or(outcome.fifo, |least| least.min(outcome.fifo)));
        self.host.add(HostShare { causes: outcome.causes, ..host });
    }
}
