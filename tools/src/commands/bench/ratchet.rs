//! The ratchet: fails when hops or releases have become plainly slower, by ratios to the floors of the same run.

use std::process::ExitCode;

use motorium_benches::MeasureError;
use motorium_benches::latency::{Bench, catalogue};

use crate::out::outln;
use crate::{exit, style};

/// Rounds of which the median counts: one that another process or the host of a virtual machine disturbs is left out.
const ROUNDS: usize = 5;
/// More rounds before it fails.
const MORE_ROUNDS: usize = 4;

/// What is compared with what, and the largest ratio of their medians that passes: well above what a machine shows on
/// its good and its bad days, so that noise does not fail it and another wake-up or copy on the way does.
struct Bound {
    what: &'static str,
    of: &'static str,
    to: &'static str,
    at_most: f64,
}

const BOUNDS: [Bound; 4] = [
    Bound {
        what: "blocking hop on one core / raw futex",
        of: "hop.blocking.same.512",
        to: "floor.futex.same",
        at_most: 1.8,
    },
    Bound {
        what: "blocking hop across cores / raw futex",
        of: "hop.blocking.across.512",
        to: "floor.futex.across",
        at_most: 1.3,
    },
    Bound {
        what: "polling hop across cores / cache line",
        of: "hop.polling.across.512",
        to: "floor.cache-line",
        at_most: 12.0,
    },
    Bound {
        what: "release lateness / plain clock_nanosleep",
        of: "release.1khz",
        to: "floor.timer",
        at_most: 0.2,
    },
];

/// Measures and judges.
pub(super) fn run(bench: &Bench<'_>) -> anyhow::Result<ExitCode> {
    let bench = Bench {
        program: bench.program.clone(),
        registry: bench.registry,
        places: bench.places,
        fifo: bench.fifo,
        samples: 4_000,
        paced: 1_000,
        seconds: 1,
        panda_seconds: 1,
        loader: bench.loader.clone(),
    };
    let mut failed = false;
    for bound in &BOUNDS {
        let mut ratios = Vec::new();
        if bench.places.other.is_none() && (bound.to.contains("across") || bound.to.contains("line")) {
            outln!("{}: not measured, it needs a second core", bound.what);
            continue;
        }
        while ratios.len() < ROUNDS
            || (ratios.len() < ROUNDS + MORE_ROUNDS && middle(&ratios) > bound.at_most)
        {
            ratios.push(ratio(&bench, bound)?);
        }
        let ratio = middle(&ratios);
        let verdict = if ratio <= bound.at_most { style::good("held") } else { style::error("slower") };
        failed |= ratio > bound.at_most;
        let all: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.3}")).collect();
        outln!("{verdict} {}: {ratio:.3}, at most {} (rounds: {})", bound.what, bound.at_most, all.join(" "));
    }
    Ok(if failed { exit::slower() } else { ExitCode::SUCCESS })
}

/// Both are measured one right after the other: what disturbs the machine for longer disturbs both.
fn ratio(bench: &Bench<'_>, bound: &Bound) -> Result<f64, MeasureError> {
    let measure = |name: &str| {
        let case = catalogue().into_iter().find(|case| case.name == name);
        bench.measure(&case.ok_or_else(|| MeasureError::Ended(format!("there is no case `{name}`")))?)
    };
    let (floor, ours) = (measure(bound.to)?, measure(bound.of)?);
    Ok(ours.ns.p50 as f64 / floor.ns.p50.max(1) as f64)
}

fn middle(ratios: &[f64]) -> f64 {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_disturbed_round_does_not_move_the_median() {
        assert_eq!(middle(&[1.0, 1.1, 50.0, 1.2, 1.05]), 1.1);
        assert_eq!(middle(&[]), f64::INFINITY);
    }

    #[test]
    fn what_the_bounds_compare_is_in_the_catalogue() {
        for bound in &BOUNDS {
            for name in [bound.of, bound.to] {
                assert!(catalogue().iter().any(|case| case.name == name), "{name}");
            }
        }
    }
}
