//! `motorium bench latency`: what is measured, in which order, and what is made of it.

mod catalogue;
mod json;
mod plot;
mod targets;

use std::path::PathBuf;

use motorium::component::Registry;
use serde::{Deserialize, Serialize};

pub use catalogue::{Case, catalogue};
pub use json::{Skipped, VERSION, Written};
pub use plot::plot;
pub use targets::{Target, Verdict, targets};

use crate::host::HostShare;
use crate::timer::Places;
use crate::{Distribution, MeasureError};

/// What the measurements need.
#[derive(Debug)]
pub struct Bench<'a> {
    /// The program that hosts `bench.relay` and plays the [`Part`](crate::Part)s: this one, as a rule.
    pub program: PathBuf,
    /// Its component kinds.
    pub registry: &'a Registry,
    /// Where to measure.
    pub places: Places,
    /// `SCHED_FIFO` priority to ask for.
    pub fifo: u8,
    /// Samples of each hop.
    pub samples: usize,
    /// How long each graph runs, s.
    pub seconds: u32,
}

/// One finished measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Its name, for `--only`.
    pub name: String,
    /// What was measured.
    pub what: String,
    /// All of it.
    pub ns: Distribution,
    /// Lowest `SCHED_FIFO` priority among its processes, read back; 0 for normal time sharing.
    pub fifo: u32,
    /// What the host of a virtual machine took meanwhile.
    pub host: HostShare,
    /// Medians of the slices in which it took turns with those it is compared with, ns; empty without turns. The host
    /// of a virtual machine moves its cores about, nearer to each other or farther apart: only slices side by side
    /// can be compared.
    pub slices_p50: Vec<u64>,
}

/// What a case gives: every sample, or a histogram of them.
#[derive(Debug)]
enum Samples {
    All(Vec<u64>),
    Histogram(Distribution),
}

impl Samples {
    fn distribution(self) -> Distribution {
        match self {
            Self::All(samples) => Distribution::of(samples),
            Self::Histogram(distribution) => distribution,
        }
    }

    fn p50(&self) -> u64 {
        match self {
            Self::All(samples) => Distribution::of(samples.clone()).p50,
            Self::Histogram(distribution) => distribution.p50,
        }
    }
}

/// Turns that the cases of a group take.
const SLICES: usize = 10;

impl Bench<'_> {
    /// Measures one case.
    ///
    /// # Errors
    /// It could not be measured here.
    pub fn measure(&self, case: &Case) -> Result<Measurement, MeasureError> {
        let load = case.loaded.then(|| crate::host::Load::start(&self.program)).transpose();
        let _load = load.map_err(|error| MeasureError::system("starting the load", error))?;
        let watch = crate::host::Watch::start();
        let (samples, fifo) = case.run(self)?;
        Ok(Measurement {
            name: case.name.clone(),
            what: case.what.clone(),
            ns: samples.distribution(),
            fifo,
            host: watch.stop(),
            slices_p50: Vec::new(),
        })
    }

    /// Measures cases that are compared with each other, in turns of a slice each.
    pub fn measure_in_turns(&self, cases: &[Case]) -> Vec<Result<Measurement, MeasureError>> {
        let slice = Bench {
            program: self.program.clone(),
            registry: self.registry,
            places: self.places,
            fifo: self.fifo,
            samples: self.samples.div_ceil(SLICES),
            seconds: self.seconds,
        };
        let mut turns: Vec<Result<Turns, MeasureError>> =
            cases.iter().map(|_| Ok(Turns::default())).collect();
        for _ in 0..SLICES {
            for (case, turns) in cases.iter().zip(&mut turns) {
                let Ok(taken) = turns else { continue };
                let watch = crate::host::Watch::start();
                match case.run(&slice) {
                    Ok((samples, fifo)) => taken.add(samples, fifo, watch.stop()),
                    Err(error) => *turns = Err(error),
                }
            }
        }
        let finish = |(case, turns): (&Case, Result<Turns, MeasureError>)| {
            turns.map(|turns| Measurement {
                name: case.name.clone(),
                what: case.what.clone(),
                ns: Distribution::of(turns.samples),
                fifo: turns.fifo.unwrap_or(0),
                host: turns.host,
                slices_p50: turns.slices_p50,
            })
        };
        cases.iter().zip(turns).map(finish).collect()
    }
}

/// What a case has gathered in its turns.
#[derive(Debug, Default)]
struct Turns {
    samples: Vec<u64>,
    slices_p50: Vec<u64>,
    fifo: Option<u32>,
    host: HostShare,
}

impl Turns {
    fn add(&mut self, samples: Samples, fifo: u32, host: HostShare) {
        self.slices_p50.push(samples.p50());
        if let Samples::All(samples) = samples {
            self.samples.extend(samples);
        }
        self.fifo = Some(self.fifo.map_or(fifo, |least| least.min(fifo)));
        let seconds = self.host.seconds + host.seconds;
        let cores = crate::host::cores().len().max(1) as f64;
        let steal_ms = self.host.steal_ms + host.steal_ms;
        self.host =
            HostShare { seconds, steal_ms, steal_share: steal_ms / (1e3 * seconds.max(1e-9) * cores) };
    }
}
