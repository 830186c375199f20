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
}

impl Bench<'_> {
    /// Measures one case.
    ///
    /// # Errors
    /// It could not be measured here.
    pub fn measure(&self, case: &Case) -> Result<Measurement, MeasureError> {
        let load = case.loaded.then(|| crate::host::Load::start(&self.program)).transpose();
        let _load = load.map_err(|error| MeasureError::system("starting the load", error))?;
        let watch = crate::host::Watch::start();
        let (ns, fifo) = case.run(self)?;
        Ok(Measurement { name: case.name.clone(), what: case.what.clone(), ns, fifo, host: watch.stop() })
    }
}
