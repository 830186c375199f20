//! Longer steps of standing robots: cost, penetration at rest, and the force that carries them.

use std::time::Instant;

use motorium_physics::Simulator;

use crate::batch::{NAME, WORLDS, median, quadruped, quadrupeds};
use crate::{STEPS, TURNS};

/// Prints a row for each length of a step.
pub(crate) fn print(_: bool) -> Result<(), String> {
    let weight = quadruped().model.mass() * 9.81;
    for ms in [1.0, 2.0, 5.0, 10.0] {
        let dt = 1e-3 * ms;
        let mut batch = quadrupeds(1, dt);
        let mut times = Vec::new();
        let (mut deepest, mut lowest, mut highest, mut speed) = (0.0_f64, f64::INFINITY, 0.0_f64, 0.0_f64);
        for _ in 0..TURNS / 4 {
            let start = Instant::now();
            let good = batch.step(dt, STEPS).iter().all(Result::is_ok);
            times.push(start.elapsed().as_secs_f64() / (STEPS * WORLDS) as f64);
            assert!(good, "standing robots do not diverge");
            let mut carried = 0.0;
            batch.world(0).visit_contacts(&mut |contact| {
                carried += contact.force * contact.normal.z.abs();
                deepest = deepest.max(contact.depth);
            });
            (lowest, highest) = (lowest.min(carried), highest.max(carried));
            speed = batch.velocities(0).iter().fold(speed, |most, v| most.max(v.abs()));
        }
        let step = median(&mut times);
        println!(
            "{NAME}, steps of {ms} ms: {:.2} us, {:.0} times real time on one thread; at rest {:.1e} m deep, {:.4} to \
             {:.4} of the weight carried, {speed:.0e} rad/s or m/s",
            1e6 * step,
            dt / step,
            deepest,
            lowest / weight,
            highest / weight
        );
    }
    Ok(())
}
