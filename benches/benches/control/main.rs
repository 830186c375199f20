//! Quadratic programs and whole control cycles: recorded streams through our solver beside Clarabel, differential inverse
//! kinematics of an arm, inverse dynamics of a humanoid on two feet; or with `--peers` the streams beside DAQP, too.
//!
//! The streams are folders of recorded problems (`motorium qp solve --help`): `MOTORIUM_QPS` names the folder, by default
//! `../shared/qps` beside the repository. Without one, streams of our own cycles are used alone.

mod cycles;
mod peers;
mod streams;

use criterion::Criterion;

fn main() {
    let streams = streams::all();
    if std::env::args().any(|argument| argument == "--peers") {
        if let Err(error) = peers::compare(&streams) {
            eprintln!("no peers: {error}");
            std::process::exit(1);
        }
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    streams::measure(&streams, &mut criterion);
    cycles::measure(&mut criterion);
    criterion.final_summary();
}
