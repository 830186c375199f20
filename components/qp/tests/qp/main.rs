//! Tests of the solvers: known, random and recorded problems, warm starts, tolerances.

mod known_problems;
mod random;
mod random_problems;
mod recorded_problems;
mod single_precision;
mod tolerances;
mod warm_starts;

motorium::count_allocations!();
