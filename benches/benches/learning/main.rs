//! Learning (criterion): search iterations, environment steps and training steps. With `--peers`, the
//! searches are compared with cma and bayesian-optimization in one run. With `--training-peers`, the time
//! until a policy balances the cart-pole is compared with Stable-Baselines3. `--returns "TASK ALGORITHM
//! STEPS"... SEEDS` compares the returns of trained policies with Stable-Baselines3's. `--parts TASK...`
//! prints the processor time of an environment step by part.

mod cart_pole;
mod parts;
mod returns;
mod training;
mod work;

use std::time::Duration;

use criterion::{Criterion, Throughput};
use motorium_benches::peers::compare;

fn main() {
    let names_after = |option: &str| {
        let mut arguments = std::env::args().skip_while(|argument| argument != option);
        // cargo adds its own option
        arguments.next().map(|_| arguments.filter(|word| !word.starts_with("--")).collect::<Vec<_>>())
    };
    if let Some(tasks) = names_after("--parts") {
        parts::print(&tasks);
        return;
    }
    if let Some(words) = names_after("--returns") {
        if let Err(error) = returns::compare(&words) {
            eprintln!("{error}; pip install -r benches/peers/training.txt");
            std::process::exit(1);
        }
        return;
    }
    if std::env::args().any(|argument| argument == "--peers") {
        if let Err(error) = compare(&mut work::all(), "learning.py", &["cma", "bayesian-optimization"]) {
            eprintln!("no peers: {error}; pip install -r benches/peers/learning.txt");
            std::process::exit(1);
        }
        return;
    }
    if std::env::args().any(|argument| argument == "--training-peers") {
        if let Err(error) = cart_pole::compare() {
            eprintln!("{error}; pip install -r benches/peers/training.txt");
            std::process::exit(1);
        }
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("learning");
    for work in &mut work::all() {
        group.bench_function(work.name, |timer| timer.iter(&mut work.run));
    }
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for row in &mut training::all() {
        group.throughput(Throughput::Elements(row.steps));
        group.bench_function(row.name.as_str(), |timer| timer.iter(&mut row.run));
    }
    group.finish();
    criterion.final_summary();
}
