//! The `motorium` command: its subcommands, its files, and the book about them.

mod animate;
mod bench;
mod book;
mod can;
mod check;
mod commands;
mod couple;
mod crates;
mod expect;
mod first_day;
mod kinds;
mod latent;
mod learn;
mod learn_robot;
mod messages;
mod model;
mod outputs;
mod primitive;
mod program;
mod qp;
mod robot;
mod robot_draw;
mod robot_hulls;
mod robot_profile;
mod schemas;
mod typed;

/// The program under test.
const MOTORIUM: &str = env!("CARGO_BIN_EXE_motorium");
