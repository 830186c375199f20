//! Kernel accounting of a thread: time running, and time waiting for its core.

use std::fs::File;

use rustix::thread::ClockId;

/// Returns the CPU time of the calling thread (`CLOCK_THREAD_CPUTIME_ID`), ns. Costs a system call of a few
/// hundred nanoseconds.
///
/// In a virtual machine, this excludes time stolen by the host if the host reports it.
pub fn thread_cpu_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Reader of the time for which a thread was ready to run, but waited because a different thread of this
/// system occupied its core.
#[derive(Debug)]
pub struct WaitedForCore(Option<File>);

impl WaitedForCore {
    /// Opens the reader for the calling thread. On a kernel without scheduler information
    /// (`CONFIG_SCHED_INFO`), the reader never returns a value.
    pub fn of_this_thread() -> Self {
        Self(File::open("/proc/thread-self/schedstat").ok())
    }

    /// Returns the total time so far, ns, or `None` if the kernel does not measure it. Costs one system call
    /// and does not allocate.
    pub fn total_ns(&self) -> Option<u64> {
        let mut text = [0_u8; 64];
        let length = rustix::io::pread(self.0.as_ref()?, &mut text, 0).ok()?;
        second_number(&text[..length])
    }
}

/// Parses the second of the fields of `schedstat`: time run, time waited, number of time slices.
fn second_number(text: &[u8]) -> Option<u64> {
    let text = core::str::from_utf8(text).ok()?;
    text.split_ascii_whitespace().nth(1)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_time_is_the_second_number() {
        assert_eq!(second_number(b"120982 5047 2\n"), Some(5_047));
        assert_eq!(second_number(b""), None);
        assert_eq!(second_number(b"12"), None);
    }

    #[test]
    fn only_a_working_thread_uses_cpu_time() {
        let before = thread_cpu_ns();
        std::thread::sleep(std::time::Duration::from_millis(30));
        let slept = thread_cpu_ns() - before;
        let start = std::time::Instant::now();
        while start.elapsed() < std::time::Duration::from_millis(30) {}
        let worked = thread_cpu_ns() - before - slept;
        assert!(worked > 3 * slept, "worked {worked} ns, slept {slept} ns");
    }
}
