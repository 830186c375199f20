//! Interfaces between motorium graphs and people: `log.console`.

mod console;

pub use console::{ConsoleLog, ConsoleLogConfig};
