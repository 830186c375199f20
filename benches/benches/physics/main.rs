//! Computing time of one simulated millisecond, for robots of the catalogue and a pile of boxes. With
//! `--peers`, the measurements alternate with MuJoCo and PyBullet in one run. Further measurements are the
//! steps per second of a batch, the parts of its steps, longer steps, and the energy of lossless motions.

mod batch;
mod energy;
mod lanes;
mod lengths;
mod peers;
mod scenes;
mod talos;

use std::time::Instant;

use scenes::{Scene, scenes};

/// Turns of each side, and steps timed together in a turn.
const TURNS: usize = 120;
const STEPS: usize = 25;

/// A name, and a function that prints the rows with this name, compared with peers or alone.
type Row = (&'static str, fn(bool) -> Result<(), String>);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let chosen: Vec<&String> = arguments.iter().filter(|argument| !argument.starts_with("--")).collect();
    let wanted = |scene: &str| chosen.is_empty() || chosen.iter().any(|name| scene.contains(name.as_str()));
    let mut scenes = scenes(wanted);
    let compared = arguments.iter().any(|argument| argument == "--peers");
    println!("us per step of 1 ms: minimum / median / 99 % of {TURNS} turns of {STEPS} steps");
    let mut result = Ok(());
    if compared {
        result = peers::compare(&mut scenes);
    } else {
        alone(&mut scenes);
    }
    let rows: [Row; 4] = [
        (batch::NAME, batch::print),
        (batch::NAME, lanes::print),
        (batch::NAME, lengths::print),
        (energy::NAME, energy::print),
    ];
    for (name, print) in rows {
        if wanted(name) {
            result = result.and_then(|()| print(compared));
        }
    }
    if let Err(error) = result {
        eprintln!("no peers: {error}");
        std::process::exit(1);
    }
}

fn alone(scenes: &mut [Scene]) {
    for scene in scenes {
        let mut times: Vec<f64> = (0..TURNS).map(|_| turn(scene)).collect();
        println!("{:<24} {:>23}   {}", scene.name, figures(&mut times), scene.contacts());
    }
}

/// Microseconds per step of a turn.
fn turn(scene: &mut Scene) -> f64 {
    let start = Instant::now();
    scene.advance(STEPS);
    start.elapsed().as_nanos() as f64 / 1e3 / STEPS as f64
}

/// Formats the minimum, the median and the 99 % quantile.
fn figures(times: &mut [f64]) -> String {
    times.sort_by(f64::total_cmp);
    format!("{:.2} / {:.2} / {:.2}", times[0], times[times.len() / 2], times[times.len() * 99 / 100])
}
