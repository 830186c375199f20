//! Time of a lidar scan of 360 rays, a height scan of 187 points and a depth image of 160 x 120 on a
//! table-top scene. With `--peers`, the measurements alternate with MuJoCo in one run, and the hits are
//! compared.

mod peer;
mod table;

use std::time::Instant;

use motorium_worlds::{RayHit, RayScene};
use table::{Scan, TableTop};

/// Turns of each side.
const TURNS: usize = 60;

/// Rays are cast this far \[m\].
const RANGE: f64 = 10.0;

fn main() {
    let compared = std::env::args().any(|argument| argument == "--peers");
    let mut table = TableTop::new();
    println!("{} shapes; us per scan: minimum / median / 99 % of {TURNS} turns", table.scene.len());
    if !compared {
        for scan in &table.scans {
            let mut hits = vec![None; scan.rays.len()];
            let mut times: Vec<f64> = (0..TURNS).map(|_| turn(&mut table.scene, scan, &mut hits)).collect();
            println!("{:<28} {:>26}   {}", scan.name, figures(&mut times), share(&hits));
        }
    } else if let Err(error) = peer::compare(&mut table) {
        eprintln!("no peers: {error}");
        std::process::exit(1);
    }
}

/// Microseconds per scan of a turn.
fn turn(scene: &mut RayScene, scan: &Scan, hits: &mut [Option<RayHit>]) -> f64 {
    let start = Instant::now();
    for _ in 0..scan.repeats {
        scene.cast_all(&scan.rays, RANGE, hits);
    }
    start.elapsed().as_nanos() as f64 / 1e3 / scan.repeats as f64
}

/// Formats the minimum, the median and the 99 % quantile.
fn figures(times: &mut [f64]) -> String {
    times.sort_by(f64::total_cmp);
    format!("{:.1} / {:.1} / {:.1}", times[0], times[times.len() / 2], times[times.len() * 99 / 100])
}

/// Formats the number of rays, and the percentage that hit something.
fn share(hits: &[Option<RayHit>]) -> String {
    let met = hits.iter().filter(|hit| hit.is_some()).count();
    format!("{} rays, {} % hit", hits.len(), 100 * met / hits.len())
}
