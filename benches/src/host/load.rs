//! Background load at normal priority, which imitates the work of other programs on a robot's computer.

use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

/// Marks a process of the load in its command line.
pub(crate) const LOAD: &str = "--bench-load";
/// Memory streamed by a process, bytes; exceeds the caches.
const STREAMED: usize = 64 << 20;

/// Load generator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Loader {
    /// `stress-ng`, with two processes per core: one streams through memory, one passes bytes through pipes.
    StressNg {
        /// Version of `stress-ng`.
        version: String,
    },
    /// `hackbench` of rt-tests, with ten processes per core that pass bytes through pipes.
    Hackbench,
    /// Two built-in processes per core: one streams through memory, one passes bytes through pipes.
    Own,
}

impl Loader {
    /// Returns the first available load generator: `stress-ng`, `hackbench`, or the built-in generator.
    pub fn detect() -> Self {
        Self::named("stress-ng").or_else(|| Self::named("hackbench")).unwrap_or(Self::Own)
    }

    /// Returns the load generator named `stress-ng`, `hackbench` or `own`; `None` if the name is unknown or
    /// the generator is not installed.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "stress-ng" => {
                let said = Command::new(name).arg("--version").stdin(Stdio::null()).output().ok()?;
                let text = String::from_utf8_lossy(&said.stdout).into_owned();
                let version =
                    text.split_whitespace().find(|word| word.starts_with(|c: char| c.is_ascii_digit()));
                Some(Self::StressNg { version: version.unwrap_or("of unknown version").to_string() })
            }
            "hackbench" => {
                let said = Command::new(name).arg("--help").stdin(Stdio::null()).output();
                said.ok().map(|_| Self::Hackbench)
            }
            "own" => Some(Self::Own),
            _ => None,
        }
    }

    /// Arguments for one core; our own processes are started otherwise.
    fn arguments(&self, cores: usize) -> Vec<String> {
        let text = match self {
            // It ends automatically when its parent has died.
            Self::StressNg { .. } => format!("--quiet --timeout 900 --stream {cores} --pipe {cores}"),
            Self::Hackbench => format!("--pipe --groups {cores} --fds 5 --loops 1000000000"),
            Self::Own => String::new(),
        };
        text.split_whitespace().map(str::to_string).collect()
    }
}

impl core::fmt::Display for Loader {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let with = self.arguments(motorium::os::machine::online_cores().len()).join(" ");
        match self {
            Self::StressNg { version } => write!(f, "stress-ng {version} {with}"),
            Self::Hackbench => write!(f, "hackbench {with}"),
            Self::Own => f.write_str("our own: for each core one process through memory, one through pipes"),
        }
    }
}

/// Processes at normal priority that keep every core busy with memory traffic, system calls and context
/// switches. They end when this value is dropped.
#[derive(Debug)]
pub struct Load(Vec<Child>);

impl Load {
    /// Starts the load. The built-in load needs a program that passes its arguments to [`Role`](crate::Role).
    ///
    /// # Errors
    /// A process could not be started.
    pub fn start(loader: &Loader, program: &Path) -> std::io::Result<Self> {
        let mut load = Self(Vec::new());
        let mut start = |program: &Path, arguments: &[String]| -> std::io::Result<()> {
            let mut command = Command::new(program);
            command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
            load.0.push(command.spawn()?);
            Ok(())
        };
        let cores = motorium::os::machine::online_cores().len();
        match loader {
            Loader::StressNg { .. } => start(Path::new("stress-ng"), &loader.arguments(cores))?,
            Loader::Hackbench => start(Path::new("hackbench"), &loader.arguments(cores))?,
            Loader::Own => {
                for _ in 0..cores {
                    for kind in ["memory", "calls"] {
                        start(program, &[LOAD.to_string(), kind.to_string()])?;
                    }
                }
            }
        }
        // Until all of its processes run.
        std::thread::sleep(Duration::from_millis(300));
        Ok(load)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        // Terminated gracefully first: a tool with many processes ends its children.
        for child in &self.0 {
            if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
                let _ = kill_process(pid, Signal::TERM);
            }
        }
        let end = Instant::now() + Duration::from_secs(3);
        for child in &mut self.0 {
            while matches!(child.try_wait(), Ok(None)) && Instant::now() < end {
                std::thread::sleep(Duration::from_millis(10));
            }
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Runs the load of one process. The load ends when the standard input of the process closes, so the process
/// never outlives its parent.
pub(crate) fn run_load(kind: &str) {
    std::thread::spawn(|| {
        let mut rest = Vec::new();
        let _ = std::io::stdin().read_to_end(&mut rest);
        std::process::exit(0);
    });
    if kind == "memory" { stream_memory() } else { call_the_system() }
}

fn stream_memory() -> ! {
    let mut memory = vec![0u64; STREAMED / 8];
    let mut round = 0u64;
    loop {
        round += 1;
        memory.iter_mut().for_each(|word| *word = word.wrapping_add(round));
        core::hint::black_box(&memory);
    }
}

/// Two threads pass a byte through pipes: continuous system calls and context switches.
fn call_the_system() {
    let (Ok((mut from_a, mut to_b)), Ok((mut from_b, mut to_a))) = (std::io::pipe(), std::io::pipe()) else {
        return;
    };
    std::thread::spawn(move || {
        let mut byte = [0];
        while from_a.read_exact(&mut byte).is_ok() && to_a.write_all(&byte).is_ok() {}
    });
    let mut byte = [1];
    while to_b.write_all(&byte).is_ok() && from_b.read_exact(&mut byte).is_ok() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_load_is_available_and_unknown_ones_are_not() {
        assert_eq!(Loader::named("own"), Some(Loader::Own));
        assert_eq!(Loader::named("sleep"), None);
    }

    #[test]
    fn load_describes_itself_and_its_command() {
        let text = Loader::StressNg { version: "0.15.06".to_string() }.to_string();
        assert!(text.starts_with("stress-ng 0.15.06 ") && text.contains("--pipe"), "{text}");
        assert!(Loader::Hackbench.to_string().contains("--groups"));
    }
}
