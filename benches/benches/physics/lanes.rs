//! The parts of a step that worlds of one model compute with the same instructions, each world in a lane of a
//! vector register, and the speed-up that lanes can give at most (Amdahl 1967).

use std::hint::black_box;
use std::time::Instant;

use motorium_robots::{Dynamics, Kinematics, MassFactor};
use nalgebra::{DMatrix, Vector3};

use crate::batch::{NAME, WORLDS, median, quadruped, quadrupeds};
use crate::{STEPS, TURNS};

/// Prints the shares and the bounds.
pub(crate) fn print(_: bool) -> Result<(), String> {
    let mut batch = quadrupeds(1, 1e-3);
    let loaded = quadruped();
    let model = &loaded.model;
    let (n, nq) = (model.nv(), model.nq());
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let (q, v) = (batch.all_positions().to_vec(), batch.all_velocities().to_vec());
    let mut kinematics = vec![Kinematics::new(model); WORLDS];
    let mut dynamics = vec![Dynamics::new(model); WORLDS];
    let mut masses = vec![DMatrix::zeros(n, n); WORLDS];
    let mut factors = vec![MassFactor::new(model); WORLDS];
    let mut bias = vec![0.0; n * WORLDS];
    let states = || q.chunks(nq).zip(v.chunks(n));
    let mut times: [Vec<f64>; 5] = Default::default();
    for _ in 0..TURNS {
        let mut clock = Instant::now();
        let mut lap = |part: usize, steps: usize| {
            times[part].push(1e6 * clock.elapsed().as_secs_f64() / (steps * WORLDS) as f64);
            clock = Instant::now();
        };
        assert!(batch.step(1e-3, STEPS).iter().all(Result::is_ok), "standing robots do not diverge");
        lap(0, STEPS);
        // As many consecutive calls as steps of a world, so that its memory is in the caches.
        for (kinematics, (q, v)) in kinematics.iter_mut().zip(states()) {
            (0..STEPS).for_each(|_| black_box(&mut *kinematics).update_with_velocity(model, q, v));
        }
        lap(1, STEPS);
        for ((dynamics, mass), (q, _)) in dynamics.iter_mut().zip(&mut masses).zip(states()) {
            (0..STEPS).for_each(|_| dynamics.crba(model, q, black_box(mass)));
        }
        lap(2, STEPS);
        for ((dynamics, bias), (q, v)) in dynamics.iter_mut().zip(bias.chunks_mut(n)).zip(states()) {
            (0..STEPS).for_each(|_| dynamics.bias(model, q, v, gravity, black_box(bias)));
        }
        lap(3, STEPS);
        for ((factor, mass), bias) in factors.iter_mut().zip(&masses).zip(bias.chunks_mut(n)) {
            for _ in 0..STEPS {
                factor.factor(mass).expect("every link has a mass");
                factor.solve(black_box(bias));
            }
        }
        lap(4, STEPS);
    }
    let [step, parts @ ..] = times.map(|mut times| median(&mut times));
    let common: f64 = parts.iter().sum();
    let share = |part: f64| 100.0 * part / step;
    let [kinematics, mass, bias, factor] = parts.map(share);
    println!(
        "{NAME}: {step:.2} us a step on one thread, of which kinematics {kinematics:.0} %, mass matrix {mass:.0} %, bias \
         {bias:.0} %, factor and solution {factor:.0} %, the rest (contacts, drives, checks) {:.0} %",
        share(step - common)
    );
    let bound = |lanes: f64| step / (step - common + common / lanes);
    println!(
        "{NAME}: speed-up by lanes at most {:.2} with 4, {:.2} with 8, {:.2} with any number of them",
        bound(4.0),
        bound(8.0),
        bound(f64::INFINITY)
    );
    Ok(())
}
