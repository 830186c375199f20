//! The machine under the measurements: what it is, what its host takes away, what else it is given to do.

mod load;
mod machine;
mod share;

pub(crate) use load::{LOAD, run_load};
pub use load::{Load, Loader};
pub use machine::Machine;
pub use share::{Causes, FloorShare, HostShare, Watch};
