//! The latches of the command gate between processes: stops, emergency stops, and their release.

use std::path::Path;
use std::time::{Duration, Instant};

use motorium::launcher::Exit;
use motorium::region::{GateState, Latch};
use rustix::process::Signal;

use crate::commands::{ROGUE, await_gate, gate, gate_of, motorium, rogue};
use crate::support::{Ended, Run, await_that, kill, machine, panda_reach, signal, workspace};

#[test]
fn stop_now_works_while_the_launcher_is_stopped() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    await_gate(&run, "it follows", |gate| gate.state == GateState::Following);
    signal(run.launcher(), Signal::STOP);
    let (code, text) = motorium(&run, &["stop", "--now"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("physics: in its safe state"), "{text}");
    for _ in 0..100 {
        let gate = gate(&run);
        assert_eq!((gate.state, gate.latch), (GateState::Safe, Some(Latch::Stop)));
        std::thread::sleep(Duration::from_millis(2));
    }
    let (code, text) = motorium(&run, &["resume"]);
    assert_eq!(code, Some(0), "{text}");
    await_gate(&run, "it follows again", |gate| gate.state == GateState::Following && gate.latch.is_none());
    let (code, text) = motorium(&run, &["resume"]);
    assert!(code == Some(1) && text.contains("is not stopped"), "{text}");
    signal(run.launcher(), Signal::CONT);
    // the launcher reports its observations
    std::thread::sleep(Duration::from_millis(200));
    for command in [&["stop", "--now"][..], &["resume"]] {
        let (code, text) = motorium(&run, command);
        assert_eq!(code, Some(0), "{text}");
        std::thread::sleep(Duration::from_millis(200));
    }
    let (code, text) = motorium(&run, &["stop"]);
    assert_eq!(code, Some(0), "{text}");
    let ended = run.finish();
    assert_eq!(ended.report().exit, Exit::Interrupted);
    assert_stop_and_resume_reported(&ended, "by `motorium stop --now`; to continue: `motorium resume`");
}

/// Asserts that the launcher reported the stop and its end with these words.
fn assert_stop_and_resume_reported(ended: &Ended, words: &str) {
    let stopped = ended.stderr.lines().position(|line| line.contains("stopped:") && line.contains(words));
    let resumed = ended.stderr.lines().position(|line| line.contains("resumed: the robot returns"));
    let in_order = stopped.zip(resumed).is_some_and(|(stopped, resumed)| stopped < resumed);
    assert!(in_order, "{words}: {}", ended.stderr);
}

#[test]
fn a_latched_outage_lasts_until_resume() {
    let _machine = machine();
    // Commands become stale so late that no stall of the machine counts as an outage.
    let settings = ["safety.resume=latch", "safety.stale_after=2 s", "safety.source_stale_after=2 s"];
    let settings = settings.into_iter().chain(["realtime.hang_after=10 s"]).flat_map(|one| ["--set", one]);
    let arguments: Vec<&str> = ["--for", "60 s"].into_iter().chain(settings).collect();
    let run = Run::start(&panda_reach(), &arguments);
    await_gate(&run, "the start is no outage", |gate| gate.state == GateState::Following);
    let controller = run.pid_of("controller");
    signal(controller, Signal::STOP);
    await_gate(&run, "it is latched", |gate| gate.latch == Some(Latch::SafeState));
    let components = ["controller", "physics"];
    let before = components.map(|name| run.steps_of(name));
    signal(controller, Signal::CONT);
    await_that("fresh commands", || {
        components.iter().zip(before).all(|(name, before)| run.steps_of(name) > before + 300)
    });
    assert_eq!(gate(&run).state, GateState::Safe, "commands are fresh again, and it stays");
    let (code, text) = motorium(&run, &["resume"]);
    assert_eq!(code, Some(0), "{text}");
    await_gate(&run, "it follows again", |gate| gate.state == GateState::Following && gate.latch.is_none());
    assert_eq!(gate(&run).entries, 1, "one outage, one latch");
    let (code, _) = motorium(&run, &["stop"]);
    assert_eq!(code, Some(0));
    assert_stop_and_resume_reported(&run.finish(), "since `physics` entered its safe state");
}

#[test]
fn an_adapter_tripped_by_a_drive_is_latched_until_resume() {
    let _machine = machine();
    let fault = r#"component.drives.config.faults=[{ at = "1 s", kind = "off", lasts = "50 ms", joint = "panda_joint4" }]"#;
    let graph = workspace().join("graphs/panda-can-sim.toml");
    // in lockstep: no stall of the machine counts as an outage
    let run = Run::start(&graph, &["--for", "3600 s", "--set", fault]);
    let await_latch = |latch: Option<Latch>, state: GateState| {
        let started = Instant::now();
        while (gate_of(&run, "adapter").latch, gate_of(&run, "adapter").state) != (latch, state) {
            assert!(started.elapsed() < Duration::from_secs(60), "{:?}", gate_of(&run, "adapter"));
            std::thread::sleep(Duration::from_millis(2));
        }
    };
    await_latch(Some(Latch::SafeState), GateState::Safe);
    run.await_steps("adapter", 1_000);
    let gate = gate_of(&run, "adapter");
    assert_eq!((gate.latch, gate.state), (Some(Latch::SafeState), GateState::Safe));
    let (code, text) = motorium(&run, &["resume"]);
    // The command reports the state at that moment.
    let reports = ["follows its commands again", "is resuming", "is released"];
    assert!(code == Some(0) && reports.iter().any(|report| text.contains(report)), "{text}");
    await_latch(None, GateState::Following);
    assert_eq!(motorium(&run, &["stop"]).0, Some(0));
    let ended = run.finish();
    let adapter = &ended.report().results["adapter"];
    assert_eq!(
        (&adapter["tripped"], &adapter["joints"]["panda_joint4"]["lost"]),
        (&false.into(), &1.into()),
        "{adapter}"
    );
}

#[test]
fn a_restarted_adapter_homes_nothing_while_latched() {
    let _machine = machine();
    let drives = std::fs::read_to_string(workspace().join("graphs/drives/panda.toml")).expect("a table");
    let wrist = "ranges   = { position = 2.9, velocity = 2.7, torque = 12.1 }";
    let homing = r#"ranges = { position = 6.0, velocity = 2.7, torque = 12.1 }
homing = { by = "stop", velocity = 1.5, effort = 2.0, position = 2.8973, back_off = 0.1 }"#;
    assert!(drives.contains(wrist));
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("drives.toml");
    std::fs::write(&table, drives.replace(wrist, homing)).expect("it can be written");
    let of = |component: &str| format!("component.{component}.config.drives=\"{}\"", table.display());
    let settings = [
        of("adapter"),
        of("drives"),
        "component.adapter.restart.when=failure".into(),
        "component.adapter.restart.within=60 s".into(),
        "safety.resume=latch".into(),
    ];
    let arguments = settings.iter().flat_map(|one| ["--set", one.as_str()]).chain(["--for", "3600 s"]);
    let arguments: Vec<&str> = arguments.collect();
    for is_resumed in [false, true] {
        // in lockstep: no stall of the machine counts as an outage
        let run = Run::start(&workspace().join("graphs/panda-can-sim.toml"), &arguments);
        kill(run.pid_of("adapter"));
        await_that("it is latched", || gate_of(&run, "adapter").latch == Some(Latch::SafeState));
        if is_resumed {
            let (code, text) = motorium(&run, &["resume"]);
            assert_eq!(code, Some(0), "{text}");
        }
        let steps = run.steps_of("adapter");
        await_that("it has time to begin", || run.steps_of("adapter") > steps + 500);
        assert_eq!(gate_of(&run, "adapter").latch.is_none(), is_resumed);
        assert_eq!(motorium(&run, &["stop"]).0, Some(0));
        let ended = run.finish();
        let adapter = &ended.report().results["adapter"];
        let is_waiting = adapter["joints"]["panda_joint7"]["homing"] == "waiting";
        assert_eq!(is_waiting, !is_resumed, "{adapter}");
    }
}

#[test]
fn a_pressed_emergency_stop_cannot_be_resumed() {
    let _machine = machine();
    let (_folder, graph) = rogue("from = 500, until = 3500", Path::new(ROGUE), "emergency_stop = \"stop\"");
    let run = Run::start(&graph, &["--for", "60 s"]);
    await_gate(&run, "it stops", |gate| gate.latch == Some(Latch::EmergencyStop));
    let (code, text) = motorium(&run, &["resume"]);
    assert!(code == Some(1) && text.contains("release the emergency stop first"), "{code:?} {text}");
    assert_eq!(gate(&run).state, GateState::Safe);
    await_that("the button is released", || run.steps_of("rogue") > 3_600);
    assert_eq!(gate(&run).latch, Some(Latch::EmergencyStop), "released, it stays latched");
    let (code, text) = motorium(&run, &["resume"]);
    assert_eq!(code, Some(0), "{text}");
    await_gate(&run, "it follows again", |gate| gate.state == GateState::Following);
    let (code, _) = motorium(&run, &["stop"]);
    assert_eq!(code, Some(0));
    let words = "by the emergency stop of `rogue` on `stop`; to continue: release the emergency stop, then";
    assert_stop_and_resume_reported(&run.finish(), words);
}
