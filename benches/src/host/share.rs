//! Disturbance of a measurement by the machine and its host.

use std::time::Instant;

use motorium::launcher::{CoreReport, CoreWatch, Report};
use motorium::os::machine::online_cores;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Time stolen by the host during a measurement, and interrupts.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HostShare {
    /// Duration of the measurement, s.
    pub seconds: f64,
    /// Time the host took from all cores together, ms (`steal` of `/proc/stat`, in steps of 10 ms).
    pub steal_ms: f64,
    /// Stolen time as a fraction of the time of all cores.
    pub steal_share: f64,
    /// Stolen time, interrupts and soft interrupts of each core.
    #[serde(default)]
    pub cores: Vec<CoreReport>,
    /// Causes of late steps; `None` unless a graph was measured.
    #[serde(default)]
    pub causes: Option<Causes>,
    /// Share of the measurement's tail that the bare machine shows in the same turns; only for releases and
    /// chains.
    #[serde(default)]
    pub floor: Option<FloorShare>,
}

/// Share of a measurement's tail that the bare machine also shows. The bare machine is a sleeping thread on
/// an otherwise idle core, or processes without motorium that wake each other by a futex.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FloorShare {
    /// Name of the measurement of the bare machine.
    pub name: String,
    /// Difference between p99.9 and p50 of the bare machine, divided by the difference between p99.9 and p50
    /// of the measurement; at most 1.
    pub share: f64,
}

/// Causes of lateness of all components of a graph, counted by their workers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Causes {
    /// Steps delayed by the host: they were ready to run while no thread of this system ran.
    pub stolen: u64,
    /// Steps that started late, because other threads had the core or the timer was late.
    pub late_wake: u64,
    /// Steps that ran too long on their core, including interrupts and stalls that the host does not report.
    pub long_step: u64,
    /// Steps whose input arrived late.
    pub late_input: u64,
    /// Number of stalls of the core, observed while a component was spinning and only read the clock.
    pub stalls: u64,
    /// Total duration of the stalls, ms.
    pub stalled_ms: f64,
    /// Total time of spinning, ms.
    pub watched_ms: f64,
    /// Longest stall, us.
    pub longest_stall_us: f64,
}

impl Causes {
    fn add(&mut self, other: &Self) {
        self.stolen += other.stolen;
        self.late_wake += other.late_wake;
        self.long_step += other.long_step;
        self.late_input += other.late_input;
        self.stalls += other.stalls;
        self.stalled_ms += other.stalled_ms;
        self.watched_ms += other.watched_ms;
        self.longest_stall_us = self.longest_stall_us.max(other.longest_stall_us);
    }

    /// Collects the causes from the report of a run.
    pub fn from_report(report: &Report) -> Self {
        let mut causes = Self::default();
        for component in &report.components {
            causes.stolen += component.misses.stolen;
            causes.late_wake += component.misses.late_wake;
            causes.long_step += component.misses.long_step;
            causes.late_input += component.misses.late_input;
            causes.stalls += component.stalls.count;
            causes.stalled_ms += component.stalls.total_ns as f64 * 1e-6;
            causes.watched_ms += component.stalls.watched_ns as f64 * 1e-6;
            causes.longest_stall_us = causes.longest_stall_us.max(component.stalls.longest_ns as f64 * 1e-3);
        }
        causes
    }

    /// Returns the number of late steps.
    pub fn misses(&self) -> u64 {
        self.stolen + self.late_wake + self.long_step + self.late_input
    }
}

impl HostShare {
    /// Returns the report of a core; `None` if the core does not exist.
    pub fn core(&self, core: usize) -> Option<&CoreReport> {
        self.cores.iter().find(|report| report.core == core)
    }

    /// Adds `other`, a further part of the same measurement.
    pub fn add(&mut self, other: Self) {
        self.seconds += other.seconds;
        self.steal_ms += other.steal_ms;
        for core in other.cores {
            match self.cores.iter_mut().find(|known| known.core == core.core) {
                Some(known) => known.add(&core),
                None => self.cores.push(core),
            }
        }
        self.steal_share = share(self.steal_ms, self.seconds, self.cores.len());
        if let Some(causes) = other.causes {
            self.causes.get_or_insert_default().add(&causes);
        }
    }

    /// Returns a short text: stolen time, the bare machine's share of the tail, misses by cause, stalls, and
    /// device interrupts on the core of the measurement. Empty if there is nothing to report.
    pub fn in_words(&self, core: usize) -> String {
        let mut words = Vec::new();
        if self.steal_ms > 0.0 {
            words.push(format!("steal {:.2} %", 100.0 * self.steal_share));
        }
        if let Some(FloorShare { name, share }) = &self.floor {
            words.push(format!("{name} {:.0} %", 100.0 * share));
        }
        if let Some(causes) = self.causes {
            let counts = [
                (causes.stolen, "stolen"),
                (causes.late_wake, "woken late"),
                (causes.long_step, "long"),
                (causes.late_input, "input late"),
            ];
            words.extend(
                counts.iter().filter(|(count, _)| *count > 0).map(|(count, word)| format!("{count} {word}")),
            );
            if causes.stalls > 0 {
                words.push(format!(
                    "stalled {:.2} %, longest {:.0} us",
                    100.0 * causes.stalled_ms / causes.watched_ms.max(1e-9),
                    causes.longest_stall_us
                ));
            }
        }
        let devices = self.core(core).map_or(0, CoreReport::from_devices);
        if devices > 0 {
            words.push(format!("{devices} irq"));
        }
        words.join(", ")
    }
}

/// Watcher of stolen time and interrupts on the cores of this machine.
#[derive(Debug)]
pub struct Watch {
    since: Instant,
    cores: CoreWatch,
}

impl Watch {
    /// Starts watching the cores.
    pub fn start() -> Self {
        Self { cores: CoreWatch::start(online_cores()), since: Instant::now() }
    }

    /// Returns the disturbance since [`start`](Self::start).
    pub fn stop(&self) -> HostShare {
        let seconds = self.since.elapsed().as_secs_f64();
        let cores = self.cores.stop();
        let steal_ms = cores.iter().map(|core| core.steal_ms).sum();
        HostShare {
            seconds,
            steal_ms,
            steal_share: share(steal_ms, seconds, cores.len()),
            cores,
            ..HostShare::default()
        }
    }
}

fn share(steal_ms: f64, seconds: f64, cores: usize) -> f64 {
    steal_ms / (1e3 * seconds.max(1e-9) * cores.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn taken(core: usize, steal_ms: f64, interrupts: &[(&str, u64)]) -> HostShare {
        let interrupts: BTreeMap<String, u64> =
            interrupts.iter().map(|(name, count)| (name.to_string(), *count)).collect();
        let report = CoreReport { core, seconds: 1.0, steal_ms, interrupts, ..CoreReport::default() };
        HostShare {
            seconds: 1.0,
            steal_ms,
            steal_share: steal_ms * 1e-3,
            cores: vec![report],
            ..HostShare::default()
        }
    }

    #[test]
    fn a_share_is_of_the_time_of_all_cores() {
        let mut sum = taken(0, 20.0, &[]);
        sum.add(taken(1, 0.0, &[]));
        assert_eq!((sum.seconds, sum.steal_ms), (2.0, 20.0));
        assert!((sum.steal_share - 20e-3 / (2.0 * 2.0)).abs() < 1e-12, "{}", sum.steal_share);
    }

    #[test]
    fn a_watch_sees_every_core_of_the_machine() {
        let seen = Watch::start().stop();
        assert_eq!(seen.cores.iter().map(|core| core.core).collect::<Vec<_>>(), online_cores());
        assert!(seen.steal_share >= 0.0);
    }

    #[test]
    fn description_lists_only_observed_causes() {
        assert_eq!(HostShare::default().in_words(0), "");
        let mut share = taken(1, 10.0, &[("LOC", 4_000), ("virtio1-req.0", 12)]);
        assert_eq!(share.in_words(1), "steal 1.00 %, 12 irq");
        assert_eq!(share.in_words(0), "steal 1.00 %");
        share.floor = Some(FloorShare { name: "floor.timer".to_string(), share: 0.93 });
        share.causes = Some(Causes {
            stolen: 3,
            long_step: 1,
            stalls: 2,
            stalled_ms: 1.0,
            watched_ms: 100.0,
            longest_stall_us: 700.0,
            ..Causes::default()
        });
        assert_eq!(
            share.in_words(0),
            "steal 1.00 %, floor.timer 93 %, 3 stolen, 1 long, stalled 1.00 %, longest 700 us"
        );
    }
}
