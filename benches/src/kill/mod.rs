//! Fault injection in running graphs: kills, stops and hangs processes, and measures the consequences.
//!
//! The graph runs as started by a user, each component as a separate process with restarts allowed. A fault
//! is a signal to one process. The run's shared memory then shows when the actuators reached their safe
//! state, when the launcher reacted, and when the component published again.

mod consequence;
mod fault;
mod outcome;
mod trial;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use consequence::{Consequence, most_frequent_outcome};
pub use fault::{Fault, Victim};
pub use outcome::{After, Outcome, Robot};
use trial::{RunEnd, Trial};

use crate::{Distribution, MeasureError};

/// Settings of a fault injection: the graph, and the faults to inject.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The motorium command.
    pub program: PathBuf,
    /// The graph file.
    pub graph: PathBuf,
    /// The components of the graph.
    pub components: Vec<String>,
    /// Number of faults.
    pub count: u32,
    /// Maximum number of faults in one run.
    pub per_run: u32,
    /// Seed for choosing victims, faults and times.
    pub seed: u64,
    /// The victims to choose from.
    pub victims: Vec<Victim>,
    /// The faults to choose from.
    pub faults: Vec<Fault>,
}

/// Results of all faults of one kind in one victim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cell {
    /// Process that received the fault.
    pub victim: Victim,
    /// The fault.
    pub fault: Fault,
    /// Number of faults.
    pub count: u32,
    /// Time from the fault to the launcher's reaction.
    pub detected: Distribution,
    /// Time from the fault to the moment when the last actuator, except for the victim, entered its safe
    /// state. Only faults after which all these actuators entered the safe state are counted.
    pub safe: Distribution,
    /// Time from the fault to the first value published by the restarted component.
    pub restarted: Distribution,
    /// Number of faults after which the component did not recover.
    pub hung: u32,
    /// Number of faults after which an actuator followed a stale command for too long.
    pub unsafe_outages: u32,
    /// Most frequent outcome of these faults; `None` if no fault had an outcome. Pauses only count if they
    /// are long compared with the maximum age of a command and short compared with a watchdog's time limit.
    pub outcome: Option<Outcome>,
}

/// Summary of all faults.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Seed for choosing victims, faults and times.
    pub seed: u64,
    /// Number of faults.
    pub faults: u32,
    /// Number of runs used for the faults.
    pub runs: u32,
    /// Total duration, s.
    pub seconds: f64,
    /// Results for each victim and fault.
    pub cells: Vec<Cell>,
    /// Number of times that a component did not recover from a fault or a run did not end.
    pub hangs: u32,
    /// Number of processes that outlived their run.
    pub strays: u32,
    /// Number of objects in shared memory that outlived their run.
    pub leaks: u32,
    /// Number of runs that ended with a nonzero exit code, unless the fault had killed the launcher.
    pub failed_runs: u32,
    /// Exit code and last printed lines of each failed run.
    pub failures: Vec<String>,
    /// Number of faults after which an actuator followed a stale command for too long.
    pub unsafe_outages: u32,
    /// Number of steps in which a simulated joint was faster than its limit.
    pub steps_beyond_a_velocity_limit: u64,
}

impl Summary {
    /// Returns `true` if every run ended normally and the robot was safe at all times.
    pub fn is_clean(&self) -> bool {
        let counts = [self.hangs, self.strays, self.leaks, self.failed_runs, self.unsafe_outages];
        counts.iter().all(|count| *count == 0) && self.steps_beyond_a_velocity_limit == 0
    }
}

/// The samples of a cell while they are collected.
struct Collected {
    victim: Victim,
    fault: Fault,
    consequences: Vec<Consequence>,
}

/// Injects the faults one after the other. After each fault, calls `report_progress` with the number of
/// injected faults.
///
/// # Errors
/// The graph does not start.
pub fn run(settings: &Settings, report_progress: &mut dyn FnMut(u32)) -> Result<Summary, MeasureError> {
    let began = Instant::now();
    let mut random = Pcg64::seed_from_u64(settings.seed);
    let mut deck = Deck::new(settings);
    let mut collected: Vec<Collected> = Vec::new();
    let mut summary = Summary {
        seed: settings.seed,
        faults: 0,
        runs: 0,
        seconds: 0.0,
        cells: Vec::new(),
        hangs: 0,
        strays: 0,
        leaks: 0,
        failed_runs: 0,
        failures: Vec::new(),
        unsafe_outages: 0,
        steps_beyond_a_velocity_limit: 0,
    };
    while summary.faults < settings.count {
        let mut trial = Trial::start(&settings.program, &settings.graph, &settings.components)?;
        summary.runs += 1;
        let mut launcher_died = false;
        for _ in 0..settings.per_run {
            if summary.faults == settings.count {
                break;
            }
            let (victim, fault) = deck.next(&mut random);
            // Half of the pauses are of the kind whose outcome counts.
            let pauses = if random.random_range(0..2) == 0 { 20..=100 } else { 1..=300 };
            let pause = Duration::from_millis(random.random_range(pauses));
            std::thread::sleep(Duration::from_millis(random.random_range(20..300)));
            let consequence = trial.inject(&settings.program, &victim, fault, pause);
            summary.faults += 1;
            report_progress(summary.faults);
            launcher_died = victim == Victim::Launcher && fault.ends(&victim);
            let hung = consequence.hung;
            // With a stopped launcher, the guard ends the run at the next fault, so no further faults are
            // injected.
            let is_over = launcher_died || hung || (victim == Victim::Launcher && fault == Fault::Hang);
            let place = collected.iter_mut().find(|cell| cell.victim == victim && cell.fault == fault);
            match place {
                Some(cell) => cell.consequences.push(consequence),
                None => collected.push(Collected { victim, fault, consequences: vec![consequence] }),
            }
            if is_over {
                break;
            }
        }
        summary.add(&trial.end(), launcher_died);
    }
    collected.sort_by(|one, other| (&one.victim, one.fault).cmp(&(&other.victim, other.fault)));
    summary.cells = collected.into_iter().map(Cell::from_collected).collect();
    summary.hangs += summary.cells.iter().map(|cell| cell.hung).sum::<u32>();
    summary.unsafe_outages = summary.cells.iter().map(|cell| cell.unsafe_outages).sum();
    summary.seconds = began.elapsed().as_secs_f64();
    Ok(summary)
}

/// Every victim with every fault, reshuffled for each pass.
struct Deck {
    cards: Vec<(Victim, Fault)>,
    drawn: usize,
}

impl Deck {
    fn new(settings: &Settings) -> Self {
        let pairs = |victim: &Victim| settings.faults.iter().map(|fault| (victim.clone(), *fault)).collect();
        let cards: Vec<_> = settings.victims.iter().flat_map::<Vec<_>, _>(pairs).collect();
        Self { drawn: cards.len(), cards }
    }

    fn next(&mut self, random: &mut Pcg64) -> (Victim, Fault) {
        if self.drawn == self.cards.len() {
            self.drawn = 0;
            for last in (1..self.cards.len()).rev() {
                self.cards.swap(last, random.random_range(0..=last));
            }
        }
        self.drawn += 1;
        self.cards[self.drawn - 1].clone()
    }
}

impl Summary {
    fn add(&mut self, end: &RunEnd, launcher_died: bool) {
        self.hangs += u32::from(end.hung);
        self.strays += end.strays as u32;
        self.leaks += end.leaks as u32;
        if !launcher_died && end.code != Some(0) {
            self.failed_runs += 1;
            let code = end.code.map_or_else(|| "a signal".to_string(), |code| format!("code {code}"));
            self.failures.push(format!("run {} ended with {code}:\n{}", self.runs, end.last_lines));
        }
        self.steps_beyond_a_velocity_limit += end.steps_beyond_a_velocity_limit;
    }
}

impl Cell {
    fn from_collected(collected: Collected) -> Self {
        let Collected { victim, fault, consequences } = collected;
        let times = |of: fn(&Consequence) -> Option<u64>| Distribution {
            buckets: Vec::new(),
            ..Distribution::from_samples(consequences.iter().filter_map(of).collect())
        };
        let count = |of: fn(&Consequence) -> bool| consequences.iter().filter(|one| of(one)).count() as u32;
        Self {
            outcome: most_frequent_outcome(fault, &consequences),
            victim,
            fault,
            count: consequences.len() as u32,
            detected: times(|one| one.detected_ns),
            safe: times(|one| one.safe_ns),
            restarted: times(|one| one.restarted_ns),
            hung: count(|one| one.hung),
            unsafe_outages: count(|one| one.unsafe_outage),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pass_combines_every_victim_and_fault_once() {
        let settings = Settings {
            program: PathBuf::new(),
            graph: PathBuf::new(),
            components: Vec::new(),
            count: 0,
            per_run: 1,
            seed: 1,
            victims: vec![Victim::Launcher, Victim::Guard, Victim::Component("arm".to_string())],
            faults: Fault::ALL.to_vec(),
        };
        let mut random = Pcg64::seed_from_u64(settings.seed);
        let mut deck = Deck::new(&settings);
        let mut orders = Vec::new();
        for _ in 0..2 {
            let order: Vec<_> = (0..18).map(|_| deck.next(&mut random)).collect();
            let mut sorted = order.clone();
            sorted.sort();
            sorted.dedup();
            assert_eq!(sorted.len(), 18);
            orders.push(order);
        }
        assert_ne!(orders[0], orders[1]);
    }
}
