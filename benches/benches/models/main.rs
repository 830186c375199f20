//! Models (criterion). With `--peers`, times and numbers are compared with onnxruntime, GPy, scikit-learn and
//! hmmlearn in one run; `--peers hmm` times only works with `hmm` in their names.

mod agreement;
mod work;

use criterion::Criterion;
use motorium_benches::peers::compare;

fn main() {
    if std::env::args().any(|argument| argument == "--peers") {
        let packages = ["onnxruntime", "GPy", "scikit-learn", "hmmlearn"];
        let compared = compare(&mut work::all(), "models.py", &packages);
        if let Err(error) = compared.and_then(|mut peers| agreement::print(&mut peers)) {
            eprintln!("no peers: {error}; pip install -r benches/peers/models.txt");
            std::process::exit(1);
        }
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("models");
    for work in &mut work::all() {
        group.bench_function(work.name, |timer| timer.iter(&mut work.run));
    }
    group.finish();
    criterion.final_summary();
}
