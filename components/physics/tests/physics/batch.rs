//! Batches: each world computes the same result as alone.

use motorium_physics::{Batch, Simulator};

use crate::legged::held;

#[test]
fn a_batch_equals_single_worlds_on_any_thread_count() {
    let count = 5;
    let command = |world: usize, step: usize, drive: usize| {
        0.05 * ((world + 1) as f64 * 0.01 * step as f64 + drive as f64).sin()
    };
    let alone: Vec<Vec<u64>> = (0..count)
        .map(|world| {
            let mut simulation = held("quadruped");
            let hold = simulation.commands_mut().to_vec();
            for step in 0..60 {
                for (drive, (command_of, hold)) in simulation.commands_mut().iter_mut().zip(&hold).enumerate()
                {
                    command_of.position = hold.position + command(world, step, drive);
                }
                (0..5).for_each(|_| _ = simulation.step(1e-3).unwrap());
            }
            let state = simulation.configuration().iter().chain(simulation.velocity());
            state.map(|x| x.to_bits()).collect()
        })
        .collect();
    for threads in [1, 2, 3] {
        let mut batch = Batch::new(count, threads, |_| Ok(held("quadruped"))).unwrap();
        let hold = held("quadruped").commands_mut().to_vec();
        for step in 0..60 {
            for (index, command_of) in batch.commands_mut().iter_mut().enumerate() {
                let (world, drive) = (index / hold.len(), index % hold.len());
                *command_of = hold[drive];
                command_of.position += command(world, step, drive);
            }
            assert!(batch.step(1e-3, 5).iter().all(Result::is_ok));
        }
        for (world, alone) in alone.iter().enumerate() {
            let state = batch.positions(world).iter().chain(batch.velocities(world));
            assert!(
                state.map(|x| x.to_bits()).eq(alone.iter().copied()),
                "world {world} on {threads} threads"
            );
        }
        assert!(alone[0] != alone[1], "the worlds differ");
    }
}

#[test]
fn a_world_that_fails_leaves_the_others_alone() {
    let mut batch = Batch::new(3, 2, |_| Ok(held("quadruped"))).unwrap();
    let before = batch.positions(1).to_vec();
    let drives = batch.world(0).joint_names().len();
    batch.commands_mut()[drives].kp = f64::NAN;
    let failed: Vec<bool> = batch.step(1e-3, 10).iter().map(Result::is_err).collect();
    assert_eq!(failed, [false, true, false]);
    assert_eq!(batch.positions(1), before);
    assert_ne!(batch.positions(0), before);
    // The world can be reset.
    let (q, v) = (before.clone(), vec![0.0; batch.velocities(0).len()]);
    batch.reset(1, &q, &v).unwrap();
    assert!(batch.step(1e-3, 10).iter().all(Result::is_ok));
}

#[test]
fn batch_observations_equal_single_worlds_after_resets() {
    for threads in [1, 2, 3] {
        let batch = Batch::new(5, threads, |_| Ok(held("quadruped"))).unwrap();
        let mut batch = batch.observing(2, |world, out| {
            out.copy_from_slice(&[world.base_pose().translation.z, world.velocity()[2]]);
        });
        let drives = batch.world(0).joint_names().len();
        batch.commands_mut()[3 * drives].effort = 5.0;
        batch.step(1e-3, 20);
        let expected = |batch: &Batch<_>, world: usize| {
            let of: &motorium_physics::ArticulatedSimulator = batch.world(world);
            [of.base_pose().translation.z, of.velocity()[2]]
        };
        let all: Vec<f64> = (0..5).flat_map(|world| expected(&batch, world)).collect();
        assert_eq!(batch.observations(), all, "{threads} threads");
        assert_ne!(batch.observation(0), batch.observation(3), "the worlds differ");
        let (q, v) = (batch.positions(0).to_vec(), vec![0.0; batch.velocities(0).len()]);
        for world in [1, 3] {
            batch.reset(world, &q, &v).unwrap();
            assert_eq!(batch.observation(world), expected(&batch, world));
            assert_eq!(batch.observation(world)[1], 0.0);
        }
    }
}

/// Per world: a generator of pushes, the sum of heights after each step, and the number of resets.
#[derive(Clone, Debug, PartialEq)]
struct Roll {
    random: u64,
    heights: f64,
    resets: u32,
}

#[test]
fn visits_give_equal_bits_on_any_number_of_threads() {
    let rolled = |threads: usize| {
        let start = |world: usize| Roll { random: world as u64 + 1, heights: 0.0, resets: 0 };
        let mut batch = Batch::new(6, threads, |_| Ok(held("quadruped"))).unwrap().with_data(start);
        let (q, v) = (batch.positions(0).to_vec(), vec![0.0; batch.velocities(0).len()]);
        for step in 0..40 {
            batch.each(|world, simulation, roll| {
                roll.random = roll.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let drives = simulation.commands_mut().len() as u64;
                let drive = (roll.random >> 33) % drives;
                simulation.commands_mut()[drive as usize].effort = (roll.random >> 60) as f64 - 8.0;
                simulation.step(1e-3).unwrap();
                roll.heights += simulation.base_pose().translation.z;
                if (step + world) % 13 == 12 {
                    simulation.reset(&q, &v).unwrap();
                    roll.resets += 1;
                }
            });
        }
        let bits: Vec<u64> = batch.all_positions().iter().map(|x| x.to_bits()).collect();
        (bits, batch.data().to_vec())
    };
    let alone = rolled(1);
    assert!(alone.1.iter().all(|roll| roll.resets >= 2), "{:?}", alone.1);
    assert_ne!(alone.1[0].heights, alone.1[1].heights, "the worlds differ");
    for threads in [2, 3, 8] {
        assert_eq!(rolled(threads), alone, "{threads} threads");
    }
}

#[test]
fn a_visit_refreshes_states_and_observations() {
    let batch = Batch::new(3, 2, |_| Ok(held("quadruped"))).unwrap();
    let mut batch = batch.observing(1, |world, out| out[0] = world.base_pose().translation.z);
    let (mut q, v) = (batch.positions(1).to_vec(), vec![0.0; batch.velocities(0).len()]);
    q[2] += 0.25;
    batch.each(|world, simulation, ()| {
        if world == 1 {
            simulation.reset(&q, &v).unwrap();
        }
    });
    assert_eq!(batch.positions(1), q);
    assert_eq!(batch.observation(1), [q[2]]);
    assert_ne!(batch.observation(0), [q[2]]);
}
