//! The machine for which a graph is checked.

/// The cores a graph may use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Machine {
    cores: Vec<usize>,
}

impl Machine {
    /// The cores that are online, those isolated from the scheduler among them. Whether a process may run on one shows
    /// when it is placed there and reads back.
    pub fn detect() -> Self {
        Self::with_cores(crate::os::machine::online_cores())
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
