//! Use of the machine by a component, as the kernel accounts for it: CPU time of the stepping thread, memory
//! of the process.

use std::fs;

/// Use of the machine by a component.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Usage {
    /// Time that its stepping thread has run, ns; spinning is running.
    pub(crate) thread_ns: u64,
    /// Memory of its process that is in use, bytes.
    pub(crate) resident_bytes: u64,
    /// Part of the resident memory that is shared with other processes: the program file and the shared
    /// memory of the run, bytes.
    pub(crate) shared_bytes: u64,
}

impl Usage {
    /// Reads the usage of a thread of a process; `None` if it is gone.
    pub(crate) fn read(pid: u32, thread: u32) -> Option<Self> {
        let task = format!("/proc/{pid}/task/{thread}");
        let exact = fs::read_to_string(format!("{task}/schedstat")).ok().and_then(|text| time_run(&text));
        let thread_ns = match exact {
            Some(ns) => ns,
            None => ticks(&fs::read_to_string(format!("{task}/stat")).ok()?)? * TICK_NS,
        };
        let (resident_bytes, shared_bytes) =
            memory(&fs::read_to_string(format!("/proc/{pid}/status")).ok()?)?;
        Some(Self { thread_ns, resident_bytes, shared_bytes })
    }
}

/// Length of a tick of `/proc`, ns: `USER_HZ` is 100 on every machine that Linux runs on today.
const TICK_NS: u64 = 10_000_000;

/// Parses `schedstat`: time run in ns, time waited, number of turns. Without scheduler information all three
/// are 0.
fn time_run(text: &str) -> Option<u64> {
    let ns = text.split_ascii_whitespace().next()?.parse().ok()?;
    (ns > 0).then_some(ns)
}

/// Parses `stat`: number, (name), state and 10 more, `utime`, `stime` in ticks. The name may contain any
/// character.
fn ticks(text: &str) -> Option<u64> {
    let mut words = text.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let mut next = || words.next()?.parse::<u64>().ok();
    Some(next()? + next()?)
}

/// Parses the resident memory and its part in files and shared memory, bytes: lines such as `VmRSS:     5124
/// kB`.
fn memory(status: &str) -> Option<(u64, u64)> {
    let of = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
        Some(line.split_ascii_whitespace().next()?.parse::<u64>().ok()? * 1024)
    };
    Some((of("VmRSS")?, of("RssFile").unwrap_or(0) + of("RssShmem").unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernel_files_are_parsed() {
        assert_eq!(time_run("120982 5047 2\n"), Some(120_982));
        assert_eq!(time_run("0 0 0\n"), None, "a kernel without scheduler information");
        let stat = "812 (a) b (c) S 1 812 812 0 -1 4194560 95 0 0 0 31 11 0 0 20 0 1 0 500 8 9";
        assert_eq!(ticks(stat), Some(42));
        let status = "Name:\ta\nVmHWM:\t 99 kB\nVmRSS:\t 512 kB\nRssAnon:\t 212 kB\nRssFile:\t 200 kB\nRssShmem:\t 100 kB\n";
        assert_eq!(memory(status), Some((512 * 1024, 300 * 1024)));
        assert_eq!((ticks("nonsense"), memory("Name: a kernel thread")), (None, None));
    }

    #[test]
    fn busy_thread_gains_time_and_a_dead_one_has_none() {
        let (pid, thread) = (std::process::id(), motorium::os::thread_id() as u32);
        let before = Usage::read(pid, thread).expect("this thread is there");
        let start = std::time::Instant::now();
        while start.elapsed() < std::time::Duration::from_millis(40) {}
        let after = Usage::read(pid, thread).expect("this thread is there");
        assert!(after.thread_ns > before.thread_ns, "{before:?} {after:?}");
        assert!(after.resident_bytes > 100_000 && after.shared_bytes < after.resident_bytes, "{after:?}");
        assert_eq!(Usage::read(0, 0), None);
    }
}
