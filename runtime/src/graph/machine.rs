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
        let online = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
        let cores = match parse_list(&online) {
            Some(cores) => cores,
            None => (0..std::thread::available_parallelism().map_or(1, |cores| cores.get())).collect(),
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

/// Reads a list of the kernel's, such as `0-3,6`.
fn parse_list(text: &str) -> Option<Vec<usize>> {
    let mut cores = Vec::new();
    for part in text.trim().split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        cores.extend(first.parse::<usize>().ok()?..=last.parse().ok()?);
    }
    Some(cores)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernels_lists_of_cores_are_read_and_nonsense_is_not() {
        assert_eq!(parse_list("0-3,6\n"), Some(vec![0, 1, 2, 3, 6]));
        assert_eq!(parse_list("0\n"), Some(vec![0]));
        assert_eq!(parse_list(""), None);
        assert_eq!(parse_list("a-b"), None);
    }
}
