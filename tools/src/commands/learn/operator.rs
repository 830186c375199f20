//! The operator of a robot, at a terminal.

use std::io::IsTerminal as _;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use motorium::declare::ParameterValue;
use motorium::plan::{Plan, Program};
use motorium::units::TimeSpan;
use motorium_learners::search::Outcome;
use motorium_learners::tuning::{AnswerError, Operator, Parameter, Question, Stage};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::termios::{QueueSelector, tcflush};

use crate::out::{err, errln};
use crate::report::decimal;

/// Longest time until an interruption is noticed.
const LOOK: Duration = Duration::from_millis(100);
/// Longest answer, bytes.
const LONGEST: usize = 1024;

/// Families of built-in kinds that reach nothing outside of the graph's processes, apart from files.
const SIMULATED: [&str; 8] =
    ["physics", "sensor", "control", "policy", "estimator", "joint", "learner", "log"];

/// Returns `true` if a graph moves only simulated robots: it has physics, and no component reaches a real
/// robot or a user's program.
pub(super) fn is_simulation(plan: &Plan) -> bool {
    let family = |program: &Program| match program {
        Program::Builtin { kind } | Program::Sibling { kind, .. } => {
            SIMULATED.into_iter().find(|family| kind.split('.').next() == Some(family))
        }
        Program::Exec { .. } => None,
    };
    let families: Option<Vec<&str>> =
        plan.components.iter().map(|component| family(&component.program)).collect();
    families.is_some_and(|families| families.contains(&"physics"))
}

/// Questions on standard error, answers from standard input.
pub(super) struct Terminal {
    rows: Vec<Row>,
    /// Duration of an episode.
    duration: TimeSpan,
    lines: Lines<std::io::Stdin>,
    /// `true` once the values of the parameters have been shown.
    has_shown: bool,
}

/// A parameter as it is shown.
struct Row {
    name: String,
    /// Its unit, or empty.
    unit: String,
    range: [f64; 2],
}

impl Terminal {
    /// Creates the dialogue about a graph. `interrupted` is set by Ctrl-C.
    pub(super) fn new(plan: &Plan, parameters: &[Parameter], interrupted: Arc<AtomicBool>) -> Self {
        let row = |parameter: &Parameter| Row {
            name: parameter.name(),
            unit: parameter.keys.first().and_then(|key| unit(plan, key)).unwrap_or_default(),
            range: parameter.range,
        };
        Self {
            rows: parameters.iter().map(row).collect(),
            duration: TimeSpan { ns: plan.duration_ns.unwrap_or_default() },
            lines: Lines { source: std::io::stdin(), read: Vec::new(), interrupted },
            has_shown: false,
        }
    }
}

impl Operator for Terminal {
    fn ask(&mut self, question: &Question) -> Option<String> {
        let has_table = question.stage == Stage::Proposed || !self.has_shown;
        self.has_shown = true;
        // what was typed before the question answers another one
        if self.lines.source.is_terminal() {
            let _ = tcflush(&self.lines.source, QueueSelector::IFlush);
            self.lines.read.clear();
        }
        err!("\n{}> ", text(question, has_table.then_some(&self.rows), self.duration));
        let line = self.lines.next();
        if line.is_none() {
            errln!();
        }
        line
    }

    fn reject(&mut self, error: &AnswerError) {
        errln!("{error}");
    }
}

/// Returns the unit of a key of a component: of its parameter of the same name and value.
fn unit(plan: &Plan, key: &str) -> Option<String> {
    let key = key.strip_prefix("component.").unwrap_or(key);
    let [component, table @ ("config" | "params"), name] = key.split('.').collect::<Vec<_>>()[..] else {
        return None;
    };
    let component = plan.components.iter().find(|each| each.name == component)?;
    let parameter = component.parameters.iter().find(|each| each.declaration.name == name)?;
    let ParameterValue::Float(initial) = parameter.initial else { return None };
    let is_same = table == "params" || component.config.get(name)?.as_f64() == Some(initial);
    is_same.then(|| parameter.declaration.unit.clone())
}

/// Returns a question, with the table of the parameters.
fn text(question: &Question, rows: Option<&Vec<Row>>, duration: TimeSpan) -> String {
    let Question { evaluation, evaluations, values, last, best, stage } = question;
    let best =
        best.map_or_else(|| "no reward yet".to_owned(), |best| format!("best reward {}", decimal(best)));
    let mut text = format!("evaluation {evaluation} of {evaluations}, {best}\n");
    let width = rows.into_iter().flatten().map(|row| row.name.len()).max().unwrap_or_default();
    for (index, (row, value)) in rows.into_iter().flatten().zip(values).enumerate() {
        let Row { name, unit, range: [low, high] } = row;
        let shown = format!("{} {unit}", decimal(*value));
        let range = format!("{} to {}", decimal(*low), decimal(*high));
        let change = match last.as_ref().and_then(|last| last.get(index)) {
            None => String::new(),
            Some(last) if last == value => ", unchanged".to_owned(),
            Some(last) => format!(", last {}, change {}", decimal(*last), signed(value - last)),
        };
        text += &format!("  {name:width$}  {}  ({range}{change})\n", shown.trim_end());
    }
    text += &match stage {
        Stage::Proposed => format!("an episode of {duration} on the robot: "),
        Stage::Ended(result) => match (result.outcome, &result.reason) {
            (Outcome::Finished, _) => format!("reward {}: ", decimal(result.reward)),
            (outcome, None) => format!("{}: ", outcome.name()),
            (outcome, Some(reason)) => format!("{}: {reason}\n", outcome.name()),
        },
    };
    text + stage.choices() + "?\n"
}

/// Returns a number with its sign.
fn signed(number: f64) -> String {
    let sign = if number > 0.0 { "+" } else { "" };
    format!("{sign}{}", decimal(number))
}

/// Lines of a descriptor, read until an interruption.
struct Lines<F> {
    source: F,
    /// Bytes read and not returned.
    read: Vec<u8>,
    interrupted: Arc<AtomicBool>,
}

impl<F: AsFd> Lines<F> {
    /// Waits for a whole line. `None` after an interruption and at the end of the input, even within a line.
    fn next(&mut self) -> Option<String> {
        while !self.interrupted.load(Relaxed) && self.read.len() <= LONGEST {
            if let Some(end) = self.read.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.read.drain(..=end).collect();
                return Some(String::from_utf8_lossy(&line).into_owned());
            }
            let timeout = Timespec { tv_sec: 0, tv_nsec: LOOK.subsec_nanos().into() };
            let mut bytes = [0; 256];
            let count = match poll(&mut [PollFd::new(&self.source, PollFlags::IN)], Some(&timeout)) {
                Ok(0) | Err(Errno::INTR) => continue,
                Ok(_) => rustix::io::read(&self.source, &mut bytes),
                Err(error) => Err(error),
            };
            match count {
                Ok(0) => return None,
                Ok(count) => self.read.extend_from_slice(&bytes[..count]),
                Err(Errno::INTR | Errno::AGAIN) => {}
                Err(_) => return None,
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::path::Path;

    use motorium::graph::{Machine, load_with};
    use motorium_learners::search::Evaluation;

    use super::*;

    fn plan(graph: &str) -> Plan {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph);
        let machine = Machine::with_cores(vec![0, 1]);
        let checked = load_with(&file, &[], &[], &crate::registry::registry(), &machine);
        checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan
    }

    #[test]
    fn graphs_with_drives_or_programs_are_no_simulation() {
        for graph in ["quadruped-trot.toml", "panda-reach-rapier.toml", "cart-pole-policy.toml"] {
            assert!(is_simulation(&plan(graph)), "{graph}");
        }
        for graph in ["panda-can-sim.toml", "panda-bridge.toml"] {
            assert!(!is_simulation(&plan(graph)), "{graph}");
        }
        let mut without_physics = plan("quadruped-trot.toml");
        without_physics.components.retain(|component| component.name != "physics");
        assert!(!is_simulation(&without_physics));
        let mut with_program = plan("quadruped-trot.toml");
        with_program.components[1].program = Program::Exec { path: "driver".into() };
        assert!(!is_simulation(&with_program));
    }

    fn question(stage: Stage) -> Question {
        Question {
            evaluation: 3,
            evaluations: 40,
            values: vec![2.25, 15.0],
            last: Some(vec![2.5, 15.0]),
            best: Some(0.5),
            stage,
        }
    }

    #[test]
    fn proposals_show_units_ranges_and_changes() {
        let parameters = ["policy.config.frequency=1:4", "policy.config.joint_command.kp=5:50:log"];
        let parameters: Vec<Parameter> = parameters.map(|text| text.parse().expect("a parameter")).into();
        let terminal = Terminal::new(&plan("quadruped-trot.toml"), &parameters, Arc::default());
        let shown = text(&question(Stage::Proposed), Some(&terminal.rows), terminal.duration);
        let expected = "evaluation 3 of 40, best reward 0.5\n  \
             policy.config.frequency         2.25 Hz  (1 to 4, last 2.5, change -0.25)\n  \
             policy.config.joint_command.kp  15  (5 to 50, unchanged)\n\
             an episode of 10 s on the robot: run, skip or stop?\n";
        assert_eq!(shown, expected);
        let stopped = Evaluation::failed(Outcome::Stopped, "`policy` ended: SIGKILL");
        let shown = text(&question(Stage::Ended(stopped)), None, terminal.duration);
        let expected =
            "evaluation 3 of 40, best reward 0.5\nstopped: `policy` ended: SIGKILL\nrepeat or stop?\n";
        assert_eq!(shown, expected);
        let finished = Stage::Ended(Evaluation::finished(-0.25));
        let first = Question { last: None, best: None, ..question(finished) };
        let shown = text(&first, None, terminal.duration);
        assert_eq!(shown, "evaluation 3 of 40, no reward yet\nreward -0.25: accept, repeat or stop?\n");
    }

    #[test]
    fn unfinished_line_is_the_end_of_the_input() {
        let (source, mut sink) = std::io::pipe().expect("a pipe");
        let mut lines = Lines { source, read: Vec::new(), interrupted: Arc::default() };
        sink.write_all(b"run\nacc").expect("written");
        assert_eq!(lines.next().as_deref(), Some("run\n"));
        sink.write_all(b"ept\r\nrun").expect("written");
        assert_eq!(lines.next().as_deref(), Some("accept\r\n"));
        drop(sink);
        assert_eq!((lines.next(), lines.next()), (None, None));
    }

    #[test]
    fn interruption_ends_the_wait_for_an_answer() {
        let (source, mut sink) = std::io::pipe().expect("a pipe");
        let interrupted = Arc::new(AtomicBool::new(false));
        let mut lines = Lines { source, read: Vec::new(), interrupted: interrupted.clone() };
        let waiting = std::thread::spawn(move || lines.next());
        interrupted.store(true, Relaxed);
        assert_eq!(waiting.join().expect("a thread"), None);
        let (source, _sink) = std::io::pipe().expect("a pipe");
        sink.write_all(b"run\n").expect_err("nobody reads");
        let mut endless = Lines { source, read: vec![b'r'; LONGEST + 1], interrupted: Arc::default() };
        assert_eq!(endless.next(), None);
    }
}
