//! The motion library: learning, recognition, recursive update, generation.
//!
//! Uses the recorded letters next to the checkout (`../shared/data/uci-char-trajectories/train.jsonl`) if
//! available, else the same number of synthetic letters. For comparison, numpy takes 123 to 194 ms for the
//! SVD of the same matrix, 2.6 us for a projection on 50 eigenforces, and 0.66 ms for a recursive update at
//! rank 50, on a similar machine.

use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use motorium_library::{
    DAMPING, Generator, Metric, MotionLibrary, Movement, Recogniser, Recordings, RecursiveLibrary,
    SampledSpring, Superposition, Truncation, letters,
};
use motorium_recordings::Selection;

fn recordings() -> Recordings {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/uci-char-trajectories/train.jsonl");
    Recordings::read([&file], &Selection { rate: Some(200.0), ..Selection::default() })
        .unwrap_or_else(|_| letters::letters(58, letters::Variation::default(), 1))
}

fn library(criterion: &mut Criterion) {
    let set = recordings();
    let spring = SampledSpring::new(200, DAMPING).expect("a stable spring");
    let name = |what: &str| format!("{what}, {} letters of 398 forces", set.trajectories.len());
    let build = |metric, keep| MotionLibrary::build(&set, spring, metric, keep).expect("letters that move");
    let mut group = criterion.benchmark_group("library");
    group.sample_size(10).measurement_time(Duration::from_secs(3));
    for (metric, words) in [(Metric::Force, "force"), (Metric::Position, "position")] {
        group.bench_function(name(&format!("build, 64 eigenforces, {words}")), |b| {
            b.iter(|| build(metric, Truncation::Rank(64)));
        });
    }
    group
        .bench_function(name("build, all eigenforces"), |b| b.iter(|| build(Metric::Force, Truncation::All)));
    let library = build(Metric::Force, Truncation::Rank(64));
    let movement = Movement::from_trajectory(&set.trajectories[0], &spring);
    let mut recogniser = Recogniser::new(&library, 50);
    group.sample_size(50);
    group.bench_function("recognise by 50 eigenforces", |b| {
        b.iter(|| recogniser.project(black_box(&movement.forces))[0]);
    });
    let forces: Vec<Vec<f64>> =
        set.trajectories.iter().map(|letter| Movement::from_trajectory(letter, &spring).forces).collect();
    let mut recursive = RecursiveLibrary::new(library.clone(), 50, 1.0);
    let mut next = forces.iter().cycle();
    group.bench_function("recursive update, rank 50", |b| {
        b.iter(|| recursive.add_forces(next.next().expect("a cycle has no end")));
    });
    let mut generator = Generator::new(&library);
    let known = Superposition::from_entry(&library, 0, 50);
    group.bench_function("generator, start by 50 eigenforces", |b| {
        b.iter(|| generator.start(black_box(&known.weights), &known.frame).is_ok());
    });
    group.bench_function("generator, step", |b| b.iter(|| generator.step(black_box(1e-6))));
    group.finish();
}

criterion_group!(benches, library);
criterion_main!(benches);
