//! The examples of the crate run to their end.

#[path = "../../examples/fit_and_roll_out.rs"]
mod fit_and_roll_out;

#[test]
fn fit_and_roll_out_reaches_another_goal() {
    fit_and_roll_out::main().unwrap();
}
