//! Implausible readings: positions and velocities that a joint cannot have, and positions at which no drive
//! is enabled.

use super::{Link, Phase, WrongSetting};
use crate::drive::Feedback;
use crate::frame::DecodeError;
use crate::protocols::dialogue::Dialogue as _;

/// Highest externally imposed velocity, as a multiple of the drive's range, such as when a disabled joint is
/// moved by hand.
const FASTER: f64 = 2.0;
/// Difference that is always allowed between two consecutive readings, rad, to cover encoder steps and
/// backlash.
const JUMP: f64 = 0.1;
/// Position beyond which 32-bit floating-point numbers do not resolve a hundredth of a radian, rad.
const FARTHEST: f64 = 1e5;
/// Velocity beyond which a reading is implausible, as a multiple of the drive's range.
const FASTEST: f64 = 20.0;

impl Link {
    /// Returns `true` if the state message is overdue, for a drive whose answers lack the state.
    pub(super) fn is_state_overdue(&self) -> bool {
        let within_ns = self.dialogue.state_within_ns();
        within_ns
            .zip(self.state_ns)
            .is_some_and(|(within_ns, state_ns)| state_ns + within_ns < self.answers.sent_ns)
    }

    /// Refuses an answer with an impossible position. While the drive follows commands, also refuses a
    /// position farther from the last one than the joint can have moved.
    pub(super) fn refuse_implausible(
        &mut self,
        feedback: &Feedback,
        time_ns: u64,
    ) -> Result<(), DecodeError> {
        let fastest = self.ranges.velocity.max;
        // a disabled joint may be moved by hand, and homing changes the zero position
        let follows = matches!(self.phase, Phase::Enabling | Phase::Enabled);
        let moved = self.reading.received_ns.filter(|_| follows).map(|received_ns| {
            // the reading may be as old as the time between two readings
            let between_ns = time_ns.saturating_sub(received_ns);
            let age_ns = self.dialogue.reports_every_ns().unwrap_or(between_ns.max(self.answers.soonest_ns));
            let seconds = (between_ns + age_ns) as f64 * 1e-9;
            let moved = (feedback.position - self.gear.to_drive(self.reading.position)).abs();
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

    /// Returns the setting that prevents enabling: a position outside of the joint's range.
    pub(super) fn out_of_range(&self) -> Option<WrongSetting> {
        let ([lower, upper], margin) = self.limits;
        let found = self.reading.position;
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
