//! Robots that settle into standing, compared with MuJoCo; `golden/generate_standing.py` writes the vectors.

use motorium_physics::{LinkForce, Simulator};
use motorium_robots::{Dynamics, Kinematics, Reference};
use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

use crate::legged::held;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn robots_come_to_stand_as_in_mujoco() {
    let document: Value = serde_json::from_str(include_str!("golden/standing.json")).unwrap();
    let robots = document["robots"].as_array().unwrap();
    assert_eq!(robots.len(), 3);
    for robot in robots {
        let name = robot["robot"].as_str().unwrap();
        let mut simulation = held(name);
        let mut steps = 0;
        for sample in robot["samples"].as_array().unwrap() {
            let until = (sample["time"].as_f64().unwrap() * 1e3).round() as usize;
            while steps < until {
                simulation.step(1e-3).unwrap();
                steps += 1;
            }
            let base = numbers(&sample["base"]);
            let pose = simulation.base_pose();
            let apart = (pose.translation.vector - Vector3::from_column_slice(&base[..3])).norm();
            let theirs = Quaternion::new(base[3], base[4], base[5], base[6]);
            let turned = pose.rotation.angle_to(&UnitQuaternion::new_normalize(theirs));
            println!("{name} at {until} ms: {apart:.5} m and {turned:.5} rad from MuJoCo's");
            // A hundredth of a second of the fall, plus the penetration of MuJoCo's stiffest contacts.
            assert!(apart < 1.5e-3 && turned < 2e-3, "{name} at {until} ms: {apart} m, {turned} rad");
        }
        let names: Vec<_> =
            robot["joints"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
        let efforts = numbers(&robot["efforts"]);
        let largest = efforts.iter().fold(0.0_f64, |most, effort| most.max(effort.abs()));
        for (joint, effort) in names.iter().zip(&efforts) {
            let index = simulation.model().joint_index(joint).unwrap();
            let ours = simulation.efforts()[index];
            assert!(
                (ours - effort).abs() < 0.03 * largest,
                "{name}: {joint} at {ours} N m, MuJoCo has {effort}"
            );
        }
    }
}

#[test]
fn efforts_of_a_standing_robot_balance_its_weight() {
    // Statics, independent of the solver: g(q) = tau + sum J' f with the published efforts and contacts.
    for name in ["quadruped", "hexapod", "centaur"] {
        let mut simulation = held(name);
        (0..3000).for_each(|_| _ = simulation.step(1e-3).unwrap());
        let model = simulation.model().clone();
        let q = simulation.configuration().to_vec();
        let mut balance = vec![0.0; model.nv()];
        Dynamics::new(&model).gravity(&model, &q, Vector3::new(0.0, 0.0, -9.81), &mut balance);
        for (balance, effort) in balance[6..].iter_mut().zip(simulation.efforts()) {
            *balance -= effort;
        }
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let mut jacobian = DMatrix::zeros(6, model.nv());
        simulation.visit_forces(&mut |contact| {
            let LinkForce { link, point, force } = *contact;
            let frame = model.frame(link).unwrap();
            kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut jacobian);
            let arm = point.coords - kinematics.pose(&model, frame).translation.vector;
            let torque = arm.cross(&force);
            for (column, balance) in balance.iter_mut().enumerate() {
                let entry = |row: usize| jacobian[(row, column)];
                *balance -= entry(0) * force.x + entry(1) * force.y + entry(2) * force.z;
                *balance -= entry(3) * torque.x + entry(4) * torque.y + entry(5) * torque.z;
            }
        });
        let weight = 9.81 * model.mass();
        let worst = balance.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        assert!(worst < 1e-3 * weight, "{name}: {worst} N m unbalanced, weight {weight} N");
    }
}

#[test]
fn a_dropped_robot_is_caught_by_its_legs() {
    let mut simulation = held("quadruped");
    let standing = simulation.configuration().to_vec();
    let commands = simulation.commands_mut().to_vec();
    let mut above = standing.clone();
    above[2] += 0.1;
    simulation.reset(&above, &[0.0; 18]).unwrap();
    simulation.commands_mut().copy_from_slice(&commands);
    let mut deepest = 0.0_f64;
    for _ in 0..1500 {
        simulation.step(1e-3).unwrap();
        simulation.visit_contacts(&mut |contact| deepest = deepest.max(contact.depth));
    }
    let height = simulation.base_pose().translation.z;
    assert!((height - standing[2]).abs() < 0.02, "{height} m");
    assert!(deepest < 1e-3, "the feet went {deepest} m into the ground");
}
