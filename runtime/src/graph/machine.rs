//! What a graph must know of the machine it is checked for.

/// The cores a graph may use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Machine {
    cores: Vec<usize>,
}

impl Machine {
    /// The cores this process may run on. On a machine shared by containers, or under `taskset`, these are fewer than
    /// there are.
    pub fn detect() -> Self {
        let set = rustix::thread::sched_getaffinity(None);
        let cores = match set {
            Ok(set) => (0..rustix::thread::CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect(),
            Err(_) => (0..std::thread::available_parallelism().map_or(1, |cores| cores.get())).collect(),
        };
        Self::with_cores(cores)
    }

    /// A machine with these cores; with core 0 alone if there are none.
    pub fn with_cores(mut cores: Vec<usize>) -> Self {
        cores.sort_unstable();
        cores.dedup();
        if cores.is_empty() {
            cores.push(0);
        }
        Self { cores }
    }

    /// Its cores, ascending, at least one.
    pub fn cores(&self) -> &[usize] {
        &self.cores
    }
}
