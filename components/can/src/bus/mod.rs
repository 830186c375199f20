//! Buses: the bits of frames, the budget of a cycle, the interface of a bus, the simulated one.

pub mod bits;
