//! Runs the steps of a table: each as soon as its needs, its lane and the machine permit.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::thread;
use std::time::Instant;

use crate::context::{Context, Shared};
use crate::failure::Failure;
use crate::outcome::Outcome;
use crate::proc::TICKS_PER_SECOND;
use crate::step::{Machine, Step};

/// End of a step.
#[derive(Debug)]
pub(crate) enum End {
    Ran(Outcome),
    Failed(Failure),
    /// A needed step has not passed.
    NotRun {
        missing: &'static str,
    },
}

impl End {
    pub(crate) fn has_passed(&self) -> bool {
        match self {
            Self::Ran(outcome) => outcome.failures.is_empty() && outcome.inconclusive.is_empty(),
            Self::Failed(_) | Self::NotRun { .. } => false,
        }
    }
}

/// A finished step.
#[derive(Debug)]
pub(crate) struct Finished {
    pub(crate) name: &'static str,
    pub(crate) seconds: f64,
    pub(crate) cpu_seconds: f64,
    pub(crate) end: End,
}

/// State of a step.
enum State {
    Pending,
    Running,
    Finished(Finished),
}

/// Next action for a pending step.
enum Next {
    Start,
    Wait,
    GiveUp { missing: &'static str },
}

/// Runs all steps and returns them in the order of the table. A failed step stops only the steps that need
/// it.
pub(crate) fn run(steps: &[Step], shared: &Shared) -> Vec<Finished> {
    let mut states: Vec<State> = steps.iter().map(|_| State::Pending).collect();
    let (sender, finished) = mpsc::channel();
    thread::scope(|scope| {
        loop {
            for (index, step) in steps.iter().enumerate() {
                match next(index, steps, &states) {
                    Next::Wait => {}
                    Next::GiveUp { missing } => {
                        (shared.print)(&format!("=== {}: not run, it needs {missing}", step.name));
                        let (name, end) = (step.name, End::NotRun { missing });
                        states[index] =
                            State::Finished(Finished { name, seconds: 0.0, cpu_seconds: 0.0, end });
                    }
                    Next::Start => {
                        states[index] = State::Running;
                        let sender = sender.clone();
                        scope.spawn(move || {
                            // the receiver lives longer than the scope
                            let _ = sender.send((index, run_step(step, shared)));
                        });
                    }
                }
            }
            // a step waits for earlier ones only, so if none runs, all have finished
            if !states.iter().any(|state| matches!(state, State::Running)) {
                break;
            }
            let Ok((index, step)) = finished.recv() else { break };
            states[index] = State::Finished(step);
        }
    });
    let finished = states.into_iter().filter_map(|state| match state {
        State::Finished(finished) => Some(finished),
        State::Pending | State::Running => None,
    });
    finished.collect()
}

fn next(index: usize, steps: &[Step], states: &[State]) -> Next {
    let step = &steps[index];
    let is_finished = |index: usize| matches!(states[index], State::Finished(_));
    if !matches!(states[index], State::Pending) {
        return Next::Wait;
    }
    let mut needs_pending = false;
    for (before, other) in steps[..index].iter().enumerate() {
        if !step.needs.contains(&other.name) {
            continue;
        }
        match &states[before] {
            State::Finished(finished) if !finished.end.has_passed() => {
                return Next::GiveUp { missing: other.name };
            }
            State::Finished(_) => {}
            State::Pending | State::Running => needs_pending = true,
        }
    }
    let blocks = |(before, other): (usize, &Step)| {
        !is_finished(before)
            && (step.machine == Machine::Alone || other.machine == Machine::Alone || other.lane == step.lane)
    };
    let is_blocked = steps[..index].iter().enumerate().any(blocks);
    if needs_pending || is_blocked { Next::Wait } else { Next::Start }
}

fn run_step(step: &Step, shared: &Shared) -> Finished {
    let prefix = match step.machine {
        Machine::Alone => String::new(),
        Machine::Shared | Machine::Aside => format!("{}: ", step.name),
    };
    let context = Context::new(shared, prefix, step.machine == Machine::Aside);
    context.say(&format!("=== {}", step.name));
    let began = Instant::now();
    let end = match catch_unwind(AssertUnwindSafe(|| (step.action)(&context))) {
        Ok(Ok(outcome)) => End::Ran(outcome),
        Ok(Err(failure)) => End::Failed(failure),
        Err(_) => End::Failed(Failure::Check("the step panicked, see the message above".to_string())),
    };
    let seconds = began.elapsed().as_secs_f64();
    let cpu_seconds = context.ticks() as f64 / TICKS_PER_SECOND;
    let verdict = match &end {
        End::Ran(_) if end.has_passed() => "passed".to_string(),
        End::Ran(outcome) if outcome.failures.is_empty() => "INCONCLUSIVE".to_string(),
        End::Ran(_) => "FAILED".to_string(),
        End::Failed(failure) => format!("FAILED: {failure}"),
        End::NotRun { .. } => "not run".to_string(),
    };
    context.say(&format!("--- {}: {verdict}, {seconds:.1} s, {cpu_seconds:.1} CPU s", step.name));
    Finished { name: step.name, seconds, cpu_seconds, end }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Mutex;

    use super::*;

    const STEP: Step = Step {
        name: "",
        about: "",
        needs: &[],
        tools: &[],
        machine: Machine::Shared,
        lane: "",
        action: |_| Ok(Outcome::default()),
    };

    /// Runs steps; returns their ends and the printed lines.
    fn ran(steps: &[Step]) -> (Vec<Finished>, Vec<String>) {
        static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
        static LINES: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        LINES.lock().unwrap().clear();
        let shared = Shared::new(PathBuf::from("/"), |line| LINES.lock().unwrap().push(line.to_string()));
        let finished = run(steps, &shared.expect("folders"));
        let lines = LINES.lock().unwrap().clone();
        (finished, lines)
    }

    fn shell(context: &Context<'_>, script: &str) -> Result<Outcome, Failure> {
        context.run(&context.call("sh").arg("-c").arg(script)).map(|_| Outcome::default())
    }

    fn line_number(lines: &[String], line: &str) -> usize {
        lines
            .iter()
            .position(|it| it.starts_with(line))
            .unwrap_or_else(|| panic!("no `{line}` in {lines:#?}"))
    }

    #[test]
    fn parallel_steps_print_with_their_names() {
        // each waits for the other's file, so they must run at the same time
        let one = |context: &Context<'_>| {
            let [mine, theirs] = ["one", "two"].map(|name| context.scratch(name).display().to_string());
            shell(context, &format!("touch {mine}; until [ -e {theirs} ]; do sleep 0.01; done; echo met"))
        };
        let two = |context: &Context<'_>| {
            let [mine, theirs] = ["two", "one"].map(|name| context.scratch(name).display().to_string());
            shell(context, &format!("touch {mine}; until [ -e {theirs} ]; do sleep 0.01; done; echo met >&2"))
        };
        let steps = [
            Step { name: "one", lane: "a", action: one, ..STEP },
            Step { name: "two", lane: "b", machine: Machine::Aside, action: two, ..STEP },
            Step {
                name: "last",
                lane: "c",
                machine: Machine::Alone,
                action: |it| shell(it, "echo end"),
                ..STEP
            },
        ];
        let (finished, lines) = ran(&steps);
        assert!(finished.iter().all(|step| step.end.has_passed()), "{finished:?}");
        for line in ["one: met", "two: met", "one: === one", "=== last", "end"] {
            line_number(&lines, line);
        }
        let last = line_number(&lines, "=== last");
        assert!(line_number(&lines, "one: --- one: passed") < last);
        assert!(line_number(&lines, "two: --- two: passed") < last);
    }

    #[test]
    fn failure_stops_only_the_steps_that_need_it() {
        let fails = |context: &Context<'_>| shell(context, "echo begins; echo no disk; exit 3");
        let steps = [
            Step { name: "build", lane: "a", action: fails, ..STEP },
            Step { name: "use", lane: "b", needs: &["build"], ..STEP },
            Step { name: "use again", lane: "b", needs: &["use"], machine: Machine::Alone, ..STEP },
            Step { name: "other", lane: "b", ..STEP },
            Step { name: "panics", lane: "b", action: |_| panic!("a defect of a step"), ..STEP },
        ];
        let (finished, _) = ran(&steps);
        let ends: Vec<_> = finished.iter().map(|step| (step.name, &step.end)).collect();
        assert!(
            matches!(
                &ends[..],
                [
                    ("build", End::Failed(Failure::Ended { status, message, .. })),
                    ("use", End::NotRun { missing: "build" }),
                    ("use again", End::NotRun { missing: "use" }),
                    ("other", End::Ran(_)),
                    ("panics", End::Failed(Failure::Check(_))),
                ] if status.code() == Some(3) && message == "no disk"
            ),
            "{ends:?}"
        );
    }

    #[test]
    fn lanes_and_lone_steps_keep_their_order() {
        let steps = [
            Step { name: "a1", lane: "a", action: |it| shell(it, "sleep 0.1"), ..STEP },
            Step { name: "a2", lane: "a", ..STEP },
            Step { name: "alone", lane: "b", machine: Machine::Alone, ..STEP },
            Step { name: "c", lane: "c", ..STEP },
        ];
        let (_, lines) = ran(&steps);
        let order = ["a1: --- a1", "a2: === a2", "a2: --- a2", "=== alone", "--- alone", "c: === c"];
        let numbers = order.map(|line| line_number(&lines, line));
        assert!(numbers.is_sorted(), "{lines:#?}");
    }

    #[test]
    fn inconclusive_step_has_not_passed() {
        let inconclusive = |_: &Context<'_>| {
            Ok(Outcome { inconclusive: vec!["the host took 30 ms".to_string()], ..Outcome::default() })
        };
        let (finished, lines) = ran(&[Step { name: "one", action: inconclusive, ..STEP }]);
        assert!(!finished[0].end.has_passed());
        line_number(&lines, "one: --- one: INCONCLUSIVE");
    }

    #[test]
    fn steps_count_the_processor_time_of_their_programs() {
        let busy =
            |context: &Context<'_>| shell(context, "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done");
        let (finished, _) = ran(&[Step { name: "busy", action: busy, ..STEP }]);
        assert!(finished[0].cpu_seconds > 0.0 && finished[0].seconds > 0.0, "{finished:?}");
    }
}
