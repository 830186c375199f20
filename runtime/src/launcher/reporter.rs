//! Reports of a run in progress: stops, counters, episodes, and the status.

use super::accounts::Accounts;
use super::episodes::Episodes;
use super::run::Run;
use super::stops::Stops;
use super::{Event, Status};

/// Time between two status reports, ns.
const STATUS_NS: u64 = 50_000_000;

/// Last reported values of a run.
pub(super) struct Reporter {
    stops: Stops,
    pub(super) accounts: Accounts,
    pub(super) episodes: Episodes,
    /// Time of the next status, `CLOCK_MONOTONIC` ns.
    pub(super) next_status_ns: u64,
}

impl Reporter {
    /// Creates a reporter that has reported nothing yet.
    pub(super) fn new(run: &Run) -> Self {
        Self {
            stops: Stops::default(),
            accounts: Accounts::new(&run.plan),
            episodes: Episodes::default(),
            next_status_ns: 0,
        }
    }

    /// Reports stops that started or ended and, in real time, changed counters and episodes that began.
    pub(super) fn look(&mut self, run: &Run, now_ns: u64, observe: &mut dyn FnMut(Event<'_>)) {
        self.stops.report(&run.plan, &run.region, observe);
        if !run.is_lockstep() {
            self.accounts.report((&run.plan, &run.region), now_ns, false, observe);
            self.episodes.note(&run.region, observe);
        }
    }

    /// Returns `true` if a status is due, and sets the time of the next one.
    pub(super) fn take_status(&mut self, now_ns: u64) -> bool {
        let is_due = now_ns >= self.next_status_ns;
        if is_due {
            self.next_status_ns = now_ns + STATUS_NS;
        }
        is_due
    }

    /// Reports the status if it is due.
    pub(super) fn report_status(&mut self, run: &Run, now_ns: u64, observe: &mut dyn FnMut(Event<'_>)) {
        if self.take_status(now_ns) {
            observe(Event::Status(&Status::read(&run.plan, &run.region)));
        }
    }
}
