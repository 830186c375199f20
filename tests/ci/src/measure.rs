//! Real-time checks that are not tests: one step is one check.

use std::process::{Command, Stdio};

use crate::clock;
use crate::evidence::{MIN_GAP_S, Record, Span};
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::witness::{Watch, Witness};

/// Exit codes of `motorium run` that a stopped machine can cause: a safe stop, lost steps, an expectation
/// that does not hold (`tools/src/exit.rs`).
pub(crate) const RUN: &[i32] = &[4, 7, 8];
/// Exit code of `motorium bench latency --ratchet` for a slowdown.
pub(crate) const RATCHET: &[i32] = &[6];

/// What a stopped machine does to a check.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sensitivity {
    /// Exit codes of failures that a stopped machine can cause.
    pub(crate) codes: &'static [i32],
    /// Shortest stop [s] that can cause them.
    pub(crate) endured_s: f64,
}

impl Sensitivity {
    /// Of a check that endures stops as short as real-time tests do.
    pub(crate) const fn usual(codes: &'static [i32]) -> Self {
        Self { codes, endured_s: MIN_GAP_S }
    }
}

/// Runs a check in real time and observes the host meanwhile. A failure that depends on time is
/// inconclusive if the host kept the machine from running.
pub(crate) fn measured(
    watch: Watch,
    sensitivity: Sensitivity,
    check: impl FnOnce() -> Result<Outcome, Failure>,
) -> Result<Outcome, Failure> {
    write_back();
    let witness = Witness::start(watch);
    let start = clock::now();
    let result = check();
    let window = Span { start, end: clock::now() };
    judge(result, sensitivity, window, &witness.stop())
}

/// Waits until the files of earlier steps are on the disk: a kernel without preemption delays real-time
/// threads while it writes them.
fn write_back() {
    let _ = Command::new("sync").stdin(Stdio::null()).status();
}

fn judge(
    result: Result<Outcome, Failure>,
    sensitivity: Sensitivity,
    window: Span,
    record: &Record,
) -> Result<Outcome, Failure> {
    let mut outcome = match result {
        Ok(outcome) => outcome,
        Err(failure) if !failure.depends_on_time(sensitivity.codes) => return Err(failure),
        Err(failure) => match record.disturbance(window, sensitivity.endured_s) {
            Some(disturbance) => {
                Outcome { inconclusive: vec![format!("{failure}: {disturbance}")], ..Outcome::default() }
            }
            None => return Err(Failure::RealTime(format!("{failure}; {}", record.description()))),
        },
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

    const SENSITIVITY: Sensitivity = Sensitivity::usual(RUN);
    const WINDOW: Span = Span { start: 0.0, end: 10.0 };

    /// The host took this many ticks of 1000 from the only core.
    fn stolen(steal: u64) -> Record {
        let sample = |time, total, steal| Sample { time, cores: vec![CoreTicks { core: 0, total, steal }] };
        Record { samples: vec![sample(0.0, 0, 0), sample(10.0, 1000, steal)], ..Record::default() }
    }

    fn ended(code: i32) -> Failure {
        let status = ExitStatus::from_raw(code << 8);
        Failure::Ended { command: "motorium run".to_string(), status, message: String::new() }
    }

    #[test]
    fn only_failures_that_depend_on_time_are_inconclusive() {
        let inconclusive = |failure| judge(Err(failure), SENSITIVITY, WINDOW, &stolen(60)).is_ok();
        assert!(inconclusive(ended(7)) && inconclusive(Failure::RealTime("5 lost".to_string())));
        assert!(!inconclusive(ended(1)) && !inconclusive(ended(101)) && !inconclusive(ended(6)));
        assert!(!inconclusive(Failure::Check("state hashes differ".to_string())));
        let status = ExitStatus::from_raw(11);
        let crashed = Failure::Ended { command: String::new(), status, message: String::new() };
        assert!(!inconclusive(crashed));
    }

    #[test]
    fn undisturbed_failure_stays_one() {
        let result = judge(Err(ended(7)), SENSITIVITY, WINDOW, &stolen(40));
        let Err(Failure::RealTime(text)) = result else { panic!("{result:?}") };
        assert!(text.contains("exit status: 7") && text.contains("the host took 400 ms (4.00 %)"), "{text}");
    }

    #[test]
    fn passed_check_counts_even_if_disturbed() {
        let outcome = judge(Ok(Outcome::default()), SENSITIVITY, WINDOW, &stolen(60)).expect("passed");
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
