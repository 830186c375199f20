//! Releases of a time-triggered component, as a pure function of time.

use crate::plan::OnOverrun;

/// The grid of releases `origin + n * period`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    period_ns: u64,
    release_ns: u64,
}

/// The next release after a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Next {
    /// True if the step ended after the following release.
    pub(super) overrun: bool,
    /// Number of dropped releases.
    pub(super) skipped: u64,
}

impl Grid {
    /// Creates a grid whose next release is the first one not before `now_ns`.
    pub(super) fn new(origin_ns: u64, period_ns: u64, now_ns: u64) -> Self {
        let passed = now_ns.saturating_sub(origin_ns).div_ceil(period_ns);
        Self { period_ns, release_ns: origin_ns + passed * period_ns }
    }

    /// Returns the current release, ns.
    pub(super) fn release_ns(&self) -> u64 {
        self.release_ns
    }

    /// Returns the release after the current one, which is the deadline of the current step, ns.
    pub(super) fn deadline_ns(&self) -> u64 {
        self.release_ns + self.period_ns
    }

    /// Moves to the next release after a step that ended at `end_ns`.
    pub(super) fn advance(&mut self, end_ns: u64, policy: OnOverrun) -> Next {
        let deadline = self.deadline_ns();
        if end_ns <= deadline {
            self.release_ns = deadline;
            return Next { overrun: false, skipped: 0 };
        }
        let behind = (end_ns - deadline).div_ceil(self.period_ns);
        let skipped = match policy {
            OnOverrun::CatchUp => {
                self.release_ns = deadline;
                0
            }
            OnOverrun::Rephase => {
                self.release_ns = end_ns + self.period_ns;
                behind
            }
            OnOverrun::Skip | OnOverrun::Hold | OnOverrun::SafeStop => {
                self.release_ns = deadline + behind * self.period_ns;
                behind
            }
        };
        Next { overrun: true, skipped }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new(1_000, 100, 1_000)
    }

    #[test]
    fn punctual_step_leads_to_the_next_release() {
        let mut grid = grid();
        assert_eq!(grid.advance(1_040, OnOverrun::Skip), Next { overrun: false, skipped: 0 });
        assert_eq!(grid.release_ns(), 1_100);
        assert_eq!(grid.advance(1_200, OnOverrun::Skip), Next { overrun: false, skipped: 0 });
        assert_eq!(grid.release_ns(), 1_200);
    }

    #[test]
    fn skip_drops_missed_releases_and_keeps_the_grid() {
        let mut grid = grid();
        assert_eq!(grid.advance(1_250, OnOverrun::Skip), Next { overrun: true, skipped: 2 });
        assert_eq!(grid.release_ns(), 1_300);
    }

    #[test]
    fn catch_up_runs_every_missed_release() {
        let mut grid = grid();
        assert_eq!(grid.advance(1_250, OnOverrun::CatchUp), Next { overrun: true, skipped: 0 });
        assert_eq!(grid.release_ns(), 1_100);
        assert_eq!(grid.advance(1_260, OnOverrun::CatchUp), Next { overrun: true, skipped: 0 });
        assert_eq!(grid.advance(1_270, OnOverrun::CatchUp), Next { overrun: false, skipped: 0 });
        assert_eq!(grid.release_ns(), 1_300);
    }

    #[test]
    fn rephase_restarts_the_grid_a_period_after_a_late_step() {
        let mut grid = grid();
        assert_eq!(grid.advance(1_250, OnOverrun::Rephase), Next { overrun: true, skipped: 2 });
        assert_eq!(grid.release_ns(), 1_350);
    }

    #[test]
    fn restarted_component_joins_at_the_next_grid_point() {
        assert_eq!(Grid::new(1_000, 100, 5_010).release_ns(), 5_100);
        assert_eq!(Grid::new(1_000, 100, 5_100).release_ns(), 5_100);
        assert_eq!(Grid::new(1_000, 100, 10).release_ns(), 1_000);
    }
}
