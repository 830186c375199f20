//! Steps in which the joints alone show that nothing touches. The resulting contacts are the same as if every
//! pair were checked in every step.

use motorium_physics::{ArticulatedSimulator, Ground, JointSetpoint, Object, ObjectShape, Simulator, World};

use crate::legged::held_in;

const DT: f64 = 1e-3;

/// A distant post; moving it forces a check of all pairs in the next step.
fn post() -> Object {
    Object {
        name: "post".to_owned(),
        shape: ObjectShape::Sphere { radius: 0.1 },
        mass: None,
        position: [500.0, 0.0, 0.1],
        ..Object::default()
    }
}

fn ground(height: f64) -> Option<Ground> {
    Some(Ground { height, ..Ground::default() })
}

/// Runs a robot with and without a check of all pairs in every step, under the same commands. The states are
/// equal to the bit, until the end or the first contact: the nearest points of two links depend on earlier
/// ones, and the motion in contact depends on these points. Returns the number of steps with contacts.
fn same_either_way(
    name: &str,
    ground: Option<Ground>,
    raise: f64,
    command: &dyn Fn(usize, &mut [JointSetpoint]),
    (steps, to_the_end): (usize, bool),
) -> usize {
    let run = |looks: bool| {
        let world = World { ground, objects: vec![post()], ..World::default() };
        let mut simulation: ArticulatedSimulator = held_in(name, world);
        let post = simulation.object("post").unwrap();
        let at = simulation.object_pose(post);
        if raise > 0.0 {
            let mut q = simulation.configuration().to_vec();
            let (v, commands) = (simulation.velocity().to_vec(), simulation.commands_mut().to_vec());
            q[2] += raise;
            simulation.reset(&q, &v).unwrap();
            simulation.commands_mut().copy_from_slice(&commands);
        }
        let (mut states, mut touching) = (Vec::new(), Vec::new());
        for step in 0..steps {
            command(step, simulation.commands_mut());
            if looks {
                simulation.set_object_pose(post, at);
            }
            simulation.step(DT).unwrap();
            states.push(simulation.configuration().to_vec());
            let mut contacts = 0;
            simulation.visit_contacts(&mut |_| contacts += 1);
            touching.push(contacts > 0);
        }
        (states, touching)
    };
    let (calm, looked) = (run(false), run(true));
    let first = |touching: &[bool]| touching.iter().position(|touches| *touches).unwrap_or(steps);
    assert_eq!(first(&calm.1), first(&looked.1), "{name}: the step of the first contact");
    let compared = if to_the_end { steps } else { first(&calm.1) };
    for (step, (one, other)) in calm.0.iter().zip(&looked.0).enumerate().take(compared) {
        assert!(one == other, "{name}, step {step}: {one:?} and {other:?}");
    }
    calm.1.iter().filter(|touches| **touches).count()
}

#[test]
fn falling_robots_land_as_with_all_pairs_checked() {
    for name in ["quadruped", "humanoid"] {
        let landed = same_either_way(name, ground(0.0), 0.5, &|_, _| {}, (500, true));
        assert!((50..450).contains(&landed), "{name}: {landed} steps on the ground");
    }
}

#[test]
fn arm_touches_ground_and_itself_as_with_all_pairs_checked() {
    let reach = |step: usize, commands: &mut [JointSetpoint]| {
        commands[1].position += if step < 1500 { 1e-3 } else { 0.0 };
    };
    let touched = same_either_way("panda", ground(0.0), 0.0, &reach, (2000, false));
    assert!((100..1900).contains(&touched), "{touched} steps on the ground");
    let fold = |step: usize, commands: &mut [JointSetpoint]| {
        commands[1].position = (0.9 * 2e-3 * step as f64).sin() * 1.7;
        commands[3].position = -1.6 - 1.4 * (2.3e-3 * step as f64).sin();
        commands[5].position = 1.8 + 1.7 * (3.1e-3 * step as f64).sin();
    };
    let touched = same_either_way("panda", ground(-2.0), 0.0, &fold, (4000, false));
    assert!(touched > 0, "it touches itself");
}

#[test]
fn state_saved_far_from_contacts_continues_bit_for_bit() {
    let fall = |simulation: &mut ArticulatedSimulator| {
        (0..400)
            .flat_map(|_| {
                simulation.step(DT).unwrap();
                simulation.configuration().iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            })
            .collect::<Vec<_>>()
    };
    let mut simulation = held_in("quadruped", World { ground: ground(-0.4), ..World::default() });
    (0..37).for_each(|_| _ = simulation.step(DT).unwrap());
    let saved = simulation.save();
    let first = fall(&mut simulation);
    simulation.restore(&saved).unwrap();
    assert!(fall(&mut simulation) == first);
}
