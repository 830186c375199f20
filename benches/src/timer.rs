//! Lateness of wake-ups, measured as `cyclictest` does.

use motorium::os::{Request, apply, monotonic_ns, prefault_stack, sleep_until};
use motorium::plan::SchedulingClass;

use crate::MeasureError;

/// The period of the wake-ups, ns: 1 kHz.
pub const PERIOD_NS: u64 = 1_000_000;

/// Measured wake-ups.
#[derive(Debug, Clone)]
pub struct WakeUps {
    /// Time from each deadline to the first clock reading after it, ns.
    pub late_ns: Vec<u64>,
    /// `SCHED_FIFO` priority during the measurement, as read back from the kernel; 0 for normal time sharing.
    pub fifo: u8,
    /// `true` if the thread ran only on the requested core, as read back from the kernel.
    pub pinned: bool,
}

/// Measures wake-ups with plain `clock_nanosleep` to absolute deadlines, one millisecond apart. The thread
/// runs on one core with the `SCHED_FIFO` priority `fifo` (0 for normal time sharing).
///
/// # Errors
/// The measuring thread ended early.
pub fn timer(core: usize, fifo: u8, wake_ups: usize) -> Result<WakeUps, MeasureError> {
    let measured = std::thread::scope(|scope| scope.spawn(|| timer_here(core, fifo, wake_ups)).join());
    measured.map_err(|_| MeasureError::system("measuring wake-ups", "the thread died"))
}

fn timer_here(core: usize, fifo: u8, wake_ups: usize) -> WakeUps {
    let class = if fifo > 0 { SchedulingClass::Fifo(fifo) } else { SchedulingClass::Normal };
    let (applied, _) = apply(&Request { class, cores: vec![core], lock_memory: false });
    prefault_stack();
    let mut late_ns = vec![0; wake_ups];
    let mut deadline = monotonic_ns() + PERIOD_NS;
    for late in &mut late_ns {
        sleep_until(deadline);
        let now = monotonic_ns();
        *late = now.saturating_sub(deadline);
        // Releases swallowed by a long delay are skipped, since they would count as on time.
        deadline += (*late / PERIOD_NS + 1) * PERIOD_NS;
    }
    WakeUps { late_ns, fifo: applied.fifo_priority, pinned: applied.cores == [core] }
}

/// Measures how long reading the clock takes, ns. This time is part of every sample of a hop.
pub fn clock() -> Vec<u64> {
    const LOOKS: u64 = 100;
    let mean = |_| {
        let start = monotonic_ns();
        for _ in 1..LOOKS {
            core::hint::black_box(monotonic_ns());
        }
        (monotonic_ns() - start) / LOOKS
    };
    (0..2_000).map(mean).collect()
}

/// Cores of the measurements: the real-time core, and a second core if the machine has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Core of the real-time components of graphs: the last core of the machine.
    pub realtime: usize,
    /// Second core, for measurements across cores; `None` on a machine with one core.
    pub other: Option<usize>,
}

impl Places {
    /// Selects the cores on this machine.
    pub fn detect() -> Self {
        let cores = motorium::os::machine::online_cores();
        let realtime = cores.last().copied().unwrap_or(0);
        Self { realtime, other: cores.first().copied().filter(|core| *core != realtime) }
    }
}
