//! Signals to the launcher.

use std::cell::Cell;
use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGTSTP};

/// Signals that request the end of the run.
pub(super) struct Signals {
    count: Arc<AtomicUsize>,
    forgotten: Cell<usize>,
    stream: UnixStream,
    /// Keeps the stream open; otherwise it would be permanently readable.
    _sender: UnixStream,
    registered: Vec<signal_hook::SigId>,
}

impl Signals {
    /// Catches signals from now on if `catch` is true. Each of several runs in a process receives all
    /// signals.
    pub(super) fn new(catch: bool) -> std::io::Result<Self> {
        let count = Arc::new(AtomicUsize::new(0));
        let (stream, sender) = UnixStream::pair()?;
        stream.set_nonblocking(true)?;
        let mut registered = Vec::new();
        if !catch {
            return Ok(Self { count, forgotten: Cell::new(0), stream, _sender: sender, registered });
        }
        catchers::enter()?;
        for signal in catchers::SIGNALS {
            // under `nohup` a closed terminal must not end the run
            if signal == SIGHUP && crate::os::is_ignored(signal) {
                continue;
            }
            let raised = count.clone();
            registered.push(signal_hook_registry_count(signal, raised)?);
            registered.push(signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?);
        }
        // Ctrl-Z must not stop the supervisor of a robot.
        registered.push(signal_hook::flag::register(SIGTSTP, Arc::default())?);
        Ok(Self { count, forgotten: Cell::new(0), stream, _sender: sender, registered })
    }

    /// Returns `true` if a signal has arrived.
    pub(super) fn is_raised(&self) -> bool {
        self.count.load(Relaxed) > self.forgotten.get()
    }

    /// Discards earlier signals.
    pub(super) fn forget(&self) {
        self.forgotten.set(self.count.load(Relaxed));
    }

    /// Returns `true` if a signal has arrived or arrives within a time, ns.
    pub(super) fn arrives_within(&self, ns: u64) -> bool {
        if !self.is_raised() {
            let timeout = Timespec { tv_sec: 0, tv_nsec: ns as _ };
            let _ = poll(&mut [PollFd::new(self.stream(), PollFlags::IN)], Some(&timeout));
        }
        self.is_raised()
    }

    /// Returns a stream that becomes readable on a signal.
    pub(super) fn stream(&self) -> &UnixStream {
        let mut drain = [0; 16];
        while matches!((&self.stream).read(&mut drain), Ok(n) if n > 0) {}
        &self.stream
    }
}

impl Drop for Signals {
    fn drop(&mut self) {
        if self.registered.is_empty() {
            return;
        }
        for id in self.registered.drain(..) {
            signal_hook::low_level::unregister(id);
        }
        catchers::leave();
    }
}

/// Counts the runs of this process that catch signals. Without any, signals have their previous effect.
mod catchers {
    use std::sync::Once;
    use std::sync::atomic::AtomicUsize;
    use std::sync::atomic::Ordering::SeqCst;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGTSTP};

    /// The signals that end a run.
    pub(super) const SIGNALS: [i32; 3] = [SIGINT, SIGTERM, SIGHUP];

    static ALIVE: AtomicUsize = AtomicUsize::new(0);

    #[allow(unsafe_code)]
    pub(super) fn enter() -> std::io::Result<()> {
        static ONCE: Once = Once::new();
        let mut registered = Ok(());
        ONCE.call_once(|| {
            for signal in SIGNALS.into_iter().chain([SIGTSTP]) {
                if registered.is_err() || !crate::os::is_default(signal) {
                    continue;
                }
                let by_default = move || {
                    if ALIVE.load(SeqCst) == 0 {
                        let _ = signal_hook::low_level::emulate_default_handler(signal);
                    }
                };
                // SAFETY: the handler reads an atomic and emulates the default action, both safe in a signal
                // handler.
                registered = unsafe { signal_hook::low_level::register(signal, by_default) }.map(drop);
            }
        });
        registered?;
        ALIVE.fetch_add(1, SeqCst);
        Ok(())
    }

    pub(super) fn leave() {
        ALIVE.fetch_sub(1, SeqCst);
    }
}

#[allow(unsafe_code)]
fn signal_hook_registry_count(signal: i32, count: Arc<AtomicUsize>) -> std::io::Result<signal_hook::SigId> {
    // SAFETY: the handler only increments an atomic, which is safe in a signal handler.
    unsafe {
        signal_hook::low_level::register(signal, move || {
            count.fetch_add(1, Relaxed);
        })
    }
}
