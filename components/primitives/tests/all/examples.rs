//! The examples of the crate run to their end.

#[path = "../../examples/fit_and_roll_out.rs"]
mod fit_and_roll_out;

#[test]
fn a_primitive_fitted_to_a_demonstration_reaches_another_goal() {
    fit_and_roll_out::main().unwrap();
}
