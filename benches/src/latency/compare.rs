//! Comparison of two benchmark files: changes beyond noise.
//!
//! The comparison uses the ratio of each measurement to a floor (the lowest possible latency) that was
//! measured in the same file, because the machine or the placement of its cores may have changed. Noise is
//! the spread of these ratios on one side, over the turns of a measurement and its floor and over several
//! files.

use schemars::JsonSchema;
use serde::Serialize;

use super::catalogue::group;
use super::{Measurement, Written};
use crate::Distribution;
use crate::host::Machine;

/// Minimum factor of a change to report, whatever the noise: builds differ in code placement.
const LEAST: f64 = 1.1;
/// Factor of a change that is reported even if there are too few ratios to estimate the noise.
const PLAIN: f64 = 1.5;
/// Minimum number of ratios per side to estimate the noise.
const FEW: usize = 3;
/// Minimum number of ratios for which the noise is their range without the lowest and the highest.
const MANY: usize = 5;
/// Factor of a floor change above which the machine has changed.
const MOVED: f64 = 1.5;

/// Direction of a change, relative to the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// The ratio of the measurement to its floor is clearly smaller than before.
    Faster,
    /// The ratio of the measurement to its floor is clearly larger than before.
    Slower,
    /// No change beyond noise.
    Same,
    /// The ratio has changed, but the floor has changed by more than half. Measure both sides on the same
    /// machine.
    FloorMoved,
    /// There are too few runs to compare a tail. Provide three files per side.
    TooFew,
}

/// The change of one measurement.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Change {
    /// Name of the measurement.
    pub name: String,
    /// The percentile: `p50` or `p99`.
    pub percentile: &'static str,
    /// Name of the floor (the lowest possible latency) by whose value at the same percentile the measurement
    /// is divided.
    pub floor: String,
    /// The median of the old ratios.
    pub old: f64,
    /// The lowest and the highest old ratio. With five or more ratios, the second lowest and the second
    /// highest ratio.
    pub old_range: [f64; 2],
    /// The median of the new ratios.
    pub new: f64,
    /// The lowest and the highest new ratio. With five or more ratios, the second lowest and the second
    /// highest ratio.
    pub new_range: [f64; 2],
    /// Relative change: `new / old`.
    pub change: f64,
    /// Direction of the change.
    pub direction: Direction,
}

/// Result of comparing the files before and after a change.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Comparison {
    /// Differences in the conditions of the two sides.
    pub differences: Vec<String>,
    /// Changes of all measurements that are in all files.
    pub changes: Vec<Change>,
    /// Measurements that are missing from some files.
    pub left_out: Vec<String>,
}

impl Comparison {
    /// Returns `true` if at least one measurement has become slower.
    pub fn is_slower(&self) -> bool {
        self.changes.iter().any(|change| change.direction == Direction::Slower)
    }
}

/// Compares the files before a change with the files after it. Each side needs at least one file.
pub fn compare(old: &[Written], new: &[Written]) -> Comparison {
    let all: Vec<&Written> = old.iter().chain(new).collect();
    let mut names: Vec<&str> = Vec::new();
    for measurement in all.iter().flat_map(|file| &file.measurements) {
        if !names.contains(&measurement.name.as_str()) {
            names.push(&measurement.name);
        }
    }
    let (mut changes, mut left_out) = (Vec::new(), Vec::new());
    for name in names.into_iter().filter(|name| !name.starts_with("floor.")) {
        let floor = floor_of(name, |floor| all.iter().all(|file| file.get(floor).is_some()));
        let Some(floor) = floor.filter(|_| all.iter().all(|file| file.get(name).is_some())) else {
            left_out.push(name.to_string());
            continue;
        };
        changes.push(change(old, new, name, &floor, &P50));
        if is_released(name) {
            changes.push(change(old, new, name, &floor, &P99));
        }
    }
    Comparison { differences: differences(&all), changes, left_out }
}

/// A percentile that is compared.
struct Percentile {
    name: &'static str,
    of: fn(&Distribution) -> u64,
}

const P50: Percentile = Percentile { name: "p50", of: |ns| ns.p50 };
const P99: Percentile = Percentile { name: "p99", of: |ns| ns.p99 };

/// Returns `true` for a timer or a chain of processes, whose tail matters as much as its median.
fn is_released(name: &str) -> bool {
    ["release.", "chain.", "panda"].iter().any(|family| name.starts_with(family))
}

/// Returns the floor by which a measurement is divided: the bare machine doing the most similar work.
fn floor_of(name: &str, is_there: impl Fn(&str) -> bool) -> Option<String> {
    const FLOORS: &[(&str, &str)] = &[
        ("hop.polling.across.", "floor.plain.512"),
        ("hop.polling.same.", "floor.futex.same"),
        ("hop.blocking.same.", "floor.futex.same"),
        ("iceoryx2.same.", "floor.futex.same"),
        ("hop.blocking.across.1khz.", "floor.futex.across.1khz"),
        ("hop.blocking.across.65536", "floor.plain-blocking.65536"),
        ("hop.blocking.across.1048576", "floor.plain-blocking.1048576"),
        ("hop.blocking.across.", "floor.futex.across"),
        ("iceoryx2.across.", "floor.futex.across"),
        ("read.", "floor.clock"),
        ("release.", "floor.timer"),
        ("chain.4", "floor.chain.4"),
        ("chain.8", "floor.chain.8"),
        ("chain.17", "floor.chain.8"),
        ("chain.", "floor.futex.same"),
        ("fan-out.", "floor.futex.same"),
        ("gate", "floor.gate"),
        ("episode", "floor.episode"),
        ("raw.", "floor.futex.same"),
        ("panda", "floor.futex.same"),
        ("joint-targets", "floor.futex.same"),
        ("latent", "floor.futex.same"),
        ("peer.cyclictest", "floor.timer"),
        ("peer.", "floor.futex.across"),
    ];
    let floor = FLOORS.iter().find(|(family, _)| name.starts_with(family)).map(|(_, floor)| *floor)?;
    // A loaded measurement uses the loaded floor, if available.
    let mut floors = vec![floor.to_string()];
    if name.ends_with(".loaded") {
        floors.splice(0..0, [format!("{floor}.loaded"), "floor.futex.same.loaded".to_string()]);
    }
    floors.into_iter().find(|floor| is_there(floor))
}

fn change(old: &[Written], new: &[Written], name: &str, floor: &str, percentile: &Percentile) -> Change {
    let sides = [old, new].map(|files| {
        let mut ratios: Vec<f64> =
            files.iter().flat_map(|file| ratios(file, name, floor, percentile)).collect();
        ratios.sort_by(f64::total_cmp);
        ratios
    });
    let [was, is] = sides.each_ref().map(|ratios| ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN));
    let [old_range, new_range] = sides.each_ref().map(|ratios| range(ratios));
    let change = is / was;
    let beyond = |factor: f64| change > factor || change < 1.0 / factor;
    let apart = old_range[1] < new_range[0] || new_range[1] < old_range[0];
    let have = |least: usize| sides.iter().all(|ratios| ratios.len() >= least);
    let is_beyond_noise = beyond(if have(MANY) { LEAST } else { PLAIN }) && (apart || !have(FEW));
    let floors = [old, new].map(|files| middle(files.iter().filter_map(|file| file.get(floor)), percentile));
    let moved = floors[1] / floors[0];
    let direction = if !have(FEW) && percentile.name != P50.name {
        Direction::TooFew
    } else if !is_beyond_noise {
        Direction::Same
    } else if !(1.0 / MOVED..=MOVED).contains(&moved) {
        Direction::FloorMoved
    } else if change > 1.0 {
        Direction::Slower
    } else {
        Direction::Faster
    };
    Change {
        name: name.to_string(),
        percentile: percentile.name,
        floor: floor.to_string(),
        old: was,
        old_range,
        new: is,
        new_range,
        change,
        direction,
    }
}

/// Ratios in one file: one per turn, or a single one without turns.
fn ratios(file: &Written, name: &str, floor: &str, percentile: &Percentile) -> Vec<f64> {
    let (Some(of), Some(to)) = (file.get(name), file.get(floor)) else { return Vec::new() };
    let ratio = |of: u64, to: u64| of as f64 / to.max(1) as f64;
    let same_group = group(name).is_some_and(|group_of| Some(group_of) == group(floor));
    let in_turns = same_group && of.slices_p50.len() == to.slices_p50.len() && !of.slices_p50.is_empty();
    if in_turns && percentile.name == P50.name {
        return of.slices_p50.iter().zip(&to.slices_p50).map(|(of, to)| ratio(*of, *to)).collect();
    }
    vec![ratio((percentile.of)(&of.ns), (percentile.of)(&to.ns))]
}

fn range(sorted: &[f64]) -> [f64; 2] {
    let inner = if sorted.len() >= MANY { &sorted[1..sorted.len() - 1] } else { sorted };
    [inner.first().copied().unwrap_or(f64::NAN), inner.last().copied().unwrap_or(f64::NAN)]
}

fn middle<'a>(measurements: impl Iterator<Item = &'a Measurement>, percentile: &Percentile) -> f64 {
    let mut all: Vec<u64> = measurements.map(|measurement| (percentile.of)(&measurement.ns)).collect();
    all.sort_unstable();
    all.get(all.len() / 2).map_or(f64::NAN, |ns| (*ns).max(1) as f64)
}

/// Differences of the files from the first one.
fn differences(all: &[&Written]) -> Vec<String> {
    let Some((first, rest)) = all.split_first() else { return Vec::new() };
    let mut words: Vec<String> = Vec::new();
    let mut say = |what: String| {
        if !words.contains(&what) {
            words.push(what);
        }
    };
    for other in rest {
        // The load before the run is not a property of the machine.
        let lasting = |machine: &Machine| Machine { load: 0.0, ..machine.clone() };
        if lasting(&first.machine) != lasting(&other.machine) {
            say(format!("measured on {}, and on {}", first.machine, other.machine));
        }
        let loaded = |file: &Written| file.measurements.iter().any(|m| m.name.ends_with(".loaded"));
        if first.load != other.load && loaded(first) && loaded(other) {
            say(format!("loaded by {}, and by {}", first.load, other.load));
        }
        for measurement in &first.measurements {
            if let Some(again) = other.get(&measurement.name).filter(|again| again.fifo != measurement.fifo) {
                say(format!("{}: SCHED_FIFO {}, and {}", measurement.name, measurement.fifo, again.fifo));
            }
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::HostShare;
    use crate::latency::VERSION;

    fn measured(name: &str, turns: &[u64]) -> Measurement {
        let mut sorted = turns.to_vec();
        sorted.sort_unstable();
        let p50 = sorted[sorted.len() / 2];
        Measurement {
            name: name.to_string(),
            what: String::new(),
            ns: Distribution {
                count: 10,
                p50,
                p99: 2 * p50,
                p99_9: 3 * p50,
                max: 4 * p50,
                ..Distribution::default()
            },
            fifo: 80,
            host: HostShare::default(),
            slices_p50: if turns.len() > 1 { turns.to_vec() } else { Vec::new() },
        }
    }

    fn file(measurements: Vec<Measurement>) -> Written {
        Written {
            version: VERSION,
            motorium: String::new(),
            arguments: Vec::new(),
            began_unix_s: 0,
            machine: Machine::default(),
            load: String::new(),
            seconds: 0.0,
            denied: Vec::new(),
            measurements,
            skipped: Vec::new(),
            targets: Vec::new(),
        }
    }

    const FLOOR: [u64; 6] = [1_000, 1_010, 990, 1_000, 1_020, 980];

    /// A hop in turns with its floor, `times` as long.
    fn hop(times: f64) -> Written {
        let turns: Vec<u64> = FLOOR.iter().map(|ns| (*ns as f64 * times) as u64).collect();
        file(vec![measured("floor.futex.same", &FLOOR), measured("hop.blocking.same.512", &turns)])
    }

    fn only(old: &[Written], new: &[Written]) -> Change {
        compare(old, new).changes.into_iter().next().unwrap()
    }

    #[test]
    fn consistent_increase_in_every_turn_is_slower() {
        let change = only(&[hop(1.1)], &[hop(1.4)]);
        assert_eq!((change.direction, change.floor.as_str()), (Direction::Slower, "floor.futex.same"));
        assert!((change.change - 1.4 / 1.1).abs() < 0.01, "{change:?}");
        assert_eq!(only(&[hop(1.4)], &[hop(1.1)]).direction, Direction::Faster);
        assert!(compare(&[hop(1.1)], &[hop(1.4)]).is_slower());
    }

    #[test]
    fn same_file_and_small_changes_are_no_change() {
        assert_eq!(only(&[hop(1.1)], &[hop(1.1)]).direction, Direction::Same);
        assert_eq!(only(&[hop(1.1)], &[hop(1.17)]).direction, Direction::Same);
        assert!(!compare(&[hop(1.1)], &[hop(1.17)]).is_slower());
    }

    #[test]
    fn change_within_the_turn_spread_is_noise() {
        let noisy = |turns: [u64; 6]| {
            file(vec![measured("floor.futex.same", &FLOOR), measured("hop.blocking.same.512", &turns)])
        };
        let old = noisy([1_100, 1_900, 1_000, 1_200, 1_700, 1_100]);
        let new = noisy([1_500, 1_400, 2_200, 1_600, 1_700, 1_300]);
        let change = only(&[old], &[new]);
        assert_eq!(change.direction, Direction::Same, "{change:?}");
    }

    #[test]
    fn changed_floor_gives_no_verdict() {
        let moved = |ns: u64| {
            let floor: Vec<u64> = FLOOR.iter().map(|floor| floor * ns / 1_000).collect();
            file(vec![measured("floor.futex.same", &floor), measured("hop.blocking.same.512", &[1_200; 6])])
        };
        assert_eq!(only(&[moved(1_000)], &[moved(4_000)]).direction, Direction::FloorMoved);
        // Machine and hop are faster: no change of the hop.
        let both = |ns: u64| {
            let floor: Vec<u64> = FLOOR.iter().map(|floor| floor * ns / 1_000).collect();
            file(vec![measured("floor.futex.same", &floor), measured("hop.blocking.same.512", &floor)])
        };
        assert_eq!(only(&[both(1_000)], &[both(4_000)]).direction, Direction::Same);
    }

    #[test]
    fn single_runs_show_only_large_changes() {
        let chain = |p50: u64| file(vec![measured("floor.futex.same", &FLOOR), measured("chain.2", &[p50])]);
        let verdicts = |old: &[Written], new: &[Written]| -> Vec<Direction> {
            compare(old, new).changes.into_iter().map(|change| change.direction).collect()
        };
        assert_eq!(verdicts(&[chain(3_000)], &[chain(4_000)]), [Direction::Same, Direction::TooFew]);
        assert_eq!(verdicts(&[chain(3_000)], &[chain(6_000)]), [Direction::Slower, Direction::TooFew]);
        let (old, new) = ([3_000, 3_100, 2_900].map(chain), [6_000, 6_200, 5_900].map(chain));
        assert_eq!(verdicts(&old, &new), [Direction::Slower, Direction::Slower]);
        // Three and three values are separated by chance in one case of ten, so a change below a third needs
        // five.
        let (old, new) = ([3_000, 3_100, 2_900].map(chain), [4_000, 4_200, 3_900].map(chain));
        assert_eq!(verdicts(&old, &new), [Direction::Same, Direction::Same]);
        let (old, new) = ([3_000, 3_100, 2_900, 3_000, 5_000], [4_000, 4_200, 3_900, 4_000, 2_000]);
        assert_eq!(verdicts(&old.map(chain), &new.map(chain)), [Direction::Slower, Direction::Slower]);
    }

    #[test]
    fn differing_conditions_are_reported() {
        let (old, mut new) = (hop(1.1), hop(1.1));
        new.machine = Machine { kernel: "7.0".to_string(), load: 3.0, ..Machine::default() };
        new.measurements[1].fifo = 0;
        new.measurements.push(measured("chain.4", &[5_000]));
        let seen = compare(std::slice::from_ref(&old), &[new]);
        assert!(seen.differences[0].contains("and on Linux 7.0"), "{:?}", seen.differences);
        assert_eq!(seen.differences[1], "hop.blocking.same.512: SCHED_FIFO 80, and 0");
        assert_eq!(seen.left_out, ["chain.4"]);
        let again = Written { machine: Machine { load: 2.0, ..Machine::default() }, ..old.clone() };
        assert!(
            compare(&[old], &[again]).differences.is_empty(),
            "the load of the moment is no other machine"
        );
    }

    #[test]
    fn every_measurement_has_a_floor_in_the_catalogue() {
        let cases = crate::latency::catalogue();
        let is_there = |floor: &str| cases.iter().any(|case| case.name == floor);
        for case in cases.iter().filter(|case| !case.name.starts_with("floor.")) {
            assert!(floor_of(&case.name, is_there).is_some(), "{}", case.name);
        }
    }
}
