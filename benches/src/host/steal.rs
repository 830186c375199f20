//! Time that the host of a virtual machine took away from its cores.

use std::time::Instant;

use serde::{Deserialize, Serialize};

/// Length of a tick in `/proc/stat`, ms: `USER_HZ` is 100 on every architecture that Linux runs on today.
const TICK_MS: f64 = 10.0;

/// What the host took during a measurement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct HostShare {
    /// How long the measurement took, s.
    pub seconds: f64,
    /// Time the host took from all cores together, ms (`steal` of `/proc/stat`, in steps of 10 ms).
    pub steal_ms: f64,
    /// The same as a share of the time of all cores.
    pub steal_share: f64,
}

/// Watches what the host takes.
#[derive(Debug)]
pub struct Watch {
    since: Instant,
    ticks: Option<(u64, usize)>,
}

impl Watch {
    /// Begins to watch.
    pub fn start() -> Self {
        Self { since: Instant::now(), ticks: now() }
    }

    /// What was taken since the start.
    pub fn stop(&self) -> HostShare {
        let seconds = self.since.elapsed().as_secs_f64();
        let (Some((before, cores)), Some((after, _))) = (self.ticks, now()) else {
            return HostShare { seconds, ..HostShare::default() };
        };
        let steal_ms = after.saturating_sub(before) as f64 * TICK_MS;
        HostShare { seconds, steal_ms, steal_share: steal_ms / (1e3 * seconds * cores.max(1) as f64) }
    }
}

fn now() -> Option<(u64, usize)> {
    stolen(&std::fs::read_to_string("/proc/stat").ok()?)
}

/// Stolen ticks of all cores together, and how many cores there are.
fn stolen(stat: &str) -> Option<(u64, usize)> {
    let all = stat.lines().find(|line| line.starts_with("cpu "))?;
    let steal = all.split_whitespace().nth(8)?.parse().ok()?;
    let is_core = |line: &&str| line.starts_with("cpu") && !line.starts_with("cpu ");
    Some((steal, stat.lines().filter(is_core).count()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stolen_time_is_the_eighth_number_of_all_cores_together() {
        let stat = "cpu  10 20 30 40 50 60 70 88 90 100\ncpu0 5 10 15 20 25 30 35 44 45 50\n\
                    cpu1 5 10 15 20 25 30 35 44 45 50\nintr 1\n";
        assert_eq!(stolen(stat), Some((88, 2)));
        assert_eq!(stolen("cpu  1 2 3\n"), None);
    }

    #[test]
    fn a_share_is_of_the_time_of_all_cores() {
        let watch = Watch::start();
        let share = watch.stop();
        assert!(share.seconds >= 0.0 && share.steal_share >= 0.0);
    }
}
