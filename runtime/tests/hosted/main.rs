//! Graphs hosted in the process of a test: `motorium::testing`, and what it shows of the runtime.

mod kit;
mod time;

motorium::count_allocations!();
