//! Runs that ended regularly without completing their task: each has a warning and exit code 7.

use std::os::unix::fs::PermissionsExt as _;
use std::process::{Command, Stdio};
use std::time::Duration;

use motorium::launcher::Exit;
use rustix::process::Signal;

use crate::MOTORIUM;
use crate::commands::motorium;
use crate::recording::text;
use crate::support::{Ended, Run, await_that, kill, machine, panda_reach, run, signal, workspace};

/// Asserts that the run ended regularly, with exit code 7 and a warning that contains these words.
fn is_short_of(ended: &Ended, words: &[&str]) {
    let report = ended.report();
    assert!(matches!(report.exit, Exit::Finished | Exit::Interrupted), "{:?}", report.exit);
    let is_named = report.warnings.iter().any(|warning| words.iter().all(|word| warning.contains(word)));
    assert!(is_named, "{words:?}: {:?}", report.warnings);
    assert_eq!(ended.code, Some(7), "{:?}", report.warnings);
}

#[test]
fn a_killed_or_hung_recorder_is_reported() {
    let _machine = machine();
    let scratch = tempfile::tempdir().expect("a folder");
    for (name, end) in [("a.mcap", Signal::KILL), ("b.mcap", Signal::STOP)] {
        let file = scratch.path().join(name);
        let run = Run::start(&panda_reach(), &["--for", "8 s", "--record", text(&file)]);
        signal(run.pid_of("recorder"), end);
        is_short_of(&run.finish(), &["`recorder` ended before the run"]);
    }
}

#[test]
fn an_actuator_that_dies_or_stops_in_settle_is_reported() {
    let _machine = machine();
    for end in [Signal::KILL, Signal::STOP] {
        let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "safety.settle=2 s"]);
        let physics = run.pid_of("physics");
        signal(run.launcher(), Signal::INT);
        await_that("the robot settles", || run.is_safe("physics"));
        signal(physics, end);
        let ended = run.finish();
        is_short_of(&ended, &["`physics`"]);
        assert!(ended.stderr.contains("physics"), "{}", ended.stderr);
    }
}

#[test]
fn an_actuator_without_commands_is_reported() {
    let _machine = machine();
    let run = Run::start(
        &panda_reach(),
        &["--for", "3 s", "--set", "component.physics.lost_steps=0.05", "--set", "realtime.hang_after=10 s"],
    );
    signal(run.pid_of("controller"), Signal::STOP);
    is_short_of(&run.finish(), &["`physics` was in its safe state for"]);
}

#[test]
fn a_stop_is_confirmed_by_an_actuator_that_is_being_restarted() {
    let _machine = machine();
    let settings =
        ["--for", "60 s", "--set", "component.physics.restart={ when = \"failure\", at_most = 100 }"];
    let run = Run::start(&panda_reach(), &settings);
    kill(run.pid_of("physics"));
    let (code, text) = motorium(&run, &["stop", "--now", "--json"]);
    let confirmed: serde_json::Value = serde_json::from_str(
        text.lines().take_while(|line| !line.starts_with("error")).collect::<String>().as_str(),
    )
    .unwrap_or_default();
    let has_confirmed = confirmed[0]["after_ms"].is_number();
    assert_eq!(
        (code == Some(0), confirmed[0]["name"].as_str()),
        (has_confirmed, Some("physics")),
        "{code:?} {text}"
    );
    assert_eq!(motorium(&run, &["stop"]).0, Some(0));
    run.finish();
}

#[test]
fn a_stop_that_nobody_can_confirm_fails() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "realtime.hang_after=10 s"]);
    signal(run.pid_of("physics"), Signal::STOP);
    let (code, text) = motorium(&run, &["stop", "--now"]);
    assert!(code == Some(1) && text.contains("not in its safe state"), "{code:?} {text}");
    signal(run.pid_of("physics"), Signal::CONT);
    assert_eq!(motorium(&run, &["stop"]).0, Some(0));
    run.finish();
}

#[test]
fn the_last_moments_are_kept_when_the_launcher_dies() {
    let _machine = machine();
    let scratch = tempfile::tempdir().expect("a folder");
    for count in 0..4 {
        let file = scratch.path().join(format!("{count}.mcap"));
        let run = Run::start(&panda_reach(), &["--record", text(&file), "--record-last", "2 s"]);
        let folder = run.folder.clone();
        kill(run.launcher());
        await_that("the guard has ended the run", || !folder.is_alive());
        drop(run);
        assert!(file.exists(), "run {count}");
    }
}

#[test]
fn a_recording_is_overwritten_only_on_request() {
    let _machine = machine();
    let scratch = tempfile::tempdir().expect("a folder");
    let file = scratch.path().join("a.mcap");
    std::fs::write(&file, "valuable").expect("it can be written");
    let arguments = ["--clock", "lockstep", "--for", "100 ms", "--no-expect", "--record", text(&file)];
    let ended = run(&panda_reach(), &arguments);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    let message = format!("{}{}", ended.stdout, ended.stderr);
    assert!(message.contains("--overwrite"), "{message}");
    assert_eq!(std::fs::read(&file).expect("it is there"), b"valuable");
    let ended = run(&panda_reach(), &[&arguments[..], &["--overwrite"]].concat());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(std::fs::metadata(&file).expect("it is there").len() > 1_000);
}

#[test]
fn check_warns_of_a_bridge_in_lockstep() {
    let warning = "simulated time does not wait for foreign programs";
    for (clock, is_warned) in [("realtime", false), ("lockstep", true)] {
        let output = Command::new(MOTORIUM)
            .args(["check", "graphs/panda-bridge.toml", "--set", &format!("clock={clock}")])
            .current_dir(workspace())
            .output()
            .expect("motorium starts");
        let text =
            format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(text.contains(warning), is_warned, "{clock}: {text}");
    }
}

#[test]
fn a_replaced_program_still_starts_its_own_guard() {
    let _machine = machine();
    let scratch = tempfile::tempdir().expect("a folder");
    let program = scratch.path().join("motorium");
    std::fs::copy(MOTORIUM, &program).expect("it can be copied");
    let mut child = Command::new(&program)
        .args(["run", text(&panda_reach()), "--for", "4 s", "--no-expect", "--json", "--force"])
        .args(["--set", "realtime.lost_steps=1"])
        .current_dir(workspace())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let launcher = child.id();
    let guard = || -> Option<u32> {
        let region = motorium::run_folder::RunFolder::list().into_iter().filter_map(|run| run.region().ok());
        let header = |region: &motorium::region::Region| {
            let relaxed = std::sync::atomic::Ordering::Relaxed;
            (region.header().launcher.load(relaxed), region.header().guard.load(relaxed))
        };
        let mut own =
            region.map(|region| header(&region)).filter(|(own, guard)| *own == launcher && *guard != 0);
        own.next().map(|(_, guard)| guard)
    };
    await_that("it has a guard", || guard().is_some());
    std::thread::sleep(Duration::from_millis(500));
    let first = guard().expect("it has a guard");
    std::fs::rename(&program, scratch.path().join("old")).expect("it can be moved");
    std::fs::write(&program, "#!/bin/sh\n").expect("it can be written");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("it can be run");
    kill(first);
    await_that("another guard", || guard().is_some_and(|guard| guard != first));
    let output = loop {
        if child.try_wait().expect("a status").is_some() {
            break child.wait_with_output().expect("its output");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let ended = Ended::from_output(&output);
    assert_eq!(ended.stderr.matches("`guard`").count(), 1, "{}", ended.stderr);
    assert!(
        !ended.report().warnings.iter().any(|warning| warning.contains("guard")),
        "{:?}",
        ended.report().warnings
    );
}
