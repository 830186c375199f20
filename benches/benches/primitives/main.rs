//! Benchmarks of movement primitives (criterion). With `--peers`, motorium is compared with
//! movement_primitives and pydmps in one run.

mod work;

use criterion::Criterion;
use motorium_benches::peers::compare;

fn main() {
    let mut works = work::all();
    if std::env::args().any(|argument| argument == "--peers") {
        if let Err(error) = compare(&mut works, "primitives.py", &["movement_primitives", "pydmps"]) {
            eprintln!("no peers: {error}");
            std::process::exit(1);
        }
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("primitives");
    for work in &mut works {
        group.bench_function(work.name, |timer| timer.iter(&mut work.run));
    }
    group.finish();
    criterion.final_summary();
}
