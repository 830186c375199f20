//! Springs in joints against closed forms, on every engine.

use motorium_physics::{ArticulatedSimulator, Integrator, JointProperties, Options, Simulator, World};
use motorium_robots::{LoadOptions, MimicMode, Model, PackagePath, parse_mjcf, parse_urdf};

use crate::engines::engines;

/// Inertia of the rod about its hinge \[kg m2\].
const INERTIA: f64 = 0.1;
const STIFFNESS: f64 = 25.0;
const REST: f64 = 0.2;

/// A rod with a spring that turns about the vertical axis, so that gravity has no effect.
fn rod(axis: &str) -> Model {
    let text = format!(
        r#"<mujoco><compiler angle="radian"/><worldbody><body name="rod">
  <joint name="hinge" axis="{axis}" stiffness="{STIFFNESS}" springref="{REST}"/>
  <inertial pos="0.3 0 0" mass="1" diaginertia="0.001 0.01 0.01"/>
</body></worldbody></mujoco>"#
    );
    parse_mjcf(&text, None, &LoadOptions::default()).unwrap().model
}

#[test]
fn the_spring_of_an_mjcf_joint_is_read_without_a_warning() {
    let model = rod("0 0 1");
    let joint = &JointProperties::from_model(&model, 0.0)[0];
    assert_eq!((joint.stiffness, joint.rest), (STIFFNESS, REST));
    let text = r#"<mujoco><worldbody><body><joint name="a" springdamper="0.5 0.8" armature="0.1"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body></worldbody></mujoco>"#;
    let robot = parse_mjcf(text, None, &LoadOptions::default()).unwrap();
    assert!(robot.warnings.is_empty(), "{:?}", robot.warnings);
    let joint = &JointProperties::from_model(&robot.model, 0.0)[0];
    // The joint moves 0.12 kg m2, armature included. A damped oscillator: d = 2 I / t, k = I / (t ratio)^2.
    assert!((joint.damping - 0.48).abs() < 1e-12, "{}", joint.damping);
    assert!((joint.stiffness - 0.12 / (0.5_f64 * 0.8).powi(2)).abs() < 1e-12, "{}", joint.stiffness);
}

#[test]
fn a_spring_swings_with_its_period_on_every_engine() {
    for engine in engines() {
        let mut swing = engine.simulate(rod("0 0 1"), World::default(), &[REST + 0.1], Options::default());
        let h = 1e-4;
        // The second backwards pass through the middle is one period after the first.
        let mut passes = Vec::new();
        let mut before = swing.positions()[0];
        for step in 1..10_000 {
            swing.step(h).unwrap();
            let now = swing.positions()[0];
            if before > REST && now <= REST {
                passes.push(h * (step as f64 - (REST - now) / (before - now)));
            }
            before = now;
        }
        let (found, expected) = (passes[1] - passes[0], std::f64::consts::TAU * (INERTIA / STIFFNESS).sqrt());
        assert!((found / expected - 1.0).abs() < 1e-3, "{engine:?}: {found} s, expected {expected} s");
    }
}

#[test]
fn a_weight_hangs_in_balance_on_every_engine() {
    for engine in engines() {
        // About y: m g l cos(q) rotates it down, q increases downwards.
        let mut rod = engine.simulate(rod("0 1 0"), World::default(), &[REST], Options::default());
        for (index, command) in rod.commands_mut().iter_mut().enumerate() {
            *command = motorium_physics::JointSetpoint { kd: 2.0, ..Default::default() };
            assert_eq!(index, 0);
        }
        (0..5000).for_each(|_| _ = rod.step(1e-3).unwrap());
        let q = rod.positions()[0];
        let missing = 9.81 * 0.3 * q.cos() - STIFFNESS * (q - REST);
        assert!(missing.abs() < 1e-3, "{engine:?}: {missing} N m are missing at {q} rad");
    }
}

#[test]
fn midpoint_rule_conserves_spring_energy_up_to_rounding() {
    let options = Options { integrator: Integrator::Midpoint, ..Options::default() };
    let mut swing =
        ArticulatedSimulator::new(rod("0 0 1"), World::default(), &[REST + 0.1], options).unwrap();
    let energy = |swing: &ArticulatedSimulator| {
        let (q, v) = (swing.positions()[0] - REST, swing.velocities()[0]);
        0.5 * (INERTIA * v * v + STIFFNESS * q * q)
    };
    let start = energy(&swing);
    (0..100_000).for_each(|_| _ = swing.step(1e-3).unwrap());
    assert!((energy(&swing) / start - 1.0).abs() < 1e-9, "{} of {start}", energy(&swing));
}

#[test]
fn a_stiff_spring_is_stable_at_any_step() {
    for integrator in [Integrator::Euler, Integrator::Midpoint] {
        let mut model = rod("0 0 1");
        model = model.with_springs(&[("hinge", 1e9, 0.0)]).unwrap();
        let options = Options { integrator, ..Options::default() };
        let mut rod = ArticulatedSimulator::new(model, World::default(), &[0.01], options).unwrap();
        for _ in 0..1000 {
            rod.step(1e-2).unwrap();
            assert!(rod.positions()[0].abs() < 0.01 + 1e-9, "{integrator:?}: {}", rod.positions()[0]);
        }
    }
}

#[test]
fn the_spring_of_a_mimic_joint_acts_on_its_leader() {
    let text = r#"<robot name="pair"><link name="base"/>
  <joint name="leader" type="continuous"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/></joint>
  <link name="one"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="follower" type="continuous"><parent link="base"/><child link="two"/><axis xyz="0 0 1"/>
    <mimic joint="leader" multiplier="-2" offset="0.1"/></joint>
  <link name="two"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>"#;
    let model = parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
    let model = model.with_springs(&[("leader", 3.0, 0.5), ("follower", 2.0, -0.3)]).unwrap();
    let joint = &JointProperties::from_model(&model, 0.0)[0];
    // 3 (q - 0.5) + 2 * 2 * (2 q - 0.1 - 0.3) = 11 q - 3.1
    assert!((joint.stiffness - 11.0).abs() < 1e-12 && (joint.rest - 3.1 / 11.0).abs() < 1e-12, "{joint:?}");
}
