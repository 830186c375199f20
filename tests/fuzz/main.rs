//! Fuzzers: damaged inputs for every reader. For any bytes, reading ends within a second of processor time,
//! with a value or an error, and never panics.
//!
//! Each target damages the files of its folder in `corpus/`, and others of the repository, by bit flips,
//! splices and extreme numbers. `MOTORIUM_FUZZ_SECONDS` sets the duration of each target (1),
//! `MOTORIUM_FUZZ_SEED` the seed (1). A failing input is reduced and written to the folder of temporary
//! files; once it is added to the corpus, every run tests it.

mod commands;
mod damage;
mod graphs;
mod policies;
mod recordings;
mod robots;
mod runs;
mod target;
