//! A control tick does not allocate; Clarabel, the reference, allocates once per solve.

use crate::robot::{ClosedLoop, Panda};
use motorium::testing::allocations;
use motorium_control::{FeedForward, RobotState, tasks::CentreOfMassTask};
use motorium_qp::{ClarabelSettings, ClarabelSolver, QpSolver};
use nalgebra::Vector3;

/// Clarabel 0.11.1 rebuilds the table of its stopwatch in every solve.
const CLARABEL_PER_SOLVE: u64 = 1;

#[test]
fn a_tick_allocates_nothing_and_clarabel_once() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut reach = ClosedLoop::new(&panda, panda.home.as_slice());
    let mut feed_forward = FeedForward::new(model, Some(Vector3::new(0.0, 0.0, -9.81))).with_inertia(0.004);
    let mut solver = ClarabelSolver::new(reach.ik.solver().structure().clone(), ClarabelSettings::default());
    let mut centre_of_mass = CentreOfMassTask::new(model);
    let mut target = panda.hand_at(panda.home.as_slice());
    target.translation.vector += Vector3::new(0.1, 0.2, -0.1);

    for tick in 0..200 {
        let assembling = allocations(|| {
            target.translation.vector.x += 1e-4;
            reach.task.set_target(target);
            centre_of_mass.set_target(0.5 * target.translation.vector);
            let q = reach.setpoint.position();
            reach.kinematics.update(model, q);
            let state = RobotState { model, kinematics: &reach.kinematics, q };
            reach.ik.assemble(
                &state,
                &mut [&mut reach.task, &mut centre_of_mass, &mut reach.posture],
                &[&reach.position, &reach.velocity],
                0.001,
            );
        });
        let updating = allocations(|| solver.update(reach.ik.problem()).unwrap());
        let solving = allocations(|| assert!(solver.solve().is_ok()));
        let solving_inside = allocations(|| assert!(reach.ik.solve().is_ok()));
        let commanding = allocations(|| {
            reach.setpoint.integrate(reach.ik.velocity(), 0.001);
            let q = reach.setpoint.position();
            feed_forward.update(&reach.setpoint, 0.001);
            assert!(feed_forward.effort(model, q, &[], &reach.setpoint)[1].is_finite());
        });
        assert_eq!((assembling, updating, commanding), (0, 0, 0), "tick {tick}");
        assert_eq!((solving, solving_inside), (CLARABEL_PER_SOLVE, 0), "tick {tick}");
    }
}
