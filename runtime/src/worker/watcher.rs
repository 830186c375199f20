//! The watcher thread of a component's process, which receives signals, detects the death of the launcher,
//! and discards output that is not read.

use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR2};

use super::output::Output;
use crate::context::{Context, Signals};
use crate::os::{Watch, interrupt_thread, monotonic_ns, thread_id};

/// Time between two checks of the space left for output.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };

/// Starts the watcher of the calling (stepping) thread. It runs at normal priority on any core.
pub(super) fn start(context: &Context) -> std::io::Result<JoinHandle<()>> {
    let signals = context.signals().clone();
    let launcher = Watch::new(context.region().header().launcher.load(Relaxed))?;
    // Ctrl-C reaches every process of the terminal, but only the launcher acts on it. Ctrl-Z must not stop a
    // process that moves a robot.
    let ignored = Arc::new(std::sync::atomic::AtomicBool::new(false));
    for signal in [SIGINT, SIGHUP, SIGTSTP, SIGTTIN, SIGTTOU] {
        signal_hook::flag::register(signal, ignored.clone())?;
    }
    let (mut commands, sender) = UnixStream::pair()?;
    commands.set_nonblocking(true)?;
    signal_hook::low_level::pipe::register(SIGUSR2, sender.try_clone()?)?;
    // Actions run in this order, so the flag is set when the watcher is woken.
    signal_hook::flag::register(SIGTERM, signals.terminated())?;
    signal_hook::low_level::pipe::register(SIGTERM, sender)?;
    let stepping = thread_id();
    let mut output = Output::open();
    std::thread::Builder::new().name("watcher".to_string()).spawn(move || {
        let mut launcher_alive = true;
        loop {
            let mut polled =
                vec![PollFd::new(&commands, PollFlags::IN), PollFd::new(&launcher, PollFlags::IN)];
            if !launcher_alive {
                polled.truncate(1);
            }
            let timeout = launcher_alive.then_some(&LOOK);
            match poll(&mut polled, timeout) {
                Ok(0) => {
                    output.relieve();
                    let dropped = output.take_dropped();
                    if dropped > 0 {
                        eprintln!("({dropped} bytes of output were dropped because they were not read)");
                    }
                    continue;
                }
                Ok(_) => {}
                Err(_) => continue,
            }
            if launcher_alive && polled[1].revents().contains(PollFlags::IN) {
                launcher_alive = false;
                // First, because later prints of a step must not wait for a reader.
                output.close();
                signals.launcher_died(monotonic_ns());
            }
            signals.note_termination(monotonic_ns());
            let mut drain = [0; 64];
            while matches!(commands.read(&mut drain), Ok(n) if n > 0) {}
            interrupt_until_seen(&signals, stepping);
        }
    })
}

/// Interrupts the stepping thread until it has seen the message, because a signal just before it falls asleep
/// would be lost.
fn interrupt_until_seen(signals: &Signals, stepping: i32) {
    let message = signals.send();
    for _ in 0..2_000 {
        interrupt_thread(stepping);
        std::thread::sleep(Duration::from_millis(1));
        if signals.has_seen(message) {
            return;
        }
    }
}
