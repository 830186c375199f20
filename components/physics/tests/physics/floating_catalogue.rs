//! Simulations of every catalogue robot with a floating base: placed on the ground it stands or rests there,
//! without a heap allocation, and without drives it falls and comes to rest.

use std::path::Path;

use motorium::telemetry::{allocations, counts_allocations};
use motorium_physics::{JointSetpoint, Simulator};
use motorium_robots::{catalogue, load};

use crate::legged::{grounded, held, run, standing};

fn floating() -> Vec<&'static str> {
    let names = catalogue().iter().map(|entry| entry.name);
    names.filter(|name| load(name, Path::new(".")).unwrap().model.base().floating).collect()
}

#[test]
fn every_floating_base_robot_stands_by_default_gains() {
    let names = floating();
    assert_eq!(
        names,
        [
            "ackermann",
            "biped",
            "centaur",
            "differential-drive",
            "hexapod",
            "humanoid",
            "quadrotor",
            "quadruped"
        ]
    );
    for name in names.into_iter().filter(|name| *name != "quadrotor") {
        let mut simulation = held(name);
        let weight = 9.81 * simulation.model().mass();
        let start = simulation.base_pose();
        run(&mut simulation, 1.0);
        let now = simulation.base_pose();
        let sunk = start.translation.z - now.translation.z;
        let tilt = (now.rotation * nalgebra::Vector3::z()).z.acos();
        let moved = (now.translation.vector - start.translation.vector).xy().norm();
        let force = simulation.contact_force();
        println!(
            "{name}: sunk {sunk:.4} m, tilt {tilt:.4} rad, moved {moved:.4} m, force {:.4} of its weight",
            force.z / weight
        );
        for warning in simulation.warnings() {
            println!("  {warning}");
        }
        // A biped without a balance controller tips over slowly.
        if name == "biped" || name == "humanoid" {
            assert!(sunk < 0.1 && tilt < 0.3, "{name}: sunk by {sunk} m, leans by {tilt} rad");
            continue;
        }
        assert!(sunk.abs() < 0.03 && tilt < 0.05 && moved < 0.02, "{name}: {sunk} m, {tilt} rad, {moved} m");
        assert!((force.z - weight).abs() < 0.02 * weight, "{name}: {force}, weight {weight}");
    }
}

#[test]
fn a_robot_without_drives_collapses_and_rests() {
    for name in ["quadruped", "hexapod"] {
        let mut simulation = standing(name, grounded(vec![]));
        // Joints with a little friction, like all real joints.
        for command in simulation.commands_mut() {
            *command = JointSetpoint { kd: 0.02, ..JointSetpoint::default() };
        }
        run(&mut simulation, 2.0);
        let speed = simulation.velocity()[..3].iter().map(|v| v * v).sum::<f64>().sqrt();
        let height = simulation.base_pose().translation.z;
        assert!(speed < 0.5 && height > 0.0, "{name} at {height} m, still at {speed} m/s");
        simulation.visit_contacts(&mut |contact| assert!(contact.depth < 0.005, "{name}: {contact:?}"));
    }
}

#[test]
fn steps_in_the_air_allocate_nothing() {
    for name in ["quadruped", "humanoid", "quadrotor"] {
        let mut simulation = standing(name, grounded(vec![]));
        let mut q = simulation.configuration().to_vec();
        q[2] += 5.0;
        let v: Vec<f64> = (0..simulation.velocity().len()).map(|i| 0.1 * (i as f64).sin()).collect();
        simulation.reset(&q, &v).unwrap();
        let before = allocations().own;
        run(&mut simulation, 0.2);
        assert_eq!(allocations().own - before, 0, "{name}");
        assert!(simulation.base_pose().translation.z < q[2]);
    }
}

#[test]
fn steps_in_contact_allocate_nothing() {
    assert!(counts_allocations());
    for name in floating() {
        let mut simulation = held(name);
        run(&mut simulation, 0.05);
        let before = allocations().own;
        run(&mut simulation, 0.2);
        assert_eq!(allocations().own - before, 0, "{name}");
    }
}
