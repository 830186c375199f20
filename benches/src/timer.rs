//! How late the machine wakes a sleeper: what `cyclictest` measures.

use motorium::os::{Request, apply, monotonic_ns, prefault_stack, sleep_until};
use motorium::plan::SchedulingClass;

use crate::MeasureError;

/// The period, ns: 1 kHz.
const PERIOD_NS: u64 = 1_000_000;

/// Sleeps to absolute deadlines with plain `clock_nanosleep`, a millisecond apart, in a thread of its own on one core
/// at one `SCHED_FIFO` priority. Returns how late it woke, and the priority read back.
///
/// # Errors
/// The thread died.
pub fn timer(core: usize, fifo: u8, wake_ups: usize) -> Result<(Vec<u64>, u32), MeasureError> {
    let measured = std::thread::scope(|scope| scope.spawn(|| timer_here(core, fifo, wake_ups)).join());
    measured.map_err(|_| MeasureError::system("measuring wake-ups", "the thread died"))
}

fn timer_here(core: usize, fifo: u8, wake_ups: usize) -> (Vec<u64>, u32) {
    let class = if fifo > 0 { SchedulingClass::Fifo(fifo) } else { SchedulingClass::Normal };
    let (applied, _) = apply(&Request { class, cores: vec![core], lock_memory: false });
    prefault_stack();
    let mut late = vec![0; wake_ups];
    let mut deadline = monotonic_ns() + PERIOD_NS;
    for late in &mut late {
        sleep_until(deadline);
        let now = monotonic_ns();
        *late = now.saturating_sub(deadline);
        // The releases a long delay has swallowed are not waited for: they would count as on time.
        deadline += (*late / PERIOD_NS + 1) * PERIOD_NS;
    }
    (late, u32::from(applied.fifo_priority))
}

/// What one look at the clock costs, ns: part of every sample of a hop.
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

/// The places of the measurements: the core of real-time work, and another one if there is any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// Where graphs run their real-time components: the last core.
    pub realtime: usize,
    /// The core across which is measured.
    pub other: Option<usize>,
}

impl Places {
    /// Those of this machine.
    pub fn detect() -> Self {
        let cores = crate::host::cores();
        let realtime = cores.last().copied().unwrap_or(0);
        Self { realtime, other: cores.first().copied().filter(|core| *core != realtime) }
    }
}
