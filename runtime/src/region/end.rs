//! The end of a component: a typed cause in the control block, with a text.
//!
//! All decisions about an end match on [`End`]. The text of an error or a panic is only displayed.

use core::fmt;
use std::panic::Location;
use std::process::ExitStatus;

use crate::units::TimeSpan;

/// Number of words of an encoded end.
pub(super) const END_WORDS: usize = 3;

/// Cause of the end of a component, or of the failure of one of its steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The process exited with this code. Threads and hosted components that stopped have code 0.
    Exited(i32),
    /// A signal with this number killed the process.
    Killed(i32),
    /// The launcher killed the process.
    KilledByLauncher,
    /// The component reported an error.
    Failed,
    /// The component panicked.
    Panicked(PanicOrigin),
    /// The component hung: within `hang_after`, it did not start a due step or did not complete a step.
    Hung(Hang),
    /// The component did not complete a step in time after a restart.
    NotStepping {
        /// Time limit after the restart, ns.
        within_ns: u64,
    },
}

/// The code in which a panic of a component occurred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PanicOrigin {
    /// The component, or a library that it uses.
    Component,
    /// iceoryx2, when it checks the shared memory of topics.
    SharedMemory,
}

/// A hang found by the watchdog.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hang {
    /// `true` if the component hangs within a step, `false` if between two steps.
    pub in_step: bool,
    /// Time since the step began or was due, ns.
    pub for_ns: u64,
    /// Time limit (`hang_after`), ns.
    pub hang_after_ns: u64,
    /// State of the stepping thread.
    pub activity: Activity,
}

/// The state of a hung thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Activity {
    /// The thread has ended, or its state cannot be read.
    Unknown = 0,
    /// Stopped by a signal or a debugger.
    Stopped = 1,
    /// Running, or ready to run.
    Computing = 2,
    /// Sleeping.
    Waiting = 3,
    /// Waiting for a device.
    InDevice = 4,
}

impl Activity {
    /// Converts a thread state as reported by the kernel, such as `R` (running) or `S` (sleeping).
    pub fn from_kernel(state: Option<char>) -> Self {
        match state {
            Some('T' | 't') => Self::Stopped,
            Some('R') => Self::Computing,
            Some('S') => Self::Waiting,
            Some('D') => Self::InDevice,
            _ => Self::Unknown,
        }
    }

    fn from_word(word: u32) -> Self {
        [Self::Stopped, Self::Computing, Self::Waiting, Self::InDevice]
            .into_iter()
            .find(|activity| *activity as u32 == word)
            .unwrap_or(Self::Unknown)
    }
}

/// Numbers that identify encoded ends; 0 means that there was no end.
mod kind {
    pub(super) const EXITED: u32 = 1;
    pub(super) const KILLED: u32 = 2;
    pub(super) const KILLED_BY_LAUNCHER: u32 = 3;
    pub(super) const FAILED: u32 = 4;
    pub(super) const PANICKED: u32 = 5;
    pub(super) const HUNG: u32 = 6;
    pub(super) const NOT_STEPPING: u32 = 7;
}

impl End {
    /// Encodes the end for the control block. The first word is not 0.
    pub(super) fn to_words(self) -> [u64; END_WORDS] {
        let (kind, detail, first, second) = match self {
            Self::Exited(code) => (kind::EXITED, code as u32, 0, 0),
            Self::Killed(signal) => (kind::KILLED, signal as u32, 0, 0),
            Self::KilledByLauncher => (kind::KILLED_BY_LAUNCHER, 0, 0, 0),
            Self::Failed => (kind::FAILED, 0, 0, 0),
            Self::Panicked(origin) => (kind::PANICKED, u32::from(origin == PanicOrigin::SharedMemory), 0, 0),
            Self::Hung(hang) => {
                let detail = u32::from(hang.in_step) | (hang.activity as u32) << 1;
                (kind::HUNG, detail, hang.for_ns, hang.hang_after_ns)
            }
            Self::NotStepping { within_ns } => (kind::NOT_STEPPING, 0, within_ns, 0),
        };
        [u64::from(kind) | u64::from(detail) << 32, first, second]
    }

    /// Decodes the words of a control block. Returns `None` before an end; an unknown number reads as
    /// [`End::Failed`].
    pub(super) fn from_words([head, first, second]: [u64; END_WORDS]) -> Option<Self> {
        let detail = (head >> 32) as u32;
        Some(match head as u32 {
            0 => return None,
            kind::EXITED => Self::Exited(detail as i32),
            kind::KILLED => Self::Killed(detail as i32),
            kind::KILLED_BY_LAUNCHER => Self::KilledByLauncher,
            kind::PANICKED if detail == 0 => Self::Panicked(PanicOrigin::Component),
            kind::PANICKED => Self::Panicked(PanicOrigin::SharedMemory),
            kind::HUNG => Self::Hung(Hang {
                in_step: detail & 1 != 0,
                for_ns: first,
                hang_after_ns: second,
                activity: Activity::from_word(detail >> 1),
            }),
            kind::NOT_STEPPING => Self::NotStepping { within_ns: first },
            _ => Self::Failed,
        })
    }

    /// Returns `true` for ends that are typical of components that encounter damaged shared memory.
    pub fn suggests_damage(self) -> bool {
        match self {
            Self::Killed(signal) => [libc::SIGSEGV, libc::SIGBUS, libc::SIGABRT].contains(&signal),
            Self::Panicked(origin) => origin == PanicOrigin::SharedMemory,
            Self::Exited(_)
            | Self::KilledByLauncher
            | Self::Failed
            | Self::Hung(_)
            | Self::NotStepping { .. } => false,
        }
    }
}

impl From<ExitStatus> for End {
    fn from(status: ExitStatus) -> Self {
        use std::os::unix::process::ExitStatusExt as _;
        match (status.code(), status.signal()) {
            (None, Some(signal)) => Self::Killed(signal),
            (code, _) => Self::Exited(code.unwrap_or(0)),
        }
    }
}

/// Formats the end without the text of its error or panic.
impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exited(0) => f.write_str("ended"),
            Self::Exited(code) => write!(f, "ended with exit code {code}"),
            Self::Killed(signal) => write!(f, "killed by signal {signal}{}", signal_name(*signal)),
            Self::KilledByLauncher => f.write_str("killed by the launcher"),
            Self::Failed => f.write_str("failed"),
            Self::Panicked(_) => f.write_str("panicked"),
            Self::Hung(hang) => hang.fmt(f),
            Self::NotStepping { within_ns } => {
                write!(f, "not stepping {} ms after its restart", within_ns / 1_000_000)
            }
        }
    }
}

fn signal_name(signal: i32) -> &'static str {
    match signal {
        libc::SIGKILL => " (SIGKILL)",
        libc::SIGSEGV => " (SIGSEGV)",
        libc::SIGABRT => " (SIGABRT)",
        libc::SIGBUS => " (SIGBUS)",
        libc::SIGTERM => " (SIGTERM)",
        libc::SIGXCPU => " (SIGXCPU): it computed for longer than its `cpu_limit` without sleeping",
        _ => "",
    }
}

impl fmt::Display for Hang {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.in_step { "step still running after" } else { "no step for" };
        let lasted = TimeSpan { ns: self.for_ns / 1_000_000 * 1_000_000 };
        let hang_after = TimeSpan { ns: self.hang_after_ns };
        let doing = match self.activity {
            Activity::Stopped => ": its thread was stopped by a signal or a debugger",
            Activity::Computing => ": its thread is computing or waiting for its core",
            Activity::Waiting => ": its thread is sleeping",
            Activity::InDevice => ": its thread is waiting for a device",
            Activity::Unknown => "",
        };
        write!(f, "hung: {what} {lasted} (`hang_after` is {hang_after}){doing}")
    }
}

/// A failure of a component: the step in which it occurred, its cause and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Index of the step in which the component failed, or of its next step if it failed between two steps.
    pub tick: u64,
    /// Cause of the failure.
    pub end: End,
    /// Text of the error or panic; empty for causes that need no text.
    pub text: String,
}

impl Failure {
    /// Creates the failure of a component that reported an error with this text.
    pub fn error(tick: u64, text: String) -> Self {
        Self { tick, end: End::Failed, text }
    }

    /// Creates a failure that needs no text.
    pub fn without_text(tick: u64, end: End) -> Self {
        Self { tick, end, text: String::new() }
    }
}

/// Formats the text, or the cause if there is no text.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.text.is_empty() { self.end.fmt(f) } else { f.write_str(&self.text) }
    }
}

/// Returns the end and text of a panic at a location in a source file.
pub(crate) fn panic_end(location: Option<&Location<'_>>, message: Option<&str>) -> (End, String) {
    let message = message.unwrap_or("a value that is not text");
    let Some(location) = location else {
        return (End::Panicked(PanicOrigin::Component), format!("panicked: {message}"));
    };
    let text = format!("panicked at {}:{}: {message}", location.file(), location.line());
    (End::Panicked(origin(location.file())), text)
}

/// Determines the origin of a panic. Sources of iceoryx2 and its parts are recognised by the folder of their
/// crate.
fn origin(file: &str) -> PanicOrigin {
    let mut folders = std::path::Path::new(file).iter();
    match folders.any(|folder| folder.as_encoded_bytes().starts_with(b"iceoryx2")) {
        true => PanicOrigin::SharedMemory,
        false => PanicOrigin::Component,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HANG: Hang =
        Hang { in_step: true, for_ns: 200_900_000, hang_after_ns: 200_000_000, activity: Activity::InDevice };

    #[test]
    fn ends_survive_the_control_block() {
        for end in [
            End::Exited(0),
            End::Exited(-1),
            End::Killed(libc::SIGBUS),
            End::KilledByLauncher,
            End::Failed,
            End::Panicked(PanicOrigin::Component),
            End::Panicked(PanicOrigin::SharedMemory),
            End::Hung(HANG),
            End::Hung(Hang { in_step: false, for_ns: u64::MAX, activity: Activity::Unknown, ..HANG }),
            End::NotStepping { within_ns: u64::MAX },
        ] {
            assert_eq!(End::from_words(end.to_words()), Some(end));
        }
        assert_eq!(End::from_words([0, 7, 7]), None);
        assert_eq!(End::from_words([u64::MAX; 3]), Some(End::Failed), "a damaged word");
    }

    #[test]
    fn only_crashes_in_shared_memory_suggest_damage() {
        let panic_in = |file: &str| End::Panicked(origin(file));
        for (end, suggests) in [
            (End::Killed(libc::SIGSEGV), true),
            (End::Killed(libc::SIGBUS), true),
            (End::Killed(libc::SIGABRT), true),
            (End::Killed(libc::SIGKILL), false),
            (panic_in("/registry/iceoryx2-bb-lock-free-0.10.0/src/mpmc/robust_unique_index_set.rs"), true),
            (panic_in("/registry/iceoryx2-0.10.0/src/port/subscriber.rs"), true),
            (panic_in("src/main.rs"), false),
            (End::Failed, false),
            (End::Exited(1), false),
            (End::Hung(HANG), false),
            (End::NotStepping { within_ns: 1 }, false),
        ] {
            assert_eq!(end.suggests_damage(), suggests, "{end:?}");
        }
    }

    #[test]
    fn error_texts_do_not_affect_decisions() {
        let failure = Failure::error(7, "killed by signal 11 (SIGSEGV) in iceoryx2".to_string());
        assert!(!failure.end.suggests_damage());
        assert_eq!(failure.to_string(), failure.text);
    }

    #[test]
    fn ends_have_one_wording() {
        for (end, text) in [
            (End::Exited(0), "ended"),
            (End::Exited(7), "ended with exit code 7"),
            (End::Killed(libc::SIGKILL), "killed by signal 9 (SIGKILL)"),
            (End::Killed(libc::SIGUSR1), "killed by signal 10"),
            (End::KilledByLauncher, "killed by the launcher"),
            (
                End::Hung(HANG),
                "hung: step still running after 200 ms (`hang_after` is 200 ms): its thread is waiting for a device",
            ),
            (
                End::Hung(Hang { in_step: false, activity: Activity::Unknown, ..HANG }),
                "hung: no step for 200 ms (`hang_after` is 200 ms)",
            ),
            (End::NotStepping { within_ns: 2_000_000_000 }, "not stepping 2000 ms after its restart"),
        ] {
            assert_eq!(Failure::without_text(0, end).to_string(), text);
        }
    }

    #[test]
    fn panics_keep_location_and_message() {
        let here = Location::caller();
        let (end, text) = panic_end(Some(here), Some("no camera"));
        assert_eq!(end, End::Panicked(PanicOrigin::Component));
        assert_eq!(text, format!("panicked at {}:{}: no camera", here.file(), here.line()));
        assert_eq!(panic_end(None, None).1, "panicked: a value that is not text");
    }

    #[test]
    fn kernel_states_become_activities() {
        for (state, activity) in [
            (Some('t'), Activity::Stopped),
            (Some('R'), Activity::Computing),
            (Some('S'), Activity::Waiting),
            (Some('D'), Activity::InDevice),
            (Some('Z'), Activity::Unknown),
            (None, Activity::Unknown),
        ] {
            assert_eq!(Activity::from_kernel(state), activity);
        }
    }
}
