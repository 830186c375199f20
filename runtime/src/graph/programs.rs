//! Programs that host components: search, and queries of their kinds and declarations.
//!
//! Loading a graph queries the programs that the graph names. This module queries programs without a graph.
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
