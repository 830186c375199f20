//! The joint-space step against its documented laws, joint by joint, for every choice of the active set.

use motorium_physics::{JointProperties, JointSetpoint, JointSpaceIntegrator};
use motorium_robots::Dynamics;
use nalgebra::{DMatrix, Vector3};

use crate::panda;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const H: f64 = 1e-3;

/// A deterministic number in (-1, 1).
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    ((*seed >> 11) as f64 / (1u64 << 52) as f64) - 1.0
}

#[test]
fn every_step_obeys_newton_drives_coulomb_and_stops() {
    let model = panda::loaded().model;
    let n = model.nv();
    let (mut saturated, mut stuck, mut slipping, mut stopped) = (0, 0, 0, 0);
    let mut seed = 7;
    let mut dynamics = Dynamics::new(&model);
    let (mut mass, mut bias, mut tau) = (DMatrix::zeros(n, n), vec![0.0; n], vec![0.0; n]);
    for _ in 0..400 {
        // Small efforts, strong friction and narrow ranges exercise every branch of every law.
        let joints: Vec<JointProperties> = JointProperties::from_model(&model, 0.0)
            .into_iter()
            .map(|joint| JointProperties {
                effort_limit: 10.0 * (1.1 + noise(&mut seed)),
                friction: (4.0 * noise(&mut seed)).max(0.0),
                damping: 1.0 + noise(&mut seed),
                lower: joint.lower.max(-0.3),
                upper: joint.upper.min(0.3),
                armature: 0.01 * (1.0 + noise(&mut seed)),
                ..joint
            })
            .collect();
        let mut arm = JointSpaceIntegrator::new(&model, joints.clone());
        let mut q: Vec<f64> =
            joints.iter().map(|j| j.lower + (0.5 + 0.499 * noise(&mut seed)) * (j.upper - j.lower)).collect();
        let mut v: Vec<f64> = (0..n).map(|_| 3.0 * noise(&mut seed)).collect();
        let commands: Vec<JointSetpoint> = q
            .iter()
            .map(|q| JointSetpoint {
                position: q + 0.2 * noise(&mut seed),
                velocity: noise(&mut seed),
                effort: 5.0 * noise(&mut seed),
                kp: 3_000.0 * (1.0 + noise(&mut seed)),
                kd: 100.0 * (1.0 + noise(&mut seed)),
                ..JointSetpoint::default()
            })
            .collect();
        for _ in 0..30 {
            let (q0, v0) = (q.clone(), v.clone());
            arm.advance(&model, &mut q, &mut v, &commands, GRAVITY, H, &mut tau).unwrap();
            dynamics.crba(&model, &q0, &mut mass);
            dynamics.bias(&model, &q0, &v0, GRAVITY, &mut bias);
            for i in 0..n {
                let (joint, c) = (&joints[i], &commands[i]);
                assert!((q[i] - (q0[i] + H * v[i])).abs() < 1e-15, "semi-implicit Euler");
                let law = c.kp * (c.position - q[i]) + c.kd * (c.velocity - v[i]) + c.effort;
                let clamped = law.clamp(-joint.effort_limit, joint.effort_limit);
                assert!(
                    (tau[i] - clamped).abs() < 1e-6 * (1.0 + law.abs()),
                    "drive {i}: {} {clamped}",
                    tau[i]
                );
                let mut force = bias[i] + joint.armature * (v[i] - v0[i]) / H;
                for j in 0..n {
                    force += mass[(i, j)] * (v[j] - v0[j]) / H;
                }
                // Force not explained by drive and damping is due to friction and stop.
                let rest = force - tau[i] + joint.damping * v[i];
                let tolerance = 1e-6 * (1.0 + force.abs() + law.abs());
                let low = q[i] - joint.lower < 1e-12;
                let high = joint.upper - q[i] < 1e-12;
                assert!(
                    q[i] > joint.lower - 1e-12 && q[i] < joint.upper + 1e-12,
                    "joint {i} leaves its range"
                );
                let friction = if low || high { 0.0 } else { rest };
                if low {
                    assert!(rest > -joint.friction - tolerance, "the lower stop pulls: {rest}");
                } else if high {
                    assert!(rest < joint.friction + tolerance, "the upper stop pulls: {rest}");
                }
                assert!(
                    friction.abs() <= joint.friction + tolerance,
                    "friction {i}: {rest} > {}",
                    joint.friction
                );
                if v[i].abs() > 1e-9 && !low && !high {
                    assert!(
                        (rest + joint.friction * v[i].signum()).abs() < tolerance,
                        "sliding friction {i}"
                    );
                }
                saturated += usize::from(law.abs() > joint.effort_limit);
                stopped += usize::from(low || high);
                stuck += usize::from(v[i] == 0.0);
                slipping += usize::from(joint.friction > 0.0 && v[i] != 0.0);
            }
        }
    }
    println!("saturated {saturated}, stopped {stopped}, stuck {stuck}, slipping {slipping}");
    for count in [saturated, stopped, stuck, slipping] {
        assert!(count > 1000, "every branch must be met often");
    }
}

#[test]
fn free_arm_conserves_energy_to_first_order() {
    // Without drives, damping and friction the drift of the total energy halves with the step.
    let model = panda::loaded().model;
    let joints: Vec<JointProperties> = JointProperties::from_model(&model, 0.0)
        .into_iter()
        .map(|joint| JointProperties {
            damping: 0.0,
            friction: 0.0,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            ..joint
        })
        .collect();
    let n = model.nv();
    let drift = |h: f64| {
        let mut arm = JointSpaceIntegrator::new(&model, joints.clone());
        let (mut q, mut v, mut tau) = (panda::home(), vec![0.3; n], vec![0.0; n]);
        // Fingers would fall out of the hand.
        v[7] = 0.0;
        let mut commands = vec![JointSetpoint::default(); n];
        commands[7] = JointSetpoint::hold(0.02, 1e5, 1e3);
        q[7] = 0.02;
        let start = energy(&model, &q, &v);
        for _ in 0..(0.3 / h).round() as usize {
            arm.advance(&model, &mut q, &mut v, &commands, GRAVITY, h, &mut tau).unwrap();
        }
        (energy(&model, &q, &v) - start).abs()
    };
    let (coarse, fine) = (drift(1e-3), drift(2.5e-4));
    println!("drift {coarse:.2e} J at 1 ms, {fine:.2e} J at 0.25 ms");
    assert!(fine < 0.5 * coarse && coarse < 0.3);
}

/// Kinetic and potential energy, the latter computed from the heights of the centres of mass.
fn energy(model: &motorium_robots::Model, q: &[f64], v: &[f64]) -> f64 {
    let n = model.nv();
    let mut mass = DMatrix::zeros(n, n);
    Dynamics::new(model).crba(model, q, &mut mass);
    let v = nalgebra::DVector::from_column_slice(v);
    let mut kinematics = motorium_robots::Kinematics::new(model);
    kinematics.update(model, q);
    let height = |(index, body): (usize, &motorium_robots::Body)| {
        let com = kinematics.body_pose(index) * nalgebra::Point3::from(body.inertia.com);
        body.inertia.mass * 9.81 * com.z
    };
    0.5 * v.dot(&(&mass * &v)) + model.bodies().iter().enumerate().map(height).sum::<f64>()
}
