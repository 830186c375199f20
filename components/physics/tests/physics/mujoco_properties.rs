//! Properties that change at a reset, with the MuJoCo engine, which recompiles its model.

use std::path::Path;

use motorium_physics::{MujocoSimulator, Options, Properties, ResetError, Simulator, World};
use motorium_robots::{BodyFactors, Model, load};

use crate::engines::has_mujoco;

#[test]
fn properties_rejected_by_mujoco_are_reported() {
    if !has_mujoco() {
        return;
    }
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let build = |model: &Model| {
        MujocoSimulator::new(model.clone(), World::default(), &[1.2], Options::default())
            .expect("MuJoCo takes it")
    };
    let with_mass = |mass: f64| {
        let factors = BodyFactors { mass, damping: 1.0, friction: 1.0, effort_limit: 1.0 };
        model.with_factors(1.0, &vec![factors; model.bodies().len()])
    };
    let swing = |simulation: &mut MujocoSimulator| {
        (0..200).for_each(|_| _ = simulation.step(1e-3).unwrap());
        [simulation.positions()[0].to_bits(), simulation.velocities()[0].to_bits()]
    };
    let mut simulation = build(&model);
    let nominal = simulation.properties();
    let weightless = Properties { model: with_mass(1e-30), ..nominal.clone() };
    let refused = simulation.reset_with(&weightless, &[0.3], &[0.0]).unwrap_err();
    assert!(matches!(&refused, ResetError::Refused { reason } if reason.contains("MuJoCo")), "{refused}");
    assert_eq!(swing(&mut simulation), swing(&mut build(&model)), "it swings on from where it was");

    let heavy = Properties { model: with_mass(3.0), ..nominal };
    simulation.reset_with(&heavy, &[1.2], &[0.0]).unwrap();
    assert_eq!(swing(&mut simulation), swing(&mut build(&heavy.model)));
}
