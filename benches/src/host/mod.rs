//! The measured machine: its properties, time stolen by its host, and background load.

mod load;
mod machine;
mod share;

pub(crate) use load::{LOAD, run_load};
pub use load::{Load, Loader};
pub use machine::Machine;
pub use share::{Causes, FloorShare, HostShare, Watch};
