//! Integration tests of the crate, one module a subject.

mod allocations;
mod discrete;
mod fitting;
mod orientation;
mod oscillators;
mod probabilistic;
mod reach;
mod reference;
mod rhythms;
mod variants;
