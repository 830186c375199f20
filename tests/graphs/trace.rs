//! Traces of whole graphs: their files are parsed like Perfetto parses them, and compared with the report of
//! the same run.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

use motorium::graph::{self, Machine, Override};
use motorium::launcher::{Exit, Options};
use motorium::region::{TraceEvent, TraceReader};
use motorium::run_folder::RunFolder;
use motorium::session::Session;
use serde_json::Value;

use crate::MOTORIUM;
use crate::support::{Ended, machine, panda_reach, run, workspace};

/// Traces the Panda; returns its report and the trace.
fn traced(output: &Path, arguments: &[&str]) -> (Ended, Value) {
    let ended = Command::new(MOTORIUM)
        .args(["trace", "graphs/panda-reach.toml", "--for", "500 ms", "--json", "--output"])
        .arg(output)
        .args(arguments)
        .current_dir(workspace())
        .stdin(Stdio::null())
        .output()
        .expect("motorium starts");
    let ended = Ended::from_output(&ended);
    let text = std::fs::read(output).unwrap_or_else(|error| panic!("{error}: {}", ended.stderr));
    let trace = serde_json::from_slice(&text).expect("JSON");
    (ended, trace)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn events(trace: &Value) -> &[Value] {
    trace["traceEvents"].as_array().expect("events")
}

/// Returns start and end of the steps of a row, us.
fn steps(trace: &Value, row: u64) -> Vec<(f64, f64, &Value)> {
    let steps = events(trace).iter().filter(|event| event["cat"] == "step" && event["tid"] == row);
    steps.map(|step| (number(&step["ts"]), number(&step["ts"]) + number(&step["dur"]), step)).collect()
}

/// Returns the rows by component name.
fn rows(trace: &Value) -> BTreeMap<String, u64> {
    let names = events(trace).iter().filter(|event| event["name"] == "thread_name");
    names
        .map(|name| {
            (name["args"]["name"].as_str().expect("a name").to_string(), name["tid"].as_u64().expect("a row"))
        })
        .collect()
}

/// Half a nanosecond, because times are written in us.
const ROUNDING: f64 = 5e-4;

fn compared(ended: &Ended, trace: &Value) {
    let report = ended.report();
    assert_eq!(report.exit, Exit::Finished, "{}", ended.stderr);
    assert_eq!(trace["otherData"]["lost_events"], serde_json::json!({}), "{}", ended.stderr);
    let rows = rows(trace);
    assert_eq!(rows.len(), report.components.len());
    for component in &report.components {
        let steps = steps(trace, rows[&component.name]);
        assert_eq!(steps.len() as u64, component.steps, "{}", component.name);
        for (index, (begin, end, step)) in steps.iter().enumerate() {
            assert_eq!(step["name"], component.name.as_str());
            assert_eq!(step["args"]["step"], index, "steps are in order");
            assert!(begin <= end, "{step}");
        }
        for pair in steps.windows(2) {
            assert!(pair[0].1 <= pair[1].0 + ROUNDING, "no two steps overlap: {} {}", pair[0].2, pair[1].2);
        }
    }
    let within = |event: &Value| {
        let at = number(&event["ts"]);
        let row = event["tid"].as_u64().expect("a row");
        let steps = steps_at(trace, row, at);
        assert!(steps, "in no step: {event}");
        at
    };
    let arrows = |phase: &str| -> BTreeMap<u64, &Value> {
        let ends = events(trace).iter().filter(|event| event["ph"] == phase);
        ends.map(|end| (end["id"].as_u64().expect("a number"), end)).collect()
    };
    let (tails, heads) = (arrows("s"), arrows("f"));
    assert_eq!(tails.keys().collect::<Vec<_>>(), heads.keys().collect::<Vec<_>>());
    assert!(tails.len() as u64 > report.components[0].steps, "{} arrows", tails.len());
    // Checking all of them takes long in a debug build: check every seventh.
    for (tail, head) in tails.values().zip(heads.values()).step_by(7) {
        assert!(within(tail) <= within(head), "a sample is read after it was published: {tail} {head}");
        assert_eq!((&tail["name"], &tail["cat"]), (&head["name"], &head["cat"]));
    }
    // A triggered component is woken by each sample of its topic, until the end of the run.
    let woken =
        |topic: &str| tails.values().filter(|tail| tail["name"] == topic && tail["cat"] == "wakes").count();
    for (reader, topic) in [
        ("encoder", "panda/true_joint_state"),
        ("policy", "panda/joint_state"),
        ("controller", "panda/target"),
    ] {
        let steps =
            report.components.iter().find(|component| component.name == reader).expect("it runs").steps;
        assert!(woken(topic) as u64 + 2 >= steps, "{reader}: {} of {steps}", woken(topic));
    }
}

fn steps_at(trace: &Value, row: u64, at: f64) -> bool {
    events(trace).iter().any(|event| {
        event["cat"] == "step"
            && event["tid"] == row
            && number(&event["ts"]) <= at + ROUNDING
            && at <= number(&event["ts"]) + number(&event["dur"]) + ROUNDING
    })
}

#[test]
fn a_real_time_trace_has_every_step_on_its_release_grid() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("new/trace.json");
    let (ended, trace) = traced(&file, &["--force"]);
    compared(&ended, &trace);
    let physics = rows(&trace)["physics"];
    let steps = steps(&trace, physics);
    let release = |step: &Value| number(&step["ts"]) - number(&step["args"]["lateness_us"]);
    let first = release(steps[0].2);
    for (begin, end, step) in &steps {
        let periods = (release(step) - first) / 1000.0;
        assert!((periods - periods.round()).abs() < 1e-5, "a release off the grid of 1 ms: {step}");
        assert_eq!(step["args"]["budget_us"], 200.0);
        let response = number(&step["args"]["response_us"]);
        assert!((response - (end - release(step))).abs() < 4.0 * ROUNDING, "{step}");
        assert!(*begin >= release(step) - ROUNDING);
        assert_eq!(step["args"]["missed"] == true, response > 1000.0, "{step}");
    }
    // The trace of a waiting component shows what woke it.
    let wakes: Vec<_> = events(&trace).iter().filter(|event| event["cat"] == "wake-up").collect();
    assert!(wakes.iter().any(|wake| wake["args"]["released_by"] == "panda/target"));
    assert!(ended.stderr.contains(" hand-overs"), "{}", ended.stderr);
}

#[test]
fn a_lockstep_trace_has_every_step_and_no_side_effects() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let (ended, trace) = traced(&folder.path().join("trace.json"), &["--clock", "lockstep"]);
    compared(&ended, &trace);
    let untraced = run(&panda_reach(), &["--clock", "lockstep", "--for", "500 ms"]);
    assert_eq!(ended.report().state_hash, untraced.report().state_hash);
    let physics = rows(&trace)["physics"];
    for (index, (_, _, step)) in steps(&trace, physics).iter().enumerate() {
        let time = number(&step["args"]["simulated_time_s"]);
        assert!((time - 1e-3 * index as f64).abs() < 1e-9, "{step}");
    }
    assert_eq!(ended.report().components[0].allocations, Some(0));
}

#[test]
fn overwritten_events_are_counted() {
    let text = std::fs::read_to_string(panda_reach()).expect("the graph is there");
    let lockstep: Override = "clock=lockstep".parse().expect("an override");
    let registry = motorium_tools::registry();
    let checked = graph::check(&panda_reach(), text, &[lockstep], &registry, &Machine::detect());
    let mut plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let launch = |plan| Session::launch(plan, &registry, &Options::inline()).expect("it starts");
    let region =
        |session: &Session<'_>| RunFolder::find(session.id()).expect("it is there").region().expect("mapped");
    let step_until = |session: &mut Session<'_>, ms| {
        session.step_until(std::time::Duration::from_millis(ms)).expect("the run continues");
    };

    let mut session = launch(plan.clone());
    step_until(&mut session, 5);
    assert_eq!(TraceReader::new(0).read(&region(&session)), [], "a run that is not traced has no trace");
    drop(session);

    // Nine events of the physics are three of its steps: a command read, a state published, the step.
    plan.trace_events = 10;
    let mut session = launch(plan);
    let (region, mut reader) = (region(&session), TraceReader::new(0));
    step_until(&mut session, 3);
    let numbers = |events: &[TraceEvent]| -> Vec<u64> {
        let number = |event: &TraceEvent| match event {
            TraceEvent::Step { number, .. } => Some(*number),
            TraceEvent::Published { .. } | TraceEvent::Read { .. } => None,
        };
        events.iter().filter_map(number).collect()
    };
    assert_eq!(numbers(&reader.read(&region)), [0, 1, 2]);
    assert_eq!(reader.lost(), 0);
    step_until(&mut session, 50);
    let events = reader.read(&region);
    assert_eq!(events.len(), 15, "a ring of 16, less the slot that is written next");
    assert_eq!(numbers(&events), [45, 46, 47, 48, 49]);
    assert_eq!(reader.lost(), 47 * 3 - 15);
    // The run ends, and its output stays readable.
    session.stop();
    assert_eq!(reader.read(&region), []);
}
