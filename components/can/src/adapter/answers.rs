//! The answers of a drive, sorted into the cycles.

use super::{Link, Phase};

impl Link {
    /// Returns `true` if the answer of this cycle has arrived or, for a drive that reports unasked, if no
    /// report is overdue. A drive with an overdue heartbeat counts as missing, whatever else it sends.
    pub(super) fn has_answered(&self) -> bool {
        match (self.dialogue.reports_every_ns(), self.received_ns) {
            (None, _) => self.answered && !self.is_state_overdue(),
            (Some(_), None) => false,
            (Some(every_ns), Some(received_ns)) => {
                received_ns + every_ns >= self.sent_ns && !self.is_state_overdue()
            }
        }
    }

    /// Sorts an answer that was received at `time_ns` into the cycles, and counts it; false for one that is
    /// not to be taken.
    ///
    /// Answers carry no number. An answer too early for this cycle's frame belongs to an earlier one, and so
    /// does the first of two in a cycle after a missing answer.
    pub(super) fn sort(&mut self, time_ns: u64) -> bool {
        if self.dialogue.reports_every_ns().is_some() {
            self.answered = true;
            return true;
        }
        let is_late = time_ns < self.sent_ns + self.soonest_ns || self.is_behind;
        if is_late {
            self.counts.late += 1;
            self.owed = self.owed.saturating_sub(1);
        } else if self.answered && self.owed == 0 {
            self.counts.duplicate += 1;
            return false;
        } else if self.answered {
            self.counts.late += 1;
            self.owed -= 1;
        }
        self.answered |= !is_late;
        true
    }

    /// Ends the cycle in which it was left out, if it was: an answer proves that it is a cycle behind;
    /// without one the answer that it owes is lost. True for the former.
    pub(super) fn end_probe(&mut self) -> bool {
        if !core::mem::take(&mut self.is_probed) {
            return false;
        }
        (self.owed, self.is_behind) = (0, self.answered);
        if self.is_behind {
            // the answer before was as late, and its cycle without one
            self.counts.late += 2;
            self.counts.missing += 1;
            self.answered = false;
        }
        self.is_behind
    }

    /// Skips the drive in the next cycle if its answers may be a cycle late: one is missing, so later ones
    /// may answer earlier frames.
    pub(super) fn probe(&mut self) {
        let answers = self.dialogue.reports_every_ns().is_none();
        self.is_probed = answers && self.phase == Phase::Enabled && self.owed > 0 && self.silent == 0;
    }
}
