//! Programs that host components: found, and asked which kinds they have and what these declare.
//!
//! A graph asks them when it is loaded; here they are asked without one.
//!
//! ```
//! use std::path::Path;
//! use motorium::graph::programs::{ExecProblem, find};
//!
//! let problem = find("no-such-program", Path::new("/")).unwrap_err();
//! assert!(matches!(problem, ExecProblem::Missing(_)));
//! assert!(problem.advice().starts_with("build it first"));
//! ```

pub use super::resolve::exec::{ExecProblem, describe, find, kinds};
pub use super::resolve::siblings::locate;
