//! Nothing on the hot path allocates.

// A global allocator is an unsafe trait; this one only counts and passes on.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

use motorium_robots::{Dynamics, Kinematics, Reference, load};
use nalgebra::{DMatrix, Matrix6xX, Vector3};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system allocator unchanged; counting touches a thread-local that needs no allocation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn calls(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(calls(|| drop(std::hint::black_box(vec![1_u8; 64]))), 2);
}

#[test]
fn kinematics_and_dynamics_do_not_allocate_after_construction() {
    let model = load("panda", Path::new(".")).unwrap().model;
    let n = model.nv();
    let hand = model.frame("panda_hand_tcp").unwrap();
    let (mut kinematics, mut dynamics) = (Kinematics::new(&model), Dynamics::new(&model));
    let (q, v, a) = (vec![0.3; n], vec![0.5; n], vec![1.0; n]);
    let mut out = vec![0.0; n];
    let mut jacobian = Matrix6xX::zeros(n);
    let mut mass = DMatrix::zeros(n, n);
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut checksum = 0.0;
    let count = calls(|| {
        kinematics.update(&model, &q);
        kinematics.update_with_velocity(&model, &q, &v);
        for reference in [Reference::Local, Reference::World, Reference::LocalWorldAligned] {
            kinematics.jacobian(&model, hand, reference, &mut jacobian);
            checksum += jacobian[(0, 0)] + kinematics.velocity_in(&model, hand, reference).linear.x;
        }
        checksum += kinematics.pose(&model, hand).translation.x;
        dynamics.rnea(&model, &q, &v, &a, gravity, &mut out);
        dynamics.bias(&model, &q, &v, gravity, &mut out);
        dynamics.gravity(&model, &q, gravity, &mut out);
        dynamics.crba(&model, &q, &mut mass);
        let tau = &v;
        dynamics.forward(&model, &q, &v, tau, gravity, &mut out).unwrap();
        checksum += out[0] + mass[(0, 0)];
    });
    assert_eq!(count, 0);
    assert!(checksum.is_finite() && checksum != 0.0);
}
