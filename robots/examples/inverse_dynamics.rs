//! Computes the joint efforts for a motion of a robot, and checks them by forward dynamics.
//!
//! `cargo run -p motorium-robots --example inverse_dynamics -- [ROBOT]`: a catalogue name (default `panda`)
//! or a file.

use std::error::Error;
use std::path::Path;

use motorium_robots::{Dynamics, load};
use nalgebra::Vector3;

fn main() -> Result<(), Box<dyn Error>> {
    run(&std::env::args().nth(1).unwrap_or_else(|| "panda".to_owned()))
}

pub(crate) fn run(robot: &str) -> Result<(), Box<dyn Error>> {
    let robot = load(robot, Path::new("."))?;
    let model = &robot.model;
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let (q, v) = (model.neutral(), vec![0.5; model.nv()]);
    let wanted = vec![1.0; model.nv()];

    let mut dynamics = Dynamics::new(model);
    let mut tau = vec![0.0; model.nv()];
    dynamics.rnea(model, &q, &v, &wanted, gravity, &mut tau);
    let offset = model.nv() - model.joint_count();
    for (joint, effort) in model.joint_names().iter().zip(&tau[offset..]) {
        println!("{joint:24} {effort:9.3}");
    }

    let mut found = vec![0.0; model.nv()];
    dynamics.forward(model, &q, &v, &tau, gravity, &mut found)?;
    let error = wanted.iter().zip(&found).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    println!("these efforts produce the desired acceleration to within {error:.1e} rad/s2");
    if error > 1e-8 {
        return Err("inverse and forward dynamics disagree".into());
    }
    Ok(())
}
