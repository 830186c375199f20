//! Tests of inverse dynamics: tasks, contacts, limits, levels, and what happens where constraints conflict.

mod closed_loop;
mod constraints;
mod robots;
mod tasks;
mod velocity;

motorium::count_allocations!();
