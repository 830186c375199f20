//! Memory: `/dev/shm`, swap, huge pages.

use std::os::unix::fs::PermissionsExt as _;

use rustix::fs::Access;

use super::finding::Finding;
use super::read;

/// Mount point of shared memory.
pub(super) const SHARED: &str = "/dev/shm";
/// Below this size, only the smallest graphs fit.
const LEAST_MIB: u64 = 16;
/// Below this size, a large graph may not fit.
const ENOUGH_MIB: u64 = 64;

pub(super) fn check() -> Vec<Finding> {
    let mode = std::fs::metadata(SHARED).ok().map(|metadata| metadata.permissions().mode() & 0o7777);
    let writable = rustix::fs::access(SHARED, Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK).is_ok();
    let free = rustix::fs::statvfs(SHARED).map(|stat| (stat.f_bavail * stat.f_frsize) >> 20).unwrap_or(0);
    vec![
        check_shared(mode, writable, free),
        check_swap(&read("/proc/swaps").unwrap_or_default()),
        check_huge_pages(read("/sys/kernel/mm/transparent_hugepage/enabled").as_deref()),
    ]
}

fn check_shared(mode: Option<u32>, writable: bool, free_mib: u64) -> Finding {
    let name = "shared memory";
    let Some(mode) = mode else {
        let fix = "sudo mount -t tmpfs -o mode=1777 tmpfs /dev/shm";
        return Finding::fail(name, format!("there is no {SHARED}"), fix);
    };
    let repair = format!("sudo chmod 1777 {SHARED}");
    let found = format!("{SHARED}: mode {mode:o}, {free_mib} MiB free");
    let grow = format!("sudo mount -o remount,size=1G {SHARED}   (a container: start it with --shm-size=1g)");
    if !writable {
        Finding::fail(name, format!("{found}; this user may not write there"), repair)
    } else if free_mib < LEAST_MIB {
        Finding::fail(name, format!("{found}: too little for any graph"), grow)
    } else if mode != 0o1777 {
        Finding::warn(
            name,
            format!("{found}; expected mode 1777: others cannot use it, or can delete your files"),
            repair,
        )
    } else if free_mib < ENOUGH_MIB {
        Finding::warn(name, format!("{found}: too little for a large graph"), grow)
    } else {
        Finding::pass(name, found)
    }
}

fn check_swap(swaps: &str) -> Finding {
    let name = "swap";
    // the first line is a heading
    let areas: Vec<&str> = swaps.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if areas.is_empty() {
        return Finding::pass(name, "none");
    }
    let found = format!("{}: unlocked memory may be paged out", areas.join(", "));
    Finding::warn(name, found, "sudo swapoff -a")
}

fn check_huge_pages(enabled: Option<&str>) -> Finding {
    let name = "huge pages";
    let chosen = enabled.and_then(|text| text.split_once('[')?.1.split_once(']')).map(|(chosen, _)| chosen);
    match chosen {
        None => Finding::pass(name, "the kernel creates none automatically"),
        Some("always") => Finding::warn(
            name,
            "always: the kernel may stop a process to merge its pages",
            "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled",
        ),
        Some(chosen) => Finding::pass(name, chosen),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    #[test]
    fn shared_memory_must_exist_be_writable_and_large_enough() {
        assert_eq!(check_shared(Some(0o1777), true, 24_000).verdict, Verdict::Pass);
        assert_eq!(check_shared(None, false, 0).verdict, Verdict::Fail);
        let closed = check_shared(Some(0o755), false, 24_000);
        assert_eq!(
            (closed.verdict, closed.fix.as_deref()),
            (Verdict::Fail, Some("sudo chmod 1777 /dev/shm"))
        );
        assert_eq!(check_shared(Some(0o777), true, 24_000).verdict, Verdict::Warn);
        assert_eq!(check_shared(Some(0o1777), true, 63).verdict, Verdict::Warn);
        assert_eq!(check_shared(Some(0o1777), true, 3).verdict, Verdict::Fail);
    }

    #[test]
    fn swap_areas_are_named() {
        let heading = "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n";
        assert_eq!(check_swap(heading).verdict, Verdict::Pass);
        let used = check_swap(&format!("{heading}/dev/sda2 partition 999 0 -2\n/swapfile file 99 0 -3\n"));
        assert_eq!(used.verdict, Verdict::Warn);
        assert!(used.found.starts_with("/dev/sda2, /swapfile:"), "{}", used.found);
    }

    #[test]
    fn automatic_huge_pages_are_a_warning() {
        assert_eq!(check_huge_pages(Some("[always] madvise never")).verdict, Verdict::Warn);
        assert_eq!(check_huge_pages(Some("always [madvise] never")), Finding::pass("huge pages", "madvise"));
        assert_eq!(check_huge_pages(None).verdict, Verdict::Pass);
    }
}
