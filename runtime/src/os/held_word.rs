//! A word in shared memory that the kernel marks when the holding thread ends in any way, which also wakes
//! its waiters: a *robust futex*.
//!
//! The descriptor of a process reports its end only after its memory has been released, which lasts
//! milliseconds with tens of megabytes of locked memory. The kernel processes the robust futexes of a thread
//! earlier.

#![allow(unsafe_code)] // the list of robust futexes is registered by a plain system call

use std::io;
use std::process::ExitStatus;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::time::Duration;

use super::{futex_wait, futex_wake, thread_id};

/// Flag set by the kernel: the holder has ended.
const OWNER_DIED: u32 = 1 << 30;
/// Flag for the kernel: there is a waiter to be woken.
const WAITERS: u32 = 1 << 31;
/// Flag of a process in `/proc/PID/stat` that is ending.
const ENDING: u64 = 0x4;

/// The kernel's list of the robust futexes of a thread (`struct robust_list_head`).
#[repr(C)]
struct Head {
    next: *mut Entry,
    /// Offset from an entry to its word, bytes.
    offset: libc::c_long,
    pending: *mut Entry,
}

#[repr(C)]
struct Entry {
    next: *mut Entry,
}

/// Holds a word from a dedicated thread until this process ends. The kernel's list is in this process, so
/// damaged shared memory cannot affect it.
///
/// # Errors
/// The system cannot create a thread.
pub(crate) fn hold(word: &AtomicU32) -> io::Result<()> {
    let address = core::ptr::from_ref(word).expose_provenance();
    // A dedicated thread, because the C library keeps its robust mutexes in the lists of all other threads.
    let thread = std::thread::Builder::new().name("holder".to_string()).stack_size(64 * 1024);
    thread.spawn(move || hold_for_ever(address)).map(drop)
}

fn hold_for_ever(address: usize) {
    super::wake_first();
    let mut entry = Entry { next: core::ptr::null_mut() };
    let offset = address.wrapping_sub((&raw const entry).addr()) as libc::c_long;
    let mut head = Head { next: &raw mut entry, offset, pending: core::ptr::null_mut() };
    // SAFETY: the list is on the stack of this thread, which only ends with the process. The kernel reads it
    // when the thread ends, changes the word only if it contains the thread's id, and skips unmapped words.
    // The word is mapped while a component of this process runs.
    unsafe {
        // the last entry points back to the head
        head.next.write(Entry { next: (&raw mut head).cast() });
        let mut all: libc::sigset_t = core::mem::zeroed();
        libc::sigfillset(&raw mut all);
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const all, core::ptr::null_mut());
        libc::syscall(libc::SYS_set_robust_list, &raw mut head, size_of::<Head>());
        let word = &*core::ptr::with_exposed_provenance::<AtomicU32>(address);
        word.store(thread_id() as u32 | WAITERS, Release);
        futex_wake(word);
        loop {
            libc::pause();
        }
    }
}

/// Prepares a word for the next holder.
pub(crate) fn offer(word: &AtomicU32) {
    word.store(0, Release);
}

/// Releases the waiters of a word: marks the word as if its holder had ended.
pub(crate) fn release(word: &AtomicU32) {
    word.fetch_or(OWNER_DIED, Release);
    futex_wake(word);
}

/// Waits until the holder of a word has ended, or the word is released.
pub(crate) fn await_end(word: &AtomicU32) {
    loop {
        let value = word.load(Acquire);
        if value & OWNER_DIED != 0 {
            return;
        }
        futex_wait(word, value, Some(Duration::from_secs(1)));
    }
}

/// Returns the exit status of an ending process; `None` before its end and while the status is unknown.
/// Unprivileged readers also see status 0.
pub(crate) fn ending_status(pid: u32) -> Option<ExitStatus> {
    use std::os::unix::process::ExitStatusExt as _;
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // the name is in parentheses and may contain any characters
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace();
    let flags: u64 = fields.nth(6)?.parse().ok()?;
    let status: i32 = fields.nth(42)?.parse().ok()?;
    (flags & ENDING != 0 && status != 0).then(|| ExitStatus::from_raw(status))
}

/// Removes the real-time priority of all threads of an ending process, so that the release of its memory does
/// not delay others.
pub(crate) fn demote(pid: u32) {
    let Ok(threads) = std::fs::read_dir(format!("/proc/{pid}/task")) else { return };
    for thread in threads.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok()) {
        let parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: `parameters` is initialised and outlives the call; for a thread that has ended it returns
        // ESRCH, which is fine.
        unsafe { libc::sched_setscheduler(thread, libc::SCHED_OTHER, &parameters) };
    }
}

/// A descriptor that becomes readable on request.
#[derive(Debug)]
pub(crate) struct Flag(std::os::fd::OwnedFd);

impl Flag {
    /// Creates an unset flag.
    ///
    /// # Errors
    /// No descriptor is available.
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self(rustix::event::eventfd(0, rustix::event::EventfdFlags::CLOEXEC)?))
    }

    /// Makes the descriptor readable permanently.
    pub(crate) fn raise(&self) {
        let _ = rustix::io::write(&self.0, &1_u64.to_ne_bytes());
    }
}

impl std::os::fd::AsFd for Flag {
    fn as_fd(&self) -> std::os::fd::BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    use super::*;

    const ROLE: &str = "MOTORIUM_TEST_HOLDER";

    /// Maps two words in a shared file, one held and one free.
    fn map(path: &std::path::Path) -> memmap2::MmapRaw {
        let file = std::fs::File::options().read(true).write(true).open(path).unwrap();
        memmap2::MmapRaw::map_raw(&file).unwrap()
    }

    fn word(map: &memmap2::MmapRaw, index: usize) -> &AtomicU32 {
        // SAFETY: the mapping begins on a page and is longer than both words; an atomic is valid for any
        // bytes.
        unsafe { &*map.as_ptr().cast::<AtomicU32>().add(index) }
    }

    fn await_that(what: &str, mut is_so: impl FnMut() -> bool) {
        let began = Instant::now();
        while !is_so() {
            assert!(began.elapsed() < Duration::from_secs(30), "{what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn word_is_marked_when_its_holder_is_killed() {
        if let Some(path) = std::env::var_os(ROLE) {
            // This is the process that is killed.
            let map = map(path.as_ref());
            hold(word(&map, 0)).unwrap();
            loop {
                std::thread::sleep(Duration::from_secs(1));
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("words");
        std::fs::write(&path, [0; 4096]).unwrap();
        let map = map(&path);
        let (held, other) = (word(&map, 0), word(&map, 1));
        for _ in 0..3 {
            offer(held);
            let mut child = Command::new(std::env::current_exe().unwrap())
                .args(["--exact", "os::held_word::tests::word_is_marked_when_its_holder_is_killed"])
                .env(ROLE, &path)
                .stdout(Stdio::null())
                .spawn()
                .unwrap();
            await_that("the process holds the word", || held.load(Acquire) != 0);
            std::thread::sleep(Duration::from_millis(20));
            assert_eq!(held.load(Acquire) & OWNER_DIED, 0, "the process is alive");
            assert_eq!(ending_status(child.id()), None);
            child.kill().unwrap();
            await_end(held);
            await_that("it shows its status", || ending_status(child.id()).is_some());
            child.wait().unwrap();
            assert_eq!(other.load(Acquire), 0);
        }
    }

    #[test]
    fn release_ends_a_wait_without_a_holder() {
        let held = AtomicU32::new(0);
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| await_end(&held));
            std::thread::sleep(Duration::from_millis(20));
            assert!(!waiting.is_finished());
            release(&held);
        });
    }
}
