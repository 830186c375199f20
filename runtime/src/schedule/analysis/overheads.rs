//! The overheads of the machine, and the kernel's limit on real-time threads.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const MICROSECOND: u64 = 1_000;

/// Time that goes to the machine and to the runtime rather than to components.
///
/// The defaults are what 99 of 100 cases stay below, with room to spare, on virtual machines of two cores (Linux 6.18)
/// on their worse days; `motorium calibrate` measures a machine's own, which are put in their place. Times of the core
/// are what `CLOCK_THREAD_CPUTIME_ID` counts besides the step itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Overheads {
    /// How late a sleeping component may be woken, ns; 150 us. It costs no time of the core. What of it falls into the
    /// time a component spins before its release is hidden by that.
    pub wake_ns: u64,
    /// Time of the core that a component takes for every release by the clock, on top of `worker_ns`, ns; 80 us: the
    /// timer and its interrupt, falling asleep, and getting back onto a core that others have had meanwhile.
    pub timer_ns: u64,
    /// Time of the core from the end of a step to the beginning of the one that it triggers on the same core, ns; 8 us.
    pub hop_same_core_ns: u64,
    /// Longest time from a publication to the moment when a component that it triggers on another core may run, ns;
    /// 150 us, most of which an idle core takes to wake up. It costs no time of either core.
    pub hop_cross_core_ns: u64,
    /// Time of the core for which a component that is triggered from another core looks for the next publication, after
    /// its step and before it sleeps, ns; 20 us at most.
    pub look_ns: u64,
    /// Time of the core that the worker takes for every step besides the component's own, ns; 16 us: reading clocks,
    /// repeating for those who look on what was published, accounting.
    pub worker_ns: u64,
}

impl Overheads {
    /// A machine that costs nothing: for the analysis of task sets in the abstract.
    pub const NONE: Self =
        Self { wake_ns: 0, timer_ns: 0, hop_same_core_ns: 0, hop_cross_core_ns: 0, look_ns: 0, worker_ns: 0 };

    /// Defaults where nothing was measured.
    pub const CAUTIOUS: Self = Self {
        wake_ns: 150 * MICROSECOND,
        timer_ns: 80 * MICROSECOND,
        hop_same_core_ns: 8 * MICROSECOND,
        hop_cross_core_ns: 150 * MICROSECOND,
        look_ns: crate::transport::SPIN_NS,
        worker_ns: 16 * MICROSECOND,
    };
}

impl Default for Overheads {
    fn default() -> Self {
        Self::CAUTIOUS
    }
}

/// How long real-time threads may keep a core busy: `sched_rt_runtime_us` in every `sched_rt_period_us`. A kernel with
/// throttling stops them for the rest of the period when they have used it up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RtLimit {
    /// Time they may run in each period, ns; as long as they like if `None`.
    pub runtime_ns: Option<u64>,
    /// The period, ns.
    pub period_ns: u64,
}

impl RtLimit {
    /// No throttling.
    pub const NONE: Self = Self { runtime_ns: None, period_ns: 1_000_000_000 };

    /// Linux's default: 950 ms in every second.
    pub const KERNEL_DEFAULT: Self = Self { runtime_ns: Some(950_000_000), period_ns: 1_000_000_000 };

    /// The limit from the two files in `/proc/sys/kernel`, in us; a negative run time means that there is none.
    /// `None` if they do not hold numbers.
    pub fn from_sysctl(runtime_us: &str, period_us: &str) -> Option<Self> {
        let runtime: i64 = runtime_us.trim().parse().ok()?;
        let period_ns = period_us.trim().parse::<u64>().ok()?.checked_mul(MICROSECOND)?;
        let runtime_ns = u64::try_from(runtime).ok().map(|us| us.saturating_mul(MICROSECOND));
        let runtime_ns = runtime_ns.filter(|runtime_ns| *runtime_ns < period_ns);
        (period_ns > 0).then_some(Self { runtime_ns, period_ns })
    }

    /// The limit of the machine this runs on; the kernel's default if it cannot be read.
    pub fn detect() -> Self {
        let read =
            |name: &str| std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).unwrap_or_default();
        Self::from_sysctl(&read("sched_rt_runtime_us"), &read("sched_rt_period_us"))
            .unwrap_or(Self::KERNEL_DEFAULT)
    }

    /// Share of each core that the kernel promises to components by their deadlines, 0 to 1: what real-time threads
    /// may have, less what it reserves for those at normal priority in the same way (the fair server of Linux 6.12 and
    /// later, 50 ms in every second of each core; counted for earlier ones too). Everything where there is no
    /// throttling.
    pub fn deadline_share(&self) -> f64 {
        const FAIR_SERVER_MS_PER_S: u64 = 50;
        match self.runtime_ns {
            Some(runtime_ns) if runtime_ns < self.period_ns => {
                let kept = self.period_ns / 1_000 * FAIR_SERVER_MS_PER_S;
                runtime_ns.saturating_sub(kept) as f64 / self.period_ns as f64
            }
            _ => 1.0,
        }
    }

    /// Share of a core that real-time threads may have, 0 to 1.
    pub fn share(&self) -> f64 {
        match self.runtime_ns {
            Some(runtime_ns) if runtime_ns < self.period_ns => runtime_ns as f64 / self.period_ns as f64,
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_read_as_the_kernel_writes_it() {
        assert_eq!(RtLimit::from_sysctl("950000\n", "1000000\n"), Some(RtLimit::KERNEL_DEFAULT));
        assert_eq!(RtLimit::from_sysctl("-1\n", "1000000\n"), Some(RtLimit::NONE));
        assert_eq!(RtLimit::from_sysctl("1000000", "1000000").map(|limit| limit.share()), Some(1.0));
        assert_eq!(RtLimit::from_sysctl("0", "1000000").map(|limit| limit.share()), Some(0.0));
        assert_eq!(RtLimit::from_sysctl("", ""), None);
        assert_eq!(RtLimit::from_sysctl("1", "0"), None);
        assert_eq!(RtLimit::KERNEL_DEFAULT.share(), 0.95);
        assert_eq!(RtLimit::KERNEL_DEFAULT.deadline_share(), 0.9);
        assert_eq!(RtLimit::NONE.deadline_share(), 1.0);
    }
}
