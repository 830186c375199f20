//! Keeping this process off the cores of real-time components.

use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_setaffinity};

/// Moves all threads of this process to these cores, including threads created later. Without the privilege
/// they stay where they are; at normal priority they delay no component.
pub(crate) fn stand_aside(cores: &[usize]) {
    let mut set = CpuSet::new();
    cores.iter().filter(|core| **core < CpuSet::MAX_CPU).for_each(|core| set.set(*core));
    if cores.is_empty() {
        return;
    }
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return };
    for thread in threads.flatten() {
        let number = thread.file_name().to_string_lossy().parse().ok().and_then(Pid::from_raw);
        if let Some(thread) = number {
            // The thread may just have ended.
            let _ = sched_setaffinity(Some(thread), &set);
        }
    }
}
