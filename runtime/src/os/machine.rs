//! Facts about the machine that the kernel publishes in `/proc` and `/sys`: its cores, processor, kernel, and
//! the time accounting of each core. All functions open files and must not be called in the step of a
//! component.

use core::ops::Sub;
use std::fs::File;
use std::io::Read as _;

/// Reads and trims a kernel file. Returns `None` if the file is empty or unreadable.
pub fn read(path: &str) -> Option<String> {
    Some(std::fs::read_to_string(path).ok()?.trim().to_string()).filter(|text| !text.is_empty())
}

/// Parses a kernel list of cores, such as `0-3,6`. Returns `None` if the list is malformed.
pub fn parse_cores(list: &str) -> Option<Vec<usize>> {
    let mut cores = Vec::new();
    for part in list.trim().split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        cores.extend(first.parse::<usize>().ok()?..=last.parse().ok()?);
    }
    Some(cores)
}

fn cores(list: &str) -> Vec<usize> {
    read(&format!("/sys/devices/system/cpu/{list}")).and_then(|list| parse_cores(&list)).unwrap_or_default()
}

/// Returns the online cores in ascending order, including cores that are isolated from the scheduler. There
/// is at least one.
pub fn online_cores() -> Vec<usize> {
    let online = cores("online");
    if online.is_empty() {
        return (0..std::thread::available_parallelism().map_or(1, |cores| cores.get())).collect();
    }
    online
}

/// Returns the cores that are isolated from the scheduler (`isolcpus`).
pub fn isolated_cores() -> Vec<usize> {
    cores("isolated")
}

/// Returns the cores that have no periodic timer tick while they run a single thread (`nohz_full`).
pub fn tickless_cores() -> Vec<usize> {
    cores("nohz_full")
}

/// Release and build of a Linux kernel.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Kernel {
    /// Kernel release, such as `6.18.0`.
    pub release: String,
    /// Kernel build, such as `#1 SMP PREEMPT_DYNAMIC Tue Nov 4 12:00:00 UTC 2025`.
    pub version: String,
}

impl Kernel {
    /// Returns the running kernel.
    pub fn detect() -> Self {
        let read = |name: &str| read(&format!("/proc/sys/kernel/{name}")).unwrap_or_default();
        Self { release: read("osrelease"), version: read("version") }
    }

    /// Returns the preemption model, such as `PREEMPT_RT`, or `None` if the build does not name it.
    pub fn preemption(&self) -> Option<&str> {
        self.version.split_whitespace().find(|word| word.starts_with("PREEMPT"))
    }
}

/// Returns the value of the first line of `/proc/cpuinfo` that starts with this name.
fn processor_value(cpuinfo: &str, name: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with(name))?;
    Some(line.split_once(':')?.1.trim().to_string())
}

/// Returns the model name of the processor, or its architecture if the kernel does not provide a name.
pub fn processor() -> String {
    let cpuinfo = read("/proc/cpuinfo").unwrap_or_default();
    processor_value(&cpuinfo, "model name").unwrap_or_else(|| std::env::consts::ARCH.to_string())
}

/// Returns `true` on a virtual machine, according to the processor flags. The host of a virtual machine may
/// preempt the cores at any time.
pub fn is_virtual() -> bool {
    has_hypervisor(&read("/proc/cpuinfo").unwrap_or_default())
}

fn has_hypervisor(cpuinfo: &str) -> bool {
    let flags = processor_value(cpuinfo, "flags").or_else(|| processor_value(cpuinfo, "Features"));
    flags.is_some_and(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"))
}

/// Returns the frequency governor of a core, or `None` without frequency scaling.
pub fn governor(core: usize) -> Option<String> {
    read(&format!("/sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor"))
}

/// Returns the driver and the governor of idle states as `driver/governor`, or `None` if they cannot be read.
pub fn idle_driver() -> Option<String> {
    let folder = "/sys/devices/system/cpu/cpuidle";
    let governor = read(&format!("{folder}/current_governor_ro"))
        .or_else(|| read(&format!("{folder}/current_governor")))?;
    Some(format!("{}/{governor}", read(&format!("{folder}/current_driver"))?))
}

/// Returns the limit on the exit latency of idle states that is set through `/dev/cpu_dma_latency`, us.
/// Returns `None` without a limit, or if this user may not read it.
pub fn idle_exit_limit_us() -> Option<u64> {
    let mut bytes = [0; 4];
    File::open("/dev/cpu_dma_latency").ok()?.read_exact(&mut bytes).ok()?;
    // Without a limit the kernel reports 2000 s.
    u64::try_from(i32::from_ne_bytes(bytes)).ok().filter(|limit| *limit < 1_000_000)
}

/// Returns the kernel's clock source, such as `tsc`.
pub fn clock_source() -> Option<String> {
    read("/sys/devices/system/clocksource/clocksource0/current_clocksource")
}

/// Returns the run time that the kernel grants to real-time threads, us per second of each core; `None`
/// without a limit.
pub fn realtime_limit_us_per_s() -> Option<u64> {
    let number = |name: &str| read(&format!("/proc/sys/kernel/{name}"))?.parse::<i64>().ok();
    let (runtime, period) = (number("sched_rt_runtime_us")?, number("sched_rt_period_us")?);
    (runtime >= 0 && runtime < period).then(|| (runtime * 1_000_000 / period) as u64)
}

/// Returns the load average over one minute, or `None` if it cannot be read.
pub fn load() -> Option<f64> {
    read("/proc/loadavg")?.split_whitespace().next()?.parse().ok()
}

/// Times of one core since the start of the machine, in ticks of `USER_HZ` (10 ms).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CoreTimes {
    /// Index of the core.
    pub core: usize,
    /// Time in programs, including real-time and low-priority (nice) programs.
    pub user: u64,
    /// Time in the kernel on behalf of programs.
    pub system: u64,
    /// Time in interrupts and soft interrupts; 0 if the kernel does not measure it.
    pub interrupts: u64,
    /// Idle time, including waits for storage.
    pub idle: u64,
    /// Time stolen by the host of a virtual machine.
    pub stolen: u64,
}

impl CoreTimes {
    /// Reads the times of all cores, in numerical order; empty if they are unavailable.
    pub fn read() -> Vec<Self> {
        Self::parse(&std::fs::read_to_string("/proc/stat").unwrap_or_default())
    }

    /// Parses the lines `cpuN user nice system idle iowait irq softirq steal ...` of `/proc/stat`, see
    /// proc_stat(5).
    fn parse(text: &str) -> Vec<Self> {
        let line = |line: &str| {
            let mut words = line.split_ascii_whitespace();
            let core = words.next()?.strip_prefix("cpu")?.parse().ok()?;
            // `user` already includes the time of guests.
            let mut next = || words.next().and_then(|word| word.parse::<u64>().ok()).unwrap_or(0);
            let [user, nice, system, idle, waiting, hard, soft, stolen] = core::array::from_fn(|_| next());
            Some(Self {
                core,
                user: user + nice,
                system,
                interrupts: hard + soft,
                idle: idle + waiting,
                stolen,
            })
        };
        text.lines().filter_map(line).collect()
    }

    /// Returns the sum of all times.
    pub fn total(self) -> u64 {
        self.user + self.system + self.interrupts + self.idle + self.stolen
    }

    /// Returns `part` as a fraction of the sum of all times; 0 if the sum is 0.
    pub fn share(self, part: u64) -> f64 {
        part as f64 / self.total().max(1) as f64
    }
}

impl Sub for CoreTimes {
    type Output = Self;

    /// Returns the times between two readings, none below zero, because the kernel sometimes corrects idle
    /// time downwards.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn core_lists_are_parsed_and_malformed_ones_refused() {
        assert_eq!(parse_cores("0-3,6\n"), Some(vec![0, 1, 2, 3, 6]));
        assert_eq!(parse_cores("0\n"), Some(vec![0]));
        for nonsense in ["", "a-b", "(null)", "0-"] {
            assert_eq!(parse_cores(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn hypervisor_is_detected_by_the_processor_flags() {
        assert!(has_hypervisor("processor : 0\nflags\t\t: fpu tsc hypervisor avx2\n"));
        assert!(!has_hypervisor("flags : fpu tsc avx2\n") && !has_hypervisor(""));
    }

    #[test]
    fn preemption_model_is_found_in_the_kernel_build() {
        let kernel = |version: &str| Kernel { release: "6.18.0".into(), version: version.into() };
        assert_eq!(kernel("#1 SMP PREEMPT_RT Tue Nov 4").preemption(), Some("PREEMPT_RT"));
        assert_eq!(kernel("#1 SMP Tue Nov 4").preemption(), None);
    }

    const STAT: &str = "cpu  30 4 60 800 10 1 9 6 0 0\ncpu0 10 1 20 400 5 0 4 2 7 0\ncpu1 20 3 40 400 5 1 5 4 0 0\nintr 5 6\nctxt 1\n";

    #[test]
    fn core_times_are_parsed_per_line() {
        let cores = CoreTimes::parse(STAT);
        let first = CoreTimes { core: 0, user: 11, system: 20, interrupts: 4, idle: 405, stolen: 2 };
        let second = CoreTimes { core: 1, user: 23, system: 40, interrupts: 6, idle: 405, stolen: 4 };
        assert_eq!(cores, [first, second]);
        assert_eq!(second.total(), 478);
        assert!((second.share(second.stolen) - 4.0 / 478.0).abs() < 1e-12);
    }

    #[test]
    fn missing_columns_count_as_zero() {
        let expected = CoreTimes { core: 3, user: 3, system: 3, idle: 4, ..CoreTimes::default() };
        assert_eq!(CoreTimes::parse("cpu3 1 2 3 4\n"), [expected]);
        assert_eq!(CoreTimes::parse(""), []);
    }

    #[test]
    fn decreasing_idle_time_is_not_negative() {
        let idle = |idle| CoreTimes { idle, ..CoreTimes::default() };
        assert_eq!((idle(10) - idle(12)).idle, 0);
        assert_eq!((idle(10) - idle(12)).share(0), 0.0);
    }

    #[test]
    fn kernel_processor_and_core_times_are_readable() {
        assert!(!Kernel::detect().release.is_empty() && !processor().is_empty());
        let (online, times) = (online_cores(), CoreTimes::read());
        assert!(!online.is_empty() && times.iter().all(|core| core.total() > 0), "{times:?}");
        assert_eq!(times.iter().map(|core| core.core).collect::<Vec<_>>(), online);
    }
}
