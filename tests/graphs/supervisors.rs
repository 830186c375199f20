//! Launchers and guards that are stopped, killed, terminated or not read: the robot still reaches its safe
//! state.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use motorium::launcher::Exit;
use motorium::run_folder::RunFolder;
use rustix::process::Signal;

use crate::faults::faulty;
use crate::support::{
    MOTORIUM, Run, await_end, await_that, is_alive, kill, leftovers, machine, panda_reach, signal, workspace,
};

const COMPONENTS: [&str; 4] = ["physics", "encoder", "policy", "controller"];

#[test]
fn the_actuator_stays_safe_for_the_settling_time() {
    let _machine = machine();
    let settle = Duration::from_millis(900);
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "safety.settle=900 ms"]);
    let id = run.folder.id().to_string();
    let (physics, guard) = (run.pid_of("physics"), run.guard());
    // like `systemctl stop`
    let asked = Instant::now();
    for component in COMPONENTS {
        signal(run.pid_of(component), Signal::TERM);
    }
    signal(guard, Signal::TERM);
    signal(run.launcher(), Signal::TERM);
    await_that("the safe state", || run.is_safe("physics"));
    run.await_steps("physics", 100);
    assert!(is_alive(physics) && run.is_safe("physics"), "it left before it had settled");
    let ended = run.finish();
    assert!(asked.elapsed() >= settle, "{:?}", asked.elapsed());
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn an_actuator_that_prints_survives_the_launcher() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"print\", at = 0, actuator = true }", "");
    let run = Run::start(&graph, &["--for", "60 s", "--set", "safety.settle=900 ms"]);
    let (faulty, guard) = (run.pid_of("faulty"), run.guard());
    kill(run.launcher());
    let killed = Instant::now();
    run.await_steps("faulty", 100);
    assert!(is_alive(faulty), "its output killed it");
    await_end(faulty);
    assert!(killed.elapsed() >= Duration::from_millis(800), "{:?}", killed.elapsed());
    await_end(guard);
}

#[test]
fn unread_output_delays_neither_restarts_nor_the_end() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"print\", at = 0 }", "");
    // neither standard output nor standard error of the launcher is read
    let mut launcher = Command::new(MOTORIUM)
        .arg("run")
        .arg(&graph)
        .args(["--for", "6 s", "--set", "policy.restart.when=failure"])
        .current_dir(workspace())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("motorium starts");
    let folder = || {
        RunFolder::list().into_iter().find(|folder| {
            folder.region().is_ok_and(|region| {
                region.header().launcher.load(std::sync::atomic::Ordering::Relaxed) == launcher.id()
            })
        })
    };
    await_that("a run", || folder().is_some());
    let folder = folder().expect("it is there");
    // enough lines to fill the pipe many times over
    let steps = |name: &str| {
        let (Ok(plan), Ok(region)) = (folder.plan(), folder.region()) else { return 0 };
        let index = plan.components.iter().position(|c| c.name == name).expect("it exists");
        region.components()[index].steps.load(std::sync::atomic::Ordering::Relaxed)
    };
    await_that("many lines", || steps("faulty") > 2_500);
    let policy = || {
        let region = folder.region().expect("the run has a region");
        region.components()[2].pid.load(std::sync::atomic::Ordering::Relaxed)
    };
    let before = policy();
    kill(before);
    await_that("a restart", || policy() != before);
    let begun = steps("policy");
    await_that("further steps", || steps("policy") > begun + 100);
    await_that("the end of the run", || !folder.path().exists());
    assert!(launcher.try_wait().expect("it can be asked").is_none(), "its last words wait for a reader");
    // its report waits for a reader, and it can be interrupted like any program
    let started = Instant::now();
    while launcher.try_wait().expect("it can be asked").is_none() {
        assert!(started.elapsed() < Duration::from_secs(10), "it cannot be interrupted");
        signal(launcher.id(), Signal::INT);
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn a_stopped_guard_is_replaced_and_the_new_one_guards() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    let first = run.guard();
    signal(first, Signal::STOP);
    await_that("another guard", || run.guard() != first);
    await_end(first);
    let second = run.guard();
    // The launcher prints on a separate thread, which dies with it.
    std::thread::sleep(Duration::from_millis(300));
    kill(run.launcher());
    await_end(second);
    let ended = run.finish();
    assert!(
        ended.stderr.contains("`guard`") && ended.stderr.contains("does not respond"),
        "{}",
        ended.stderr
    );
    assert!(ended.stderr.contains("`physics` in its safe state (hold)"), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn a_guard_that_is_asked_to_end_stays_and_guards() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    let guard = run.guard();
    for how in [Signal::TERM, Signal::INT, Signal::HUP] {
        signal(guard, how);
    }
    run.await_steps("physics", 300);
    assert!(is_alive(guard) && run.guard() == guard, "it left before the run");
    kill(run.launcher());
    await_end(guard);
    let ended = run.finish();
    assert!(ended.stderr.contains("`physics` in its safe state (hold)"), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn a_run_under_nohup_survives_a_hang_up() {
    let _machine = machine();
    // shorter than the steps awaited below, in which a hang-up would have ended the run
    let run = Run::start_under_nohup(&panda_reach(), &["--for", "60 s", "--set", "safety.settle=300 ms"]);
    for process in COMPONENTS.map(|component| run.pid_of(component)).into_iter().chain([run.guard()]) {
        signal(process, Signal::HUP);
    }
    signal(run.launcher(), Signal::HUP);
    run.await_steps("physics", 1000);
    assert!(is_alive(run.launcher()) && !run.is_safe("physics"), "the hang-up ended the run");
    signal(run.launcher(), Signal::TERM);
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
}

#[test]
fn a_stopped_launcher_resumes_supervision() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "policy.restart.when=failure"]);
    signal(run.launcher(), Signal::STOP);
    std::thread::sleep(Duration::from_millis(1_500));
    signal(run.launcher(), Signal::CONT);
    run.await_steps("physics", 300);
    let policy = run.pid_of("policy");
    kill(policy);
    await_that("a restart", || run.pid_of("policy") != policy);
    run.await_steps("policy", 100);
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("does not respond") && ended.stderr.contains("responds again"),
        "{}",
        ended.stderr
    );
}

#[test]
fn the_guard_ends_the_run_of_a_stopped_launcher() {
    let _machine = machine();
    // also for components that end before the guard detects the silence, which takes 1 s
    for (how, after_ms) in
        [(Signal::KILL, 1_200), (Signal::STOP, 1_200), (Signal::KILL, 60), (Signal::KILL, 700)]
    {
        let run = Run::start(&panda_reach(), &["--for", "60 s"]);
        let id = run.folder.id().to_string();
        let guard = run.guard();
        signal(run.launcher(), Signal::STOP);
        std::thread::sleep(Duration::from_millis(after_ms));
        signal(run.pid_of("controller"), how);
        await_end(guard);
        let ended = run.finish();
        let is_reported = ended.stderr.contains("did not respond when component `controller`")
            && ended.stderr.contains("`physics`")
            && ended.stderr.contains("in its safe state (hold)");
        assert!(is_reported, "{}", ended.stderr);
        assert_eq!(leftovers(&id), Vec::<String>::new());
    }
}

#[test]
fn a_dead_actuator_is_named_and_not_certified() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    kill(run.pid_of("physics"));
    let ended = run.finish();
    let warning = "not all actuators are in their safe state: `physics` dead";
    assert!(ended.stderr.contains(warning), "{}", ended.stderr);
    assert!(!ended.stderr.contains("all actuators in their safe state after"), "{}", ended.stderr);
    // the same by the guard: the state in which it died shows nothing
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "physics.on_failure=ignore"]);
    let (physics, guard) = (run.pid_of("physics"), run.guard());
    signal(run.pid_of("controller"), Signal::STOP);
    await_that("the safe state", || run.is_safe("physics"));
    kill(physics);
    await_end(physics);
    kill(run.launcher());
    await_end(guard);
    let ended = run.finish();
    assert!(
        ended.stderr.contains("`physics` had no process that could reach its safe state"),
        "{}",
        ended.stderr
    );
}

#[test]
fn everything_stopped_and_continued_comes_back() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "8 s", "--set", "realtime.lost_steps=1"]);
    let id = run.folder.id().to_string();
    std::thread::sleep(Duration::from_millis(500));
    let components = COMPONENTS.map(|name| run.pid_of(name));
    let guard = run.guard();
    let all = [&components[..], &[guard, run.launcher()]].concat();
    for _ in 0..2 {
        // like a stopped container, or a virtual machine that its host does not schedule
        all.iter().for_each(|pid| signal(*pid, Signal::STOP));
        let steps = run.steps_of("physics");
        std::thread::sleep(Duration::from_millis(1_500));
        assert_eq!(run.steps_of("physics"), steps, "it is stopped");
        all.iter().for_each(|pid| signal(*pid, Signal::CONT));
        await_that("further steps", || run.steps_of("physics") > steps + 100);
        await_that("the commands are followed", || !run.is_safe("physics"));
    }
    assert_eq!((COMPONENTS.map(|name| run.pid_of(name)), run.guard()), (components, guard));
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
    let physics = &ended.report().components[0];
    assert!(physics.gate.as_ref().is_some_and(|gate| gate.entries >= 2), "{physics:?}");
    assert!(ended.report().components.iter().all(|component| component.restarts == 0));
    assert_eq!(leftovers(&id), Vec::<String>::new());
}
