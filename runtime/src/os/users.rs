//! Processes and threads of users from `/proc`: the number of this user's threads, and the real-time threads
//! of other users.
//!
//! With the mount option `hidepid` of `/proc`, or in a separate process namespace, processes of other users
//! are invisible.

use std::fs;

/// A process of another user that has real-time threads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Foreign {
    /// Id of the process.
    pub pid: u32,
    /// Id of the user who owns the process.
    pub user: u32,
    /// Name of the program as reported by the kernel, at most 15 bytes.
    pub program: String,
    /// Scheduling class of the most urgent thread, such as `SCHED_FIFO 83`.
    pub class: String,
    /// Cores to which the real-time threads are bound.
    pub cores: Vec<usize>,
}

/// Returns the number of visible threads of this user, or `None` without `/proc`.
pub fn threads_of_this_user() -> Option<u64> {
    let user = rustix::process::getuid().as_raw();
    let mut threads = 0;
    for pid in processes("/proc")? {
        let Some(status) = Status::read(&format!("/proc/{pid}/status")) else { continue };
        if status.user == Some(user) {
            threads += status.threads;
        }
    }
    Some(threads)
}

/// Returns `true` if the limit on processes and threads applies to this process. Root and users with the
/// resource capability are exempt.
pub fn is_bound_by_process_limit() -> bool {
    const EXEMPT: u64 = 1 << 24 | 1 << 21; // CAP_SYS_RESOURCE, CAP_SYS_ADMIN
    let capabilities = Status::read("/proc/self/status").map_or(0, |status| status.capabilities);
    !rustix::process::getuid().is_root() && capabilities & EXEMPT == 0
}

/// Returns the processes of other users with real-time threads bound to one of these cores, except kernel
/// threads. Threads that may run on any core, such as some daemons, are ignored, because the scheduler moves
/// them away.
pub fn realtime_of_others(cores: &[usize]) -> Vec<Foreign> {
    let own = rustix::process::getuid().as_raw();
    let online = fs::read_to_string("/sys/devices/system/cpu/online").map(|list| self::cores(list.trim()));
    // On a machine with one core, all threads are bound to it.
    let all = online.map_or(usize::MAX, |online| online.len().max(2));
    let found = processes("/proc").into_iter().flatten();
    found.filter_map(|pid| foreign(pid, own, cores, all)).collect()
}

fn foreign(pid: u32, own: u32, cores: &[usize], all: usize) -> Option<Foreign> {
    let process = Status::read(&format!("/proc/{pid}/status"))?;
    let user = process.user.filter(|user| *user != own)?;
    let mut found: Option<Foreign> = None;
    let mut most_urgent = 0;
    for thread in processes(&format!("/proc/{pid}/task"))? {
        let folder = format!("/proc/{pid}/task/{thread}");
        let Some(class) = fs::read_to_string(format!("{folder}/stat")).ok().and_then(|stat| class(&stat))
        else {
            continue;
        };
        let Some(allowed) = Status::read(&format!("{folder}/status")).map(|status| status.cores) else {
            continue;
        };
        if allowed.len() >= all {
            continue;
        }
        let shared: Vec<usize> = allowed.into_iter().filter(|core| cores.contains(core)).collect();
        if shared.is_empty() {
            continue;
        }
        let program = process.name.clone();
        let foreign =
            found.get_or_insert(Foreign { pid, user, program, class: String::new(), cores: Vec::new() });
        foreign.cores.extend(shared);
        if class.urgency() > most_urgent {
            (most_urgent, foreign.class) = (class.urgency(), class.to_string());
        }
    }
    if let Some(foreign) = &mut found {
        foreign.cores.sort_unstable();
        foreign.cores.dedup();
    }
    found
}

/// A real-time class of a thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Fifo(u32),
    RoundRobin(u32),
    Deadline,
}

impl Class {
    fn urgency(self) -> u32 {
        match self {
            Self::Fifo(priority) | Self::RoundRobin(priority) => priority,
            Self::Deadline => 100,
        }
    }
}

impl core::fmt::Display for Class {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Fifo(priority) => write!(f, "SCHED_FIFO {priority}"),
            Self::RoundRobin(priority) => write!(f, "SCHED_RR {priority}"),
            Self::Deadline => f.write_str("SCHED_DEADLINE"),
        }
    }
}

/// Returns the real-time class in the text of a `stat` file; `None` for other threads and kernel threads.
fn class(stat: &str) -> Option<Class> {
    const KERNEL: u64 = 0x0020_0000;
    // The name is in parentheses and may contain any characters. The state, field 3, follows.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    if field(9)? & KERNEL != 0 {
        return None;
    }
    let priority = u32::try_from(field(40)?).ok()?;
    match field(41)? {
        1 => Some(Class::Fifo(priority)),
        2 => Some(Class::RoundRobin(priority)),
        6 => Some(Class::Deadline),
        _ => None,
    }
}

/// Content of a `status` file.
#[derive(Debug, Default, PartialEq, Eq)]
struct Status {
    name: String,
    user: Option<u32>,
    threads: u64,
    cores: Vec<usize>,
    capabilities: u64,
}

impl Status {
    fn read(path: &str) -> Option<Self> {
        Some(Self::parse(&fs::read_to_string(path).ok()?))
    }

    fn parse(text: &str) -> Self {
        let mut status = Self::default();
        for (key, value) in text.lines().filter_map(|line| line.split_once(':')) {
            let value = value.trim();
            match key {
                "Name" => status.name = value.to_string(),
                "Uid" => status.user = value.split_whitespace().next().and_then(|user| user.parse().ok()),
                "Threads" => status.threads = value.parse().unwrap_or(0),
                "Cpus_allowed_list" => status.cores = cores(value),
                "CapEff" => status.capabilities = u64::from_str_radix(value, 16).unwrap_or(0),
                _ => {}
            }
        }
        status
    }
}

/// Returns the cores of a list such as `0-2,5`.
fn cores(list: &str) -> Vec<usize> {
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    list.split(',').filter_map(range).flatten().take(4_096).collect()
}

/// Returns the numbers among the names in a folder.
fn processes(folder: &str) -> Option<Vec<u32>> {
    let entries = fs::read_dir(folder).ok()?.flatten();
    Some(entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the `stat` line of a thread with these flags, priority and policy.
    fn stat(flags: u64, priority: u32, policy: u32) -> String {
        let between = ["0"; 30].join(" ");
        format!("17 (a) b (c)) S 1 1 1 0 -1 {flags} {between} {priority} {policy} 0 0")
    }

    #[test]
    fn class_is_read_for_any_thread_name() {
        assert_eq!(class(&stat(0, 83, 1)), Some(Class::Fifo(83)));
        assert_eq!(class(&stat(0, 5, 2)), Some(Class::RoundRobin(5)));
        assert_eq!(class(&stat(0, 0, 6)), Some(Class::Deadline));
        assert_eq!(class(&stat(0, 0, 0)), None, "a normal one");
        assert_eq!(class(&stat(0x0020_8040, 99, 1)), None, "one of the kernel");
        assert_eq!(class("cut (short"), None);
    }

    #[test]
    fn status_is_parsed_by_key() {
        let status = Status::parse("Name:\tcat\nUid:\t5\t6\t6\t6\nThreads:\t3\nCpus_allowed_list:\t0-1,4\n");
        assert_eq!((status.name.as_str(), status.user, status.threads), ("cat", Some(5), 3));
        assert_eq!(status.cores, [0, 1, 4]);
    }

    #[test]
    fn user_threads_include_this_process() {
        let before = threads_of_this_user().expect("there is /proc");
        assert!(before >= 1);
        let own = Status::read("/proc/self/status").expect("there is /proc");
        assert!(own.threads >= 1 && own.user == Some(rustix::process::getuid().as_raw()));
    }

    #[test]
    fn own_threads_are_not_reported_as_foreign() {
        let own = rustix::process::getuid().as_raw();
        let all: Vec<usize> = (0..1_024).collect();
        assert!(realtime_of_others(&all).iter().all(|foreign| foreign.user != own));
    }
}
