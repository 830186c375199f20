//! Helper threads of a component, for work that must not be done in a step.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::ConfigureError;
use crate::os;
use crate::plan::SchedulingClass;

/// Interval between interrupts of a helper that must stop.
const INTERRUPT_EVERY: Duration = Duration::from_millis(1);
/// Longest name of a thread, bytes.
const LONGEST_NAME: usize = 15;

/// Stop request of a component, as seen by its helper threads.
///
/// ```
/// use motorium::component::StopRequest;
/// use std::time::Duration;
///
/// fn count(stop: &StopRequest) -> u32 {
///     let mut rounds = 0;
///     while !stop.wait(Duration::from_millis(20)) {
///         rounds += 1;
///     }
///     rounds
/// }
/// ```
#[derive(Debug, Clone)]
pub struct StopRequest(Arc<AtomicBool>);

impl StopRequest {
    /// Returns `true` once the component has begun to stop.
    pub fn is_made(&self) -> bool {
        self.0.load(Acquire)
    }

    /// Sleeps for `time`, or until the component stops. Returns `true` if the component stops. May return
    /// early, like [`park_timeout`](std::thread::park_timeout).
    pub fn wait(&self, time: Duration) -> bool {
        if !self.is_made() {
            std::thread::park_timeout(time);
        }
        self.is_made()
    }
}

/// Helper threads of one component. They are stopped and joined on drop.
#[derive(Debug, Default)]
pub(crate) struct Helpers {
    threads: Vec<Helper>,
    /// Maximum time for each thread to stop.
    within: Duration,
}

#[derive(Debug)]
struct Helper {
    name: String,
    stop: Arc<AtomicBool>,
    kernel_id: i32,
    thread: JoinHandle<()>,
}

impl Helpers {
    /// Creates an empty set of helpers. Each helper must stop within this time.
    pub(crate) fn stopping_within(within: Duration) -> Self {
        Self { threads: Vec::new(), within }
    }

    /// Starts a thread at normal priority on these cores.
    pub(super) fn start(
        &mut self,
        name: &str,
        cores: Vec<usize>,
        run: impl FnOnce(&StopRequest) + Send + 'static,
    ) -> Result<(), ConfigureError> {
        if name.is_empty() || name.len() > LONGEST_NAME || name.contains('\0') {
            return Err(ConfigureError::failed(format!(
                "the helper name {name:?} is not valid, expected 1 to {LONGEST_NAME} bytes without NUL"
            )));
        }
        // Without a handler the interrupt would terminate the process.
        os::install_interrupt().map_err(ConfigureError::failed)?;
        let stop = Arc::new(AtomicBool::new(false));
        let request = StopRequest(stop.clone());
        let (sender, receiver) = crossbeam_channel::bounded(1);
        let thread = std::thread::Builder::new().name(name.to_string()).spawn(move || {
            // If the system denies this, the thread stays on the cores of the component, still at normal
            // priority.
            let _ = os::apply(&os::Request { class: SchedulingClass::Normal, cores, lock_memory: false });
            let _ = sender.send(os::thread_id());
            run(&request);
        });
        let thread = thread.map_err(|error| {
            ConfigureError::failed(format!("starting helper `{name}`: {}", os::named(&error)))
        })?;
        let kernel_id = receiver
            .recv()
            .map_err(|_| ConfigureError::failed(format!("helper `{name}` ended while it was starting")))?;
        self.threads.push(Helper { name: name.to_string(), stop, kernel_id, thread });
        Ok(())
    }

    /// Stops and joins all helpers.
    ///
    /// # Errors
    /// A helper panicked or did not stop in time.
    pub(crate) fn stop(&mut self) -> Result<(), String> {
        for helper in &self.threads {
            helper.stop.store(true, Release);
            helper.thread.thread().unpark();
        }
        let until = Instant::now() + self.within;
        let mut result = Ok(());
        for helper in self.threads.drain(..) {
            // A blocking system call returns on an interrupt; an interrupt just before the call is followed
            // by another.
            while !helper.thread.is_finished() && Instant::now() < until {
                os::interrupt_thread(helper.kernel_id);
                std::thread::sleep(INTERRUPT_EVERY);
            }
            let name = &helper.name;
            if !helper.thread.is_finished() {
                result = Err(format!("its helper `{name}` did not stop within {:?}", self.within));
            } else if helper.thread.join().is_err() {
                result = Err(format!("its helper `{name}` panicked"));
            }
        }
        result
    }
}

impl Drop for Helpers {
    fn drop(&mut self) {
        // A component that ends normally has stopped them already and reported errors.
        let _ = self.stop();
    }
}

#[cfg(test)]
mod tests {
    use crossbeam_channel::unbounded;

    use super::*;

    fn helpers() -> Helpers {
        Helpers::stopping_within(Duration::from_secs(20))
    }

    #[test]
    fn helper_runs_under_its_name_until_stopped() {
        let (sender, receiver) = unbounded();
        let mut helpers = helpers();
        helpers
            .start("decoder", vec![0], move |stop| {
                let name = std::thread::current().name().map(str::to_string);
                sender.send(name).unwrap();
                while !stop.wait(Duration::from_secs(100)) {}
                sender.send(None).unwrap();
            })
            .unwrap();
        assert_eq!(receiver.recv().unwrap().as_deref(), Some("decoder"));
        assert_eq!(helpers.stop(), Ok(()));
        assert_eq!(receiver.recv(), Ok(None), "it was woken from its sleep");
    }

    #[test]
    fn blocking_helper_is_interrupted() {
        let (mut reader, _writer) = std::io::pipe().unwrap();
        let (sender, receiver) = unbounded();
        let mut helpers = helpers();
        helpers
            .start("reader", vec![0], move |stop| {
                use std::io::Read as _;
                while !stop.is_made() {
                    let error = reader.read(&mut [0]).unwrap_err();
                    sender.send(error.kind()).unwrap();
                }
            })
            .unwrap();
        assert_eq!(helpers.stop(), Ok(()));
        assert!(receiver.try_iter().all(|kind| kind == std::io::ErrorKind::Interrupted));
    }

    #[test]
    fn panicking_or_stuck_helper_is_reported() {
        let mut helpers = Helpers::stopping_within(Duration::from_secs(20));
        helpers.start("broken", vec![0], |_| panic!("in a test")).unwrap();
        assert_eq!(helpers.stop(), Err("its helper `broken` panicked".to_string()));
        let mut helpers = Helpers::stopping_within(Duration::from_millis(20));
        let (sender, receiver) = unbounded::<()>();
        helpers.start("deaf", vec![0], move |_| while receiver.recv().is_ok() {}).unwrap();
        assert!(helpers.start("a-name-that-is-too-long", vec![0], |_| ()).is_err());
        assert_eq!(helpers.stop(), Err("its helper `deaf` did not stop within 20ms".to_string()));
        drop(sender);
    }
}
