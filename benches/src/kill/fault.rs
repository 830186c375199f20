//! Faults of a trial: the affected process and its signal.

use core::fmt;
use std::time::{Duration, Instant};

use motorium::os::Watch;
use rustix::process::Signal;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Time within which a process is scheduled twice and dies of a segmentation fault, even on a busy machine.
const SEGFAULTS: Duration = Duration::from_secs(5);

/// The process that receives a fault.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Victim {
    /// A component of the graph, by its name.
    Component(String),
    /// The launcher: `motorium run`.
    Launcher,
    /// The guard, which ends a run after the launcher has died.
    Guard,
    /// `motorium topic echo` on the actuator's state.
    Observer,
}

impl Victim {
    /// Returns the victim named `name` in a graph with these components; `None` if the name is unknown.
    pub fn named(name: &str, components: &[String]) -> Option<Self> {
        match name {
            "launcher" => Some(Self::Launcher),
            "guard" => Some(Self::Guard),
            "observer" => Some(Self::Observer),
            name => components.iter().any(|known| known == name).then(|| Self::Component(name.to_string())),
        }
    }
}

impl fmt::Display for Victim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Component(name) => f.write_str(name),
            Self::Launcher => f.write_str("launcher"),
            Self::Guard => f.write_str("guard"),
            Self::Observer => f.write_str("observer"),
        }
    }
}

/// A fault injected by signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// `SIGKILL`.
    Kill,
    /// `SIGABRT`, as sent by a failed assertion in foreign code.
    Abort,
    /// `SIGSEGV`, sent repeatedly until the process ends, because Rust's detection of stack overflows handles
    /// the first signal.
    Segfault,
    /// `SIGTERM`: requests the process to end.
    Terminate,
    /// `SIGSTOP`, after which the process is never continued, so that it hangs.
    Hang,
    /// `SIGSTOP`, after which the process is continued after a time.
    Pause,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 6] =
        [Self::Kill, Self::Abort, Self::Segfault, Self::Terminate, Self::Hang, Self::Pause];

    /// Returns the name of the fault, as in a command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::Abort => "abort",
            Self::Segfault => "segfault",
            Self::Terminate => "terminate",
            Self::Hang => "hang",
            Self::Pause => "pause",
        }
    }

    /// Returns the fault named `name`; `None` if the name is unknown.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| fault.name() == name)
    }

    /// Returns `true` for a temporary fault, after which the process continues.
    pub fn passes(self) -> bool {
        self == Self::Pause
    }

    /// Returns `true` for a fault that ends `victim`. [`Terminate`](Self::Terminate) does not end the guard,
    /// which only ends with the run.
    pub fn ends(self, victim: &Victim) -> bool {
        match self {
            Self::Kill | Self::Abort | Self::Segfault => true,
            Self::Terminate => *victim != Victim::Guard,
            Self::Hang | Self::Pause => false,
        }
    }

    /// Returns `true` for a fault that this process survives without help.
    pub(super) fn is_survived(self, victim: &Victim) -> bool {
        self.passes() || (self == Self::Terminate && *victim == Victim::Guard)
    }

    /// Injects the fault; a temporary one lasts for `pause`.
    pub(super) fn make(self, process: &Watch, pause: Duration) {
        match self {
            Self::Kill => process.signal(Signal::KILL),
            Self::Abort => process.signal(Signal::ABORT),
            // Two pending signals for a process that was not scheduled count as one.
            Self::Segfault => {
                let began = Instant::now();
                while !process.has_ended() && began.elapsed() < SEGFAULTS {
                    process.signal(Signal::SEGV);
                    std::thread::sleep(Duration::from_micros(300));
                }
            }
            Self::Terminate => process.signal(Signal::TERM),
            Self::Hang => process.signal(Signal::STOP),
            Self::Pause => {
                process.signal(Signal::STOP);
                std::thread::sleep(pause);
                process.signal(Signal::CONT);
            }
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
