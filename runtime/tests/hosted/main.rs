//! Graphs hosted in the process of a test: `motorium::testing`, and what it shows of the runtime.

mod episodes;
mod example;
mod kit;
mod parameters;
mod stamps;
mod time;

// the example of a component, which `example` includes, installs the allocator that counts
