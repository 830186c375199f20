//! Real-time checks that are not tests: one step is one check.

use crate::clock;
use crate::evidence::{Record, Span};
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::witness::{Watch, Witness};

/// Exit codes of `motorium run` that a stopped machine can cause: a safe stop, lost steps, an expectation
/// that does not hold (`tools/src/exit.rs`).
pub(crate) const RUN: &[i32] = &[4, 7, 8];
/// Exit code of `motorium bench latency --ratchet` for a slowdown.
pub(crate) const RATCHET: &[i32] = &[6];

/// Runs a check in real time and observes the host meanwhile. A failure that depends on time is
/// inconclusive if the host kept the machine from running; `codes` are the exit codes of such failures.
pub(crate) fn measured(
    watch: Watch,
    codes: &[i32],
    check: impl FnOnce() -> Result<Outcome, Failure>,
) -> Result<Outcome, Failure> {
    let witness = Witness::start(watch);
    let start = clock::now();
    let result = check();
    let window = Span { start, end: clock::now() };
    judge(result, codes, window, &witness.stop())
}

fn judge(
    result: Result<Outcome, Failure>,
    codes: &[i32],
    window: Span,
    record: &Record,
) -> Result<Outcome, Failure> {
    let mut outcome = match result {
        Ok(outcome) => outcome,
        Err(failure) => {
            let disturbance = record.disturbance(window).filter(|_| failure.depends_on_time(codes));
            let Some(disturbance) = disturbance else { return Err(failure) };
            Outcome { inconclusive: vec![format!("{failure}: {disturbance}")], ..Outcome::default() }
        }
    };
    outcome.real_time += 1;
    outcome.notes.push(record.description());
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;
    use std::process::ExitStatus;

    use super::*;
    use crate::evidence::Sample;
    use crate::proc::CoreTicks;

    const WINDOW: Span = Span { start: 0.0, end: 10.0 };

    /// The host took this many ticks of 1000 from the only core.
    fn stolen(steal: u64) -> Record {
        let sample = |time, total, steal| Sample { time, cores: vec![CoreTicks { core: 0, total, steal }] };
        Record { samples: vec![sample(0.0, 0, 0), sample(10.0, 1000, steal)], ..Record::default() }
    }

    fn ended(code: i32) -> Failure {
        Failure::Ended { command: "motorium run".to_string(), status: ExitStatus::from_raw(code << 8) }
    }

    #[test]
    fn only_failures_that_depend_on_time_are_inconclusive() {
        let inconclusive = |failure| judge(Err(failure), RUN, WINDOW, &stolen(60)).is_ok();
        assert!(inconclusive(ended(7)) && inconclusive(Failure::RealTime("5 lost".to_string())));
        assert!(!inconclusive(ended(1)) && !inconclusive(ended(101)) && !inconclusive(ended(6)));
        assert!(!inconclusive(Failure::Check("state hashes differ".to_string())));
        let crashed = Failure::Ended { command: String::new(), status: ExitStatus::from_raw(11) };
        assert!(!inconclusive(crashed));
    }

    #[test]
    fn undisturbed_failure_stays_one() {
        let result = judge(Err(ended(7)), RUN, WINDOW, &stolen(40));
        assert!(matches!(result, Err(Failure::Ended { .. })), "{result:?}");
    }

    #[test]
    fn passed_check_counts_even_if_disturbed() {
        let outcome = judge(Ok(Outcome::default()), RUN, WINDOW, &stolen(60)).expect("passed");
        assert_eq!((outcome.real_time, outcome.inconclusive.len()), (1, 0));
        assert!(outcome.notes[0].starts_with("the host took 600 ms (6.00 %)"), "{:?}", outcome.notes);
    }

    #[test]
    fn exit_codes_match_the_table_of_the_command() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/src/exit.rs");
        let source = std::fs::read_to_string(path).expect("the table of exit codes");
        for (name, code) in
            [("SafeStop", RUN[0]), ("Incomplete", RUN[1]), ("Unmet", RUN[2]), ("Slower", RATCHET[0])]
        {
            assert!(source.contains(&format!("    {name} = {code}, ")), "{name}");
        }
    }
}
