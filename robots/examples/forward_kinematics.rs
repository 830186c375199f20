//! Loads a robot and prints the pose and the Jacobian of its tool frame at the home pose.
//!
//! `cargo run -p motorium-robots --example forward_kinematics -- [ROBOT]`: a catalogue name (default `panda`)
//! or a file.

use std::error::Error;
use std::path::Path;

use motorium_robots::{Kinematics, Reference, load};
use nalgebra::Matrix6xX;

fn main() -> Result<(), Box<dyn Error>> {
    run(&std::env::args().nth(1).unwrap_or_else(|| "panda".to_owned()))
}

pub(crate) fn run(robot: &str) -> Result<(), Box<dyn Error>> {
    let robot = load(robot, Path::new("."))?;
    let model = &robot.model;
    let tool = robot.end_effector(None)?;
    let q = match &robot.profile {
        Some(profile) => profile.configuration(model, &profile.home)?.as_slice().to_vec(),
        None => model.neutral(),
    };

    // The workspace is created once; nothing below allocates.
    let mut kinematics = Kinematics::new(model);
    let mut jacobian = Matrix6xX::zeros(model.nv());
    kinematics.update(model, &q);
    kinematics.jacobian(model, tool, Reference::LocalWorldAligned, &mut jacobian);

    let pose = kinematics.pose(model, tool);
    println!(
        "{} at home: {} is at {:.4} m",
        model.name(),
        model.frames()[tool.index()].name,
        pose.translation
    );
    println!("turned by {:.4} rad", pose.rotation.angle());
    println!("Jacobian, linear rows [m/rad] first, one column per joint:{jacobian:.3}");
    Ok(())
}
