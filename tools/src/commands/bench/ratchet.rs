//! The ratchet (`--ratchet`): fails if the ratio of a hop, release or chain to the floor of the same run
//! exceeds its bound.

use std::process::ExitCode;

use motorium_benches::latency::{Bench, Case, Measurement, catalogue};
use motorium_benches::{Distribution, MeasureError};

use crate::out::outln;
use crate::{exit, style};

/// Number of rounds whose median is used, so that one round disturbed by another process or the host has no
/// effect.
const ROUNDS: usize = 5;
/// Number of additional rounds before a failure.
const MORE_ROUNDS: usize = 4;

/// The compared measurements and the largest ratio that passes. It is well above the normal variation of a
/// machine, so that noise passes but an additional wake-up, sleep or copy does not.
struct Bound {
    what: &'static str,
    of: &'static str,
    to: &'static str,
    /// Percentile of the measurement; the floor uses the median.
    share: f64,
    at_most: f64,
}

const BOUNDS: [Bound; 6] = [
    Bound {
        what: "blocking hop on one core / raw futex",
        of: "hop.blocking.same.512",
        to: "floor.futex.same",
        share: 0.5,
        at_most: 1.8,
    },
    Bound {
        what: "blocking hop across cores / raw futex",
        of: "hop.blocking.across.512",
        to: "floor.futex.across",
        share: 0.5,
        at_most: 0.6,
    },
    Bound {
        what: "polling hop across cores / cache line",
        of: "hop.polling.across.512",
        to: "floor.cache-line",
        share: 0.5,
        at_most: 12.0,
    },
    Bound {
        what: "release lateness, p50 / plain clock_nanosleep",
        of: "release.1khz",
        to: "floor.timer",
        share: 0.5,
        at_most: 0.05,
    },
    Bound {
        what: "release lateness, p90 / plain clock_nanosleep",
        of: "release.1khz",
        to: "floor.timer",
        share: 0.9,
        at_most: 0.5,
    },
    Bound {
        what: "chain of 4 processes / the same with a bare futex",
        of: "chain.4",
        to: "floor.chain.4",
        share: 0.5,
        at_most: 2.5,
    },
];

/// Result for one bound.
#[derive(Debug, PartialEq)]
struct MeasuredBound {
    /// Median of the rounds.
    ratio: f64,
    rounds: Vec<f64>,
    held: bool,
}

/// Measures rounds until their median is decided.
fn measure_bound<E>(at_most: f64, mut round: impl FnMut() -> Result<f64, E>) -> Result<MeasuredBound, E> {
    let mut rounds = Vec::new();
    while rounds.len() < ROUNDS || (rounds.len() < ROUNDS + MORE_ROUNDS && middle(&rounds) > at_most) {
        rounds.push(round()?);
    }
    let ratio = middle(&rounds);
    Ok(MeasuredBound { ratio, rounds, held: ratio <= at_most })
}

/// Measures and checks the bounds.
pub(super) fn run(bench: &Bench<'_>) -> anyhow::Result<ExitCode> {
    let bench = Bench {
        program: bench.program.clone(),
        registry: bench.registry,
        places: bench.places,
        fifo: bench.fifo,
        samples: 4_000,
        paced: 1_000,
        seconds: 1,
        fast_seconds: 1,
        panda_seconds: 1,
        loader: bench.loader.clone(),
    };
    let mut failed = false;
    // Bounds of the same pair use the same rounds.
    for bounds in BOUNDS.chunk_by(|one, next| (one.of, one.to) == (next.of, next.to)) {
        let mut taken: Vec<[Measurement; 2]> = Vec::new();
        for bound in bounds {
            if bench.places.other.is_none() && (bound.to.contains("across") || bound.to.contains("line")) {
                outln!("{}: not measured, it needs a second core", bound.what);
                continue;
            }
            let mut next = 0;
            let measured = measure_bound(bound.at_most, || {
                if next == taken.len() {
                    taken.push(pair(&bench, bound)?);
                }
                let [ours, floor] = &taken[next];
                next += 1;
                Ok::<_, MeasureError>(ratio(&ours.ns, &floor.ns, bound.share))
            })?;
            let verdict = if measured.held { style::good("held") } else { style::error("slower") };
            failed |= !measured.held;
            let all: Vec<String> = measured.rounds.iter().map(|ratio| format!("{ratio:.4}")).collect();
            outln!(
                "{verdict} {}: {:.4}, at most {} (rounds: {})",
                bound.what,
                measured.ratio,
                bound.at_most,
                all.join(" ")
            );
        }
    }
    Ok(if failed { exit::slower() } else { ExitCode::SUCCESS })
}

fn ratio(ours: &Distribution, floor: &Distribution, share: f64) -> f64 {
    let ours = if share == 0.5 { ours.p50 } else { ours.quantile(share) };
    ours as f64 / floor.p50.max(1) as f64
}

/// Measures both in direct succession, so that a longer disturbance of the machine affects both.
fn pair(bench: &Bench<'_>, bound: &Bound) -> Result<[Measurement; 2], MeasureError> {
    let case = |name: &str| -> Result<Case, MeasureError> {
        let case = catalogue().into_iter().find(|case| case.name == name);
        case.ok_or_else(|| MeasureError::Ended(format!("unknown case `{name}`")))
    };
    let floor = bench.measure(&case(bound.to)?)?;
    Ok([bench.measure(&case(bound.of)?)?, floor])
}

fn middle(ratios: &[f64]) -> f64 {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the verdict on the results of rounds in sequence.
    fn measured(at_most: f64, rounds: &[f64]) -> MeasuredBound {
        let mut rounds = rounds.iter().copied();
        measure_bound(at_most, || rounds.next().ok_or("no more rounds than needed")).unwrap()
    }

    #[test]
    fn one_disturbed_round_does_not_move_the_median() {
        assert_eq!(middle(&[1.0, 1.1, 50.0, 1.2, 1.05]), 1.1);
        assert_eq!(middle(&[]), f64::INFINITY);
    }

    #[test]
    fn two_disturbed_rounds_of_five_do_not_fail_it() {
        let seen = measured(1.8, &[1.1, 50.0, 1.2, 50.0, 1.1]);
        assert!(seen.held && seen.rounds.len() == 5, "{seen:?}");
    }

    #[test]
    fn slow_ratchet_rounds_are_repeated_before_failing() {
        let noise = measured(1.8, &[2.0, 2.0, 2.0, 1.1, 1.1, 1.1, 1.2]);
        assert!(noise.held && noise.rounds.len() == 7, "{noise:?}");
        let slow = measured(1.8, &[2.0; 9]);
        assert!(!slow.held && slow.rounds.len() == 9, "{slow:?}");
    }

    #[test]
    fn ratio_is_percentile_to_median_of_floor() {
        let ours = Distribution::from_samples((1..=1_000).collect());
        let floor = Distribution::from_samples(vec![50; 10]);
        assert_eq!((ratio(&ours, &floor, 0.5), ratio(&ours, &floor, 0.9)), (10.0, 18.0));
    }

    #[test]
    fn cases_of_the_bounds_are_in_the_catalogue() {
        for bound in &BOUNDS {
            for name in [bound.of, bound.to] {
                assert!(catalogue().iter().any(|case| case.name == name), "{name}");
            }
        }
    }
}
