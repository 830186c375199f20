//! Tails of torque cycles, separated from the machine's tails. Each cycle alternates with a floor of plain
//! arithmetic of equal duration and fixed path. The iterations of the slowest cycles are printed.

use std::hint::black_box;
use std::time::Instant;

use crate::bipeds::Biped;
use crate::torque::{Motion, Tasks, TorqueCycle};

/// Cycles of a row.
const CYCLES: usize = 20_000;
/// Number of warm-up cycles.
const WARM_UP: usize = 2000;
/// Numbers processed by the floor, as many bytes as the matrices of a problem with 60 unknowns.
const NUMBERS: usize = 24 * 1024;

/// Prints the tails of the humanoid of the catalogue and, if available, of Talos.
pub(crate) fn measure(humanoid: &Biped, talos: Option<&Biped>) {
    println!(
        "tails, us, {CYCLES} cycles in turn with as many floors; iterations: median, those of the cycles from the 99.9th percentile on, most\n"
    );
    println!(
        "{:<44} {:>8} {:>8} {:>8} {:>9}   {:<14} {:>14}",
        "", "p50", "p99", "p99.9", "max", "iterations", "p99.9 - floor"
    );
    for (name, tasks, motion) in [
        ("humanoid, four tasks, to and fro", Tasks::Four, Motion::ToAndFro),
        ("humanoid, four tasks, a jump each second", Tasks::Four, Motion::Round),
        ("humanoid, four tasks, a foot lifted", Tasks::Four, Motion::Step),
        ("humanoid, four tasks, it falls", Tasks::Four, Motion::Fall),
    ] {
        row(name, TorqueCycle::new(humanoid, tasks, motion));
    }
    if let Some(talos) = talos {
        row("Talos, two tasks, to and fro", TorqueCycle::new(talos, Tasks::Two, Motion::ToAndFro));
        row("Talos, two tasks, a foot lifted", TorqueCycle::new(talos, Tasks::Two, Motion::Step));
    }
}

fn row(name: &str, mut cycle: TorqueCycle) {
    let floor = Floor::as_long_as(&mut cycle);
    let (mut ours, mut floors) = (Vec::with_capacity(CYCLES), Vec::with_capacity(CYCLES));
    for _ in 0..CYCLES {
        let start = Instant::now();
        let iterations = cycle.run();
        ours.push((start.elapsed().as_nanos() as f64 * 1e-3, iterations));
        let start = Instant::now();
        floor.run();
        floors.push((start.elapsed().as_nanos() as f64 * 1e-3, 0));
    }
    let (ours, floors) = (Tail::from_samples(ours), Tail::from_samples(floors));
    let excess = (ours.p99_9 - ours.p50) - (floors.p99_9 - floors.p50);
    println!("{} {excess:>14.1}", ours.line(name));
    println!("{}", floors.line("  floor"));
}

/// Percentiles of one side, us.
struct Tail {
    p50: f64,
    p99: f64,
    p99_9: f64,
    max: f64,
    iterations: [u32; 4],
}

impl Tail {
    fn from_samples(mut samples: Vec<(f64, u32)>) -> Self {
        let mut counts: Vec<u32> = samples.iter().map(|(_, iterations)| *iterations).collect();
        counts.sort_unstable();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let place = |share: f64| (samples.len() as f64 * share).ceil() as usize - 1;
        let mut slow: Vec<u32> = samples[place(0.999)..].iter().map(|(_, iterations)| *iterations).collect();
        slow.sort_unstable();
        let at = |share: f64| samples[place(share)].0;
        Self {
            p50: at(0.5),
            p99: at(0.99),
            p99_9: at(0.999),
            max: at(1.0),
            iterations: [counts[place(0.5)], slow[0], slow[slow.len() / 2], counts[counts.len() - 1]],
        }
    }

    fn line(&self, name: &str) -> String {
        let [median, least, middle, most] = self.iterations;
        let iterations = format!("{median} | {least}..{middle} | {most}");
        let Self { p50, p99, p99_9, max, .. } = self;
        format!("{name:<44} {p50:>8.1} {p99:>8.1} {p99_9:>8.1} {max:>9.1}   {iterations:<14}")
    }
}

/// Plain arithmetic over as much memory as a cycle uses: sums of products, the same each time.
struct Floor {
    numbers: Vec<f64>,
    rounds: usize,
}

impl Floor {
    /// Creates a floor with the median duration of `cycle`, which is warmed up in the process.
    fn as_long_as(cycle: &mut TorqueCycle) -> Self {
        let mut floor =
            Self { numbers: (0..NUMBERS).map(|n| 1.0 / (1.0 + n as f64)).collect(), rounds: 1000 };
        let median = |run: &mut dyn FnMut()| {
            let mut times: Vec<f64> = (0..WARM_UP)
                .map(|_| {
                    let start = Instant::now();
                    run();
                    start.elapsed().as_nanos() as f64
                })
                .collect();
            times.sort_by(f64::total_cmp);
            times[WARM_UP / 2]
        };
        let wanted = median(&mut || _ = cycle.run());
        let found = median(&mut || floor.run());
        floor.rounds = (floor.rounds as f64 * wanted / found).ceil() as usize;
        floor
    }

    fn run(&self) {
        let mut sums = [0.0; 8];
        let blocks = self.numbers.as_chunks::<8>().0;
        for block in blocks.iter().cycle().take(self.rounds) {
            for (sum, number) in sums.iter_mut().zip(black_box(block)) {
                *sum += number * number;
            }
        }
        black_box(sums);
    }
}
