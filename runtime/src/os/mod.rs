//! The operating system's real-time facilities, as safe functions.
//!
//! Every `unsafe` block in this module is a single call into libc with arguments that the caller owns.

mod backoff;
mod cpu_time;
mod fork;
mod futex;
pub(crate) mod held_word;
mod idle;
mod lock;
pub mod machine;
mod prefetch;
mod process;
mod random;
mod readiness;
mod realtime;
mod shortage;
mod users;
mod wait;

pub(crate) use backoff::Backoff;
pub use cpu_time::{WaitedForCore, thread_cpu_ns};
pub use fork::OtherProcess;
pub(crate) use fork::Owned;
pub(crate) use futex::{futex_sleep, futex_wake_low};
pub use idle::IdleLimit;
pub use lock::{Lock, is_held};
pub use prefetch::{prefetch_read, prefetch_write};
pub use process::{Watch, discard_output, install_interrupt, interrupt_thread, process_state, thread_id};
pub(crate) use process::{is_default, is_ignored};
pub use random::random_bytes;
pub use readiness::Readiness;
pub use realtime::{
    Applied, Denied, Placement, Request, apply, hand_over_when_asleep, leave_realtime, limit_cpu,
    page_faults, prefault_stack, times_asleep, wake_first, wake_soon,
};
pub use shortage::{
    Room, amount, named, open_descriptors, process_limit, raise_limit, shortage, with_shortage,
};
pub use users::{Foreign, is_bound_by_process_limit, realtime_of_others, threads_of_this_user};
pub use wait::{
    boottime_ns, current_core, futex_wait, futex_wake, monotonic_ns, realtime_ns, sleep_until, yield_core,
};
