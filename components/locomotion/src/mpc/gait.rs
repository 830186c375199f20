//! Gaits: schedules of foot contacts.

/// A periodic gait: each foot is in stance for a fraction of the period, then swings.
///
/// ```
/// use motorium_locomotion::mpc::Gait;
///
/// // a trot: two diagonals in turn
/// let trot = Gait::new(0.4, 0.5, vec![0.0, 0.5, 0.5, 0.0])?;
/// assert_eq!(trot.swing_time(), 0.2);
/// # Ok::<(), motorium_locomotion::mpc::GaitError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Gait {
    period: f64,
    duty: f64,
    offsets: Vec<f64>,
}

/// Error returned when the parameters of a gait are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GaitError {
    /// The period is not positive.
    #[error("the gait has a period of {0} s, expected more than 0 s")]
    Period(f64),
    /// The duty factor is not a fraction of the period.
    #[error("a foot is in stance for a fraction {0} of the period, expected more than 0 and less than 1")]
    Duty(f64),
    /// The offset is not a fraction of the period.
    #[error("a foot has an offset of {0} periods, expected 0 to 1")]
    Offset(f64),
}

impl Gait {
    /// Creates a gait with this period \[s\]. Each foot is in stance for the fraction `duty` of the period,
    /// starting at its phase in `offsets` (fractions of the period).
    ///
    /// # Errors
    /// [`GaitError`] if the period is not positive, or if the duty factor or an offset is out of range.
    pub fn new(period: f64, duty: f64, offsets: Vec<f64>) -> Result<Self, GaitError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(GaitError::Period(period));
        }
        if !(duty > 0.0 && duty < 1.0) {
            return Err(GaitError::Duty(duty));
        }
        match offsets.iter().find(|offset| !(0.0..=1.0).contains(*offset)) {
            Some(offset) => Err(GaitError::Offset(*offset)),
            None => Ok(Self { period, duty, offsets }),
        }
    }

    /// Returns the duration of each swing \[s\].
    pub fn swing_time(&self) -> f64 {
        (1.0 - self.duty) * self.period
    }

    /// Returns the duration of each stance \[s\].
    pub fn stance_time(&self) -> f64 {
        self.duty * self.period
    }

    /// Returns the number of feet.
    pub fn feet(&self) -> usize {
        self.offsets.len()
    }

    /// Returns the start of the swing in progress for `foot` at `time` \[s\], assuming that the gait
    /// continues indefinitely.
    fn swing_began(&self, foot: usize, time: f64) -> Option<f64> {
        let phase = (time / self.period - self.offsets[foot]).rem_euclid(1.0);
        (phase >= self.duty).then_some(time - (phase - self.duty) * self.period)
    }
}

/// A gait that can be started and stopped. All feet are in stance before the start and after the end.
///
/// A foot that would be in mid-swing at the start stays in stance until its next swing. A foot in the air at
/// the end lands as planned. The executed schedule therefore matches the predicted schedule.
#[derive(Clone, Debug, PartialEq)]
pub struct Stepping {
    gait: Gait,
    began: Option<f64>,
    ends: Option<f64>,
}

/// Tolerance for rounding of times, s.
const SAME: f64 = 1e-9;

impl Stepping {
    /// Creates a stopped gait, with all feet in stance.
    pub fn new(gait: Gait) -> Self {
        Self { gait, began: None, ends: None }
    }

    /// Returns the gait.
    pub fn gait(&self) -> &Gait {
        &self.gait
    }

    /// Starts (`steps` is `true`) or stops stepping at `time` \[s\]. No effect if already in that state.
    pub fn set(&mut self, steps: bool, time: f64) {
        match (steps, self.began, self.ends) {
            // stepping starts again once all feet have landed
            (true, None, _) => (self.began, self.ends) = (Some(time), None),
            (true, Some(_), Some(ends)) if time >= ends + self.gait.swing_time() => {
                (self.began, self.ends) = (Some(time), None);
            }
            (false, Some(_), None) => self.ends = Some(time),
            _ => {}
        }
    }

    /// Returns to stance on all feet immediately.
    pub fn reset(&mut self) {
        (self.began, self.ends) = (None, None);
    }

    /// Returns the start and end of the swing of `foot` that is in progress at `time` \[s\]; `None` during
    /// stance.
    pub fn swing(&self, foot: usize, time: f64) -> Option<(f64, f64)> {
        let start = self.began?;
        let began = start + self.gait.swing_began(foot, time - start + SAME)?;
        let swings = began >= start - SAME && self.ends.is_none_or(|ends| began < ends - SAME);
        swings.then(|| (began, began + self.gait.swing_time()))
    }

    /// Returns the time at which `foot` lifts off for its next swing \[s\]; infinite if no swing follows. The
    /// foot must be in stance at `time` \[s\].
    pub fn lifts(&self, foot: usize, time: f64) -> f64 {
        let Some(start) = self.began else { return f64::INFINITY };
        let gait = &self.gait;
        let phase = ((time - start + SAME) / gait.period - gait.offsets[foot]).rem_euclid(1.0);
        let wait = (gait.duty - phase).rem_euclid(1.0) * gait.period;
        let lifts = time + wait;
        if self.ends.is_none_or(|ends| lifts < ends - SAME) { lifts } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trot() -> Stepping {
        Stepping::new(Gait::new(0.4, 0.6, vec![0.0, 0.5, 0.5, 0.0]).unwrap())
    }

    fn swings(stepping: &Stepping, time: f64) -> Vec<bool> {
        (0..4).map(|foot| stepping.swing(foot, time).is_some()).collect()
    }

    #[test]
    fn trot_alternates_its_diagonals() {
        let mut stepping = trot();
        stepping.set(true, 10.0);
        // the first swings start at 0.6 of the period; the other diagonal's start 0.5 later, at 0.1 of the
        // period
        let mut share = [0; 4];
        for step in 0..4000 {
            let time = 10.0 + f64::from(step) * 1e-3;
            let swings = swings(&stepping, time);
            assert_eq!((swings[0], swings[1]), (swings[3], swings[2]));
            assert!(!(swings[0] && swings[1]), "{time}");
            swings.iter().zip(&mut share).for_each(|(swings, share)| *share += i32::from(*swings));
        }
        for share in share {
            assert!((f64::from(share) / 4000.0 - 0.4).abs() < 1e-3, "{share}");
        }
    }

    #[test]
    fn swing_times_do_not_depend_on_the_query_time() {
        let mut stepping = trot();
        stepping.set(true, 1.0);
        for step in 0..1600 {
            let time = 1.0 + f64::from(step) * 1e-3;
            for foot in 0..4 {
                match stepping.swing(foot, time) {
                    Some((begins, ends)) => {
                        assert!(begins <= time + 1e-6 && time < ends + 1e-6);
                        assert!((ends - begins - 0.16).abs() < 1e-9);
                        let middle = stepping.swing(foot, 0.5 * (begins + ends)).unwrap();
                        assert!((middle.0 - begins).abs() < 1e-9);
                        assert!(stepping.swing(foot, begins - 1e-6).is_none());
                        assert!((stepping.lifts(foot, begins - 1e-3) - begins).abs() < 1e-8);
                    }
                    None => assert!(stepping.lifts(foot, time) > time - 1e-6),
                }
            }
        }
    }

    #[test]
    fn feet_stand_before_the_start_and_land_after_the_end() {
        let mut stepping = trot();
        assert_eq!(swings(&stepping, 5.0), [false; 4]);
        assert_eq!(stepping.lifts(0, 5.0), f64::INFINITY);
        stepping.set(true, 5.0);
        // the other diagonal would have been in swing from 4.84 to 5.0
        assert_eq!(swings(&stepping, 5.0), [false; 4]);
        assert_eq!(swings(&stepping, 5.05), [false, true, true, false]);
        stepping.set(false, 5.1);
        assert_eq!(swings(&stepping, 5.15), [false, true, true, false], "the feet land as planned");
        assert_eq!(swings(&stepping, 5.25), [false; 4], "and no other foot lifts off");
        assert_eq!(stepping.lifts(0, 5.2), f64::INFINITY);
        // not before all feet have landed
        stepping.set(true, 5.15);
        assert_eq!(swings(&stepping, 5.25), [false; 4]);
        stepping.set(true, 6.0);
        assert_eq!(swings(&stepping, 6.05), [false, true, true, false]);
    }

    #[test]
    fn invalid_gaits_are_rejected() {
        let gait = |period, duty, offset| Gait::new(period, duty, vec![0.0, offset]).unwrap_err();
        assert_eq!(gait(0.0, 0.5, 0.5), GaitError::Period(0.0));
        assert_eq!(gait(0.4, 1.0, 0.5), GaitError::Duty(1.0));
        assert_eq!(gait(0.4, 0.5, 1.5), GaitError::Offset(1.5));
        assert!(matches!(gait(f64::NAN, 0.5, 0.5), GaitError::Period(_)));
    }
}
