//! Movement primitives (criterion). With `--peers`, compared with movement_primitives and pydmps in one run.

mod peers;
mod work;

use criterion::Criterion;

fn main() {
    let mut works = work::all();
    if std::env::args().any(|argument| argument == "--peers") {
        if let Err(error) = peers::compare(&mut works) {
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
