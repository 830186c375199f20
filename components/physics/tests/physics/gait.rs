//! A gait on the ground: joints that follow cosines, like the output of a pattern generator.

use motorium_physics::{JointSetpoint, Simulator};

use crate::legged::held;

/// Cosines of hip pitch and knee whose feet follow ellipses of 6 by 6 cm, with diagonal legs in phase:
/// (offset, amplitude, phase).
const FRONT: [(f64, f64, f64); 3] = [(0.0, 0.0, 0.0), (0.8, 0.1875, 2.371), (-1.6, 0.261, -1.571)];
const HIND: [(f64, f64, f64); 3] = [(0.0, 0.0, 0.0), (-0.8, 0.1875, -2.371), (1.6, 0.261, 1.571)];

#[test]
fn trot_moves_the_quadruped_as_far_as_in_mujoco() {
    let mut simulation = held("quadruped");
    let omega = std::f64::consts::TAU * 2.0;
    for step in 0..6000 {
        let time = f64::from(step) * 1e-3;
        let share = (2.0 * time).min(1.0);
        let commands = simulation.commands_mut().iter_mut().enumerate();
        for (index, command) in commands {
            let leg = index / 3;
            let (offset, amplitude, phase) = if leg < 2 { FRONT[index % 3] } else { HIND[index % 3] };
            let of_leg = if leg == 0 || leg == 3 { 0.0 } else { std::f64::consts::PI };
            let angle = omega * time + of_leg + phase;
            *command = JointSetpoint {
                position: offset + share * amplitude * angle.cos(),
                velocity: -share * amplitude * omega * angle.sin(),
                kp: 15.0,
                kd: 0.3,
                ..JointSetpoint::default()
            };
        }
        simulation.step(1e-3).unwrap();
    }
    let place = simulation.base_pose().translation;
    println!("after 6 s at {place}");
    // Reference: MuJoCo 4.0.0, with the model of golden/generate_standing.py and the same commands: 1.45 m.
    assert!((place.x - 1.45).abs() < 0.3, "{place}");
    assert!(place.y.abs() < 0.3 && place.z > 0.2, "{place}");
    let up = simulation.base_pose().rotation * nalgebra::Vector3::z();
    assert!(up.z > 0.98, "{up}");
}
