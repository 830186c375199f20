//! Off-centre impacts with friction and restitution do not gain energy.

use motorium_physics::{ArticulatedSimulator, Object, ObjectShape, Options, Simulator, World};
use motorium_worlds::MeshCollision;
use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::meshes::{mesh, pendulum, prism};

const DT: f64 = 1e-3;

fn shapes() -> Vec<ObjectShape> {
    vec![
        ObjectShape::Sphere { radius: 0.05 },
        ObjectShape::Box { size: [0.2, 0.08, 0.05] },
        ObjectShape::Cylinder { radius: 0.04, length: 0.2 },
        ObjectShape::Capsule { radius: 0.03, length: 0.2 },
        mesh("hull", prism(6, 0.04, 0.2), MeshCollision::Hull).shape,
    ]
}

/// Kinetic energy of two objects \[J\].
fn energy(simulation: &ArticulatedSimulator, objects: &[Object]) -> f64 {
    let of = |object: &Object| {
        let Some(mass) = object.mass_properties() else { return 0.0 };
        let id = simulation.object(&object.name).unwrap();
        let (linear, angular) = simulation.object_velocity(id);
        let pose = simulation.object_pose(id);
        let axes = mass.frame.map_or(pose, |frame| pose * frame).rotation;
        let own = axes.inverse() * angular;
        0.5 * mass.mass * linear.norm_squared() + 0.5 * mass.moments.dot(&own.component_mul(&own))
    };
    objects.iter().map(of).sum()
}

/// Largest energy gain in an impact, relative to the energy before it, and largest loss.
fn gain(shapes: [&ObjectShape; 2], random: &mut Pcg64Mcg) -> (f64, f64) {
    let mut vector =
        |size: f64| -> Vector3<f64> { Vector3::from_fn(|_, _| random.random_range(-size..=size)) };
    let (towards, speed, spin) = (vector(1.0).normalize(), vector(0.5), vector(3.0));
    let turns = [vector(3.0), vector(3.0)].map(UnitQuaternion::from_scaled_axis);
    let [friction, restitution] = [random.random_range(0.0..=1.0), random.random_range(0.2..=1.0)];
    let fixed = random.random_range(0.0..=1.0) < 0.3;
    let object = |name: &str, shape: &ObjectShape, turn: UnitQuaternion<f64>| Object {
        name: name.to_owned(),
        shape: shape.clone(),
        mass: Some(1.0),
        rpy: turn.euler_angles().into(),
        friction,
        restitution,
        ..Object::default()
    };
    let mut objects = vec![
        object("one", shapes[0], turns[0]),
        Object {
            position: (towards * 0.3).into(),
            velocity: (-towards * 1.5 + speed).into(),
            angular_velocity: spin.into(),
            ..object("other", shapes[1], turns[1])
        },
    ];
    if fixed {
        objects[0].mass = None;
    }
    let world = World { gravity: [0.0; 3], objects: objects.clone(), ..World::default() };
    let options = Options::default();
    let mut simulation = ArticulatedSimulator::new(pendulum(), world, &[0.0], options).unwrap();
    let mut before = energy(&simulation, &objects);
    let (mut gain, start) = (0.0_f64, before);
    for _ in 0..500 {
        simulation.step(DT).unwrap();
        let after = energy(&simulation, &objects);
        gain = gain.max((after - before) / start);
        before = after;
    }
    (gain, 1.0 - before / start)
}

#[test]
fn impacts_with_friction_gain_no_energy() {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let (shapes, mut met, mut worst) = (shapes(), 0, 0.0_f64);
    for index in 0..960 {
        let pair = [&shapes[index % 5], &shapes[index / 5 % 5]];
        let (gain, loss) = gain(pair, &mut random);
        met += usize::from(loss.abs() > 1e-6);
        worst = worst.max(gain);
        assert!(
            gain < 1e-5,
            "impact {index} of shapes {} and {}: gains {gain:.2e} of the energy",
            index % 5,
            index / 5 % 5
        );
    }
    assert!(met > 480, "{met} of 960 met");
    println!("{met} of 960 met, largest gain {worst:.2e}");
}
