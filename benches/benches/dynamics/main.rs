//! Kinematics, dynamics and distances (criterion). With `--peers`, kinematics and dynamics compared with
//! Pinocchio in C++, pair by pair in one run.

mod distances;
mod peers;
mod quantities;
mod robots;

use criterion::Criterion;
use quantities::{Bench, NAMES};

fn main() {
    let scratch = std::env::temp_dir().join(format!("motorium-dynamics-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).expect("a writable temporary folder");
    let subjects = robots::subjects(&scratch);
    if std::env::args().any(|argument| argument == "--peers") {
        if let Err(error) = peers::compare(&subjects) {
            eprintln!("no peers: {error}");
            std::process::exit(1);
        }
    } else {
        let mut criterion = Criterion::default().configure_from_args();
        for subject in &subjects {
            let mut group = criterion.benchmark_group(subject.name);
            for name in NAMES {
                let mut bench = Bench::new(subject);
                if bench.run(name) {
                    group.bench_function(name, |timer| timer.iter(|| bench.run(name)));
                }
            }
            group.finish();
        }
        distances::measure(&mut criterion);
        criterion.final_summary();
    }
    // A leftover folder is harmless: the system clears its temporary files.
    let _ = std::fs::remove_dir_all(&scratch);
}
