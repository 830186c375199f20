//! A control tick allocates nothing of its own; what Clarabel allocates is counted apart.
#![allow(unsafe_code, reason = "a counting allocator cannot be written without")]

mod robot;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use motorium_control::{
    CommandComposer, RobotState,
    solver::{ClarabelSettings, ClarabelSolver, QpSolver},
};
use nalgebra::Vector3;
use robot::{Panda, Reach};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on unchanged to the system allocator; counting touches no heap memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise for this call is the one `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the pointer came from `System` with this layout.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations_in(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// Clarabel 0.11.1 rebuilds the table of its own stopwatch in every solve.
const CLARABEL_PER_SOLVE: u64 = 1;

#[test]
fn a_tick_allocates_nothing_but_clarabels_one() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut reach = Reach::new(&panda, panda.home.as_slice());
    let mut composer =
        CommandComposer::new(model, &panda.gains, Some(Vector3::new(0.0, 0.0, -9.81))).unwrap();
    let mut solver = ClarabelSolver::new(reach.ik.solver().structure().clone(), ClarabelSettings::default());
    let mut target = panda.hand_at(panda.home.as_slice());
    target.translation.vector += Vector3::new(0.1, 0.2, -0.1);
    assert_eq!(allocations_in(|| drop(std::hint::black_box(Box::new(1)))), 1, "the counter counts");

    for tick in 0..200 {
        let assembling = allocations_in(|| {
            target.translation.vector.x += 1e-4;
            reach.task.set_target(target);
            let q = reach.setpoint.position();
            reach.kinematics.update(model, q);
            let state = RobotState { model, kinematics: &reach.kinematics, q };
            reach.ik.assemble(
                &state,
                &mut [&mut reach.task, &mut reach.posture],
                &[&reach.position, &reach.velocity],
                0.001,
            );
        });
        let updating = allocations_in(|| solver.update(reach.ik.problem()).unwrap());
        let solving = allocations_in(|| assert!(solver.solve().is_ok()));
        let solving_inside = allocations_in(|| assert!(reach.ik.solve().is_ok()));
        let commanding = allocations_in(|| {
            reach.setpoint.integrate(reach.ik.velocity(), 0.001);
            let q = reach.setpoint.position();
            assert!(composer.compose(model, q, &reach.setpoint).effort[1].is_finite());
        });
        assert_eq!((assembling, updating, commanding), (0, 0, 0), "tick {tick}");
        assert_eq!((solving, solving_inside), (CLARABEL_PER_SOLVE, CLARABEL_PER_SOLVE), "tick {tick}");
    }
}
