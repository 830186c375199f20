//! The machine line: what the figures were measured on.

use std::fs::File;
use std::io::Read as _;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The machine, as far as it matters to latencies.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Machine {
    /// Kernel release and preemption, such as `6.18.0 PREEMPT_DYNAMIC`.
    pub kernel: String,
    /// Name of the processor.
    pub processor: String,
    /// Cores that are online.
    pub cores: usize,
    /// What the kernel reads the time from.
    pub clock_source: String,
    /// Whether it is a virtual machine: its host may take the cores away.
    pub is_virtual: bool,
    /// Frequency governor of the first core; `None` where the system does not scale frequencies.
    pub governor: Option<String>,
    /// What puts idle cores to sleep, as `driver/governor`; `None` where it cannot be read.
    pub idle: Option<String>,
    /// Longest time that a core may take to leave its idle state, us; `None` where nothing limits it or it cannot be read.
    #[serde(default)]
    pub idle_exit_us: Option<u64>,
    /// Load average over one minute when the measurements began.
    pub load: f64,
    /// Share of time real-time threads may use, us per s; `None` without a limit.
    pub realtime_us_per_s: Option<u64>,
}

impl Machine {
    /// Looks at this machine.
    pub fn detect() -> Self {
        let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let line = |name: &str| {
            let found = cpuinfo.lines().find(|line| line.starts_with(name));
            found.and_then(|line| line.split_once(':')).map(|(_, value)| value.trim().to_string())
        };
        let flags = line("flags").or_else(|| line("Features")).unwrap_or_default();
        let version = read("/proc/sys/kernel/version").unwrap_or_default();
        let preemption = version.split_whitespace().find(|word| word.starts_with("PREEMPT")).unwrap_or("");
        let idle = "/sys/devices/system/cpu/cpuidle";
        let idle = read(&format!("{idle}/current_driver"))
            .zip(
                read(&format!("{idle}/current_governor_ro"))
                    .or_else(|| read(&format!("{idle}/current_governor"))),
            )
            .map(|(driver, governor)| format!("{driver}/{governor}"));
        Self {
            kernel: format!("{} {preemption}", read("/proc/sys/kernel/osrelease").unwrap_or_default())
                .trim()
                .to_string(),
            processor: line("model name").unwrap_or_else(|| std::env::consts::ARCH.to_string()),
            cores: cores().len(),
            clock_source: read("/sys/devices/system/clocksource/clocksource0/current_clocksource")
                .unwrap_or_else(|| "unknown".to_string()),
            is_virtual: flags.split_whitespace().any(|flag| flag == "hypervisor"),
            governor: read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
            idle,
            load: read("/proc/loadavg")
                .and_then(|text| text.split_whitespace().next()?.parse().ok())
                .unwrap_or(0.0),
            idle_exit_us: idle_exit_us(),
            realtime_us_per_s: throttling(),
        }
    }
}

impl core::fmt::Display for Machine {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let kind = if self.is_virtual { "virtual" } else { "not virtual" };
        write!(f, "Linux {}, {} cores ({}), {kind}", self.kernel, self.cores, self.processor)?;
        write!(f, ", clock {}", self.clock_source)?;
        match &self.governor {
            Some(governor) => write!(f, ", governor {governor}")?,
            None => write!(f, ", no frequency scaling")?,
        }
        if let Some(idle) = &self.idle {
            write!(f, ", idle {idle}")?;
        }
        if let Some(limit) = self.idle_exit_us {
            write!(f, ", idle states limited to {limit} us")?;
        }
        if let Some(limit) = self.realtime_us_per_s {
            write!(f, ", real time limited to {limit} us/s")?;
        }
        write!(f, ", load {:.2}", self.load)
    }
}

/// What those who hold `/dev/cpu_dma_latency` open have limited idle states to.
fn idle_exit_us() -> Option<u64> {
    let mut bytes = [0; 4];
    File::open("/dev/cpu_dma_latency").ok()?.read_exact(&mut bytes).ok()?;
    // Without a limit the kernel shows 2000 s.
    u64::try_from(i32::from_ne_bytes(bytes)).ok().filter(|limit| *limit < 1_000_000)
}

fn read(path: &str) -> Option<String> {
    Some(std::fs::read_to_string(path).ok()?.trim().to_string()).filter(|text| !text.is_empty())
}

fn throttling() -> Option<u64> {
    let number = |name: &str| read(&format!("/proc/sys/kernel/{name}"))?.parse::<i64>().ok();
    let (runtime, period) = (number("sched_rt_runtime_us")?, number("sched_rt_period_us")?);
    (runtime >= 0 && runtime < period).then(|| (runtime * 1_000_000 / period) as u64)
}

/// The cores that are online.
pub fn cores() -> Vec<usize> {
    let list = read("/sys/devices/system/cpu/online").unwrap_or_else(|| "0".to_string());
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.trim().parse().ok()?..=last.trim().parse().ok()?)
    };
    list.split(',').filter_map(range).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_line_names_what_matters() {
        let machine = Machine {
            kernel: "6.18.0 PREEMPT_DYNAMIC".into(),
            processor: "EPYC".into(),
            cores: 2,
            clock_source: "tsc".into(),
            is_virtual: true,
            governor: None,
            idle: Some("haltpoll/haltpoll".into()),
            load: 0.5,
            idle_exit_us: Some(0),
            realtime_us_per_s: Some(950_000),
        };
        assert_eq!(
            machine.to_string(),
            "Linux 6.18.0 PREEMPT_DYNAMIC, 2 cores (EPYC), virtual, clock tsc, no frequency scaling, \
             idle haltpoll/haltpoll, idle states limited to 0 us, real time limited to 950000 us/s, load 0.50"
        );
    }

    #[test]
    fn this_machine_has_a_core_and_a_kernel() {
        let machine = Machine::detect();
        assert!(machine.cores >= 1 && !machine.kernel.is_empty());
    }
}
