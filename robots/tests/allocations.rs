//! Nothing on the hot path allocates.

// A global allocator is an unsafe trait; this one only counts and passes on.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

use motorium_robots::{
    BaseMode, CollisionModel, CollisionOptions, Collisions, ConstrainedDynamics, Constraint, Derivatives,
    Dynamics, IkOptions, InverseKinematics, Kinematics, LoadOptions, MimicMode, Reference, TaskRows, Wrench,
    load, load_with, parse_urdf_with,
};
use nalgebra::{DMatrix, Matrix6xX, Vector3};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system allocator unchanged; counting uses a thread-local that does not
// allocate.
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
fn allocation_counter_counts() {
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
        dynamics.crba_upper(&model, &q, &mut mass);
        kinematics.place_carriers(&model, &q, hand);
        let tau = &v;
        dynamics.forward(&model, &q, &v, tau, gravity, &mut out).unwrap();
        checksum += out[0] + mass[(0, 0)];
    });
    assert_eq!(count, 0);
    assert!(checksum.is_finite() && checksum != 0.0);
}

#[test]
fn floating_base_algorithms_do_not_allocate() {
    let options =
        LoadOptions { base: BaseMode::Floating, mimic: MimicMode::Independent, ..LoadOptions::default() };
    let model = load_with("panda", Path::new("."), &options).unwrap().model;
    let n = model.nv();
    let hand = model.frame("panda_hand_tcp").unwrap();
    let (mut kinematics, mut dynamics) = (Kinematics::new(&model), Dynamics::new(&model));
    let (mut constrained, mut ik) = (ConstrainedDynamics::new(&model, 6), InverseKinematics::new(&model));
    let (mut q, v, a) = (model.neutral(), vec![0.5; n], vec![1.0; n]);
    model.integrate(&q.clone(), &v, &mut q);
    let (mut next, mut between) = (q.clone(), q.clone());
    let (mut out, mut lambda) = (vec![0.0; n], vec![0.0; 6]);
    let (mut jacobian, mut rows, mut scratch) =
        (Matrix6xX::zeros(n), DMatrix::zeros(6, n), Matrix6xX::zeros(n));
    let (mut mass, mut regressor) = (DMatrix::zeros(n, n), DMatrix::zeros(n, model.parameter_count()));
    let mut com = nalgebra::Matrix3xX::zeros(n);
    let mut derivatives = Derivatives::new(&model);
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut checksum = 0.0;
    let count = calls(|| {
        kinematics.update_with_acceleration(&model, &q, &v, &a);
        kinematics.jacobian(&model, hand, Reference::LocalWorldAligned, &mut rows);
        kinematics.relative_jacobian(&model, hand, hand, &mut scratch, &mut jacobian);
        kinematics.jacobian_at(&model, &q, hand, Reference::Local, &mut jacobian);
        kinematics.com_jacobian(&model, &mut com);
        checksum += kinematics.acceleration_in(&model, hand, Reference::World).linear.x;
        checksum += kinematics.centre_of_mass(&model).position.x;
        dynamics.forward(&model, &q, &v, &a, gravity, &mut out).unwrap();
        let push = [(hand, Wrench { force: Vector3::new(1.0, 2.0, 3.0), moment: Vector3::zeros() })];
        dynamics.forward_external(&model, &q, &v, &a, gravity, &push, &mut out).unwrap();
        dynamics.rnea_external(&model, &q, &v, &a, gravity, &push, &mut out);
        dynamics.crba(&model, &q, &mut mass);
        dynamics.crba_upper(&model, &q, &mut mass);
        dynamics.factor_mass(&model, &q).unwrap().solve(&mut out);
        dynamics.inverse_mass(&model, &q, &mut mass).unwrap();
        kinematics.place_carriers(&model, &q, hand);
        checksum += kinematics.manipulability(&model, hand, TaskRows::POSE);
        checksum += kinematics.manipulability_gradient(&model, hand, TaskRows::POSE, &mut out);
        dynamics.centroidal_map(&model, &q, &mut jacobian);
        checksum +=
            dynamics.momentum_rate(&model, &q, &v, &a).linear.x + dynamics.kinetic_energy(&model, &q, &v);
        checksum +=
            dynamics.momentum(&model, &q, &v).linear.x + dynamics.potential_energy(&model, &q, gravity);
        dynamics.rnea_derivatives(&model, &q, &v, &a, gravity, &mut derivatives);
        dynamics.forward_derivatives(&model, &q, &v, &a, gravity, &mut out, &mut derivatives).unwrap();
        dynamics.regressor(&model, &q, &v, &a, gravity, &mut regressor);
        let constraint = Constraint { jacobian: &rows, drift: &[0.1; 6], damping: 1e-9 };
        constrained.forward(&model, &q, &v, &a, gravity, constraint, &mut out, &mut lambda).unwrap();
        model.integrate(&q, &v, &mut next);
        model.difference(&q, &next, &mut out);
        model.interpolate(&q, &next, 0.3, &mut between);
        let target = kinematics.pose(&model, hand);
        ik.solve(&model, hand, &target, &IkOptions::default(), &mut next).unwrap();
        checksum += out[0] + mass[(0, 0)] + regressor[(0, 0)] + derivatives.q[(0, 7)];
    });
    assert_eq!(count, 0);
    assert!(checksum.is_finite() && checksum != 0.0);
}

#[test]
fn distances_and_their_jacobians_do_not_allocate() {
    let model = load("panda", Path::new(".")).unwrap().model;
    let solids =
        CollisionModel::new(&model, &CollisionOptions { adjacent: true, ..CollisionOptions::default() })
            .unwrap();
    let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
    let mut rows = DMatrix::zeros(solids.pairs().len(), model.nv());
    let (mut deepest, mut found): (f64, usize) = (0.0, 0);
    let mut run = |range: f64| {
        for step in 0..100 {
            let q: [f64; 8] =
                std::array::from_fn(|joint| (f64::from(step) * 0.37 + joint as f64).sin() * 1.5);
            kinematics.update(&model, &q);
            collisions.update(&solids, &kinematics);
            let nearest = collisions.nearest(&solids).unwrap().distance;
            deepest = deepest.min(nearest);
            found += collisions.within(&solids, range).len();
            solids.distance_jacobians(&model, &kinematics, collisions.found(), &mut rows);
        }
    };
    assert_eq!(calls(|| run(0.2)), 0);
    // deep overlaps, beyond the radii, are included
    assert!(deepest < -0.02 && found > 1000, "{deepest} {found}");
}

#[test]
fn deep_overlaps_of_hulls_and_cylinders_do_not_allocate() {
    // round bodies use all corners of the depth search
    let points = (0..400).map(|index| {
        let (turn, height) = (f64::from(index) * 2.399_963, f64::from(index) / 199.5 - 1.0);
        let radius = (1.0 - height * height).max(0.0).sqrt();
        format!("v {} {} {}\n", 0.3 * radius * turn.cos(), 0.3 * radius * turn.sin(), 0.3 * height)
    });
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("ball.obj");
    std::fs::write(&mesh, points.collect::<String>() + "f 1 200 400\n").unwrap();
    let shapes = [
        "<cylinder radius=\"0.3\" length=\"0.5\"/>".to_owned(),
        format!("<mesh filename=\"{}\"/>", mesh.display()),
        "<box size=\"0.4 0.5 0.6\"/>".to_owned(),
    ];
    let mut deep = 0;
    for (first, second) in [(0, 0), (0, 1), (1, 1), (1, 2), (2, 2)] {
        let collision =
            |shape: usize| format!("<collision><geometry>{}</geometry></collision>", shapes[shape]);
        let text = format!(
            "<robot name=\"r\"><link name=\"a\">{}</link><link name=\"v\"/><link name=\"b\">{}</link>\
             <joint name=\"p\" type=\"planar\"><parent link=\"a\"/><child link=\"v\"/><axis xyz=\"0 0 1\"/></joint>\
             <joint name=\"t\" type=\"continuous\"><parent link=\"v\"/><child link=\"b\"/><axis xyz=\"1 0 0\"/></joint></robot>",
            collision(first),
            collision(second)
        );
        let model = parse_urdf_with(&text, None, &LoadOptions::default()).unwrap().model;
        let options = CollisionOptions { adjacent: true, ..CollisionOptions::default() };
        let solids = CollisionModel::new(&model, &options).unwrap();
        let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
        let count = calls(|| {
            for step in 0..200 {
                let q: [f64; 4] =
                    std::array::from_fn(|joint| (f64::from(step) * 0.37 + joint as f64).sin() * 0.3);
                kinematics.update(&model, &q);
                collisions.update(&solids, &kinematics);
                deep += usize::from(collisions.distance(&solids, 0).distance < -0.05);
            }
        });
        assert_eq!(count, 0, "{first} {second}");
    }
    assert!(deep > 500, "{deep}");
}

#[test]
fn capsules_do_not_allocate_at_any_depth() {
    let text = "<robot name=\"r\"><link name=\"a\"><collision><geometry><capsule radius=\"0.1\" length=\"1\"/></geometry>\
                </collision></link><link name=\"v\"/><link name=\"b\"><collision><geometry><capsule radius=\"0.2\" length=\"1\"/>\
                </geometry></collision></link>\
                <joint name=\"p\" type=\"planar\"><parent link=\"a\"/><child link=\"v\"/><axis xyz=\"0 0 1\"/></joint>\
                <joint name=\"t\" type=\"continuous\"><parent link=\"v\"/><child link=\"b\"/><axis xyz=\"1 0 0\"/></joint></robot>";
    let model = parse_urdf_with(text, None, &LoadOptions::default()).unwrap().model;
    let solids =
        CollisionModel::new(&model, &CollisionOptions { adjacent: true, ..CollisionOptions::default() })
            .unwrap();
    let (mut collisions, mut kinematics) = (Collisions::new(&solids), Kinematics::new(&model));
    let mut depths = 0;
    let count = calls(|| {
        for step in 0..500 {
            let q: [f64; 4] =
                std::array::from_fn(|joint| (f64::from(step) * 0.37 + joint as f64).sin() * 0.4);
            kinematics.update(&model, &q);
            collisions.update(&solids, &kinematics);
            depths += usize::from(collisions.colliding(&solids, 0.0).is_some());
        }
    });
    assert_eq!(count, 0);
    assert!(depths > 100 && depths < 500, "{depths}");
}
