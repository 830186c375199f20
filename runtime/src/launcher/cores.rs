//! Activity of a core during a run that its components did not cause: interrupts, soft interrupts, and time
//! stolen by the host.

use std::collections::BTreeMap;
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::os::machine::CoreTimes;

/// Length of a tick in `/proc/stat`, ms: `USER_HZ` is 100 on every architecture that Linux runs on today.
const TICK_MS: f64 = 10.0;

/// Activity on one core during a run that the run's components did not cause.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CoreReport {
    /// Index of the core.
    pub core: usize,
    /// Duration of the measurement, s.
    pub seconds: f64,
    /// Time stolen by the host of a virtual machine, ms (`steal` of `/proc/stat`, in steps of 10 ms).
    pub steal_ms: f64,
    /// Time in interrupts and soft interrupts, ms, in steps of 10 ms; 0 if the kernel does not measure it.
    pub interrupt_ms: f64,
    /// Number of interrupts, by name in `/proc/interrupts`. `LOC` is the timer, `RES` and `CAL` are
    /// interrupts from other cores, and all other names are device interrupts.
    pub interrupts: BTreeMap<String, u64>,
    /// Number of soft interrupts, by name in `/proc/softirqs`.
    pub softirqs: BTreeMap<String, u64>,
}

impl CoreReport {
    /// Returns the total number of interrupts.
    pub fn interrupts_in_all(&self) -> u64 {
        self.interrupts.values().sum()
    }

    /// Returns the number of device interrupts, which could be moved to another core. Timer interrupts and
    /// interrupts from other cores do not count.
    pub fn from_devices(&self) -> u64 {
        let device =
            |name: &&String| !(name.len() == 3 && name.chars().all(|letter| letter.is_ascii_uppercase()));
        self.interrupts.iter().filter(|(name, _)| device(name)).map(|(_, count)| count).sum()
    }

    /// Adds `other`, a measurement of the same core over a separate interval, to this measurement.
    pub fn add(&mut self, other: &Self) {
        self.seconds += other.seconds;
        self.steal_ms += other.steal_ms;
        self.interrupt_ms += other.interrupt_ms;
        for (mine, theirs) in
            [(&mut self.interrupts, &other.interrupts), (&mut self.softirqs, &other.softirqs)]
        {
            theirs.iter().for_each(|(name, count)| *mine.entry(name.clone()).or_default() += count);
        }
    }
}

/// A measurement of the activity on several cores.
#[derive(Debug)]
pub struct CoreWatch {
    since: Instant,
    cores: Vec<usize>,
    before: Counts,
}

impl CoreWatch {
    /// Starts to measure these cores.
    pub fn start(mut cores: Vec<usize>) -> Self {
        cores.sort_unstable();
        cores.dedup();
        Self { cores, before: Counts::now(), since: Instant::now() }
    }

    /// Returns the activity of each core since the start. Values that the system does not count are zero.
    pub fn stop(&self) -> Vec<CoreReport> {
        let seconds = self.since.elapsed().as_secs_f64();
        let after = Counts::now();
        self.cores
            .iter()
            .map(|core| {
                let times = after.times(*core) - self.before.times(*core);
                CoreReport {
                    core: *core,
                    seconds,
                    steal_ms: times.stolen as f64 * TICK_MS,
                    interrupt_ms: times.interrupts as f64 * TICK_MS,
                    interrupts: came(&self.before.interrupts, &after.interrupts, *core),
                    softirqs: came(&self.before.softirqs, &after.softirqs, *core),
                }
            })
            .collect()
    }
}

/// Counts of one kind by name and core.
type ByName = BTreeMap<String, BTreeMap<usize, u64>>;

#[derive(Debug, Default)]
struct Counts {
    times: Vec<CoreTimes>,
    interrupts: ByName,
    softirqs: ByName,
}

impl Counts {
    fn now() -> Self {
        let read = |name: &str| std::fs::read_to_string(format!("/proc/{name}")).unwrap_or_default();
        Self {
            times: CoreTimes::read(),
            interrupts: table(&read("interrupts")),
            softirqs: table(&read("softirqs")),
        }
    }
}

impl Counts {
    fn times(&self, core: usize) -> CoreTimes {
        self.times.iter().find(|times| times.core == core).copied().unwrap_or_default()
    }
}

/// Returns the increase of a core's counts between two readings.
fn came(before: &ByName, after: &ByName, core: usize) -> BTreeMap<String, u64> {
    let count = |counts: &ByName, name: &str| counts.get(name).and_then(|cores| cores.get(&core)).copied();
    after
        .keys()
        .filter_map(|name| {
            let came = count(after, name)?.saturating_sub(count(before, name).unwrap_or(0));
            (came > 0).then(|| (name.clone(), came))
        })
        .collect()
}

/// Parses a table of the kernel with cores in the first line, then a label and a count for each core per row.
/// A row whose label is a number is named by its last word, the device. Rows with equal names are added.
fn table(text: &str) -> ByName {
    let mut lines = text.lines();
    let head = lines.next().unwrap_or_default();
    let cores: Vec<usize> =
        head.split_whitespace().filter_map(|word| word.strip_prefix("CPU")?.parse().ok()).collect();
    let mut found = ByName::new();
    for line in lines {
        let Some((label, rest)) = line.split_once(':') else { continue };
        let label = label.trim();
        let mut words = rest.split_whitespace();
        let counts: Vec<u64> = words.by_ref().take(cores.len()).map_while(|word| word.parse().ok()).collect();
        // rows with one count for all cores (`ERR`, `MIS`) belong to no core
        if counts.len() < cores.len() {
            continue;
        }
        let is_number = label.chars().all(|digit| digit.is_ascii_digit());
        let name = if is_number { words.next_back().unwrap_or(label) } else { label };
        let row = found.entry(name.to_string()).or_default();
        cores.iter().zip(counts).for_each(|(core, count)| *row.entry(*core).or_default() += count);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERRUPTS: &str = "           CPU0       CPU3       \n 24:          1          7  IO-APIC   5-edge      ttyS0\n \
                              36:          0         40  PCI-MSIX-0000:00:02.0   1-edge      virtio1-req.0\n\
                              LOC:        500        900   Local timer interrupts\nERR:          0\n";

    #[test]
    fn interrupts_are_named_by_their_device_or_by_their_label() {
        let found = table(INTERRUPTS);
        assert_eq!(found["ttyS0"], BTreeMap::from([(0, 1), (3, 7)]));
        assert_eq!(found["virtio1-req.0"][&3], 40);
        assert_eq!(found["LOC"][&0], 500);
        assert!(!found.contains_key("ERR"), "belongs to no core");
    }

    #[test]
    fn counts_cover_the_interval_and_the_core_only() {
        let before = table(INTERRUPTS);
        let after = table(&INTERRUPTS.replace("900", "950").replace("500", "777"));
        assert_eq!(came(&before, &after, 3), BTreeMap::from([("LOC".to_string(), 50)]));
        assert_eq!(came(&before, &after, 1), BTreeMap::new());
    }

    #[test]
    fn device_interrupts_exclude_timers_and_other_cores() {
        let counts = [("LOC", 1_000), ("RES", 20), ("virtio1-req.0", 3), ("eth0", 4)];
        let interrupts = counts.map(|(name, count)| (name.to_string(), count)).into();
        let seen = CoreReport { interrupts, ..CoreReport::default() };
        assert_eq!((seen.interrupts_in_all(), seen.from_devices()), (1_027, 7));
    }

    #[test]
    fn counts_of_two_intervals_add_up() {
        let one = |name: &str| CoreReport {
            seconds: 1.0,
            steal_ms: 10.0,
            interrupts: BTreeMap::from([(name.to_string(), 2)]),
            ..CoreReport::default()
        };
        let mut sum = one("LOC");
        sum.add(&one("LOC"));
        sum.add(&one("eth0"));
        assert_eq!((sum.seconds, sum.steal_ms), (3.0, 30.0));
        assert_eq!(sum.interrupts, BTreeMap::from([("LOC".to_string(), 4), ("eth0".to_string(), 2)]));
    }

    #[test]
    fn watch_reports_the_requested_cores() {
        let watch = CoreWatch::start(vec![0, 0]);
        let seen = watch.stop();
        assert_eq!(seen.iter().map(|core| core.core).collect::<Vec<_>>(), [0]);
        assert!(seen[0].seconds >= 0.0);
    }
}
