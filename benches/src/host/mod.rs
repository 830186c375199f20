//! The machine under the measurements: what it is, what its host takes away, what else it is given to do.

mod load;
mod machine;
mod steal;

pub use load::Load;
pub(crate) use load::{LOAD, run_load};
pub use machine::{Machine, cores};
pub use steal::{HostShare, Watch};
