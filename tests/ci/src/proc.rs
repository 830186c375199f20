//! Counters of the kernel below `/proc`.

/// Ticks per second of all counters (`USER_HZ`, the same on every architecture that the project supports).
pub(crate) const TICKS_PER_SECOND: f64 = 100.0;

/// Time of one core since the machine started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CoreTicks {
    pub(crate) core: usize,
    /// All time, idle time included.
    pub(crate) total: u64,
    /// Time in which the host ran something else.
    pub(crate) steal: u64,
}

/// Reads the cores in the text of `/proc/stat`.
pub(crate) fn cores(stat: &str) -> Vec<CoreTicks> {
    let core = |line: &str| {
        let mut fields = line.strip_prefix("cpu")?.split_whitespace();
        let core = fields.next()?.parse().ok()?;
        // user, nice, system, idle, iowait, irq, softirq, steal; guest time is included in user time
        let ticks: Vec<u64> = fields.take(8).map_while(|field| field.parse().ok()).collect();
        let steal = *ticks.get(7)?;
        Some(CoreTicks { core, total: ticks.iter().sum(), steal })
    };
    // the first line sums up all cores and has no number
    stat.lines().filter(|line| !line.starts_with("cpu ")).filter_map(core).collect()
}

/// State and processor time of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Process {
    /// The process has ended, and its parent has not waited for it yet.
    pub(crate) is_zombie: bool,
    /// Processor time of the process and of the children that it waited for, in ticks.
    pub(crate) ticks: u64,
}

/// Reads the text of `/proc/PID/stat`.
pub(crate) fn process(stat: &str) -> Option<Process> {
    // the name, in parentheses, may contain anything
    let (_, rest) = stat.rsplit_once(')')?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    let times = fields.get(11..15)?.iter().map(|field| field.parse::<u64>());
    let ticks = times.sum::<Result<u64, _>>().ok()?;
    Some(Process { is_zombie: matches!(fields.first(), Some(&"Z" | &"X")), ticks })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cores_have_total_and_steal() {
        let stat = "cpu  30 2 3 40 5 0 6 7 0 0\ncpu0 10 1 2 20 3 0 4 5 0 0\ncpu3 20 1 1 20 2 0 2 2 9 9\n\
                    intr 1 2 3\nctxt 5\n";
        let expected =
            [CoreTicks { core: 0, total: 45, steal: 5 }, CoreTicks { core: 3, total: 48, steal: 2 }];
        assert_eq!(cores(stat), expected);
        assert_eq!(cores("cpu0 1 2 3\ncpux 1 2 3 4 5 6 7 8\n"), [], "old or damaged lines");
    }

    #[test]
    fn cores_of_this_machine_are_counted() {
        let stat = std::fs::read_to_string("/proc/stat").expect("Linux");
        let cores = cores(&stat);
        assert!(!cores.is_empty() && cores.iter().all(|core| core.total > core.steal), "{cores:?}");
    }

    #[test]
    fn process_times_include_awaited_children() {
        let stat = "77 (a ) b) Z 1 2 3 4 5 6 7 8 9 10 100 20 3 4 20 0 1 0";
        assert_eq!(process(stat), Some(Process { is_zombie: true, ticks: 127 }));
        assert_eq!(process("77 (a) S 1 2"), None);
        let own = std::fs::read_to_string("/proc/self/stat").expect("Linux");
        assert!(process(&own).is_some_and(|process| !process.is_zombie), "{own}");
    }
}
