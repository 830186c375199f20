//! Quadratic programs and whole control cycles: recorded streams solved by motorium and Clarabel,
//! differential inverse kinematics of an arm and of a humanoid, strict priorities, inverse dynamics on two
//! feet, the horizon of a trot. With `--peers`, each measurement alternates with solvers and libraries of
//! PyPI. With `--tail`, the slowest torque cycles are compared with plain arithmetic.
//!
//! The streams are files of recorded problems (`motorium qp solve --help`) in the folder `MOTORIUM_QPS`, by
//! default `../shared/qps` next to the repository. Without this folder, only problems of motorium's own
//! cycles are used.

mod bipeds;
mod peers;
mod planner;
mod streams;
mod tail;
mod torque;
mod velocity;

use bipeds::Biped;
use criterion::Criterion;
use torque::{Motion, Tasks, TorqueCycle};

fn main() {
    if std::env::args().any(|argument| argument == "--tail") {
        let talos = peers::talos().map_err(|error| eprintln!("no Talos: {error}")).ok();
        tail::measure(&Biped::catalogue(), talos.as_ref());
        return;
    }
    let streams = streams::all();
    if std::env::args().any(|argument| argument == "--peers") {
        peers::compare(&streams);
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    streams::measure(&streams, &mut criterion);
    let humanoid = Biped::catalogue();
    let mut group = criterion.benchmark_group("cycle");
    group.bench_function("panda, two tasks in a sum", |timer| timer.iter(velocity::panda(false)));
    group.bench_function("panda, two levels", |timer| timer.iter(velocity::panda(true)));
    group.bench_function("humanoid on held feet", |timer| timer.iter(velocity::on_held_feet(&humanoid)));
    group.bench_function("humanoid, four levels", |timer| timer.iter(velocity::in_four_levels(&humanoid)));
    let mut torque = TorqueCycle::new(&humanoid, Tasks::Four, Motion::ToAndFro);
    group.bench_function("humanoid, inverse dynamics on two soles", |timer| timer.iter(|| torque.run()));
    group.bench_function("quadruped, horizon of ten steps in a trot", |timer| timer.iter(planner::trot()));
    group.finish();
    criterion.final_summary();
}
