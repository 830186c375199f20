//! Verdict on the test programs of a step.

use std::collections::BTreeMap;

use crate::evidence::{MIN_GAP_S, Record, Span};
use crate::libtest::{Outcome, Program};
use crate::outcome;

/// Judges the tests of a step.
///
/// A failed test is inconclusive if it runs in real time and the record, if there is one, shows a
/// disturbance by the host between the reservation of the machine and the end of the test. All other failed
/// tests fail the step, as does a crashed program, or a failure of cargo that no test explains.
pub(crate) fn judge(programs: &[Program], has_succeeded: bool, record: Option<&Record>) -> outcome::Outcome {
    let mut verdict = outcome::Outcome::default();
    let mut skipped: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for program in programs {
        let mut failed = 0;
        for (name, test) in &program.tests {
            let name = format!("{}: {name}", program.name);
            verdict.real_time += usize::from(test.real_time_from.is_some());
            match test.outcome {
                Outcome::Passed => {
                    if let Some(reason) = &test.skipped {
                        skipped.entry(reason).or_default().push(name);
                    }
                }
                Outcome::Ignored => skipped.entry("marked as ignored").or_default().push(name),
                Outcome::Failed => {
                    failed += 1;
                    let window = test.real_time_from.map(|start| Span { start, end: test.ended });
                    match window
                        .zip(record)
                        .and_then(|(window, record)| record.disturbance(window, MIN_GAP_S))
                    {
                        Some(disturbance) => verdict.inconclusive.push(format!("{name}: {disturbance}")),
                        None => verdict.failures.push(name),
                    }
                }
            }
        }
        match program.failed {
            _ if program.is_killed => verdict.failures.push(format!("{}: the program crashed", program.name)),
            None => verdict.failures.push(format!("{}: the program did not end", program.name)),
            Some(count) if count != failed => verdict
                .failures
                .push(format!("{}: {count} failed tests, of which {failed} are named", program.name)),
            Some(0) if program.has_failed => {
                verdict.failures.push(format!("{}: the program failed, and no test", program.name));
            }
            Some(_) => {}
        }
    }
    if !has_succeeded && verdict.failures.is_empty() && verdict.inconclusive.is_empty() {
        verdict.failures.push("cargo failed, see its output above".to_string());
    }
    let skipped = skipped.into_iter();
    verdict.skipped =
        skipped.map(|(reason, what)| outcome::Skipped { what, reason: reason.to_string() }).collect();
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{Gap, Sample};
    use crate::libtest::Test;
    use crate::proc::CoreTicks;

    fn test(outcome: Outcome, real_time_from: Option<f64>, ended: f64) -> Test {
        Test { outcome, ended, real_time_from, skipped: None }
    }

    fn program(failed: Option<usize>, tests: &[(&str, Test)]) -> Program {
        let tests = tests.iter().map(|(name, test)| ((*name).to_string(), test.clone())).collect();
        Program { name: "graphs".to_string(), tests, failed, has_failed: failed != Some(0), is_killed: false }
    }

    /// Both cores stop from 10 s to 10.1 s.
    fn stopped() -> Record {
        let span = Span { start: 10.0, end: 10.1 };
        let sample = |time: f64| Sample {
            time,
            cores: [0, 1].map(|core| CoreTicks { core, total: (time * 100.0) as u64, steal: 0 }).to_vec(),
        };
        Record {
            is_real_time: true,
            gaps: vec![Gap { core: 0, span }, Gap { core: 1, span }],
            samples: vec![sample(0.0), sample(60.0)],
        }
    }

    #[test]
    fn only_disturbed_real_time_tests_are_inconclusive() {
        let programs = [program(
            Some(4),
            &[
                ("before", test(Outcome::Failed, Some(2.0), 9.0)),
                ("during", test(Outcome::Failed, Some(9.0), 12.0)),
                ("after", test(Outcome::Failed, Some(10.2), 12.0)),
                ("lockstep", test(Outcome::Failed, None, 12.0)),
                ("passed", test(Outcome::Passed, Some(9.0), 12.0)),
            ],
        )];
        let verdict = judge(&programs, false, Some(&stopped()));
        assert_eq!(verdict.inconclusive, ["graphs: during: the host took 100 ms in one piece"]);
        assert_eq!(verdict.failures, ["graphs: after", "graphs: before", "graphs: lockstep"]);
        assert_eq!(verdict.real_time, 4);
        let unobserved = judge(&programs, false, None);
        assert_eq!((unobserved.inconclusive.len(), unobserved.failures.len()), (0, 4));
    }

    #[test]
    fn crash_is_a_failure_even_if_the_host_stopped() {
        let programs = [program(None, &[("during", test(Outcome::Failed, Some(9.0), 12.0))])];
        let verdict = judge(&programs, false, Some(&stopped()));
        assert_eq!(verdict.failures, ["graphs: the program did not end"]);
        let test = test(Outcome::Failed, Some(9.0), 12.0);
        let killed = Program { is_killed: true, ..program(Some(1), &[("during", test)]) };
        let verdict = judge(&[killed], false, Some(&stopped()));
        assert_eq!(verdict.failures, ["graphs: the program crashed"]);
    }

    #[test]
    fn unnamed_failures_and_failures_of_cargo_count() {
        let unnamed = judge(&[program(Some(1), &[])], false, Some(&stopped()));
        assert_eq!(unnamed.failures, ["graphs: 1 failed tests, of which 0 are named"]);
        let cargo = judge(&[], false, None);
        assert_eq!(cargo.failures, ["cargo failed, see its output above"]);
        let silent = Program { has_failed: true, ..program(Some(0), &[]) };
        let verdict = judge(&[silent], false, None);
        assert_eq!(verdict.failures, ["graphs: the program failed, and no test"]);
        let passed = judge(&[program(Some(0), &[])], true, None);
        assert_eq!(passed, outcome::Outcome::default());
    }

    #[test]
    fn skipped_tests_are_grouped_by_reason() {
        let skipped = Test { skipped: Some("no strace".into()), ..test(Outcome::Passed, None, 1.0) };
        let tests = [
            ("a", skipped.clone()),
            ("b", skipped),
            ("c", test(Outcome::Ignored, None, 1.0)),
            ("d", test(Outcome::Passed, None, 1.0)),
        ];
        let verdict = judge(&[program(Some(0), &tests)], true, None);
        let lines: Vec<String> = verdict.skipped.iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "1 test not run: marked as ignored (graphs: c)",
                "2 tests not run: no strace (graphs: a, graphs: b)"
            ]
        );
    }
}
