//! Readings that are not believed: positions and velocities that a joint cannot have, and positions at which
//! no drive is enabled.

use super::{Link, Phase, WrongSetting};
use crate::frame::DecodeError;
use crate::mit;

/// Velocities of the drive's range that a joint may move with from outside, as when it is off and moved by
/// hand.
const FASTER: f64 = 2.0;
/// Distance always allowed between two consecutive readings, rad: encoder steps and backlash.
const JUMP: f64 = 0.1;
/// Position beyond which 32-bit numbers do not resolve a hundredth of a radian, rad.
const FARTHEST: f64 = 1e5;
/// Velocities of the drive's range beyond which a reading is no velocity.
const FASTEST: f64 = 20.0;

impl Link {
    /// True if the message with its state is overdue, of a drive whose answers are without.
    pub(super) fn is_state_overdue(&self) -> bool {
        let within_ns = self.dialogue.state_within_ns();
        within_ns.zip(self.state_ns).is_some_and(|(within_ns, state_ns)| state_ns + within_ns < self.sent_ns)
    }

    /// Refuses an answer with a position that no drive has, or, while it follows
    /// commands, that is farther from the last one than it can have moved.
    pub(super) fn refuse_implausible(
        &mut self,
        feedback: &mit::Feedback,
        time_ns: u64,
    ) -> Result<(), DecodeError> {
        let fastest = self.ranges.velocity.max;
        // one that is off may be moved by hand, and one that is homed begins to count elsewhere
        let follows = matches!(self.phase, Phase::Enabling | Phase::Enabled);
        let moved = self.received_ns.filter(|_| follows).map(|received_ns| {
            // the reading may be as old as the time between two of them
            let between_ns = time_ns.saturating_sub(received_ns);
            let age_ns = self.dialogue.reports_every_ns().unwrap_or(between_ns.max(self.soonest_ns));
            let seconds = (between_ns + age_ns) as f64 * 1e-9;
            let moved = (feedback.position - self.gear.to_drive(self.position)).abs();
            (moved, FASTER * fastest * seconds + JUMP)
        });
        let field = if !feedback.position.is_finite()
            || feedback.position.abs() > FARTHEST
            || moved.is_some_and(|(moved, most)| moved > most)
        {
            "the position"
        } else if !feedback.velocity.is_finite() || feedback.velocity.abs() > FASTEST * fastest {
            "the velocity"
        } else {
            return Ok(());
        };
        self.counts.implausible += 1;
        Err(DecodeError::Implausible { field })
    }

    /// The reason for which it is not enabled: its position is outside of the joint's range.
    pub(super) fn out_of_range(&self) -> Option<WrongSetting> {
        let ([lower, upper], margin) = self.limits;
        let found = self.position;
        if (lower - margin..=upper + margin).contains(&found) {
            return None;
        }
        let turn = core::f64::consts::TAU / self.gear.ratio;
        let turns = ((lower + upper) / 2.0 - found) / turn;
        let turns = (turns.is_finite() && turns.abs() < 1e6).then(|| turns.round());
        let turns = turns.filter(|turns| (lower..=upper).contains(&(found + turns * turn)));
        let turns = turns.map(|turns| turns as i32 + self.gear.turns);
        Some(WrongSetting::Position { found, lower, upper, margin, turns })
    }
}
