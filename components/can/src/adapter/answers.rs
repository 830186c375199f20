//! Assignment of a drive's answers to the cycles.

use super::{Link, Phase};
use crate::protocols::dialogue::Dialogue as _;

impl Link {
    /// Returns `true` if the answer of this cycle has arrived or, for a drive that reports unsolicited, if no
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

    /// Assigns an answer received at `time_ns` to a cycle and counts it. Returns `false` if the answer must
    /// be discarded.
    ///
    /// Answers carry no sequence number. An answer that arrives before this cycle's frame can have been
    /// answered belongs to an earlier cycle. So does the first of two answers in a cycle that follows a cycle
    /// without one.
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

    /// Ends the cycle in which the drive was left out, if any. An answer in that cycle proves that the drive
    /// is a cycle behind, and the function returns `true`. Without an answer, the owed one counts as lost.
    pub(super) fn end_probe(&mut self) -> bool {
        if !core::mem::take(&mut self.is_probed) {
            return false;
        }
        (self.owed, self.is_behind) = (0, self.answered);
        if self.is_behind {
            // the previous answer was just as late, and its cycle had none
            self.counts.late += 2;
            self.counts.missing += 1;
            self.answered = false;
        }
        self.is_behind
    }

    /// Leaves the drive out of the next cycle if its answers may be a cycle late: one answer is missing, so
    /// all later ones may belong to the preceding frames.
    pub(super) fn probe(&mut self) {
        let answers = self.dialogue.reports_every_ns().is_none();
        self.is_probed = answers && self.phase == Phase::Enabled && self.owed > 0 && self.silent == 0;
    }
}
