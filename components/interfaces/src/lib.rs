//! Interfaces between motorium graphs and people.

mod console;

pub use console::{ConsoleLog, ConsoleLogConfig};
