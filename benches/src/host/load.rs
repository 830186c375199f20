//! Other work for the machine, at normal priority: what a robot's computer does besides control.

use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Marks a process of the load in its command line.
pub(crate) const LOAD: &str = "--bench-load";
/// Memory that a process streams through, bytes: more than the caches hold.
const STREAMED: usize = 64 << 20;

/// Processes at normal priority that keep every core busy with memory traffic, system calls and context switches: two
/// for each core. They end when this is dropped.
#[derive(Debug)]
pub struct Load(Vec<Child>);

impl Load {
    /// Starts the load with a program that hands its arguments to [`Part`](crate::Part).
    ///
    /// # Errors
    /// A process could not be started.
    pub fn start(program: &Path) -> std::io::Result<Self> {
        let mut load = Self(Vec::new());
        for _ in super::cores() {
            for kind in ["memory", "calls"] {
                let child = Command::new(program)
                    .args([LOAD, kind])
                    .stdin(Stdio::piped())
                    .stdout(Stdio::null())
                    .stderr(Stdio::null())
                    .spawn()?;
                load.0.push(child);
            }
        }
        Ok(load)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The load of one process; ends when its standard input does, so that it never outlives who started it.
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

/// Two threads throw a byte to and fro through pipes: system calls and context switches without end.
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
