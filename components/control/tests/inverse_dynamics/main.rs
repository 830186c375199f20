//! Tests of inverse dynamics: tasks, contacts, limits, levels, and conflicting constraints.

mod added_tasks;
mod axes;
mod barriers;
mod closed_loop;
mod collision_rows;
mod constraints;
mod distances;
mod first_order;
mod friction;
mod impedance;
mod limits;
mod points;
mod robots;
mod second_order;
mod steps;
mod tasks;
mod unknowns;
mod velocity;
mod wrench_cones;
mod wrenches;

motorium::count_allocations!();
