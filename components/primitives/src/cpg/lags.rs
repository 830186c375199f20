//! Phase lags between pairs of oscillators, and whether they contradict each other.

use std::f64::consts::{PI, TAU};

/// By how much one oscillator is to be ahead of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// The oscillator that is led.
    pub follower: usize,
    /// The oscillator that leads.
    pub leader: usize,
    /// `phi_leader - phi_follower`, rad.
    pub ahead: f64,
}

/// Lags that are no pattern.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LagError {
    /// An oscillator that does not exist.
    #[error("a lag of oscillator {found}: there are {oscillators}, counted from 0")]
    NoSuchOscillator {
        /// Index named.
        found: usize,
        /// Number that exists.
        oscillators: usize,
    },
    /// A lag that is not a number.
    #[error("the lag between oscillators {follower} and {leader} is {ahead}, expected a finite number")]
    NotFinite {
        /// The one that is led.
        follower: usize,
        /// The one that leads.
        leader: usize,
        /// The lag.
        ahead: f64,
    },
    /// The lags round a loop do not add up to whole turns.
    #[error(
        "oscillator {leader} is to be {ahead:.4} rad ahead of {follower}, but the lags on the other way round make it {implied:.4}: the loop does not close"
    )]
    Inconsistent {
        /// The one that is led.
        follower: usize,
        /// The one that leads.
        leader: usize,
        /// The lag given.
        ahead: f64,
        /// Lag implied by the others.
        implied: f64,
    },
}

/// Tolerance of the sum of lags round a loop, rad: the loss of printed digits.
const TOLERANCE: f64 = 1e-3;

/// One phase for each oscillator whose differences are the lags given, rad. The first oscillator of every connected group
/// has phase 0.
///
/// # Errors
/// Lags that contradict each other (`phi_ij` and `phi_ji` are a loop, too), oscillators that do not exist, numbers that
/// are none.
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

/// An angle in (-pi, pi].
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
    fn the_lags_of_a_trot_are_consistent_and_give_its_phases() {
        let lags = [lag(0, 1, PI), lag(1, 0, -PI), lag(0, 2, -PI), lag(1, 3, PI), lag(2, 3, PI)];
        let phases = consistent_phases(4, &lags).unwrap();
        for (found, expected) in phases.iter().zip([0.0, PI, PI, 0.0]) {
            assert!(wrapped(found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_loop_that_does_not_close_is_refused_with_the_lag_at_fault() {
        let lags = [lag(0, 1, 2.0), lag(1, 2, 2.0), lag(2, 0, 2.0)];
        let error = consistent_phases(3, &lags).unwrap_err();
        assert!(matches!(error, LagError::Inconsistent { .. }));
        assert!(error.to_string().contains("does not close"), "{error}");
        assert!(consistent_phases(3, &[lag(0, 1, 2.0), lag(1, 2, 2.0), lag(2, 0, TAU - 4.0)]).is_ok());
    }

    #[test]
    fn lags_there_and_back_must_be_opposite() {
        assert!(consistent_phases(2, &[lag(0, 1, 1.0), lag(1, 0, 1.0)]).is_err());
        assert!(consistent_phases(2, &[lag(0, 1, 1.0), lag(1, 0, -1.0)]).is_ok());
        assert!(
            consistent_phases(2, &[lag(0, 1, PI), lag(1, 0, PI)]).is_ok(),
            "half a turn is its own opposite"
        );
    }

    #[test]
    fn an_oscillator_that_is_not_there_is_refused_by_number() {
        let error = consistent_phases(2, &[lag(0, 5, 1.0)]).unwrap_err().to_string();
        assert_eq!(error, "a lag of oscillator 5: there are 2, counted from 0");
    }
}
