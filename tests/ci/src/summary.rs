//! Closing lines.

use crate::schedule::{End, Finished};

/// Largest share of the real-time checks that may be inconclusive.
const MAX_INCONCLUSIVE_SHARE: f64 = 0.01;

/// Verdict on all steps.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Summary {
    pub(crate) lines: Vec<String>,
    pub(crate) has_passed: bool,
}

/// Sums up the steps: a table of their seconds, tests that did not run, inconclusive checks and failures.
pub(crate) fn summarise(steps: &[Finished], seconds: f64) -> Summary {
    let mut lines = vec![format!("{:>7} {:>7}  step", "seconds", "cpu")];
    let (mut notes, mut skipped, mut inconclusive, mut failures) = (vec![], vec![], vec![], vec![]);
    let mut real_time = 0;
    for Finished { name, seconds, cpu_seconds, end } in steps {
        let mark = match end {
            End::Ran(_) if end.has_passed() => "",
            End::Ran(outcome) if outcome.failures.is_empty() => "  INCONCLUSIVE",
            End::Ran(_) | End::Failed(_) => "  FAILED",
            End::NotRun { .. } => "  not run",
        };
        lines.push(format!("{seconds:7.1} {cpu_seconds:7.1}  {name}{mark}"));
        match end {
            End::Ran(outcome) => {
                real_time += outcome.real_time;
                notes.extend(outcome.notes.iter().map(|note| format!("{name}: {note}")));
                skipped.extend(outcome.skipped.iter().map(|skipped| format!("{name}: {skipped}")));
                inconclusive.extend(outcome.inconclusive.iter().map(|it| format!("{name}: {it}")));
                failures.extend(outcome.failures.iter().map(|failure| format!("{name}: {failure}")));
            }
            End::Failed(failure) => failures.push(format!("{name}: {failure}")),
            End::NotRun { missing } => failures.push(format!("{name}: not run, it needs {missing}")),
        }
    }
    let cpu: f64 = steps.iter().map(|step| step.cpu_seconds).sum();
    lines.push(format!("{seconds:7.1} {cpu:7.1}  in all"));
    lines.extend(notes);
    lines.extend(skipped);
    if !inconclusive.is_empty() {
        lines.push(format!(
            "{} of {real_time} real-time checks inconclusive, which means not passed",
            inconclusive.len()
        ));
        lines.extend(inconclusive.iter().map(|it| format!("inconclusive: {it}")));
    }
    let share = inconclusive.len() as f64 / real_time.max(1) as f64;
    if share > MAX_INCONCLUSIVE_SHARE {
        let (share, most) = (100.0 * share, 100.0 * MAX_INCONCLUSIVE_SHARE);
        failures
            .push(format!("{share:.1} % of the real-time checks are inconclusive, at most {most} % may be"));
    }
    lines.extend(failures.iter().map(|failure| format!("FAILED: {failure}")));
    let has_passed = failures.is_empty();
    lines.push(if has_passed {
        "all checks passed".to_string()
    } else {
        format!("{} FAILED", failures.len())
    });
    if has_passed && !inconclusive.is_empty() {
        lines.pop();
        lines.push(format!("all checks passed except {} inconclusive ones", inconclusive.len()));
    }
    Summary { lines, has_passed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::Failure;
    use crate::outcome::{Outcome, Skipped};

    fn step(name: &'static str, end: End) -> Finished {
        Finished { name, seconds: 1.5, cpu_seconds: 0.25, end }
    }

    fn real_time(count: usize, inconclusive: &[&str]) -> Finished {
        let inconclusive = inconclusive.iter().map(ToString::to_string).collect();
        step("tests", End::Ran(Outcome { real_time: count, inconclusive, ..Outcome::default() }))
    }

    #[test]
    fn passing_run_has_a_table_and_names_tests_not_run() {
        let skipped = vec![Skipped { what: vec!["graphs: a".into()], reason: "no strace".into() }];
        let outcome = Outcome { skipped, notes: vec!["4 samples".into()], ..Outcome::default() };
        let summary = summarise(&[step("fmt", End::Ran(outcome))], 2.0);
        let expected = [
            "seconds     cpu  step",
            "    1.5     0.2  fmt",
            "    2.0     0.2  in all",
            "fmt: 4 samples",
            "fmt: 1 test not run: no strace (graphs: a)",
            "all checks passed",
        ];
        assert_eq!(summary, Summary { lines: expected.map(String::from).to_vec(), has_passed: true });
    }

    #[test]
    fn failures_are_named_last() {
        let failed = Outcome { failures: vec!["graphs: a".into(), "graphs: b".into()], ..Outcome::default() };
        let steps = [
            step("build", End::Failed(Failure::Check("no clippy".into()))),
            step("tests", End::Ran(failed)),
            step("learner", End::NotRun { missing: "build" }),
        ];
        let summary = summarise(&steps, 2.0);
        assert!(!summary.has_passed);
        assert_eq!(
            summary.lines[5..],
            [
                "FAILED: build: no clippy",
                "FAILED: tests: graphs: a",
                "FAILED: tests: graphs: b",
                "FAILED: learner: not run, it needs build",
                "4 FAILED",
            ]
        );
    }

    #[test]
    fn one_percent_of_real_time_checks_may_be_inconclusive() {
        let few = summarise(&[real_time(200, &["a: the host took 30 ms", "b: the host took 40 ms"])], 1.0);
        assert!(few.has_passed);
        assert_eq!(
            few.lines[3..],
            [
                "2 of 200 real-time checks inconclusive, which means not passed",
                "inconclusive: tests: a: the host took 30 ms",
                "inconclusive: tests: b: the host took 40 ms",
                "all checks passed except 2 inconclusive ones",
            ]
        );
        let many = summarise(&[real_time(199, &["a", "b"])], 1.0);
        assert!(!many.has_passed);
        let expected = "FAILED: 1.0 % of the real-time checks are inconclusive, at most 1 % may be";
        assert!(many.lines.contains(&expected.to_string()), "{:?}", many.lines);
        assert!(!summarise(&[real_time(0, &["a"])], 1.0).has_passed);
    }
}
