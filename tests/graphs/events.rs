//! The event log of a run: its content, its readers, and its lack of side effects.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use motorium::launcher::{Event, LoggedEvent, Options, REPORTED_EVENTS};
use motorium::region::{EventKind, EventSeverity};
use motorium::session::Session;
use rustix::process::Signal;

use crate::support::{Ended, MOTORIUM, Run, await_that, kill, machine, panda_reach, run, signal, workspace};

/// Returns the events that `motorium events ARGUMENTS --json` prints for a run.
fn events(run: &str, arguments: &[&str]) -> Vec<LoggedEvent> {
    let output = Command::new(MOTORIUM).args(["events", run, "--json"]).args(arguments).output();
    let output = output.expect("motorium starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    parsed(&String::from_utf8_lossy(&output.stdout))
}

fn parsed(lines: &str) -> Vec<LoggedEvent> {
    lines.lines().map(|line| serde_json::from_str(line).expect("an event in JSON")).collect()
}

fn kinds(events: &[LoggedEvent]) -> Vec<EventKind> {
    events.iter().map(|event| event.kind).collect()
}

fn event_of_kind(events: &[LoggedEvent], kind: EventKind) -> &LoggedEvent {
    events.iter().find(|event| event.kind == kind).unwrap_or_else(|| panic!("{kind:?} in {events:#?}"))
}

/// Follows the events of a run until the run ends.
fn follow(run: &str) -> Child {
    let mut command = Command::new(MOTORIUM);
    command.args(["events", run, "--follow", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("motorium starts")
}

#[test]
fn a_failure_and_its_restart_are_in_the_event_log() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "controller.restart.when=failure"]);
    let id = run.folder.id().to_string();
    let killed = run.pid_of("controller");
    kill(killed);
    await_that("a restart", || run.pid_of("controller") != killed);
    run.await_running("controller");
    let shown = events(&id, &[]);
    assert_eq!(kinds(&shown)[..2], [EventKind::Created, EventKind::Started]);
    assert!(shown[0].time_s < 0.0, "before the first step: {:?}", shown[0]);
    let failed = event_of_kind(&shown, EventKind::Failed);
    assert_eq!((failed.severity, failed.component.as_deref()), (EventSeverity::Error, Some("controller")));
    assert!(failed.text.contains("SIGKILL") && failed.text.contains("restarting"), "{}", failed.text);
    let restarted = event_of_kind(&shown, EventKind::Restarted);
    assert!(restarted.time_s > failed.time_s && restarted.value > 0.0, "{restarted:?}");
    // Two more equivalent commands.
    let of_controller = events(&id, &["--component", "controller", "--severity", "error"]);
    assert_eq!(kinds(&of_controller), [EventKind::Failed]);
    assert_eq!(kinds(&events(&id, &["--kind", "restarted", "-n", "1"])), [EventKind::Restarted]);
    let top = Command::new(MOTORIUM).args(["top", &id, "--once", "--json"]).output().expect("it runs");
    let top: serde_json::Value = serde_json::from_slice(&top.stdout).expect("data");
    let newest = top["events"].as_array().expect("events");
    assert!((1..=5).contains(&newest.len()), "{newest:?}");
    let ended = {
        signal(run.launcher(), Signal::INT);
        run.finish()
    };
    let report = ended.report();
    assert_eq!(report.events_left_out, 0);
    assert!(report.events.iter().any(|event| event == failed), "{:#?}", report.events);
    assert_eq!(event_of_kind(&report.events, EventKind::Ending).text, "the run ends: requested by a signal");
    assert!(report.events.is_sorted_by(|a, b| a.time_s <= b.time_s), "{:#?}", report.events);
}

#[test]
fn entering_and_leaving_the_safe_state_is_in_the_log() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "realtime.hang_after=10 s"]);
    let id = run.folder.id().to_string();
    let controller = run.pid_of("controller");
    let changes = || -> Vec<EventKind> {
        kinds(&events(&id, &["--component", "physics", "-k", "entered_safe_state", "-k", "left_safe_state"]))
    };
    let await_changes = |count: usize| {
        await_that("the change is in the log", || changes().len() >= count);
    };
    await_changes(1);
    let before = changes().len();
    signal(controller, Signal::STOP);
    await_changes(before + 1);
    signal(controller, Signal::CONT);
    await_changes(before + 2);
    let shown = events(&id, &["--component", "physics"]);
    let entered = event_of_kind(&shown, EventKind::EnteredSafeState);
    assert_eq!(entered.severity, EventSeverity::Warning);
    assert_eq!(entered.text, "`physics` entered its safe state: its commands are stale");
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let last = ended.report().events.iter().rfind(|event| event.kind == EventKind::EnteredSafeState);
    let last = last.expect("the end of the run brings it there");
    assert_eq!((last.severity, last.text.ends_with("the run ends")), (EventSeverity::Information, true));
}

#[test]
fn followers_read_guard_events_without_the_launcher() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let mut follower = follow(run.folder.id());
    let mut events = BufReader::new(follower.stdout.take().expect("it is piped"));
    let mut shown = String::new();
    events.read_line(&mut shown).expect("it shows the first event");
    kill(run.launcher());
    events.read_to_string(&mut shown).expect("text");
    let output = follower.wait_with_output().expect("it ends with the run");
    let shown = parsed(&shown);
    let ended = event_of_kind(&shown, EventKind::LauncherEnded);
    assert!(ended.text.contains("was killed") && ended.severity == EventSeverity::Error, "{ended:?}");
    let acted = event_of_kind(&shown, EventKind::GuardActed);
    assert!(acted.text.contains("`physics` in its safe state"), "{acted:?}");
    assert!(acted.time_s > ended.time_s);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("is over"), "{errors}");
    drop(run);
}

#[test]
fn log_of_a_crashed_run_is_read_by_its_id() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    // A running launcher would replace its guard.
    signal(run.launcher(), Signal::STOP);
    kill(run.guard());
    kill(run.launcher());
    await_that("the run is dead", || !run.folder.is_alive());
    let shown = events(&id, &[]);
    assert_eq!(kinds(&shown)[..2], [EventKind::Created, EventKind::Started]);
    let follower = follow(&id).wait_with_output().expect("it ends immediately: the run is over");
    assert_eq!(parsed(&String::from_utf8_lossy(&follower.stdout)).len(), shown.len());
    let components: Vec<u32> = {
        let region = run.folder.region().expect("it is still there");
        let pids = region.components().iter();
        pids.map(|block| block.pid.load(std::sync::atomic::Ordering::Relaxed)).collect()
    };
    components.iter().for_each(|pid| crate::support::await_end(*pid));
    run.folder.remove();
}

#[test]
fn the_log_is_a_topic_that_can_be_listed_and_echoed() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let command = |arguments: &[&str]| {
        let output = Command::new(MOTORIUM).args(arguments).args(["--run", run.folder.id()]).output();
        let output = output.expect("motorium starts");
        (
            output.status.success(),
            String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned(),
        )
    };
    let (_, rows) = command(&["topic", "list", "--json"]);
    let rows: serde_json::Value = serde_json::from_str(&rows).expect("rows");
    let row = rows.as_array().expect("rows").last().expect("a row").clone();
    assert_eq!(
        (row["name"].as_str(), row["type"].as_str()),
        (Some("motorium/events"), Some("motorium.Event"))
    );
    let (good, text) = command(&["topic", "echo", "motorium/events", "--count", "2", "--json"]);
    assert!(good, "{text}");
    let samples: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).expect("a sample")).collect();
    assert_eq!(samples[0]["value"]["code"], EventKind::Created as u32);
    assert_eq!(samples[1]["value"]["text"], "all ports connected, running");
    let (good, text) = command(&["topic", "echo", "motorium/events", "--rate", "2"]);
    assert!(!good && text.contains("remove --rate"), "{text}");
    let (good, text) = command(&["topic", "hz", "motorium/events"]);
    assert!(!good && text.contains("motorium events"), "{text}");
}

/// Runs a graph in lockstep.
fn lockstep_events(graph: &Path, arguments: &[&str]) -> Ended {
    run(graph, &[&["--clock", "lockstep"], arguments].concat())
}

/// Kind, simulated time, episode, component and text of an event.
type EventFacts = (EventKind, Option<f64>, Option<u64>, Option<String>, String);

/// Returns the machine-independent part: everything except times in real time and printed lines.
fn repeatable(events: &[LoggedEvent]) -> Vec<EventFacts> {
    let message = events.iter().filter(|event| !matches!(event.kind, EventKind::Output | EventKind::Created));
    message
        .map(|event| {
            (event.kind, event.simulated_s, event.episode, event.component.clone(), event.text.clone())
        })
        .collect()
}

#[test]
fn equal_lockstep_runs_log_the_same_events_in_any_hosting() {
    let graph = panda_reach();
    let of_hosting = |hosting: &str| {
        let arguments = ["--for", "700 ms", "--hosting", hosting, "--episodes", "2", "--vary-seed"];
        let ended = lockstep_events(&graph, &arguments);
        let report = ended.report();
        let hash = report.state_hash.clone().expect("a hash");
        (hash, repeatable(&report.events))
    };
    let (hash, message) = of_hosting("processes");
    assert_eq!((hash.clone(), message.clone()), of_hosting("processes"));
    assert_eq!((hash, message.clone()), of_hosting("inline"));
    let reset = message.iter().find(|(kind, ..)| *kind == EventKind::Reset).expect("a reset");
    assert_eq!((reset.1, reset.2), (Some(0.0), Some(1)));
    let entries = message.iter().filter(|(kind, ..)| *kind == EventKind::EnteredSafeState).count();
    assert_eq!(entries, 0, "a reset is no outage: {message:#?}");
}

#[test]
fn refused_commands_are_in_the_log_with_their_reason() {
    let config = "nonsense = \"far_position\", from = 300, until = 600";
    let (_folder, graph) =
        crate::commands::rogue(config, Path::new(crate::commands::ROGUE), "limits = \"refuse\"");
    let ended = lockstep_events(&graph, &["--for", "2 s"]);
    let message: Vec<&LoggedEvent> =
        ended.report().events.iter().filter(|event| event.kind == EventKind::Refused).collect();
    let sum: f64 = message.iter().map(|event| event.value).sum();
    assert_eq!(sum, 300.0, "{message:#?}");
    assert!(message.len() < 5, "they are reported together: {message:#?}");
    assert!(message[0].text.contains("beyond a limit"), "{}", message[0].text);
    let entered = event_of_kind(&ended.report().events, EventKind::EnteredSafeState);
    assert_eq!(entered.text, "`physics` entered its safe state: its commands are refused");
    assert!((0.3..0.45).contains(&entered.simulated_s.expect("simulated time")), "{entered:?}");
}

#[test]
fn a_flood_of_output_is_bounded_and_counted_in_the_report() {
    let _machine = machine();
    let (_folder, graph) = crate::faults::faulty("{ fault = \"print\", at = 0 }", "");
    let ended = lockstep_events(&graph, &["--for", "2 s"]);
    let report = ended.report();
    assert!(report.events.len() <= REPORTED_EVENTS, "{}", report.events.len());
    let lines = report.events.iter().filter(|event| event.kind == EventKind::Output).count();
    assert!(lines > 0 && report.events_left_out > 500, "{lines} lines, {} left out", report.events_left_out);
    event_of_kind(&report.events, EventKind::Ending);
}

#[test]
fn a_session_reads_its_events_once_each() {
    let path = workspace().join("graphs/panda-reach.toml");
    let text = std::fs::read_to_string(&path).expect("the graph is there");
    let settings = ["clock=lockstep".parse().expect("an override")];
    let registry = motorium_tools::registry();
    let machine = motorium::graph::Machine::detect();
    let plan =
        motorium::graph::check(&path, text, &settings, &registry, &machine).expect("a good graph").plan;
    let mut seen = 0;
    let mut session = Session::observed(plan, &registry, &Options::inline(), |event| {
        seen += usize::from(!matches!(event, Event::Status(_)));
    })
    .expect("it starts");
    assert_eq!(kinds(&session.events()), [EventKind::Created, EventKind::Started]);
    session.step_until(Duration::from_millis(300)).expect("it steps");
    assert_eq!(kinds(&session.events()), [EventKind::LeftSafeState]);
    for seed in 0..200 {
        session.reset(seed).expect("it resets");
    }
    let resets = session.events();
    assert_eq!((resets.len(), session.lost_events()), (128, 200 - 128));
    assert_eq!(resets.last().expect("one").value, 200.0);
    assert_eq!(session.events(), []);
    let report = session.stop();
    assert_eq!(report.events.last().expect("one").kind, EventKind::Ending);
    assert_eq!(report.events_left_out, 200 + 4 - 128);
    assert_eq!(seen, 200 + 4);
}
