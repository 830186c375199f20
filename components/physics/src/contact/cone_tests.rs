//! Tests of the contact solver against the conditions that define its solution.

use nalgebra::{DMatrix, DVector, Vector3};

use super::cone::ConeSolver;

/// Pseudo-random numbers from -1 to 1.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A solved problem and its velocities without impulses.
struct Solved {
    solver: ConeSolver,
    free: DVector<f64>,
    points: usize,
}

/// `bodies` flat soles of 1 kg that fall and slide onto the ground, each with `points` random points coupled
/// by the carrying body.
fn soles(points: usize, bodies: usize, friction: f64, numbers: &mut Numbers) -> Solved {
    let (rows, freedoms) = (3 * points, 6 * bodies);
    let mut jacobian = DMatrix::zeros(rows, freedoms);
    for point in 0..points {
        let at = 6 * (point * bodies / points);
        let place = Vector3::new(0.1 * numbers.next(), 0.05 * numbers.next(), -0.05);
        for (part, axis) in [Vector3::z(), Vector3::x(), Vector3::y()].into_iter().enumerate() {
            let turn = place.cross(&axis);
            for k in 0..3 {
                jacobian[(3 * point + part, at + k)] = axis[k];
                jacobian[(3 * point + part, at + 3 + k)] = turn[k];
            }
        }
    }
    let scale = |k: usize| if k % 6 < 3 { 1.0 } else { 10.0 };
    let mut inverse =
        DMatrix::from_fn(freedoms, freedoms, |a, b| if a == b { scale(a) * scale(a) } else { 0.0 });
    if bodies > 1 {
        let link = DVector::from_fn(freedoms, |k, _| 0.7 * scale(k) * numbers.next());
        inverse += &link * link.transpose();
    }
    let delassus = &jacobian * inverse * jacobian.transpose();
    let falling = DVector::from_fn(freedoms, |k, _| match k % 6 {
        2 => -0.3 + 0.1 * numbers.next(),
        0 | 1 => 0.2 * numbers.next(),
        _ => numbers.next(),
    });
    let free = jacobian * falling;
    let mut solver = ConeSolver::new(points);
    solver.delassus.copy_from_slice(delassus.as_slice());
    solver.velocity.copy_from_slice(free.as_slice());
    solver.friction.fill(friction);
    solver.solve(points);
    Solved { solver, free, points }
}

impl Solved {
    /// Returns the worst violation of the contact conditions, as a velocity \[m/s\].
    fn violation(&self) -> f64 {
        let rows = 3 * self.points;
        let lambda = &self.solver.lambda;
        let mut worst = 0.0_f64;
        for index in 0..self.points {
            let at = 3 * index;
            let w = |row: usize| {
                let pushes = &self.solver.delassus[row * rows..][..rows];
                self.free[row] + pushes.iter().zip(lambda).map(|(w, l)| w * l).sum::<f64>()
            };
            let gap = w(at) + 1e-6 * self.solver.delassus[at * rows + at] * lambda[at];
            assert!(lambda[at] >= 0.0, "a contact pulls by {}", lambda[at]);
            worst = worst.max(-gap).max(if lambda[at] > 0.0 { gap.abs() } else { 0.0 });
            let slip = (w(at + 1).powi(2) + w(at + 2).powi(2)).sqrt();
            let held = (lambda[at + 1].powi(2) + lambda[at + 2].powi(2)).sqrt();
            let bound = self.solver.friction[index] * lambda[at];
            assert!(held <= bound * (1.0 + 1e-9) + 1e-12, "{held} in a cone of {bound}");
            if held < bound * (1.0 - 1e-6) {
                worst = worst.max(slip);
            } else if lambda[at] > 0.0 && bound > 0.0 && slip > 1e-6 {
                // On the edge of the cone friction opposes the slip.
                let along = w(at + 1) * lambda[at + 1] + w(at + 2) * lambda[at + 2];
                worst = worst.max((slip + along / held).abs());
            }
        }
        worst
    }
}

#[test]
fn impulses_fulfil_signorini_and_coulomb_at_every_point() {
    let mut numbers = Numbers(7);
    for case in 0..300 {
        let solved = soles(4, 2, [0.0, 0.1][case % 2], &mut numbers);
        assert!(solved.violation() < 1e-6, "case {case}: {} m/s", solved.violation());
    }
}

#[test]
fn an_overdetermined_impact_is_solved_precisely() {
    let mut numbers = Numbers(7);
    let mut exact = 0;
    for case in 0..300 {
        let violation = soles(8, 1 + case % 2, [0.1, 0.6][case / 2 % 2], &mut numbers).violation();
        assert!(violation < 5e-3, "case {case}: {violation} m/s");
        exact += usize::from(violation < 1e-5);
    }
    assert!(exact > 270, "{exact} of 300 to the end");
}
