//! The machine for which a graph is checked.

/// The cores that a graph may use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Machine {
    cores: Vec<usize>,
}

impl Machine {
    /// Detects the online cores of this machine, including cores that are isolated from the scheduler. The
    /// system may still deny one of these cores when a process is pinned to it.
    pub fn detect() -> Self {
        Self::with_cores(crate::os::machine::online_cores())
    }

    /// Creates a machine with these cores, or with core 0 if the list is empty.
    pub fn with_cores(mut cores: Vec<usize>) -> Self {
        cores.sort_unstable();
        cores.dedup();
        if cores.is_empty() {
            cores.push(0);
        }
        Self { cores }
    }

    /// Returns the cores in ascending order. There is at least one.
    pub fn cores(&self) -> &[usize] {
        &self.cores
    }
}
