//! The kernel: version, preemption, timers, clock source, throttling.

use std::process::{Command, Stdio};

use super::finding::Finding;
use super::read;

/// Check of the kernel's preemption model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Preemption {
    Realtime,
    Full,
    Lazy,
    Voluntary,
    None,
    Unknown,
}

pub(super) fn check() -> Vec<Finding> {
    let version = read("/proc/version").unwrap_or_default();
    let preemption = preemption(
        &version,
        read("/sys/kernel/realtime").as_deref(),
        read("/sys/kernel/debug/sched/preempt").as_deref(),
        &read("/proc/cmdline").unwrap_or_default(),
        &configuration(&version).unwrap_or_default(),
    );
    let resolution = rustix::time::clock_getres(rustix::time::ClockId::Monotonic);
    vec![
        check_version(&version),
        check_preemption(preemption),
        check_resolution(resolution.tv_sec as u64 * 1_000_000_000 + resolution.tv_nsec as u64),
        check_clock_source(
            &read("/sys/devices/system/clocksource/clocksource0/current_clocksource").unwrap_or_default(),
            &read("/sys/devices/system/clocksource/clocksource0/available_clocksource").unwrap_or_default(),
        ),
        check_throttling(
            &read("/proc/sys/kernel/sched_rt_runtime_us").unwrap_or_default(),
            &read("/proc/sys/kernel/sched_rt_period_us").unwrap_or_default(),
        ),
    ]
}

/// Returns the kernel's build configuration, if it is available.
fn configuration(version: &str) -> Option<String> {
    if let Some(text) = read(&format!("/boot/config-{}", release(version)?)) {
        return Some(text);
    }
    let file = "/proc/config.gz";
    std::path::Path::new(file).exists().then_some(())?;
    let output = Command::new("gzip").args(["-dc", file]).stdin(Stdio::null()).output().ok()?;
    String::from_utf8(output.stdout).ok()
}

/// Parses the release from `/proc/version`: `Linux version 6.18.1-rt ... (...)`.
fn release(version: &str) -> Option<&str> {
    version.split_whitespace().nth(2)
}

fn check_version(version: &str) -> Finding {
    let Some(release) = release(version) else {
        return Finding::warn("kernel", "its version cannot be read", "is /proc mounted?");
    };
    let mut numbers = release.split(['.', '-', '+']).map(|part| part.parse::<u32>().unwrap_or(0));
    let (major, minor) = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    if (major, minor) < (5, 4) {
        let found = format!("Linux {release}: processes cannot be watched by pidfd");
        return Finding::fail("kernel", found, "install Linux 5.4 or newer");
    }
    Finding::pass("kernel", format!("Linux {release}"))
}

/// Returns the preemption model, from the kernel's own report, the boot command line, or the build
/// configuration, in this order.
fn preemption(
    version: &str,
    realtime: Option<&str>,
    debug: Option<&str>,
    command_line: &str,
    configuration: &str,
) -> Preemption {
    if realtime == Some("1") || version.contains("PREEMPT_RT") {
        return Preemption::Realtime;
    }
    let named = |name: &str| match name {
        "full" => Some(Preemption::Full),
        "lazy" => Some(Preemption::Lazy),
        "voluntary" => Some(Preemption::Voluntary),
        "none" => Some(Preemption::None),
        _ => None,
    };
    // "none voluntary (full)": the active model is in parentheses
    let bracketed = |text: &str| text.split_once('(')?.1.split_once(')').map(|(name, _)| name.to_string());
    if let Some(preemption) = debug.and_then(bracketed).and_then(|name| named(&name)) {
        return preemption;
    }
    let booted = command_line.split_whitespace().rev().find_map(|word| word.strip_prefix("preempt="));
    if let Some(preemption) = booted.and_then(named) {
        return preemption;
    }
    let built = |option: &str| configuration.lines().any(|line| line == format!("CONFIG_{option}=y"));
    let models = [
        ("PREEMPT", Preemption::Full),
        ("PREEMPT_LAZY", Preemption::Lazy),
        ("PREEMPT_VOLUNTARY", Preemption::Voluntary),
        ("PREEMPT_NONE", Preemption::None),
    ];
    if let Some((_, preemption)) = models.into_iter().find(|(option, _)| built(option)) {
        return preemption;
    }
    let words: Vec<_> = version.split_whitespace().collect();
    if words.contains(&"PREEMPT") {
        Preemption::Full
    } else if words.contains(&"PREEMPT_DYNAMIC") || words.is_empty() {
        Preemption::Unknown
    } else {
        Preemption::None
    }
}

fn check_preemption(preemption: Preemption) -> Finding {
    let name = "preemption";
    let better = "boot with preempt=full on the kernel command line, or install a PREEMPT_RT kernel \
                  (Debian: sudo apt install linux-image-rt-amd64)";
    let found = match preemption {
        Preemption::Realtime => return Finding::pass(name, "PREEMPT_RT: latencies are bounded"),
        Preemption::Full => {
            return Finding::pass(name, "full, but not PREEMPT_RT: latencies are short, not bounded");
        }
        Preemption::Lazy => {
            "lazy, not PREEMPT_RT: normal threads may delay real-time threads inside the kernel"
        }
        Preemption::Voluntary => "voluntary: a real-time thread waits for other threads to leave the kernel",
        Preemption::None => "none: a real-time thread waits until other threads leave the kernel",
        Preemption::Unknown => "chosen at boot, but not readable as this user",
    };
    Finding::warn(name, found, better)
}

fn check_resolution(resolution_ns: u64) -> Finding {
    let name = "timers";
    if resolution_ns <= 1_000 {
        return Finding::pass(name, format!("high resolution ({resolution_ns} ns)"));
    }
    let found = format!("resolution {resolution_ns} ns: too coarse for a rate of 1 kHz");
    Finding::fail(
        name,
        found,
        "boot without highres=off and nohz=off; the kernel needs CONFIG_HIGH_RES_TIMERS=y",
    )
}

fn check_clock_source(current: &str, available: &str) -> Finding {
    let name = "clock source";
    match current {
        "tsc" | "arch_sys_counter" | "riscv_clocksource" => Finding::pass(name, current),
        "kvm-clock" | "hyperv_clocksource_tsc_page" => {
            Finding::pass(name, format!("{current} (read without a system call)"))
        }
        "" => Finding::warn(name, "unknown", "is /sys mounted?"),
        slow => {
            let found = format!("{slow}: every clock reading is a slow system call");
            let fix = if available.split_whitespace().any(|source| source == "tsc") {
                "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
            } else {
                "boot with tsc=reliable if the processor's counter is (sudo dmesg | grep -i tsc says why not)"
            };
            Finding::warn(name, found, fix)
        }
    }
}

fn check_throttling(runtime: &str, period: &str) -> Finding {
    let name = "throttling";
    let (Ok(runtime), Ok(period)) = (runtime.parse::<i64>(), period.parse::<i64>()) else {
        return Finding::warn(name, "unknown: sched_rt_runtime_us cannot be read", "is /proc mounted?");
    };
    let off =
        "sudo sysctl kernel.sched_rt_runtime_us=-1   (a runaway real-time thread can then block its core)";
    match runtime {
        ..0 => Finding::pass(name, "off: real-time threads may use their cores fully"),
        0 => Finding::fail(
            name,
            "real-time threads get no time at all",
            "sudo sysctl kernel.sched_rt_runtime_us=950000",
        ),
        _ if runtime >= period => Finding::pass(name, "none: real-time threads may use their cores fully"),
        _ => {
            let share = runtime as f64 * 100.0 / period as f64;
            let pause = (period - runtime) / 1000;
            let found = format!(
                "real-time threads that keep a core busy for more than {share:.0} % are stopped for {pause} ms; \
                 no harm to graphs that stay below"
            );
            if share < 50.0 { Finding::fail(name, found, off) } else { Finding::warn(name, found, off) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    const DYNAMIC: &str = "Linux version 6.18.1 (b@h) (gcc 15) #1 SMP PREEMPT_DYNAMIC Sat";

    #[test]
    fn preemption_model_comes_from_the_most_exact_source() {
        let built = "CONFIG_PREEMPT_NONE=y\n# CONFIG_PREEMPT is not set\nCONFIG_PREEMPT_DYNAMIC=y\n";
        let cases = [
            (preemption(DYNAMIC, Some("1"), None, "", built), Preemption::Realtime),
            (
                preemption("Linux version 6.1 (x) #1 SMP PREEMPT_RT Debian", None, None, "", ""),
                Preemption::Realtime,
            ),
            (
                preemption(DYNAMIC, None, Some("none voluntary (full) lazy"), "preempt=none", built),
                Preemption::Full,
            ),
            (
                preemption(DYNAMIC, None, None, "quiet preempt=none preempt=voluntary", built),
                Preemption::Voluntary,
            ),
            (preemption(DYNAMIC, Some("0"), None, "quiet", built), Preemption::None),
            (preemption(DYNAMIC, None, None, "", "CONFIG_PREEMPT=y\n"), Preemption::Full),
            (preemption(DYNAMIC, None, None, "", "CONFIG_PREEMPT_LAZY=y\n"), Preemption::Lazy),
            (preemption(DYNAMIC, None, None, "", ""), Preemption::Unknown),
            (preemption("Linux version 5.10 (x) #1 SMP PREEMPT Mon", None, None, "", ""), Preemption::Full),
            (preemption("Linux version 5.10 (x) #1 SMP Mon", None, None, "", ""), Preemption::None),
        ];
        for (i, (found, expected)) in cases.into_iter().enumerate() {
            assert_eq!(found, expected, "case {i}");
        }
    }

    #[test]
    fn only_a_preemptible_kernel_passes() {
        assert_eq!(check_preemption(Preemption::Realtime).verdict, Verdict::Pass);
        assert_eq!(check_preemption(Preemption::Full).verdict, Verdict::Pass);
        for other in [Preemption::Lazy, Preemption::Voluntary, Preemption::None, Preemption::Unknown] {
            let finding = check_preemption(other);
            assert_eq!(finding.verdict, Verdict::Warn);
            assert!(finding.fix.unwrap().contains("preempt=full"));
        }
    }

    #[test]
    fn a_kernel_too_old_for_pidfds_fails() {
        assert_eq!(check_version("Linux version 4.19.0-27-amd64 (x)").verdict, Verdict::Fail);
        assert_eq!(check_version("Linux version 5.4.0 (x)").verdict, Verdict::Pass);
        assert_eq!(check_version(DYNAMIC), Finding::pass("kernel", "Linux 6.18.1"));
        assert_eq!(check_version("").verdict, Verdict::Warn);
    }

    #[test]
    fn timers_with_tick_resolution_fail() {
        assert_eq!(check_resolution(1).verdict, Verdict::Pass);
        assert_eq!(check_resolution(4_000_000).verdict, Verdict::Fail);
    }

    #[test]
    fn slow_clock_source_comes_with_a_fix() {
        assert_eq!(check_clock_source("tsc", "tsc hpet").verdict, Verdict::Pass);
        let finding = check_clock_source("hpet", "hpet tsc acpi_pm");
        assert_eq!(finding.verdict, Verdict::Warn);
        assert!(finding.fix.unwrap().starts_with("echo tsc"));
        assert!(check_clock_source("acpi_pm", "acpi_pm").fix.unwrap().contains("tsc=reliable"));
    }

    #[test]
    fn throttling_is_shown_in_percent_and_milliseconds() {
        let usual = check_throttling("950000", "1000000");
        assert_eq!(usual.verdict, Verdict::Warn);
        assert!(usual.found.contains("95 %") && usual.found.contains("50 ms"), "{}", usual.found);
        assert_eq!(check_throttling("-1", "1000000").verdict, Verdict::Pass);
        assert_eq!(check_throttling("1000000", "1000000").verdict, Verdict::Pass);
        assert_eq!(check_throttling("0", "1000000").verdict, Verdict::Fail);
        assert_eq!(check_throttling("100000", "1000000").verdict, Verdict::Fail);
        assert_eq!(check_throttling("", "").verdict, Verdict::Warn);
    }
}
