//! Real-time requests of one process, which are applied and then read back.

#![allow(unsafe_code)] // scheduling parameters and `getrusage` of one thread are plain libc calls

use std::io;

use rustix::mm::MlockAllFlags;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};

use crate::plan::SchedulingClass;

/// Time between `SIGXCPU` and `SIGKILL`, us.
const CAUGHT_US: u64 = 20_000;

/// Real-time settings that a process requests from the kernel.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Scheduling class.
    pub class: SchedulingClass,
    /// Cores on which the process may run.
    pub cores: Vec<usize>,
    /// True to keep all current and future memory resident.
    pub lock_memory: bool,
}

/// Real-time settings in force, as read back from the kernel.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Applied {
    /// `SCHED_FIFO` priority, or 0 if the class is not `SCHED_FIFO`.
    pub fifo_priority: u8,
    /// True if the thread runs under `SCHED_DEADLINE`.
    pub deadline: bool,
    /// Cores on which the process may run.
    pub cores: Vec<usize>,
    /// True if the memory of the process is locked.
    pub memory_locked: bool,
}

/// A real-time request that the system denied, with the reason.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Denied {
    /// Real-time priority under `SCHED_FIFO`.
    #[error("SCHED_FIFO priority {0} ({1})")]
    Priority(u8, String),
    /// Run time under `SCHED_DEADLINE`. Either privileges are missing, or the kernel cannot guarantee the
    /// requested time next to existing guarantees.
    #[error("SCHED_DEADLINE with {} us in every {} us ({reason})", runtime_ns / 1000, period_ns / 1000)]
    Deadline {
        /// Requested CPU time in each period, ns.
        runtime_ns: u64,
        /// Length of the period, ns.
        period_ns: u64,
        /// Error of the operating system.
        reason: String,
    },
    /// Cores on which the process should run.
    #[error("cores {0:?} ({1})")]
    Cores(Vec<usize>, String),
    /// Limit on the time for which a thread may compute without sleeping.
    #[error("a limit on CPU time between sleeps ({0})")]
    CpuLimit(String),
    /// Locking of the memory of the process.
    #[error("locked memory ({0})")]
    Memory(String),
}

/// Saved core affinity of the creating thread. It is restored when this value is dropped in that thread.
#[derive(Debug)]
pub struct Placement {
    thread: std::thread::ThreadId,
    cores: Option<CpuSet>,
}

impl Placement {
    /// Saves the core affinity of the calling thread.
    pub fn remember() -> Self {
        Self { thread: std::thread::current().id(), cores: sched_getaffinity(None).ok() }
    }
}

impl Drop for Placement {
    fn drop(&mut self) {
        if let Some(cores) = self.cores.filter(|_| std::thread::current().id() == self.thread) {
            // On failure the thread keeps its current cores.
            let _ = sched_setaffinity(None, &cores);
        }
    }
}

/// Applies a request to the calling thread and its process. Returns the settings in force and the denied
/// requests.
pub fn apply(request: &Request) -> (Applied, Vec<Denied>) {
    let mut denied = Vec::new();
    let deadline = matches!(request.class, SchedulingClass::Deadline { .. });
    let mut cores = CpuSet::new();
    // The kernel grants deadlines only to threads that may run on any core.
    let wanted = if deadline { (0..CpuSet::MAX_CPU).collect() } else { request.cores.clone() };
    wanted.iter().for_each(|core| cores.set(*core));
    if let Err(error) = sched_setaffinity(None, &cores) {
        denied.push(Denied::Cores(request.cores.clone(), error.to_string()));
    }
    if request.lock_memory
        && let Err(error) = rustix::mm::mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
    {
        denied.push(Denied::Memory(error.to_string()));
    }
    if let SchedulingClass::Fifo(priority) = request.class
        && let Err(error) = set_fifo(priority)
    {
        denied.push(Denied::Priority(priority, error.to_string()));
    }
    if let SchedulingClass::Deadline { runtime_ns, period_ns } = request.class
        && let Err(error) = set_deadline(runtime_ns, period_ns)
    {
        denied.push(Denied::Deadline { runtime_ns, period_ns, reason: error.to_string() });
    }
    let applied = Applied {
        fifo_priority: fifo_priority(),
        deadline: policy() == libc::SCHED_DEADLINE,
        cores: sched_getaffinity(None)
            .map(|set| (0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect())
            .unwrap_or_default(),
        memory_locked: request.lock_memory && locked_memory(),
    };
    // The kernel may accept a request without complying (cpuset, container), so the settings read back
    // decide.
    if denied.is_empty() {
        if let SchedulingClass::Fifo(priority) = request.class
            && applied.fifo_priority != priority
        {
            denied.push(Denied::Priority(priority, format!("read back {}", applied.fifo_priority)));
        }
        if let SchedulingClass::Deadline { runtime_ns, period_ns } = request.class
            && !applied.deadline
        {
            denied.push(Denied::Deadline {
                runtime_ns,
                period_ns,
                reason: "read back another class".to_string(),
            });
        }
        if !deadline && applied.cores != request.cores {
            denied.push(Denied::Cores(request.cores.clone(), format!("read back {:?}", applied.cores)));
        }
        if request.lock_memory && !applied.memory_locked {
            denied.push(Denied::Memory("read back 0 kB locked".to_string()));
        }
    }
    (applied, denied)
}

fn set_fifo(priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: `parameters` is initialised and outlives the call; 0 is the calling thread. Children do not
    // inherit.
    let result =
        unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &parameters) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Lets the calling thread keep its core until it sleeps, even after it has woken another thread on that core
/// (`SCHED_BATCH`). Waking the next component then costs one thread switch. If the system denies this, the
/// hand-over is slower but correct.
pub fn hand_over_when_asleep() {
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: `parameters` is initialised and outlives the call; 0 is the calling thread.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_BATCH, &parameters) };
}

fn set_deadline(runtime_ns: u64, period_ns: u64) -> io::Result<()> {
    // SAFETY: zero is a valid value of the plain struct.
    let mut attributes: libc::sched_attr = unsafe { core::mem::zeroed() };
    attributes.size = size_of::<libc::sched_attr>() as u32;
    attributes.sched_policy = libc::SCHED_DEADLINE as u32;
    // A thread with a deadline must not create others with a deadline.
    attributes.sched_flags = libc::SCHED_FLAG_RESET_ON_FORK as u64;
    (attributes.sched_runtime, attributes.sched_deadline, attributes.sched_period) =
        (runtime_ns, period_ns, period_ns);
    // SAFETY: `attributes` is initialised and outlives the call; 0 is the calling thread.
    let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Kills this process if one of its `SCHED_FIFO` threads computes for longer than `ns` without sleeping. The
/// kernel sends `SIGXCPU`, then `SIGKILL` if the first signal is caught. The kernel counts in ticks (4 ms at
/// 250 Hz), so the process may end up to two ticks later.
///
/// # Errors
/// The kernel refuses, because a lower limit is already in force.
pub fn limit_cpu(ns: u64) -> io::Result<()> {
    use rustix::process::{Resource, Rlimit, setrlimit};
    let soft_us = ns.div_ceil(1_000);
    let limit = Rlimit { current: Some(soft_us), maximum: Some(soft_us + CAUGHT_US) };
    Ok(setrlimit(Resource::Rttime, limit)?)
}

/// Returns the calling thread to normal time sharing, for work outside steps, such as saving results.
pub fn leave_realtime() {
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: `parameters` is initialised and outlives the call; 0 is the calling thread.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_OTHER | libc::SCHED_RESET_ON_FORK, &parameters) };
}

/// Sets the calling thread to the lowest real-time priority. The thread then wakes before all threads that
/// are not real-time. If the priority is denied, the function acts like [`wake_soon`]. Intended for a thread
/// that sleeps almost all the time and uses no resource that a thread at normal priority may hold.
pub fn wake_first() {
    if set_fifo(1).is_err() {
        wake_soon();
    }
}

/// Lets the calling thread, which must have normal priority, run sooner after it wakes than other threads of
/// normal priority. Requests time slices as short as the kernel allows (0.1 ms on Linux 6.12 and later; no
/// effect on earlier kernels). Intended for a thread that sleeps almost all the time.
pub fn wake_soon() {
    const SHORTEST_TURN_NS: u64 = 100_000;
    // SAFETY: zero is a valid value of the plain struct.
    let mut attributes: libc::sched_attr = unsafe { core::mem::zeroed() };
    attributes.size = size_of::<libc::sched_attr>() as u32;
    attributes.sched_policy = libc::SCHED_OTHER as u32;
    attributes.sched_flags = libc::SCHED_FLAG_RESET_ON_FORK as u64;
    // SAFETY: a system call on integers; 0 is this process and thread.
    attributes.sched_nice = unsafe { libc::getpriority(libc::PRIO_PROCESS, 0) };
    attributes.sched_runtime = SHORTEST_TURN_NS;
    // SAFETY: `attributes` is initialised and outlives the call; 0 is the calling thread. A failure changes
    // nothing.
    unsafe {
        libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0);
        // Maximum lateness of timers of threads at normal priority, ns.
        libc::prctl(libc::PR_SET_TIMERSLACK, 1_000);
    }
}

/// Returns the scheduling policy of the calling thread.
fn policy() -> i32 {
    // SAFETY: a system call on an integer.
    unsafe { libc::sched_getscheduler(0) & !libc::SCHED_RESET_ON_FORK }
}

fn fifo_priority() -> u8 {
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: the call reads the calling thread's scheduling; `parameters` outlives it.
    let read = unsafe { libc::sched_getparam(0, &raw mut parameters) };
    if policy() == libc::SCHED_FIFO && read == 0 {
        u8::try_from(parameters.sched_priority).unwrap_or(0)
    } else {
        0
    }
}

fn locked_memory() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmLck:"))
        .and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<u64>().ok())
        .is_some_and(|kilobytes| kilobytes > 0)
}

/// Returns the number of page faults of the calling thread so far, minor and major.
pub fn page_faults() -> u64 {
    let usage = usage();
    (usage.ru_minflt + usage.ru_majflt) as u64
}

/// Returns the number of times that the calling thread went to sleep (voluntary context switches).
pub fn times_asleep() -> u64 {
    usage().ru_nvcsw as u64
}

fn usage() -> libc::rusage {
    // SAFETY: zero is a valid value of the plain struct, which outlives the call.
    unsafe {
        let mut usage: libc::rusage = core::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage);
        usage
    }
}

/// Touches 256 KiB of stack to avoid page faults on the hot path.
#[inline(never)]
pub fn prefault_stack() {
    let mut stack = [0u8; 256 * 1024];
    for page in stack.chunks_mut(4096) {
        page[0] = core::hint::black_box(1);
    }
    core::hint::black_box(&stack);
}
