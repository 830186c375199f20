//! Graphs hosted in the process of a test with `motorium::testing`.

mod episodes;
mod example;
mod kit;
mod parameters;
mod stamps;
mod time;

// the example component, included by `example`, installs the counting allocator
