//! Fuzzers: damaged inputs of every reader. Whatever the bytes are, reading them ends within a second of
//! processor time, with a value or with an error, and never in a panic.
//!
//! Each target damages the files of its folder in `corpus/`, and others of the repository, by flips of bytes,
//! splices and extreme numbers. `MOTORIUM_FUZZ_SECONDS` sets how long each target runs (1),
//! `MOTORIUM_FUZZ_SEED` what it draws (1). An input that fails is reduced and written to the folder of
//! temporary files; put into the corpus it is tried in every run from then on.

mod commands;
mod damage;
mod graphs;
mod recordings;
mod robots;
mod runs;
mod target;
