//! Description of the machine on which figures were measured.

use motorium::os::machine;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Properties of the machine that affect latencies.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Machine {
    /// Kernel release and preemption, such as `6.18.0 PREEMPT_DYNAMIC`.
    pub kernel: String,
    /// Name of the processor.
    pub processor: String,
    /// Number of online cores.
    pub cores: usize,
    /// Clock source of the kernel.
    pub clock_source: String,
    /// `true` for a virtual machine, whose host may preempt the cores.
    pub is_virtual: bool,
    /// Frequency governor of the first core; `None` without frequency scaling.
    pub governor: Option<String>,
    /// Driver and governor of idle states, as `driver/governor`; `None` if unreadable.
    pub idle: Option<String>,
    /// Maximum exit latency of permitted idle states, us; `None` if unlimited or unreadable.
    #[serde(default)]
    pub idle_exit_us: Option<u64>,
    /// Load average over one minute when the measurements began.
    pub load: f64,
    /// Maximum processor time of real-time threads, us per s; `None` without a limit.
    pub realtime_us_per_s: Option<u64>,
}

impl Machine {
    /// Reads the properties of this machine.
    pub fn detect() -> Self {
        let kernel = machine::Kernel::detect();
        let preemption = kernel.preemption().map_or(String::new(), |model| format!(" {model}"));
        Self {
            kernel: format!("{}{preemption}", kernel.release),
            processor: machine::processor(),
            cores: machine::online_cores().len(),
            clock_source: machine::clock_source().unwrap_or_else(|| "unknown".to_string()),
            is_virtual: machine::is_virtual(),
            governor: machine::governor(0),
            idle: machine::idle_driver(),
            idle_exit_us: machine::idle_exit_limit_us(),
            load: machine::load().unwrap_or(0.0),
            realtime_us_per_s: machine::realtime_limit_us_per_s(),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machine_line_names_relevant_properties() {
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
