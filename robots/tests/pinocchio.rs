//! The catalogue compared with Pinocchio, by vectors written by `golden/generate.py`.

use std::path::Path;

use crate::golden::Golden;
use motorium_robots::load;

#[test]
fn panda_agrees_with_pinocchio_in_every_quantity() {
    let golden = Golden::parse(include_str!("golden/panda.json"));
    let panda = load("panda", Path::new(".")).unwrap();
    let errors = golden.compare(&panda.model);
    println!("{}", errors.summary());
    assert_eq!(errors.0.len(), 13, "{}", errors.summary());
    errors.stay_below(1e-10, 1e-10);
}

#[test]
fn panda_limits_match_pinocchio() {
    let golden = Golden::parse(include_str!("golden/panda.json"));
    golden.compare_limits(&load("panda", Path::new(".")).unwrap().model);
}
