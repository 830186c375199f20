//! The end of a run: signals, the safe state, the orderly stop.

use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::{Event, Launch, STOP_WITHIN, Services};
use crate::os::monotonic_ns;
use crate::plan::ClockKind;
use crate::region::{Command, Phase};

/// Signals that ask the launcher to end the run.
pub(super) struct Signals {
    count: Arc<AtomicUsize>,
    stream: UnixStream,
    registered: Vec<signal_hook::SigId>,
}

impl Signals {
    pub(super) fn catch() -> std::io::Result<Self> {
        let count = Arc::new(AtomicUsize::new(0));
        let (stream, sender) = UnixStream::pair()?;
        stream.set_nonblocking(true)?;
        let mut registered = Vec::new();
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            let raised = count.clone();
            registered.push(signal_hook_registry_count(signal, raised)?);
            registered.push(signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?);
        }
        Ok(Self { count, stream, registered })
    }

    /// Number of signals so far.
    pub(super) fn raised(&self) -> usize {
        self.count.load(Relaxed)
    }

    /// A stream that becomes readable at a signal.
    pub(super) fn stream(&self) -> &UnixStream {
        let mut drain = [0; 16];
        while matches!((&self.stream).read(&mut drain), Ok(n) if n > 0) {}
        &self.stream
    }
}

impl Drop for Signals {
    fn drop(&mut self) {
        for id in self.registered.drain(..) {
            signal_hook::low_level::unregister(id);
        }
    }
}

#[allow(unsafe_code)]
fn signal_hook_registry_count(signal: i32, count: Arc<AtomicUsize>) -> std::io::Result<signal_hook::SigId> {
    // SAFETY: the handler only adds to an atomic, which is safe in a signal handler.
    unsafe {
        signal_hook::low_level::register(signal, move || {
            count.fetch_add(1, Relaxed);
        })
    }
}

impl Launch<'_> {
    /// Brings the actuators to their safe state and waits until the robot has settled.
    pub(super) fn safe_stop(&mut self, reason: &str, observe: &mut dyn FnMut(Event<'_>)) {
        let noticed = monotonic_ns();
        let header = self.region.header();
        header.safe_stop_ns.store(noticed, Relaxed);
        header.order(Command::SafeStop);
        self.signal_all();
        observe(Event::SafeStop { reason });
        let settle = Duration::from_nanos(self.plan.safety.settle_ns);
        let until = Instant::now() + settle;
        let mut told = false;
        while Instant::now() < until {
            self.relay_output(observe);
            if !told && let Some(after_ns) = self.all_actuators_safe_since(noticed) {
                observe(Event::Safe { after_ns });
                told = true;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Time from `noticed` until the last living actuator was in its safe state, once all are.
    fn all_actuators_safe_since(&self, noticed: u64) -> Option<u64> {
        let mut last = noticed;
        let mut any = false;
        for (component, block) in self.plan.components.iter().zip(self.region.components()) {
            if component.actuator && block.phase() == Phase::Running {
                if block.safe.load(Relaxed) == 0 {
                    return None;
                }
                any = true;
                last = last.max(block.safe_since_ns.load(Relaxed));
            }
        }
        any.then(|| last - noticed)
    }

    /// Ends all components: the actuators reach their safe state first, then all components are asked to stop, and
    /// those that do not are killed.
    pub(super) fn end(&mut self, services: &Services, observe: &mut dyn FnMut(Event<'_>)) {
        let running = self.plan.clock == ClockKind::Realtime
            && self.region.components().iter().any(|block| block.phase() == Phase::Running);
        let actuators = self.plan.components.iter().any(|component| component.actuator);
        if running && actuators && self.region.header().command() == Command::Run {
            self.region.header().order(Command::SafeStop);
            std::thread::sleep(Duration::from_nanos(self.plan.safety.settle_ns));
        }
        self.region.header().order(Command::Stop);
        let until = Instant::now() + STOP_WITHIN;
        for index in 0..self.children.len() {
            while self.children[index].ended().is_none() && Instant::now() < until {
                self.wake_triggered(services);
                self.signal_all();
                self.children[index].wait(Duration::from_millis(10));
            }
            self.children[index].kill();
        }
        // Their pipes are closed now: their last lines have arrived or will in a moment.
        std::thread::sleep(Duration::from_millis(2));
        self.relay_output(observe);
    }

    /// Wakes components that wait for a publication, so that they see the command.
    pub(super) fn wake_triggered(&self, services: &Services) {
        for topic in &services.waited_for {
            topic.interrupt();
        }
    }
}
