//! The overheads of the machine, and the kernel's limit on real-time threads.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const MICROSECOND: u64 = 1_000;

/// Time that the machine and the runtime use in addition to the components' own execution times.
///
/// The defaults cover 99 of 100 cases on virtual machines with two cores (Linux 6.18) under load. `motorium
/// calibrate` measures the overheads of the machine, which then replace the defaults. Core times are measured
/// by `CLOCK_THREAD_CPUTIME_ID` and do not include the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Overheads {
    /// Maximum delay of the wake-up of a sleeping component, ns; 150 us by default. The delay uses no core
    /// time. A component that spins before its release wakes earlier by the spin time, which reduces the
    /// effect of the delay by the same amount.
    pub wake_ns: u64,
    /// Core time for every release by the clock, in addition to `worker_ns`, ns; 80 us by default. This time
    /// covers the timer and its interrupt, falling asleep, and cache misses after other threads have used the
    /// core.
    pub timer_ns: u64,
    /// Core time from the end of a step to the start of the step that it triggers on the same core, ns; 8 us
    /// by default.
    pub hop_same_core_ns: u64,
    /// Maximum time from a publication until a component that it triggers on a different core can run, ns;
    /// 150 us by default, mostly for the wake-up of an idle core. This time uses no core time.
    pub hop_cross_core_ns: u64,
    /// Core time for which a component polls for the next publication after its step and before it sleeps,
    /// ns; 20 us by default. Only components that are triggered from a different core poll.
    pub look_ns: u64,
    /// Core time of the worker per step, in addition to the component's own time, ns; 16 us by default. The
    /// worker spends this time on clock readings and statistics.
    pub worker_ns: u64,
}

impl Overheads {
    /// Overheads that are all zero, for the analysis of abstract task sets.
    pub const NONE: Self =
        Self { wake_ns: 0, timer_ns: 0, hop_same_core_ns: 0, hop_cross_core_ns: 0, look_ns: 0, worker_ns: 0 };

    /// Conservative defaults for a machine without measurements.
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

/// The kernel's limit on real-time threads: run time `sched_rt_runtime_us` in every period
/// `sched_rt_period_us`. Once the threads have used up their run time, the kernel stops them for the rest of
/// the period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RtLimit {
    /// Permitted run time in each period, ns; `None` if it is unlimited.
    pub runtime_ns: Option<u64>,
    /// Period of the limit, ns.
    pub period_ns: u64,
}

impl RtLimit {
    /// No limit, as on a kernel that does not throttle real-time threads.
    pub const NONE: Self = Self { runtime_ns: None, period_ns: 1_000_000_000 };

    /// Default limit of Linux: 950 ms in every second.
    pub const KERNEL_DEFAULT: Self = Self { runtime_ns: Some(950_000_000), period_ns: 1_000_000_000 };

    /// Parses the limit from the texts of the two files in `/proc/sys/kernel`, in us. A negative run time
    /// means no limit. Returns `None` if the texts are not numbers.
    pub fn from_sysctl(runtime_us: &str, period_us: &str) -> Option<Self> {
        let runtime: i64 = runtime_us.trim().parse().ok()?;
        let period_ns = period_us.trim().parse::<u64>().ok()?.checked_mul(MICROSECOND)?;
        let runtime_ns = u64::try_from(runtime).ok().map(|us| us.saturating_mul(MICROSECOND));
        let runtime_ns = runtime_ns.filter(|runtime_ns| *runtime_ns < period_ns);
        (period_ns > 0).then_some(Self { runtime_ns, period_ns })
    }

    /// Returns the limit of this machine, or the kernel's default if it cannot be read.
    pub fn detect() -> Self {
        let read =
            |name: &str| std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).unwrap_or_default();
        Self::from_sysctl(&read("sched_rt_runtime_us"), &read("sched_rt_period_us"))
            .unwrap_or(Self::KERNEL_DEFAULT)
    }

    /// Returns the fraction of each core that the kernel grants to `SCHED_DEADLINE` components, 0 to 1. This
    /// is [`share`](Self::share) minus the kernel's reserve for threads of normal priority (the fair server
    /// of Linux 6.12 and later). The reserve is 50 ms in every second of each core, and is also assumed for
    /// earlier kernels. The result is 1 if the kernel does not throttle real-time threads.
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

    /// Returns the fraction of a core that real-time threads may use, 0 to 1.
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
    fn limit_is_parsed_in_kernel_format() {
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
