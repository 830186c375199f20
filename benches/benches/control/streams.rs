//! Consecutive quadratic programs of controllers, solved warm in order.

use std::path::{Path, PathBuf};

use criterion::Criterion;
use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, Problem, QpSolver, Structure,
    recorded,
};

use crate::torque;

/// A stream of problems of one structure.
pub(crate) struct Stream {
    pub(crate) name: String,
    pub(crate) structure: Structure,
    pub(crate) problems: Vec<Problem>,
    /// Its file, if it was recorded.
    pub(crate) file: Option<PathBuf>,
}

/// Returns the available recorded streams, and one from the humanoid.
pub(crate) fn all() -> Vec<Stream> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/qps");
    let folder = std::env::var_os("MOTORIUM_QPS").map_or(beside, PathBuf::from);
    let mut streams = Vec::new();
    for name in ["panda_ik", "talos_ik", "talos_id"] {
        let file = folder.join(format!("{name}.json"));
        let Ok(text) = std::fs::read_to_string(&file) else {
            eprintln!("no {}: left out", file.display());
            continue;
        };
        match recorded::read(&text) {
            Ok((structure, problems)) => {
                streams.push(Stream { name: name.to_owned(), structure, problems, file: Some(file) });
            }
            Err(error) => eprintln!("{}: {error}", file.display()),
        }
    }
    let (structure, problems) = torque::problems();
    streams.push(Stream { name: "humanoid_id".to_owned(), structure, problems, file: None });
    streams
}

/// Repeated solves of a stream, one after the other.
pub(crate) struct Solves<'a> {
    stream: &'a Stream,
    solver: Box<dyn QpSolver>,
    next: usize,
}

impl<'a> Solves<'a> {
    pub(crate) fn active_set(stream: &'a Stream) -> Self {
        let solver = ActiveSetSolver::new(stream.structure.clone(), ActiveSetSettings::default());
        Self { stream, solver: Box::new(solver), next: 0 }
    }

    pub(crate) fn clarabel(stream: &'a Stream) -> Self {
        let solver = ClarabelSolver::new(stream.structure.clone(), ClarabelSettings::default());
        Self { stream, solver: Box::new(solver), next: 0 }
    }

    pub(crate) fn run(&mut self) {
        let problem = &self.stream.problems[self.next];
        self.next = (self.next + 1) % self.stream.problems.len();
        self.solver.update(problem).expect("a recorded problem has numbers");
        std::hint::black_box(self.solver.solve().expect("a recorded problem has a solution"));
    }
}

pub(crate) fn measure(streams: &[Stream], criterion: &mut Criterion) {
    for stream in streams {
        let mut group = criterion.benchmark_group(format!("qp/{}", stream.name));
        let mut ours = Solves::active_set(stream);
        group.bench_function("active_set", |timer| timer.iter(|| ours.run()));
        let mut reference = Solves::clarabel(stream);
        group.bench_function("clarabel", |timer| timer.iter(|| reference.run()));
        group.finish();
    }
}
