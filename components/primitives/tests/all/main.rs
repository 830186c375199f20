//! Integration tests of the crate, one module per subject.

mod allocations;
mod discrete;
mod examples;
mod fitting;
mod means;
mod orientation;
mod oscillators;
mod probabilistic;
mod reach;
mod reference;
mod rhythms;
mod rollout;
mod variants;
