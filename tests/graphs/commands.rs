//! The command gate between processes: outages and recovery, and commands out of range.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use motorium::launcher::{ComponentReport, Exit};
use motorium::region::{GateReport, GateState, LimitKind, Limited, Refusal, Refused};
use rustix::process::Signal;

use crate::support::{Ended, FAULTY, MOTORIUM, Run, is_root, machine, panda_reach, run, signal};

pub(crate) const ROGUE: &str = env!("CARGO_BIN_EXE_rogue-commander");

/// Limits of the catalogue's Panda: rad/s and rad/s^2.
const VELOCITY: [f64; 7] = [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61];
const ACCELERATION: [f64; 7] = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0];

fn numbers(ended: &Ended, component: &str, key: &str) -> Vec<f64> {
    let values = ended.report().results[component][key].as_array().expect("a list");
    values.iter().map(|value| value.as_f64().expect("a number")).collect()
}

/// Largest share of its limit that a joint of the arm reached.
fn share(measured: &[f64], limits: &[f64; 7]) -> f64 {
    measured.iter().zip(limits).map(|(x, limit)| x / limit).fold(0.0, f64::max)
}

fn physics(ended: &Ended) -> &ComponentReport {
    ended.report().components.iter().find(|c| c.name == "physics").expect("physics is reported")
}

pub(crate) fn gate(run: &Run) -> GateReport {
    gate_of(run, "physics")
}

pub(crate) fn gate_of(run: &Run, component: &str) -> GateReport {
    let plan = run.folder.plan().expect("the run has a plan");
    let index = plan.components.iter().position(|c| c.name == component).expect("there is such a component");
    run.folder.region().expect("the run has a region").components()[index]
        .gate
        .report()
        .expect("it has a gate")
}

pub(crate) fn await_gate(run: &Run, what: &str, reached: impl Fn(&GateReport) -> bool) {
    let started = Instant::now();
    while !reached(&gate(run)) {
        assert!(started.elapsed() < Duration::from_secs(15), "{what}: {:?}", gate(run));
        std::thread::sleep(Duration::from_millis(2));
    }
}

pub(crate) fn motorium(run: &Run, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(MOTORIUM).args(arguments).args(["--run", run.folder.id()]).output();
    let output = output.expect("motorium starts");
    let text =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code(), text)
}

/// The shipped graph with one additional process that observes every step of the simulation.
fn watched_reach(measure_from: u64) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let text = std::fs::read_to_string(panda_reach()).expect("the graph is there");
    let text = format!(
        "{text}\n[component.watch]\nexec = \"{ROGUE}\"\ntrigger = \"panda/true_joint_state\"\n\
         subscribe = {{ joint_state = \"panda/true_joint_state\" }}\n\
         config = {{ measure_from = {measure_from} }}\n"
    );
    let graph = folder.path().join("watched.toml");
    std::fs::write(&graph, text).expect("it can be written");
    (folder, graph)
}

#[test]
fn the_arm_comes_back_within_limits_after_an_outage() {
    let _machine = machine();
    for away_ms in [500, 3_000] {
        // The recovery is measured, starting shortly before the controller continues.
        let (_folder, graph) = watched_reach(900 + away_ms);
        // Long enough that the stopped controller does not count as hung.
        let run = Run::start(&graph, &["--for", "16 s", "--set", "realtime.hang_after=10 s"]);
        std::thread::sleep(Duration::from_millis(1_000));
        let controller = run.pid_of("controller");
        signal(controller, Signal::STOP);
        await_gate(&run, "it goes to its safe state", |gate| gate.state == GateState::Safe);
        std::thread::sleep(Duration::from_millis(away_ms));
        signal(controller, Signal::CONT);
        await_gate(&run, "it follows again", |gate| gate.state == GateState::Following);
        let ended = run.finish();
        assert_eq!(ended.report().exit, Exit::Finished, "{}", ended.stderr);
        let (fastest, hardest) = (numbers(&ended, "watch", "fastest"), numbers(&ended, "watch", "hardest"));
        assert!(share(&fastest, &VELOCITY) <= 1.0, "{away_ms} ms: {fastest:?} rad/s");
        // From step to step; a step change to the command would be 24 times the limit.
        assert!(share(&hardest, &ACCELERATION) <= 1.0, "{away_ms} ms: {hardest:?} rad/s^2");
        assert!(physics(&ended).gate.as_ref().expect("a gate").entries >= 1);
    }
}

#[test]
fn the_arm_survives_a_pause_of_machine_or_actuator() {
    let _machine = machine();
    let (_folder, graph) = watched_reach(1_000);
    let run = Run::start(&graph, &["--for", "8 s", "--set", "realtime.hang_after=10 s"]);
    std::thread::sleep(Duration::from_millis(1_200));
    let pids = ["physics", "encoder", "policy", "controller"].map(|name| run.pid_of(name));
    let (all, actuator) = (&pids[..], &pids[..1]);
    for still_ms in [3, 8, 30, 4, 60, 15, 2, 25] {
        for pids in [all, actuator] {
            pids.iter().for_each(|pid| signal(*pid, Signal::STOP));
            std::thread::sleep(Duration::from_millis(still_ms));
            pids.iter().for_each(|pid| signal(*pid, Signal::CONT));
            std::thread::sleep(Duration::from_millis(300));
        }
    }
    let ended = run.finish();
    assert_eq!(ended.report().exit, Exit::Finished, "{}", ended.stderr);
    let (fastest, hardest) = (numbers(&ended, "watch", "fastest"), numbers(&ended, "watch", "hardest"));
    assert!(share(&fastest, &VELOCITY) <= 1.0, "{fastest:?} rad/s");
    assert!(share(&hardest, &ACCELERATION) <= 1.0, "{hardest:?} rad/s^2");
    assert!(physics(&ended).gate.as_ref().expect("a gate").entries >= 3, "it was never stopped");
}

#[test]
fn the_arm_follows_a_moving_goal_within_limits() {
    let _machine = machine();
    for (away, within) in [(60, 1_500), (500, 2_500), (3_000, 3_500)] {
        // The controller no longer receives the joint state: it commands nothing, and restarts from the arm's
        // current position.
        let (_folder, graph) = watched_reach(1_000 + away);
        let text = std::fs::read_to_string(&graph).expect("the graph can be read");
        let text = text.replace(
            "subscribe = { joint_state = \"panda/joint_state\", target = \"panda/target\" }",
            "subscribe = { joint_state = \"panda/passed_on\", target = \"panda/target\" }",
        );
        assert!(text.contains("panda/passed_on"), "{text}");
        let until = 1_000 + away;
        let relay = format!(
            "[component.relay]\nexec = \"{FAULTY}\"\ntrigger = \"panda/joint_state\"\n\
             subscribe = {{ input = \"panda/joint_state\" }}\npublish = {{ output = \"panda/passed_on\" }}\n\
             config = {{ fault = \"mute\", at = 1000, until = {until} }}\n"
        );
        std::fs::write(&graph, format!("{text}\n{relay}")).expect("the graph can be written");
        let duration = format!("{} ms", until + within);
        let ended = run(&graph, &["--for", &duration, "--clock", "lockstep"]);
        let gate = physics(&ended).gate.as_ref().expect("a gate");
        let resuming = &ended.report().results["physics"]["steps_resuming"];
        assert_eq!((gate.state, gate.entries), (GateState::Following, 1), "{away} ms: {resuming} steps");
        let (fastest, hardest) = (numbers(&ended, "watch", "fastest"), numbers(&ended, "watch", "hardest"));
        assert!(share(&fastest, &VELOCITY) <= 1.0, "{away} ms: {fastest:?} rad/s");
        assert!(share(&hardest, &ACCELERATION) <= 1.0, "{away} ms: {hardest:?} rad/s^2");
        assert!(gate.limited.is_empty(), "{away} ms: {gate:?}");
    }
}

/// A Panda under the commands of a rogue.
pub(crate) fn rogue(config: &str, program: &Path, more: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = folder.path().join("rogue.toml");
    let program = program.display();
    let text = format!(
        r#"
name = "rogue"
[robot.panda]
urdf = "panda"
[component.physics]
kind = "physics.articulated"
robot = "panda"
rate = "1 kHz"
subscribe = {{ joint_command = "panda/joint_command" }}
publish = {{ joint_state = "panda/joint_state" }}
[component.rogue]
exec = "{program}"
trigger = "panda/joint_state"
subscribe = {{ joint_state = "panda/joint_state" }}
publish = {{ joint_command = "panda/joint_command", stop = "stop" }}
config = {{ {config} }}
[safety]
{more}
"#
    );
    std::fs::write(&graph, text).expect("it can be written");
    (folder, graph)
}

#[test]
fn finite_nonsense_keeps_velocity_limits_and_is_counted() {
    for (nonsense, limit) in [
        ("far_position", LimitKind::Position),
        ("jumping_position", LimitKind::PositionRate),
        ("huge_position", LimitKind::Position),
        ("huge_velocity", LimitKind::Velocity),
        ("huge_effort", LimitKind::Effort),
        ("pure_effort", LimitKind::Effort),
        ("huge_kp", LimitKind::Kp),
        ("huge_kd", LimitKind::Kd),
    ] {
        for joint in [0, 3, 6] {
            let config = format!("nonsense = \"{nonsense}\", joint = {joint}, from = 1000, until = 1600");
            let (_folder, graph) = rogue(&config, Path::new(ROGUE), "");
            let ended = run(&graph, &["--for", "1900 ms", "--clock", "lockstep"]);
            assert_eq!(ended.report().exit, Exit::Finished, "{nonsense}: {}", ended.stderr);
            let fastest = numbers(&ended, "rogue", "fastest");
            assert!(share(&fastest, &VELOCITY) <= 1.05, "{nonsense} of joint {joint}: {fastest:?} rad/s");
            let gate = physics(&ended).gate.as_ref().expect("a gate");
            let name = format!("panda_joint{}", joint + 1);
            let counted = gate.limited.iter().find(|l| l.joint == name && l.limit == limit);
            assert!(counted.is_some_and(|l| l.count > 500), "{nonsense}: {gate:?}");
        }
    }
}

#[test]
fn invalid_commands_are_refused_and_never_followed() {
    for (nonsense, reason) in [("wrong_count", Refusal::Count), ("negative_gain", Refusal::NegativeGain)] {
        let config = format!("nonsense = \"{nonsense}\", from = 300");
        let (_folder, graph) = rogue(&config, Path::new(ROGUE), "");
        let ended = run(&graph, &["--for", "1 s", "--clock", "lockstep"]);
        let gate = physics(&ended).gate.as_ref().expect("a gate");
        assert_eq!((gate.state, gate.entries), (GateState::Safe, 1), "{nonsense}");
        assert!(matches!(gate.refused[..], [ref one] if one.reason == reason && one.count > 600), "{gate:?}");
        let share = share(&numbers(&ended, "rogue", "fastest"), &VELOCITY);
        assert!(share < 0.5, "{nonsense}: the arm is held, {share}");
    }
    for nonsense in ["not_a_number", "infinite"] {
        let config = format!("nonsense = \"{nonsense}\", from = 300");
        let (_folder, graph) = rogue(&config, Path::new(ROGUE), "");
        let ended = run(&graph, &["--for", "1 s", "--clock", "lockstep"]);
        let gate = physics(&ended).gate.as_ref().expect("a gate");
        assert_eq!(
            (gate.state, gate.entries),
            (GateState::Safe, 1),
            "{nonsense}: withheld by its own output"
        );
    }
}

#[test]
fn refused_commands_beyond_a_limit_lead_to_the_safe_state() {
    let config = "nonsense = \"far_position\", from = 300, until = 600";
    let (_folder, graph) = rogue(config, Path::new(ROGUE), "limits = \"refuse\"");
    let ended = run(&graph, &["--for", "2 s", "--clock", "lockstep"]);
    let gate = physics(&ended).gate.as_ref().expect("a gate");
    assert!(matches!(gate.refused[..], [Refused { reason: Refusal::Limits, count: 300 }]), "{gate:?}");
    let joint = "panda_joint1".to_string();
    assert_eq!(gate.limited, [Limited { joint, limit: LimitKind::Position, count: 300 }]);
    assert_eq!((gate.state, gate.entries), (GateState::Following, 1));
}

/// Two Pandas of one simulation, the left one under the commands of a rogue, with `refuse` and
/// `stop_together`.
fn two_robots(folder: &Path, config: &str) -> PathBuf {
    let arm = |name: &str, side: f64, config: &str| {
        format!(
            "[robot.{name}]\nurdf = \"panda\"\nbase = {{ position = [0.0, {side}, 0.0] }}\n\
             [component.{name}-rogue]\nexec = \"{ROGUE}\"\ntrigger = \"{name}/joint_state\"\n\
             subscribe = {{ joint_state = \"{name}/joint_state\" }}\n\
             publish = {{ joint_command = \"{name}/joint_command\", stop = \"{name}/stop\" }}\n\
             config = {{ {config} }}\n"
        )
    };
    let text = format!(
        r#"
name = "two-robots"
[component.physics]
kind = "physics.articulated"
robots = ["left", "right"]
rate = "1 kHz"
subscribe = {{ "left.joint_command" = "left/joint_command", "right.joint_command" = "right/joint_command" }}
publish = {{ "left.joint_state" = "left/joint_state", "right.joint_state" = "right/joint_state" }}
{}{}
[safety]
limits = "refuse"
stop_together = true
"#,
        arm("left", 0.6, config),
        arm("right", -0.6, "")
    );
    let graph = folder.join("two-robots.toml");
    std::fs::write(&graph, text).expect("it can be written");
    graph
}

#[test]
fn one_flapping_robot_does_not_disturb_the_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = "nonsense = \"far_position\", from = 500, until = 1500, every = 50";
    let graph = two_robots(folder.path(), config);
    let ended = run(&graph, &["--for", "3 s", "--clock", "lockstep"]);
    let gate = physics(&ended).gate.as_ref().expect("a gate");
    assert!(matches!(gate.refused[..], [Refused { reason: Refusal::Limits, count: 20 }]), "{gate:?}");
    assert_eq!((gate.state, gate.entries), (GateState::Following, 1), "one stop, and one recovery");
    let robots = &ended.report().results["physics"]["robots"];
    for name in ["left", "right"] {
        // From the first refusal, at 0.5 s, until half a second after the last, at 1.45 s.
        let safe = robots[name]["steps_in_safe_state"].as_u64().expect("a number");
        assert!((1_440..1_480).contains(&safe), "{name}: {safe} steps");
    }
}

#[test]
fn commands_from_a_clock_ahead_are_never_applied() {
    let _machine = machine();
    let ahead = ["--time", "--monotonic", "10"];
    let works = Command::new("unshare").args(ahead).arg("true").status().is_ok_and(|status| status.success());
    if !is_root() || !works {
        return eprintln!("skipped: this user may not set a separate clock for a process");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("ahead");
    let script = format!("#!/bin/sh\nexec unshare --time --monotonic 10 {ROGUE} \"$@\"\n");
    std::fs::write(&program, script).expect("it can be written");
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&program, mode).expect("it can be made executable");
    let (_folder, graph) = rogue("", &program, "");
    let ended = run(&graph, &["--for", "2 s"]);
    let gate = physics(&ended).gate.as_ref().expect("a gate");
    assert_eq!((gate.state, gate.entries), (GateState::Safe, 0), "{gate:?}");
    assert!(gate.refused.iter().any(|r| r.reason == Refusal::Future && r.count > 500), "{gate:?}");
}
