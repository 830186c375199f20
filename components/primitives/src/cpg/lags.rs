//! Phase lags between pairs of oscillators, and a check that they are consistent.

use std::f64::consts::{PI, TAU};

/// Desired phase lag of one oscillator (`follower`) behind another (`leader`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Index of the lagging oscillator.
    pub follower: usize,
    /// Index of the leading oscillator.
    pub leader: usize,
    /// Lead `phi_leader - phi_follower`, rad.
    pub ahead: f64,
}

/// Error returned when phase lags do not form a consistent pattern.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LagError {
    /// An index is out of range.
    #[error("a lag refers to oscillator {found}, expected an index below {oscillators}")]
    NoSuchOscillator {
        /// Index found.
        found: usize,
        /// Number of oscillators.
        oscillators: usize,
    },
    /// A lag is not finite.
    #[error("the lag between oscillators {follower} and {leader} is {ahead}, expected a finite number")]
    NotFinite {
        /// Index of the lagging oscillator.
        follower: usize,
        /// Index of the leading oscillator.
        leader: usize,
        /// Lag found, rad.
        ahead: f64,
    },
    /// The lags around a loop do not sum to a multiple of 2 pi.
    #[error(
        "oscillator {leader} must lead {follower} by {ahead:.4} rad, but the other lags of the loop imply {implied:.4}: the loop does not close"
    )]
    Inconsistent {
        /// Index of the lagging oscillator.
        follower: usize,
        /// Index of the leading oscillator.
        leader: usize,
        /// Lag found, rad.
        ahead: f64,
        /// Lag implied by the other lags, rad.
        implied: f64,
    },
}

/// Tolerance of the sum of lags around a loop, rad. Covers the rounding of printed lags.
const TOLERANCE: f64 = 1e-3;

/// Computes one phase per oscillator, rad, such that the phase differences equal the given lags. The first
/// oscillator of every connected group has phase 0.
///
/// # Errors
/// [`LagError`] if lags contradict each other (a lag in each direction between two oscillators also forms a
/// loop), an oscillator does not exist, or a lag is not finite.
pub fn consistent_phases(oscillators: usize, lags: &[Lag]) -> Result<Vec<f64>, LagError> {
    for lag in lags {
        for found in [lag.follower, lag.leader] {
            if found >= oscillators {
                return Err(LagError::NoSuchOscillator { found, oscillators });
            }
        }
        if !lag.ahead.is_finite() {
            let Lag { follower, leader, ahead } = *lag;
            return Err(LagError::NotFinite { follower, leader, ahead });
        }
    }
    let mut phases: Vec<Option<f64>> = vec![None; oscillators];
    let mut open = Vec::new();
    for root in 0..oscillators {
        if phases[root].is_some() {
            continue;
        }
        phases[root] = Some(0.0);
        open.push(root);
        while let Some(here) = open.pop() {
            let phase = phases[here].unwrap_or(0.0);
            for lag in lags {
                let (there, expected) = match here {
                    _ if lag.follower == here => (lag.leader, phase + lag.ahead),
                    _ if lag.leader == here => (lag.follower, phase - lag.ahead),
                    _ => continue,
                };
                if phases[there].is_none() {
                    phases[there] = Some(expected);
                    open.push(there);
                }
            }
        }
    }
    let phases: Vec<f64> = phases.into_iter().map(|phase| phase.unwrap_or(0.0).rem_euclid(TAU)).collect();
    for lag in lags {
        let implied = phases[lag.leader] - phases[lag.follower];
        if wrapped(implied - lag.ahead).abs() > TOLERANCE {
            let Lag { follower, leader, ahead } = *lag;
            return Err(LagError::Inconsistent { follower, leader, ahead, implied: wrapped(implied) });
        }
    }
    Ok(phases)
}

/// Wraps an angle to (-pi, pi].
pub(super) fn wrapped(angle: f64) -> f64 {
    PI - (PI - angle).rem_euclid(TAU)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lag(follower: usize, leader: usize, ahead: f64) -> Lag {
        Lag { follower, leader, ahead }
    }

    #[test]
    fn trot_lags_are_consistent_and_yield_its_phases() {
        let lags = [lag(0, 1, PI), lag(1, 0, -PI), lag(0, 2, -PI), lag(1, 3, PI), lag(2, 3, PI)];
        let phases = consistent_phases(4, &lags).unwrap();
        for (found, expected) in phases.iter().zip([0.0, PI, PI, 0.0]) {
            assert!(wrapped(found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn open_loop_is_rejected_and_names_the_lag() {
        let lags = [lag(0, 1, 2.0), lag(1, 2, 2.0), lag(2, 0, 2.0)];
        let error = consistent_phases(3, &lags).unwrap_err();
        assert!(matches!(error, LagError::Inconsistent { .. }));
        assert!(error.to_string().contains("does not close"), "{error}");
        assert!(consistent_phases(3, &[lag(0, 1, 2.0), lag(1, 2, 2.0), lag(2, 0, TAU - 4.0)]).is_ok());
    }

    #[test]
    fn reverse_lags_must_be_opposite() {
        assert!(consistent_phases(2, &[lag(0, 1, 1.0), lag(1, 0, 1.0)]).is_err());
        assert!(consistent_phases(2, &[lag(0, 1, 1.0), lag(1, 0, -1.0)]).is_ok());
        assert!(
            consistent_phases(2, &[lag(0, 1, PI), lag(1, 0, PI)]).is_ok(),
            "half a turn is its own opposite"
        );
    }

    #[test]
    fn unknown_oscillator_is_rejected_by_index() {
        let error = consistent_phases(2, &[lag(0, 5, 1.0)]).unwrap_err().to_string();
        assert_eq!(error, "a lag refers to oscillator 5, expected an index below 2");
    }
}
