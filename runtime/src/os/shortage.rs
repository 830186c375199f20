//! Messages for exhausted resources.

use std::fs::File;
use std::path::Path;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Free space below which nothing can be created, bytes: a few pages.
const NO_ROOM: u64 = 64 * 1024;
/// Number of free files below which nothing can be created.
const NO_NAMES: u64 = 8;

/// Free space in a file system, for this user.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Number of bytes that are still available to this user.
    pub bytes: u64,
    /// Total size of the file system, bytes.
    pub total: u64,
    /// Number of files that can still be created.
    pub files: u64,
}

impl Room {
    /// Returns the free space in the file system that contains `path`, or `None` if it cannot be determined.
    pub fn for_path(path: &Path) -> Option<Self> {
        let stat = rustix::fs::statvfs(path).ok()?;
        // A file system without a limit on files reports 0 of 0.
        let files = if stat.f_files == 0 { u64::MAX } else { stat.f_favail };
        let bytes = |blocks: u64| blocks.saturating_mul(stat.f_frsize);
        Some(Self { bytes: bytes(stat.f_bavail), total: bytes(stat.f_blocks), files })
    }

    fn is_full(self) -> bool {
        self.bytes < NO_ROOM || self.files < NO_NAMES
    }
}

/// Formats a number of bytes in a readable unit, such as MiB.
pub fn amount(bytes: u64) -> String {
    match bytes {
        0..10_240 => format!("{bytes} bytes"),
        10_240..10_485_760 => format!("{} KiB", bytes / 1024),
        _ => format!("{} MiB", bytes / (1024 * 1024)),
    }
}

/// Describes the exhausted resource with advice, for errors that do not name their cause. Checks the
/// descriptors of this process, and the space in shared memory or in the file system that contains `place`.
/// Returns `None` if nothing is exhausted.
pub fn shortage(place: &Path) -> Option<String> {
    if let Err(error) = File::open("/dev/null") {
        match error.raw_os_error() {
            Some(libc::EMFILE) => {
                let limit = limit(Resource::Nofile).map_or_else(String::new, |limit| format!(" ({limit})"));
                return Some(format!(
                    "this process has reached its limit of open files{limit}; raise the limit with `ulimit -n 1024`"
                ));
            }
            Some(libc::ENFILE) => return Some("the system has reached its limit of open files".to_string()),
            _ => {}
        }
    }
    [Path::new("/dev/shm"), place].into_iter().find_map(|path| {
        let room = Room::for_path(path).filter(|room| room.is_full())?;
        let what = if room.bytes < NO_ROOM {
            format!("{} of {} are free", amount(room.bytes), amount(room.total))
        } else {
            format!("{} more files can be created", room.files)
        };
        Some(format!(
            "{} is full: {what}; `ls -lS {0}` shows what fills it, `motorium doctor --clean` removes the remains of dead runs",
            path.display()
        ))
    })
}

/// Appends a description of the exhausted resource to `reason`, if a resource is exhausted.
pub fn with_shortage(reason: String, place: &Path) -> String {
    match shortage(place) {
        Some(shortage) => format!("{reason}; {shortage}"),
        None => reason,
    }
}

/// Formats an error of starting a process or thread. If a limit of the user is the cause, the text names the
/// limit.
pub fn named(error: &std::io::Error) -> String {
    if error.raw_os_error() != Some(libc::EAGAIN) {
        return error.to_string();
    }
    let limit = process_limit().map_or_else(String::new, |limit| format!(" ({limit})"));
    format!(
        "{error}; this user has reached the limit of processes and threads{limit}; raise the limit with `ulimit -u`, or \
         `TasksMax=` of the service"
    )
}

/// Returns the maximum number of processes and threads of this user, or `None` if it is unlimited.
pub fn process_limit() -> Option<u64> {
    limit(Resource::Nproc)
}

/// Returns the limit in force on a resource of this process; `None` without a limit.
fn limit(resource: Resource) -> Option<u64> {
    getrlimit(resource).current
}

/// Raises the limit of a resource to `wanted`, as far as permitted. Returns the new limit, or `None` if the
/// resource is unlimited.
pub fn raise_limit(resource: Resource, wanted: u64) -> Option<u64> {
    let Rlimit { current, maximum } = getrlimit(resource);
    let current = current?;
    let raised = maximum.map_or(wanted, |maximum| maximum.min(wanted)).max(current);
    if raised > current && setrlimit(resource, Rlimit { current: Some(raised), maximum }).is_ok() {
        return Some(raised);
    }
    Some(current)
}

/// Returns the number of open descriptors of this process.
pub fn open_descriptors() -> std::io::Result<u64> {
    // One descriptor reads the list.
    Ok(std::fs::read_dir("/proc/self/fd")?.count().saturating_sub(1) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_use_readable_units() {
        for (bytes, text) in
            [(0, "0 bytes"), (4_096, "4096 bytes"), (65_536, "64 KiB"), (67_108_864, "64 MiB")]
        {
            assert_eq!(amount(bytes), text);
        }
    }

    #[test]
    fn no_shortage_is_found_with_free_resources() {
        let room = Room::for_path(Path::new("/dev/shm")).expect("there is shared memory");
        if room.is_full() {
            return eprintln!("skipped: /dev/shm is full");
        }
        assert_eq!(shortage(Path::new("/dev/shm")), None);
        assert_eq!(with_shortage("refused".into(), Path::new("/dev/shm")), "refused");
        assert!(Room { bytes: 4_096, total: 1 << 20, files: 100 }.is_full());
        assert!(Room { bytes: 1 << 20, total: 1 << 20, files: 3 }.is_full());
    }

    #[test]
    fn sufficient_limit_is_unchanged() {
        let before = limit(Resource::Nofile);
        assert_eq!(raise_limit(Resource::Nofile, 1), before);
        assert_eq!(limit(Resource::Nofile), before);
        assert!(open_descriptors().unwrap() >= 3);
    }
}
