//! Assignment of a drive's answers to the cycles in which they were requested.

use super::Counts;

/// Cycles of silence after which a drive counts as lost.
pub const LOST_AFTER: u32 = 3;

/// Answers of one drive, and the frames that it has not answered yet.
#[derive(Clone, Debug)]
pub(super) struct Answers {
    /// `true` if the drive reports unsolicited, so its messages answer no frame.
    is_unsolicited: bool,
    /// Number of frames on its bus in this cycle after which the drive has been queried; `None` if it is not
    /// queried.
    pub(super) asked_by: Option<usize>,
    pub(super) asked: bool,
    pub(super) answered: bool,
    /// `true` if the drive has answered at least once.
    pub(super) is_found: bool,
    /// Unanswered frames of past cycles; their answers may still arrive.
    owed: u32,
    /// `true` if the drive is skipped in this cycle; any answer from it belongs to an earlier frame.
    pub(super) is_probed: bool,
    /// `true` if every answer of the drive comes a cycle late.
    is_behind: bool,
    pub(super) sent_ns: u64,
    /// Shortest time from sending a frame to the end of its answer, ns.
    pub(super) soonest_ns: u64,
    /// Number of cycles without an answer.
    pub(super) silent: u32,
}

impl Answers {
    /// Expects answers no earlier than `soonest_ns` after their frames.
    pub(super) fn new(is_unsolicited: bool, soonest_ns: u64) -> Self {
        Self {
            is_unsolicited,
            asked_by: None,
            asked: false,
            answered: false,
            is_found: false,
            owed: 0,
            is_probed: false,
            is_behind: false,
            sent_ns: 0,
            soonest_ns,
            silent: 0,
        }
    }

    /// Returns `true` if the drive was queried in this cycle and has not answered.
    pub(super) fn is_awaited(&self) -> bool {
        self.asked && !self.answered && !self.is_unsolicited
    }

    /// Returns `true` if the drive has just answered.
    pub(super) fn is_present(&self) -> bool {
        self.silent == 0
    }

    /// Returns `true` if the drive has been silent for too long.
    pub(super) fn is_lost(&self) -> bool {
        self.silent >= LOST_AFTER
    }

    /// Forgets unanswered frames.
    pub(super) fn forget(&mut self) {
        (self.owed, self.is_probed, self.is_behind) = (0, false, false);
    }

    /// Records an answer that identifies its request, so no earlier answers are outstanding.
    pub(super) fn settle(&mut self) {
        (self.answered, self.owed) = (true, 0);
    }

    /// Assigns an answer received at `time_ns` to a cycle and counts it. Returns `false` if the answer must
    /// be discarded.
    ///
    /// Answers carry no sequence number. An answer that arrives too early for this cycle's frame belongs to
    /// an earlier cycle. If the previous cycle had no answer and this cycle has two, the first one also
    /// belongs to an earlier cycle.
    pub(super) fn sort(&mut self, time_ns: u64, counts: &mut Counts) -> bool {
        if self.is_unsolicited {
            self.answered = true;
            return true;
        }
        let is_late = time_ns < self.sent_ns + self.soonest_ns || self.is_behind;
        if is_late {
            counts.late += 1;
            self.owed = self.owed.saturating_sub(1);
        } else if self.answered && self.owed == 0 {
            counts.duplicate += 1;
            return false;
        } else if self.answered {
            counts.late += 1;
            self.owed -= 1;
        }
        self.answered |= !is_late;
        true
    }

    /// Records that the frames of this cycle, `count` on its bus, were sent at `now_ns`.
    pub(super) fn sent(&mut self, count: usize, now_ns: u64, counts: &mut Counts) {
        if self.asked_by.is_none_or(|by| by > count) {
            return;
        }
        // answers received since the end of the last cycle belong to an earlier frame
        counts.late += u64::from(self.answered && !self.is_unsolicited);
        self.owed = self.owed.saturating_sub(u32::from(self.answered));
        (self.asked, self.answered, self.sent_ns) = (true, false, now_ns);
    }

    /// Updates the counters at the end of a cycle. `is_due` is `true` if the drive is queried in every cycle.
    pub(super) fn count(&mut self, is_missing: bool, is_due: bool, counts: &mut Counts) {
        // a drive that has never answered, such as before power-up, is waited for
        let is_lost = is_missing && self.is_found;
        counts.awaited += u64::from(is_missing && !self.is_found);
        counts.missing += u64::from(is_lost);
        self.owed = self.owed.saturating_add(u32::from(is_lost && !self.is_unsolicited));
        if (self.asked || is_due) && !self.is_probed {
            self.silent = if is_missing { self.silent + 1 } else { 0 };
        }
    }

    /// Enters the interval between two cycles.
    pub(super) fn end_cycle(&mut self) {
        self.answered &= self.is_probed;
        self.asked = false;
    }

    /// Ends the cycle in which the drive was skipped, if any. An answer in that cycle proves that the drive
    /// is a cycle behind: it is lost, and the function returns `true`. Without an answer, the outstanding one
    /// counts as lost.
    pub(super) fn end_probe(&mut self, counts: &mut Counts) -> bool {
        if !core::mem::take(&mut self.is_probed) {
            return false;
        }
        (self.owed, self.is_behind) = (0, self.answered);
        if self.is_behind {
            // the previous answer was just as late, and its cycle had none
            counts.late += 2;
            counts.missing += 1;
            self.answered = false;
            // three answers are missing: the previous one, the one mistaken for a timely answer, and the one
            // of the skipped cycle
            self.silent = LOST_AFTER;
        }
        self.is_behind
    }

    /// Skips an enabled drive in the next cycle if its answers may be a cycle late: after a missing answer,
    /// all later ones may belong to the preceding frames.
    pub(super) fn probe(&mut self, is_enabled: bool) {
        self.is_probed = is_enabled && !self.is_unsolicited && self.owed > 0 && self.is_present();
    }
}
