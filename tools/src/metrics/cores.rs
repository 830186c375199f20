//! What each core of the machine did, from `/proc/stat`.

use core::ops::Sub;

/// What one core did since the machine started, in ticks of the kernel's clock (1/100 s).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct CoreTimes {
    /// Its number.
    pub(crate) core: usize,
    /// Programs, real-time and nice ones included.
    pub(crate) user: u64,
    /// The kernel for programs.
    pub(crate) system: u64,
    /// Interrupts, soft ones included.
    pub(crate) interrupts: u64,
    /// Nothing, waiting for storage included.
    pub(crate) idle: u64,
    /// Held back by the host of the virtual machine.
    pub(crate) stolen: u64,
}

impl CoreTimes {
    /// All cores, in the order of their numbers; none if the kernel does not say.
    pub(crate) fn read() -> Vec<Self> {
        parse(&std::fs::read_to_string("/proc/stat").unwrap_or_default())
    }

    /// All of it.
    pub(crate) fn total(self) -> u64 {
        self.user + self.system + self.interrupts + self.idle + self.stolen
    }

    /// The share of a part in all of it; 0 of nothing.
    pub(crate) fn share(self, part: u64) -> f64 {
        part as f64 / self.total().max(1) as f64
    }
}

impl Sub for CoreTimes {
    type Output = Self;

    /// What it did since `earlier`. The kernel corrects idle time downwards at times, so nothing goes below zero.
    fn sub(self, earlier: Self) -> Self {
        Self {
            core: self.core,
            user: self.user.saturating_sub(earlier.user),
            system: self.system.saturating_sub(earlier.system),
            interrupts: self.interrupts.saturating_sub(earlier.interrupts),
            idle: self.idle.saturating_sub(earlier.idle),
            stolen: self.stolen.saturating_sub(earlier.stolen),
        }
    }
}

/// The lines `cpuN user nice system idle iowait irq softirq steal ...` (proc_stat(5)). Guests' time is in `user` already.
fn parse(text: &str) -> Vec<CoreTimes> {
    text.lines()
        .filter_map(|line| {
            let mut words = line.split_ascii_whitespace();
            let core = words.next()?.strip_prefix("cpu")?.parse().ok()?;
            let mut next = || words.next().and_then(|word| word.parse::<u64>().ok()).unwrap_or(0);
            let (user, nice, system, idle, waiting, hard, soft, stolen) =
                (next(), next(), next(), next(), next(), next(), next(), next());
            Some(CoreTimes {
                core,
                user: user + nice,
                system,
                interrupts: hard + soft,
                idle: idle + waiting,
                stolen,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "cpu  30 4 60 800 10 1 9 6 0 0\ncpu0 10 1 20 400 5 0 4 2 7 0\ncpu1 20 3 40 400 5 1 5 4 0 0\nintr 5 6\nctxt 1\n";

    #[test]
    fn each_core_has_its_line() {
        let cores = parse(TEXT);
        let first = CoreTimes { core: 0, user: 11, system: 20, interrupts: 4, idle: 405, stolen: 2 };
        let second = CoreTimes { core: 1, user: 23, system: 40, interrupts: 6, idle: 405, stolen: 4 };
        assert_eq!(cores, [first, second]);
        assert_eq!(second.total(), 478);
        assert!((second.share(second.stolen) - 4.0 / 478.0).abs() < 1e-12);
    }

    #[test]
    fn a_kernel_without_the_later_columns_is_read_as_far_as_it_goes() {
        let expected = CoreTimes { core: 3, user: 3, system: 3, idle: 4, ..CoreTimes::default() };
        assert_eq!(parse("cpu3 1 2 3 4\n"), [expected]);
        assert_eq!(parse(""), []);
    }

    #[test]
    fn idle_time_that_the_kernel_takes_back_is_no_negative_time() {
        let of = |idle| CoreTimes { idle, ..CoreTimes::default() };
        assert_eq!((of(10) - of(12)).idle, 0);
        assert_eq!((of(10) - of(12)).share(0), 0.0);
    }

    #[test]
    fn this_machine_has_cores_that_did_something() {
        let cores = CoreTimes::read();
        assert!(!cores.is_empty() && cores.iter().all(|core| core.total() > 0), "{cores:?}");
    }
}
