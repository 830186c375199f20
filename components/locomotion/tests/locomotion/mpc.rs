//! Model-predictive control of the centroidal motion, compared with closed forms, the Riccati recursion and
//! finite differences.

use motorium_locomotion::mpc::{CentroidalMpc, CentroidalState, MpcSettings, MpcWeights};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const GRAVITY: f64 = 9.81;

fn settings() -> MpcSettings {
    MpcSettings { mass: 12.0, steps: 10, step: 0.03, ..MpcSettings::default() }
}

fn inertia() -> Matrix3<f64> {
    Matrix3::new(0.11, 0.01, 0.02, 0.01, 0.26, -0.01, 0.02, -0.01, 0.24)
}

/// Places the feet of a quadruped around the origin, with a reference above them.
fn standing(mpc: &mut CentroidalMpc) {
    for step in mpc.horizon_mut() {
        step.position = Vector3::new(0.0, 0.0, 0.3);
        for (foot, (x, y)) in [(0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15)].into_iter().enumerate()
        {
            step.points[foot] = Some(Vector3::new(x, y, 0.0));
        }
    }
}

fn pushed() -> CentroidalState {
    CentroidalState {
        turn: Vector3::new(0.05, -0.08, 0.1),
        position: Vector3::new(0.01, -0.02, 0.28),
        angular_momentum: Vector3::new(0.02, 0.03, -0.04),
        velocity: Vector3::new(0.1, 0.2, -0.1),
    }
}

fn four_feet(settings: MpcSettings) -> CentroidalMpc {
    let mut mpc = CentroidalMpc::new(settings, &[0.6; 4]);
    standing(&mut mpc);
    mpc
}

#[test]
fn robot_at_rest_shares_its_weight_equally() {
    let mut mpc = four_feet(settings());
    let state = CentroidalState { position: Vector3::new(0.0, 0.0, 0.3), ..CentroidalState::default() };
    mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    for step in 0..10 {
        for foot in 0..4 {
            let share = Vector3::new(0.0, 0.0, 3.0 * GRAVITY);
            assert!(
                (mpc.force(step, foot) - share).norm() < 1e-7,
                "{step} {foot}: {}",
                mpc.force(step, foot)
            );
        }
    }
    assert!((mpc.predicted()[10].position - state.position).norm() < 1e-9);
}

/// A mass above a contact point that can push and pull. The first force equals the force of the
/// finite-horizon regulator.
#[test]
fn unlimited_first_force_matches_the_riccati_recursion() {
    let weights = MpcWeights { force: 0.3, ..MpcWeights::default() };
    let settings = MpcSettings { weights, ..settings() };
    let (mass, h) = (settings.mass, settings.step);
    // with this friction and a nearly vertical motion, no limit is active
    let mut mpc = CentroidalMpc::new(settings, &[1e6]);
    for step in mpc.horizon_mut() {
        step.position = Vector3::new(0.0, 0.0, 0.5);
        step.points[0] = Some(Vector3::zeros());
    }
    let (height, speed) = (0.49, 0.05);
    let state = CentroidalState {
        position: Vector3::new(0.0, 0.0, height),
        velocity: Vector3::new(0.0, 0.0, speed),
        ..CentroidalState::default()
    };
    mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    // x = (z - z*, v), u = f - m g: x' = A x + B u, costs of the states after each step
    let a = DMatrix::from_row_slice(2, 2, &[1.0, h, 0.0, 1.0]);
    let b = DMatrix::from_column_slice(2, 1, &[0.5 * h * h / mass, h / mass]);
    let (place, velocity) = (weights.position.z, weights.velocity.z);
    let q = DMatrix::from_diagonal(&DVector::from_vec(vec![place * place, velocity * velocity]));
    let r = (weights.force / (mass * GRAVITY)).powi(2);
    let (mut cost, mut gain) = (q.clone(), DMatrix::zeros(1, 2));
    for _ in 0..settings.steps {
        let denominator = r + (b.transpose() * &cost * &b)[0];
        gain = b.transpose() * &cost * &a / denominator;
        let closed = &a - &b * &gain;
        cost = closed.transpose() * &cost * &closed + gain.transpose() * r * &gain + &q;
    }
    let expected = mass * GRAVITY - (gain * DVector::from_vec(vec![height - 0.5, speed]))[0];
    assert!(
        expected > 0.5 * mass * GRAVITY && (expected / (mass * GRAVITY) - 1.0).abs() > 0.05,
        "{expected}"
    );
    let found = mpc.force(0, 0).z;
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

/// Returns the cost of a sequence of forces, from an independent roll-out: many small steps of the equations
/// of motion.
fn rolled_out(mpc: &mut CentroidalMpc, state: &CentroidalState, heading: f64, forces: &[f64]) -> f64 {
    let settings = *mpc.settings();
    let weights = settings.weights;
    let (parts, mut at, mut cost) = (400, *state, 0.0);
    let dt = settings.step / f64::from(parts);
    let mut centre = state.position + state.velocity * (0.5 * settings.step);
    for (index, step) in mpc.horizon_mut().iter().enumerate() {
        if index > 0 {
            centre = step.position;
        }
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), step.heading - heading);
        let inverse = (turn * inertia() * turn.transpose()).try_inverse().unwrap();
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        for (point, place) in step.points.iter().enumerate() {
            let Some(place) = place else { continue };
            let one = Vector3::from_column_slice(&forces[12 * index + 3 * point..][..3]);
            force += one;
            torque += (place - centre).cross(&one);
        }
        for _ in 0..parts {
            // exact for quadratic motion
            let before = at;
            at.angular_momentum += torque * dt;
            at.velocity += (force / settings.mass + settings.gravity) * dt;
            at.turn += inverse * (before.angular_momentum + at.angular_momentum) * (0.5 * dt)
                - step.angular_velocity * dt;
            at.position += (before.velocity + at.velocity) * (0.5 * dt);
        }
        let to_heading = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -step.heading);
        let errors = [
            (at.turn, weights.turn),
            (at.position - step.position, weights.position),
            (inverse * at.angular_momentum - step.angular_velocity, weights.angular_velocity),
            (at.velocity - step.velocity, weights.velocity),
        ];
        for (error, weight) in errors {
            cost += 0.5 * (to_heading * error).component_mul(&weight).norm_squared();
        }
        let touching = step.points.iter().flatten().count() as f64;
        let share = Vector3::new(0.0, 0.0, settings.mass * GRAVITY / touching);
        for (point, place) in step.points.iter().enumerate() {
            if place.is_some() {
                let one = Vector3::from_column_slice(&forces[12 * index + 3 * point..][..3]);
                cost += 0.5 * ((one - share) * (weights.force / (settings.mass * GRAVITY))).norm_squared();
            }
        }
    }
    cost
}

/// Fills a horizon with lift-offs and touchdowns while the reference moves and turns.
fn trotting(mpc: &mut CentroidalMpc) {
    standing(mpc);
    for (index, step) in mpc.horizon_mut().iter_mut().enumerate() {
        let time = 0.03 * (index as f64 + 1.0);
        step.position += Vector3::new(0.3 * time, 0.1 * time, 0.0);
        step.velocity = Vector3::new(0.3, 0.1, 0.0);
        step.angular_velocity = Vector3::new(0.0, 0.0, 0.8);
        step.heading = 0.4 + 0.8 * time;
        let swinging = if index < 5 { [0, 3] } else { [1, 2] };
        swinging.iter().for_each(|foot| step.points[*foot] = None);
    }
}

#[test]
fn gradient_and_curvature_match_the_rolled_out_cost() {
    let settings = MpcSettings { steps: 10, ..settings() };
    let mut mpc = CentroidalMpc::new(settings, &[0.6; 4]);
    trotting(&mut mpc);
    let state = pushed();
    mpc.solve(&state, (&inertia(), 0.4), 0.0).unwrap();
    let problem = mpc.problem().clone();
    let n = problem.gradient.len();
    let symmetric = |i: usize, j: usize| problem.hessian[(i.min(j), i.max(j))];
    let at = |x: &DVector<f64>, i: usize| -> f64 {
        problem.gradient[i] + (0..n).map(|j| symmetric(i, j) * x[j]).sum::<f64>()
    };
    let place =
        DVector::from_fn(n, |i, _| 3.0 * (i as f64 * 0.7).sin() + if i % 3 == 2 { 30.0 } else { 0.0 });
    for i in (0..n).step_by(7) {
        let mut moved = place.clone();
        let mut cost = |delta: f64| {
            moved[i] = place[i] + delta;
            rolled_out(&mut mpc, &state, 0.4, moved.as_slice())
        };
        // the cost is quadratic, so differences are exact up to rounding
        let slope = (cost(1.0) - cost(-1.0)) / 2.0;
        let (step, foot) = (i / 12, (i % 12) / 3);
        let swings = if step < 5 { foot == 0 || foot == 3 } else { foot == 1 || foot == 2 };
        if swings {
            assert_eq!(slope, 0.0);
            assert_eq!(mpc.force(step, foot), Vector3::zeros(), "a foot in the air has no force");
            continue;
        }
        let expected = at(&place, i);
        assert!((slope - expected).abs() < 1e-7 * (1.0 + expected.abs()), "{i}: {slope} {expected}");
    }
}

#[test]
fn prediction_matches_a_rigid_body_under_the_forces() {
    let mut mpc = four_feet(settings());
    let state = pushed();
    // lever arms come from the last prediction: repeated solutions at one state converge
    for _ in 0..8 {
        mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    }
    let (parts, mut at, inverse) = (3000, state, inertia().try_inverse().unwrap());
    let dt = 0.03 / f64::from(parts);
    for step in 0..10 {
        for _ in 0..parts {
            let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
            for foot in 0..4 {
                let place = mpc.horizon_mut()[step].points[foot].unwrap();
                force += mpc.force(step, foot);
                torque += (place - at.position).cross(&mpc.force(step, foot));
            }
            at.velocity += (force / 12.0 + Vector3::new(0.0, 0.0, -GRAVITY)) * dt;
            at.position += at.velocity * dt;
            at.angular_momentum += torque * dt;
            at.turn += inverse * at.angular_momentum * dt;
        }
        let found = &mpc.predicted()[step + 1];
        assert!((found.position - at.position).norm() < 1e-4, "{step}: {} {}", found.position, at.position);
        assert!((found.turn - at.turn).norm() < 5e-3, "{step}: {} {}", found.turn, at.turn);
        assert!((found.angular_momentum - at.angular_momentum).norm() < 1e-2, "{step}");
    }
    let error = |state: &CentroidalState| (state.position - Vector3::new(0.0, 0.0, 0.3)).norm();
    assert!(error(&mpc.predicted()[10]) < 0.3 * error(&state) && mpc.predicted()[10].turn.norm() < 0.05);
}

#[test]
fn hard_push_respects_friction_and_force_limits() {
    let settings = MpcSettings { max_force: 60.0, ..settings() };
    let mut mpc = four_feet(settings);
    let state = CentroidalState { velocity: Vector3::new(1.5, -2.0, -0.8), ..pushed() };
    mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    let (mut at_friction, mut at_most) = (0, 0);
    for step in 0..10 {
        for foot in 0..4 {
            let force = mpc.force(step, foot);
            let cone = 0.6 * std::f64::consts::FRAC_1_SQRT_2 * force.z;
            assert!(force.z > -1e-8 && force.z < 60.0 + 1e-8, "{force}");
            assert!(force.x.abs() < cone + 1e-8 && force.y.abs() < cone + 1e-8, "{force}");
            at_friction += i32::from(force.x.abs().max(force.y.abs()) > cone - 1e-8 && cone > 1.0);
            at_most += i32::from(force.z > 60.0 - 1e-8);
        }
    }
    assert!(at_friction > 5 && at_most > 5, "{at_friction} {at_most}");
}

#[test]
fn solve_is_repeatable_and_does_not_allocate() {
    let mut mpc = four_feet(settings());
    let state = pushed();
    mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    let first = mpc.force(0, 0);
    trotting(&mut mpc);
    let made = motorium::testing::allocations(|| mpc.solve(&state, (&inertia(), 0.4), 0.005).unwrap());
    assert_eq!(made, 0);
    assert_ne!(mpc.force(0, 1), first);
    mpc.reset();
    standing(&mut mpc);
    mpc.horizon_mut().iter_mut().for_each(|step| {
        (step.heading, step.velocity, step.angular_velocity) = (0.0, Vector3::zeros(), Vector3::zeros());
    });
    mpc.solve(&state, (&inertia(), 0.0), 0.0).unwrap();
    assert_eq!(mpc.force(0, 0), first);
}
