//! Privileges of this user: real-time priorities and locked memory, tested by using them.

use std::sync::{Mutex, PoisonError};

use motorium::os::machine::online_cores;
use motorium::os::{Applied, Denied, Request, apply};
use motorium::plan::SchedulingClass;
use rustix::process::{Resource, getrlimit};

use super::finding::Finding;
use super::read;

/// The priority to test, above all priorities that graphs choose automatically.
pub(super) const PRIORITY: u8 = 80;
/// Number of `CAP_IPC_LOCK`: unlimited locked memory.
const IPC_LOCK: u32 = 14;
/// Number of `CAP_SYS_NICE`: any scheduling policy.
const SYS_NICE: u32 = 23;

const LIMITS: &str = "printf '* - rtprio 98\\n* - memlock unlimited\\n' | sudo tee /etc/security/limits.d/90-motorium.conf   \
                      (then log in again; `*` may be a user or a @group)";

pub(super) fn check() -> Vec<Finding> {
    let status = read("/proc/self/status").unwrap_or_default();
    let capabilities = effective_capabilities(&status);
    let limits = Limits {
        priority: getrlimit(Resource::Rtprio).current,
        memory: getrlimit(Resource::Memlock).current,
        files: getrlimit(Resource::Nofile).current,
    };
    vec![
        check_fifo(&try_fifo(), capabilities & 1 << SYS_NICE != 0),
        check_deadline(&try_deadline()),
        check_memory(&try_locking()),
        check_limits(&limits, capabilities),
    ]
}

/// Runs `work` in a new thread, so that this thread keeps its scheduling.
fn aside<T: Send>(run: impl FnOnce() -> T + Send) -> Option<T> {
    std::thread::scope(|scope| scope.spawn(run).join().ok())
}

/// Requests `SCHED_FIFO` on the cores of this process and reads it back.
fn try_fifo() -> Result<u8, String> {
    let request =
        Request { class: SchedulingClass::Fifo(PRIORITY), cores: online_cores(), lock_memory: false };
    let (applied, denied): (Applied, Vec<Denied>) =
        aside(|| apply(&request)).ok_or("the thread that tried it failed")?;
    match denied.into_iter().find(|denied| matches!(denied, Denied::Priority(..))) {
        Some(Denied::Priority(_, reason)) => Err(reason),
        _ => Ok(applied.fifo_priority),
    }
}

fn check_fifo(tried: &Result<u8, String>, capable: bool) -> Finding {
    let name = "SCHED_FIFO";
    match tried {
        Ok(priority) => Finding::pass(name, format!("granted and read back (priority {priority})")),
        Err(reason) if capable => {
            let found = format!(
                "denied ({reason}), although this user has the permission: the control group has no real-time budget"
            );
            let fix = "echo 950000 | sudo tee /sys/fs/cgroup/cpu/$(cut -d: -f3 /proc/self/cgroup | head -1)/cpu.rt_runtime_us, \
                       or boot with rt_group_sched=0";
            Finding::fail(name, found, fix)
        }
        Err(reason) => {
            Finding::fail(name, format!("denied ({reason}): any other program may delay a step"), LIMITS)
        }
    }
}

/// Requests 10 us per second under `SCHED_DEADLINE` and reads it back.
fn try_deadline() -> Result<(), String> {
    let class = SchedulingClass::Deadline { runtime_ns: 10_000, period_ns: 1_000_000_000 };
    let request = Request { class, cores: online_cores(), lock_memory: false };
    let (applied, denied) = aside(|| apply(&request)).ok_or("the thread that tried it failed")?;
    match denied.into_iter().find(|denied| matches!(denied, Denied::Deadline { .. })) {
        Some(Denied::Deadline { reason, .. }) => Err(reason),
        _ if applied.deadline => Ok(()),
        _ => Err("read back another class".to_string()),
    }
}

fn check_deadline(tried: &Result<(), String>) -> Finding {
    let name = "SCHED_DEADLINE";
    match tried {
        Ok(()) => Finding::pass(name, "granted and read back"),
        Err(reason) => Finding::warn(
            name,
            format!("denied ({reason}); graphs use SCHED_FIFO and do without it"),
            "run as root, or: sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v motorium)",
        ),
    }
}

/// Held by the thread that tests locked memory, which affects the whole process.
static TRYING: Mutex<()> = Mutex::new(());

fn try_locking() -> Result<(), String> {
    let _alone = TRYING.lock().unwrap_or_else(PoisonError::into_inner);
    lock_and_unlock()
}

/// Locks the memory of this process, reads it back, and unlocks it again.
fn lock_and_unlock() -> Result<(), String> {
    let request = Request { class: SchedulingClass::Normal, cores: online_cores(), lock_memory: true };
    let (applied, denied) = aside(|| apply(&request)).ok_or("the thread that tried it failed")?;
    let _ = rustix::mm::munlockall();
    match denied.into_iter().find(|denied| matches!(denied, Denied::Memory(_))) {
        Some(Denied::Memory(reason)) => Err(reason),
        _ if applied.memory_locked => Ok(()),
        _ => Err("read back 0 kB locked".to_string()),
    }
}

fn check_memory(tried: &Result<(), String>) -> Finding {
    let name = "locked memory";
    match tried {
        Ok(()) => Finding::pass(name, "granted and read back"),
        Err(reason) => {
            Finding::warn(name, format!("denied ({reason}): a page fault may delay a step"), LIMITS)
        }
    }
}

/// Limits of this process; `None` means no limit.
#[derive(Debug, Clone, Copy)]
struct Limits {
    priority: Option<u64>,
    memory: Option<u64>,
    files: Option<u64>,
}

/// Parses the effective capabilities from `/proc/self/status`, one bit each.
fn effective_capabilities(status: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    line.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

fn check_limits(limits: &Limits, capabilities: u64) -> Finding {
    let name = "limits";
    let has = |capability: u32| capabilities & 1 << capability != 0;
    let number =
        |limit: Option<u64>| limit.map_or_else(|| "unlimited".to_string(), |limit| limit.to_string());
    let locked =
        limits.memory.map_or_else(|| "unlimited".to_string(), |bytes| format!("{} kB", bytes / 1024));
    let mut found =
        format!("rtprio {}, memlock {locked}, nofile {}", number(limits.priority), number(limits.files));
    let passes: Vec<&str> = [(SYS_NICE, "CAP_SYS_NICE"), (IPC_LOCK, "CAP_IPC_LOCK")]
        .into_iter()
        .filter_map(|(capability, name)| has(capability).then_some(name))
        .collect();
    if !passes.is_empty() {
        found += &format!(" (overridden by {})", passes.join(" and "));
    }
    if limits.files.is_some_and(|files| files < 1024) {
        return Finding::warn(name, found, "ulimit -n 1024");
    }
    let priority = has(SYS_NICE) || limits.priority.is_none_or(|limit| limit >= u64::from(PRIORITY));
    let memory = has(IPC_LOCK) || limits.memory.is_none();
    if priority && memory { Finding::pass(name, found) } else { Finding::warn(name, found, LIMITS) }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    #[test]
    fn capabilities_are_read_from_the_status_of_the_process() {
        let status = "Name:\tx\nCapPrm:\t0000000000000000\nCapEff:\t0000000000804000\nCapBnd:\tffff\n";
        let found = effective_capabilities(status);
        assert_eq!(found, 1 << SYS_NICE | 1 << IPC_LOCK);
        assert_eq!(effective_capabilities("Name:\tx\n"), 0);
    }

    #[test]
    fn low_limits_warn_unless_a_capability_overrides() {
        let limits = Limits { priority: Some(0), memory: Some(8 << 20), files: Some(20_000) };
        let user = check_limits(&limits, 0);
        assert_eq!(user.verdict, Verdict::Warn);
        assert_eq!(user.found, "rtprio 0, memlock 8192 kB, nofile 20000");
        assert!(user.fix.unwrap().contains("limits.d"));
        let root = check_limits(&limits, u64::MAX);
        assert_eq!(root.verdict, Verdict::Pass);
        assert!(root.found.ends_with("(overridden by CAP_SYS_NICE and CAP_IPC_LOCK)"), "{}", root.found);
        let raised = Limits { priority: Some(98), memory: None, files: None };
        assert_eq!(check_limits(&raised, 0).verdict, Verdict::Pass);
        let few = Limits { files: Some(256), ..raised };
        assert_eq!(check_limits(&few, 0).verdict, Verdict::Warn);
    }

    #[test]
    fn denied_priority_names_user_or_control_group() {
        let denied = Err("Operation not permitted".to_string());
        let user = check_fifo(&denied, false);
        assert_eq!(user.verdict, Verdict::Fail);
        assert!(user.fix.unwrap().contains("rtprio"));
        let group = check_fifo(&denied, true);
        assert!(group.found.contains("control group") && group.fix.unwrap().contains("cpu.rt_runtime_us"));
        assert_eq!(check_fifo(&Ok(80), false).verdict, Verdict::Pass);
    }

    /// Parses the scheduling policy from `/proc/thread-self/stat`: field 41 in the numbering of `proc(5)`.
    fn scheduling_policy(stat: &str) -> Option<u32> {
        // the second field, the name, may contain spaces and parentheses
        stat.rsplit_once(')')?.1.split_whitespace().nth(41 - 3)?.parse().ok()
    }

    #[test]
    fn tests_of_privileges_restore_thread_and_memory() {
        let policy = || scheduling_policy(&read("/proc/thread-self/stat").unwrap());
        let locked = || {
            let status = read("/proc/self/status").unwrap();
            status.lines().find(|line| line.starts_with("VmLck:")).map(str::to_string)
        };
        // A concurrent test may lock memory, too.
        let _alone = TRYING.lock().unwrap_or_else(PoisonError::into_inner);
        let before = (policy(), locked());
        let _ = (try_fifo(), try_deadline(), lock_and_unlock());
        assert_eq!((policy(), locked()), before);
    }
}
