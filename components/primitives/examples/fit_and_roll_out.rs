//! Fits a dynamic movement primitive to a demonstration and rolls it out to another goal in another time.
//!
//! ```console
//! $ cargo run -p motorium-primitives --example fit_and_roll_out
//! ```

use std::error::Error;

use motorium_primitives::dmp::{Demonstration, DiscreteDmp, DmpModel, Regression, Settings};
use nalgebra::DMatrix;

/// Fits, rolls out and prints; returns the position at the end.
pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // a demonstration of 1.5 s: 200 positions [m] in two dimensions, at rest at both ends
    let positions = DMatrix::from_fn(200, 2, |k, d| {
        let p = k as f64 / 199.0;
        let s = p * p * p * (10.0 - 15.0 * p + 6.0 * p * p);
        if d == 0 { 0.4 * s } else { 0.1 * (std::f64::consts::PI * s).sin() }
    });
    let demonstration = Demonstration::from_positions(1.5, positions)?;

    let settings = Settings { kernels: 30, ..Settings::default() };
    let model = DmpModel::fit(settings, &[demonstration], Regression::default())?;

    // the same movement, 1 s long, from (0, 0) to (0.6, 0.2), at 1 kHz; a step does not allocate
    let goal = [0.6, 0.2];
    let mut dmp = DiscreteDmp::new(model);
    dmp.start(&[0.0, 0.0], &goal, 1.0)?;
    for step in 0..=1000 {
        if step % 250 == 0 {
            let (position, velocity) = (dmp.position(), dmp.velocity());
            println!("{:.2} s: position {position:.3?} m, velocity {velocity:.3?} m/s", step as f64 * 1e-3);
        }
        dmp.step(1e-3);
    }
    let off = dmp.position().iter().zip(goal).map(|(y, g)| (y - g).abs()).fold(0.0, f64::max);
    if off > 1e-3 {
        return Err(format!("the movement ended {off} m from its goal").into());
    }
    Ok(())
}
