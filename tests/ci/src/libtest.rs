//! Reader of the output of `cargo test -- --show-output`.
//!
//! A test program prints a line when a test ends. At its end, it prints the output of passed tests and then
//! the output of failed tests. The output of a test states why the test was skipped and when it reserved the
//! machine.

use std::collections::BTreeMap;

/// Line that `motorium::testing::machine` prints, followed by the Unix time [s].
pub(crate) const REAL_TIME_MARK: &str = "real time from ";

/// Result of one test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Passed,
    Failed,
    Ignored,
}

/// One test.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Test {
    pub(crate) outcome: Outcome,
    /// Unix time [s] of the line that reports the outcome.
    pub(crate) ended: f64,
    /// Unix time [s] at which the test reserved the machine: it runs in real time from then on.
    pub(crate) real_time_from: Option<f64>,
    /// Why the test, or a part of it, was skipped.
    pub(crate) skipped: Option<String>,
}

/// One test program, or the doc tests of a crate.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Program {
    pub(crate) name: String,
    pub(crate) tests: BTreeMap<String, Test>,
    /// Number of failed tests in the closing line of the program, if it was printed.
    pub(crate) failed: Option<usize>,
    /// Cargo reports that the program failed.
    pub(crate) has_failed: bool,
    /// Cargo reports that the program ended in another way than by failed tests.
    pub(crate) is_killed: bool,
}

/// Part of the output of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Section {
    /// Lines of tests, and everything that belongs to no other part.
    Tests,
    Successes,
    Failures,
}

/// Reads the output line by line.
#[derive(Debug)]
pub(crate) struct Reader {
    programs: Vec<Program>,
    section: Section,
    /// The test whose output is being read.
    current: Option<String>,
}

impl Reader {
    pub(crate) fn new() -> Self {
        Self { programs: Vec::new(), section: Section::Tests, current: None }
    }

    /// Reads one line that arrived at a Unix time [s]. Returns `true` if it is worth printing: everything
    /// except the output of passed tests.
    pub(crate) fn line(&mut self, line: &str, arrived: f64) -> bool {
        let line = without_colours(line);
        let text = line.trim_end();
        let is_output = self.section != Section::Tests;
        if !is_output && let Some(name) = program_name(text) {
            self.programs.push(Program { name, ..Program::default() });
            return true;
        }
        let Some(program) = self.programs.last_mut() else { return true };
        match text {
            "successes:" => (self.section, self.current) = (Section::Successes, None),
            "failures:" => (self.section, self.current) = (Section::Failures, None),
            // a test may start another test program, whose closing line comes first
            _ if text.starts_with("test result: ") => {
                program.failed = failed_tests(text);
                (self.section, self.current) = (Section::Tests, None);
            }
            _ if !is_output && text.contains(" failed, to rerun pass `") => program.has_failed = true,
            _ if !is_output && text.contains("process didn't exit successfully: ") => {
                program.is_killed = true
            }
            _ => match self.section {
                Section::Tests => {
                    if let Some((name, outcome)) = test(text) {
                        let test = Test { outcome, ended: arrived, real_time_from: None, skipped: None };
                        program.tests.insert(name, test);
                    }
                }
                Section::Successes | Section::Failures => {
                    if let Some(name) = output_of(text) {
                        let outcome =
                            if self.section == Section::Failures { Outcome::Failed } else { Outcome::Passed };
                        let test = Test { outcome, ended: arrived, real_time_from: None, skipped: None };
                        program.tests.entry(name.to_string()).or_insert(test).outcome = outcome;
                        self.current = Some(name.to_string());
                    } else if let Some(test) =
                        self.current.as_ref().and_then(|name| program.tests.get_mut(name))
                    {
                        test.read(text);
                    }
                }
            },
        }
        self.section != Section::Successes
    }

    /// Returns all programs in the order of their start.
    pub(crate) fn finish(self) -> Vec<Program> {
        self.programs
    }
}

impl Test {
    /// Reads a line of the test's output.
    fn read(&mut self, line: &str) {
        if let Some(time) = line.strip_prefix(REAL_TIME_MARK) {
            self.real_time_from = self.real_time_from.or(time.trim().parse().ok());
        } else if let Some(reason) = skip_reason(line) {
            self.skipped.get_or_insert_with(|| reason.to_string());
        }
    }
}

/// Returns the reason in a line by which a test reports that it was skipped: `skipped: REASON`.
fn skip_reason(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let (word, rest) = line.split_at_checked("skipped".len())?;
    let rest = word.eq_ignore_ascii_case("skipped").then_some(rest)?;
    rest.strip_prefix(": ").or_else(|| rest.strip_prefix(' '))
}

/// Returns the name of the program in a line such as
/// `Running tests/all/main.rs (target/debug/deps/all-0123456789abcdef)` or `Doc-tests motorium`.
fn program_name(line: &str) -> Option<String> {
    let line = line.trim_start();
    if let Some(library) = line.strip_prefix("Doc-tests ") {
        return Some(format!("doc tests of {library}"));
    }
    let (_, path) = line.strip_prefix("Running ")?.strip_suffix(')')?.rsplit_once('(')?;
    let file = path.rsplit('/').next()?;
    Some(file.rsplit_once('-').map_or(file, |(name, _hash)| name).to_string())
}

/// Reads a line such as `test module::name ... ok`.
fn test(line: &str) -> Option<(String, Outcome)> {
    let (name, outcome) = line.strip_prefix("test ")?.rsplit_once(" ... ")?;
    let outcome = match outcome.split([',', ' ']).next()? {
        "ok" => Outcome::Passed,
        "FAILED" => Outcome::Failed,
        "ignored" => Outcome::Ignored,
        _ => return None,
    };
    let modes = [" - should panic", " - compile fail", " - compile"];
    let name = modes.iter().find_map(|mode| name.strip_suffix(mode)).unwrap_or(name);
    Some((name.to_string(), outcome))
}

/// Returns the test in the heading of an output: `---- module::name stdout ----`.
fn output_of(line: &str) -> Option<&str> {
    line.strip_prefix("---- ")?.strip_suffix(" stdout ----")
}

/// Reads the number of failed tests of the closing line: `test result: ok. 3 passed; 0 failed; ...`.
fn failed_tests(line: &str) -> Option<usize> {
    let counts = line.split([';', '.']).find_map(|part| part.trim().strip_suffix(" failed"));
    counts.and_then(|count| count.parse().ok())
}

/// Removes escape sequences for colours.
fn without_colours(line: &str) -> String {
    let mut plain = String::with_capacity(line.len());
    let mut rest = line;
    while let Some((before, sequence)) = rest.split_once("\u{1b}[") {
        plain += before;
        let end = sequence.find(|c: char| c.is_ascii_alphabetic()).map_or(sequence.len(), |at| at + 1);
        rest = &sequence[end..];
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The programs of an output whose lines arrive once a second, and the printed lines.
    fn read(output: &str) -> (Vec<Program>, Vec<&str>) {
        let mut reader = Reader::new();
        let lines = output.lines().enumerate();
        let printed = lines.filter(|(time, line)| reader.line(line, *time as f64)).map(|(_, line)| line);
        let printed = printed.collect();
        (reader.finish(), printed)
    }

    const OUTPUT: &str = "   Compiling motorium v0.1.0
     Running graphs/main.rs (target/debug/deps/graphs-d17fe568143c5148)

running 4 tests
test faults::one ... ok
test faults::two - should panic ... ok
test runs::three ... FAILED
test runs::four ... ignored, needs a robot

successes:

---- faults::one stdout ----
real time from 1796000000.250
skipped: strace is not installed
test faults::nested ... FAILED

successes:
    faults::one
    faults::two

failures:

---- runs::three stdout ----
real time from 1796000003.500
thread 'runs::three' panicked at tests/graphs/runs.rs:1:1:
     Running a line that the test printed (a/b-1)

failures:
    runs::three

test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 3.00s

error: test failed, to rerun pass `-p motorium-tests --test graphs`
   Doc-tests motorium

running 1 test
test src/lib.rs - units (line 3) - compile ... ok

test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.10s
";

    #[test]
    fn outcomes_windows_and_skips_are_read() {
        let (programs, _) = read(OUTPUT);
        let [graphs, docs] = &programs[..] else { panic!("{programs:?}") };
        assert_eq!((graphs.name.as_str(), graphs.failed, graphs.has_failed), ("graphs", Some(1), true));
        let test = |outcome, ended, real_time_from, skipped: Option<&str>| Test {
            outcome,
            ended,
            real_time_from,
            skipped: skipped.map(str::to_string),
        };
        let expected = [
            (
                "faults::one",
                test(Outcome::Passed, 4.0, Some(1_796_000_000.25), Some("strace is not installed")),
            ),
            ("faults::two", test(Outcome::Passed, 5.0, None, None)),
            ("runs::four", test(Outcome::Ignored, 7.0, None, None)),
            ("runs::three", test(Outcome::Failed, 6.0, Some(1_796_000_003.5), None)),
        ];
        let expected = expected.map(|(name, test)| (name.to_string(), test));
        assert_eq!(graphs.tests, BTreeMap::from(expected));
        assert_eq!(
            (docs.name.as_str(), docs.failed, docs.has_failed),
            ("doc tests of motorium", Some(0), false)
        );
        assert_eq!(docs.tests.keys().collect::<Vec<_>>(), ["src/lib.rs - units (line 3)"]);
    }

    #[test]
    fn output_of_passed_tests_is_not_printed() {
        let (_, printed) = read(OUTPUT);
        assert!(!printed.contains(&"skipped: strace is not installed"), "{printed:?}");
        for line in ["test runs::three ... FAILED", "---- runs::three stdout ----", "   Doc-tests motorium"] {
            assert!(printed.contains(&line), "{line}");
        }
    }

    #[test]
    fn crashed_program_has_no_result() {
        let (programs, _) = read(
            "     Running unittests src/lib.rs (target/debug/deps/motorium_can-0a)\nrunning 2 tests\n\
             test a ... ok\nerror: test failed, to rerun pass `-p motorium-can --lib`\n\
             \nCaused by:\n  process didn't exit successfully: `x` (signal: 11, SIGSEGV)\n\
             \u{1b}[32m     Running\u{1b}[0m tests/b.rs (target/debug/deps/b-0a)\n\
             test result: ok. 0 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s\n",
        );
        let results: Vec<_> = programs.iter().map(|it| (it.name.as_str(), it.failed, it.is_killed)).collect();
        assert_eq!(results, [("motorium_can", None, true), ("b", Some(0), false)]);
    }

    #[test]
    fn reasons_of_skipped_tests_are_recognised() {
        assert_eq!(skip_reason("skipped: no strace"), Some("no strace"));
        assert_eq!(skip_reason("SKIPPED: no python3"), Some("no python3"));
        assert_eq!(skip_reason("skipped ur5e: no vectors"), Some("ur5e: no vectors"));
        for other in ["skippedness", "3 skipped", "no skips", "skipped", "skippéd: no"] {
            assert_eq!(skip_reason(other), None, "{other}");
        }
    }

    #[test]
    fn mark_matches_the_reservation_of_the_machine() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../runtime/src/testing/machine.rs");
        let source = std::fs::read_to_string(path).expect("the file that prints it");
        assert!(source.contains(&format!("println!(\"{REAL_TIME_MARK}{{")), "{REAL_TIME_MARK}");
    }
}
