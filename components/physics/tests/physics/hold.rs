//! The safe state `hold` on simulated robots: it stops them for any gains of the last command.

use std::path::Path;

use motorium::plan::{GateRules, LimitPolicy, ResumeRule, SafeState};
use motorium::region::{LimitKind, Refusal};
use motorium::safety::{Account, Gate, JointLimits, Measured, Offer, REST_SPEED};
use motorium::state::JointCommand as Command;
use motorium_physics::{JointSetpoint, Simulator, World};
use motorium_robots::{Dynamics, MimicMode, PackagePath, load, parse_urdf};
use nalgebra::Vector3;

use crate::engines::engines;
use crate::legged::{grounded, standing};

const DT: f64 = 1e-3;
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

struct NoAccount;

impl Account for NoAccount {
    fn limited(&self, _: usize, _: LimitKind) {}

    fn refused(&self, _: Refusal) {}
}

/// Uniformly distributed in 0 to 1.
fn uniform(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64
}

/// Largest joint speed before the controller dies, and 1 s later.
fn speeds(name: &str, world: World, (kp, kd): (f64, f64), seed: &mut u64) -> (f64, f64) {
    let robot = load(name, Path::new(".")).unwrap();
    let (model, profile) = (&robot.model, robot.profile.as_ref());
    let mut simulation = standing(name, world);
    let count = simulation.positions().len();
    let gains = profile.and_then(|profile| profile.gains(model).ok());
    let acceleration = profile.map(|profile| profile.acceleration_limit(model).unwrap());
    let joints = (0..count).map(|i| {
        let effort = model.effort_limit()[i].abs();
        let (kp, kd) =
            gains.as_ref().map_or((20.0 * effort, 2.0 * effort), |gains| (gains.kp[i], gains.kd[i]));
        JointLimits {
            lower: model.lower()[i],
            upper: model.upper()[i],
            velocity: model.velocity_limit()[i],
            acceleration: acceleration.as_ref().map_or(f64::INFINITY, |limits| limits[i]),
            kp,
            kd,
            ..JointLimits::new(&format!("joint{i}"))
        }
        .with_effort(effort)
    });
    let joints: Vec<JointLimits> = joints.collect();
    let rules =
        GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::AtOnce };
    let mut gate = Gate::new(joints.clone(), rules);
    let mut dynamics = Dynamics::new(model);
    let mut generalised = vec![0.0; model.nv()];
    let (home, omega) = (simulation.positions().to_vec(), 2.0 + 4.0 * uniform(seed));
    let amplitude: Vec<f64> = (0..count).map(|_| 0.4 * (uniform(seed) - 0.5)).collect();
    let fastest = |simulation: &dyn Simulator| {
        let held = simulation.velocities().iter().zip(&joints).filter(|(_, joint)| joint.kp > 0.0);
        held.map(|(velocity, _)| velocity.abs()).fold(0.0, f64::max)
    };
    let mut at_death = 0.0;
    for step in 0..1_320 {
        let (q, v) = (simulation.positions().to_vec(), simulation.velocities().to_vec());
        dynamics.gravity(model, simulation.configuration(), GRAVITY, &mut generalised);
        let efforts = model.joints_of_v(&generalised).to_vec();
        let mut gravity = |effort: &mut [f64]| effort.copy_from_slice(&efforts);
        let measured = Measured { position: &q, velocity: &v, gravity: &mut gravity };
        if step < 320 {
            let mut command = Command::default();
            command.set_count(count);
            let phase = omega * f64::from(step) * DT;
            for i in 0..count {
                let soft = step >= 300;
                command.position_mut()[i] = home[i] + amplitude[i] * phase.sin();
                command.velocity_mut()[i] = amplitude[i] * omega * phase.cos();
                command.effort_mut()[i] = efforts[i];
                command.kp_mut()[i] = if soft { kp } else { joints[i].kp };
                command.kd_mut()[i] = if soft { kd } else { joints[i].kd };
            }
            gate.offer(Offer { command: &command, is_new: true, ahead: DT }, measured, DT, &NoAccount);
            at_death = fastest(&simulation);
        } else {
            gate.make_safe(measured, DT);
        }
        for (command, setpoint) in simulation.commands_mut().iter_mut().zip(gate.setpoints()) {
            *command = *setpoint;
        }
        simulation.step(DT).unwrap();
    }
    (at_death, fastest(&simulation))
}

#[test]
fn hold_stops_robots_with_soft_controllers() {
    let mut seed = 11;
    for (name, is_legged) in [("panda", false), ("ur5e", false), ("quadruped", true)] {
        let (mut worst, mut moving) = (0.0_f64, Vec::new());
        for case in 0..67 {
            let gains = (10_f64.powf(-6.0 + 9.0 * uniform(&mut seed)), 100.0 * uniform(&mut seed));
            let world = if is_legged { grounded(vec![]) } else { World::default() };
            let (at_death, later) = speeds(name, world, gains, &mut seed);
            if later >= REST_SPEED {
                moving.push(format!("{case}, gains {gains:?}: {at_death} rad/s, {later} 1 s later"));
            }
            // Drives that saturate against the ground add no energy.
            assert!(!is_legged || at_death < 40.0, "{case}, gains {gains:?}: {at_death} rad/s at death");
            worst = worst.max(later);
        }
        assert!(moving.is_empty(), "{name}: {} of 67 move: {moving:#?}", moving.len());
        println!("{name}: at most {worst:.4} rad/s 1 s after the last command");
    }
}

#[test]
fn a_joint_without_an_effort_limit_keeps_its_velocity_limit() {
    for (kind, range, limit) in [("continuous", "", 2.0), ("prismatic", r#"lower="-99" upper="99""#, 0.5)] {
        let urdf = format!(
            r#"<robot name="r"><link name="base"/><link name="a"><inertial><mass value="1"/>
            <inertia ixx="0.06" iyy="0.06" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial></link>
            <joint name="j" type="{kind}"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
            <limit {range} velocity="{limit}"/></joint></robot>"#
        );
        let model = parse_urdf(&urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
        for engine in engines() {
            for effort in [20.0, -30.0] {
                let options = motorium_physics::Options::default();
                let mut simulation = engine.simulate(model.clone(), World::default(), &[0.0], options);
                simulation.commands_mut()[0] = JointSetpoint {
                    min_velocity: -limit,
                    max_velocity: limit,
                    ..JointSetpoint::effort(effort)
                };
                let mut fastest = 0.0_f64;
                for _ in 0..1_000 {
                    simulation.step(DT).unwrap();
                    fastest = fastest.max(simulation.velocities()[0].abs());
                }
                assert!(fastest < 1.05 * limit, "{kind}, {engine:?}, {effort}: {fastest} of {limit}");
                assert!(fastest > 0.95 * limit, "{kind}, {engine:?}, {effort}: it moves at only {fastest}");
            }
        }
    }
}
