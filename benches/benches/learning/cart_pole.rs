//! Processor time until PPO balances the cart-pole, compared with Stable-Baselines3.

use std::path::Path;

use motorium_benches::peers::{Peer, processor_time};
use motorium_learners::environment::Scene;
use motorium_learners::ppo::{Ppo, PpoSettings};
use motorium_learners::task::Task;

/// Seeds of the training runs.
const SEEDS: core::ops::RangeInclusive<u64> = 1..=10;
/// Mean return of the last 100 episodes at which the pole counts as balanced, of 500.
const BALANCED: f64 = 475.0;

/// Trains with each seed on both sides in turn, until the pole is balanced or the steps of the run are used
/// up, and prints the times.
pub(crate) fn compare() -> Result<(), String> {
    let mut peer = Peer::start("training.py", "stable-baselines3")?;
    println!("s of processor time until the mean return of 100 episodes is {BALANCED}; - if it never is\n");
    println!("{:<8} {:>10} {:>20}", "seed", "motorium", "stable-baselines3");
    let row = |name: String, seconds: [Option<f64>; 2]| {
        println!("{name:<8} {:>10} {:>20}", shown(seconds[0]), shown(seconds[1]));
    };
    let mut columns = [Vec::new(), Vec::new()];
    for seed in SEEDS {
        let theirs = peer.measure(&format!("cart-pole {seed}"))?;
        let seconds = [balance(seed)?, theirs.is_finite().then_some(theirs * 1e-9)];
        columns.iter_mut().zip(seconds).for_each(|(column, seconds)| column.push(seconds));
        row(seed.to_string(), seconds);
    }
    row("median".to_owned(), columns.map(|column| median(&column)));
    Ok(())
}

fn shown(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "-".to_owned(), |seconds| format!("{seconds:.2}"))
}

/// Returns the median of runs; a run that never balances the pole counts as longer than all others.
fn median(runs: &[Option<f64>]) -> Option<f64> {
    let mut runs: Vec<f64> = runs.iter().map(|seconds| seconds.unwrap_or(f64::INFINITY)).collect();
    runs.sort_by(f64::total_cmp);
    runs.get(runs.len() / 2).copied().filter(|seconds| seconds.is_finite())
}

/// Seconds of processor time of a training run on one thread.
fn balance(seed: u64) -> Result<Option<f64>, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tasks");
    let text = std::fs::read_to_string(folder.join("cart-pole.toml")).map_err(|error| error.to_string())?;
    let task = Task::parse(&text).map_err(|error| error.to_string())?;
    let start = processor_time();
    let scene = Scene::load(&task, &folder).map_err(|error| error.to_string())?;
    let settings = PpoSettings::from_table(&task.algorithms).map_err(|error| error.to_string())?;
    let mut run =
        Ppo::new(&task, settings, (seed, 1), || scene.simulation()).map_err(|error| error.to_string())?;
    while !run.is_finished() {
        let progress = run.advance().map_err(|error| error.to_string())?;
        if progress.episodes >= 100 && progress.mean_return.is_some_and(|mean| mean >= BALANCED) {
            return Ok(Some((processor_time() - start).as_secs_f64()));
        }
    }
    Ok(None)
}
