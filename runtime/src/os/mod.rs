//! The operating system's real-time facilities, as safe functions.
//!
//! Everything here that needs `unsafe` is a single call into libc whose arguments are owned by the caller.

mod cpu_time;
mod idle;
pub mod machine;
mod prefetch;
mod process;
mod realtime;
mod wait;

pub use cpu_time::{WaitedForCore, thread_cpu_ns};
pub use idle::IdleLimit;
pub use prefetch::{prefetch_read, prefetch_write};
pub use process::{Watch, install_interrupt, interrupt_thread, thread_id};
pub use realtime::{Applied, Denied, Request, apply, page_faults, prefault_stack, times_asleep};
pub use wait::{boottime_ns, current_core, futex_wait, futex_wake, monotonic_ns, sleep_until, yield_core};
