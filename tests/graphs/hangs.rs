//! Components that hang, loop, are stopped or lose steps: every fault is detected, and the robot still
//! reaches its safe state.

use std::time::Duration;

use motorium::launcher::{Exit, Report};
use rustix::process::Signal;

use crate::faults::faulty;
use crate::support::{
    Run, await_end, await_that, is_alive, is_root, kill, leftovers, machine, panda_reach, run, signal,
};

const COMPONENTS: [&str; 4] = ["physics", "encoder", "policy", "controller"];

fn reason(report: &Report) -> &str {
    match &report.exit {
        Exit::SafeStop { reason } => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_stopped_component_is_reported_killed_and_restarted() {
    let _machine = machine();
    let restart: Vec<String> = COMPONENTS.iter().map(|name| format!("{name}.restart.when=failure")).collect();
    let mut arguments = vec!["--for", "60 s", "--set", "realtime.hang_after=50 ms"];
    restart.iter().for_each(|setting| arguments.extend(["--set", setting]));
    let run = Run::start(&panda_reach(), &arguments);
    for component in COMPONENTS {
        run.await_steps(component, 100);
        let pid = run.pid_of(component);
        signal(pid, Signal::STOP);
        await_that(component, || run.pid_of(component) != pid);
        await_end(pid);
        run.await_steps(component, 100);
    }
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
    assert!(ended.report().components.iter().all(|c| c.restarts == 1), "{:?}", ended.report().components);
    for component in COMPONENTS {
        let message = ended.stderr.lines().any(|line| {
            line.contains(&format!("`{component}`"))
                && line.contains("hung: ")
                && line.contains("stopped by a signal")
        });
        assert!(message, "{component}: {}", ended.stderr);
    }
}

#[test]
fn a_stopped_component_leads_to_the_safe_state() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    signal(run.pid_of("controller"), Signal::STOP);
    let ended = run.finish();
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let reason = reason(ended.report());
    assert!(
        reason.contains("`controller`")
            && reason.contains("(`hang_after` is 200 ms): its thread was stopped"),
        "{reason}"
    );
    assert!(ended.stderr.contains("all actuators in their safe state"), "{}", ended.stderr);
    // its rate is measured until the end of the run, not until its last step
    let components = &ended.report().components;
    let rate = |name: &str| components.iter().find(|c| c.name == name).expect("it is reported").rate_hz;
    assert!(rate("controller") < 0.9 * rate("physics"), "{} Hz", rate("controller"));
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn a_step_that_never_ends_is_reported_and_follows_the_policy() {
    let _machine = machine();
    let settings = "hang_after = \"60 ms\"\nrestart = { when = \"failure\" }";
    let (_folder, graph) = faulty("{ fault = \"hang\", at = 200, once = true }", settings);
    let ended = run(&graph, &["--for", "2 s"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
    for message in ["`faulty` at tick 200: hung: step still running after", "(`hang_after` is 60 ms)"] {
        assert!(ended.stderr.contains(message), "{}", ended.stderr);
    }
}

#[test]
fn an_endless_loop_above_the_actuator_is_ended_by_the_kernel() {
    let _machine = machine();
    if !is_root() {
        return eprintln!("skipped: without real-time priority a loop does not block the core");
    }
    let (_folder, graph) = faulty("{ fault = \"loop\", at = 200 }", "cpu_limit = \"12 ms\"");
    let ended = run(&graph, &["--for", "60 s"]);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let reason = reason(ended.report());
    assert!(
        reason.contains("`faulty`") && reason.contains("SIGXCPU") && reason.contains("`cpu_limit`"),
        "{reason}"
    );
    assert!(ended.stderr.contains("all actuators in their safe state"), "{}", ended.stderr);
    // no other component waited for as long as the watchdog time
    let physics = &ended.report().components[0];
    assert!(physics.lateness_ns.max < 200_000_000, "{physics:?}");
    assert!(ended.report().components.iter().any(|c| c.fifo_priority > physics.fifo_priority));
}

#[test]
fn always_late_component_is_not_reported_as_hung() {
    let _machine = machine();
    // each step takes 5 ms, and the next trigger is always there already
    let (_folder, graph) =
        faulty("{ fault = \"work\", at = 200 }", "core = 0\ncpu_limit = \"60 ms\"\nlost_steps = 1");
    let ended = run(&graph, &["--for", "1 s"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
}

#[test]
fn component_with_a_silent_trigger_is_not_hung() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"mute\", at = 100 }", "hang_after = \"50 ms\"");
    let text = std::fs::read_to_string(&graph).expect("the graph can be read");
    let begins = text.find("[component.faulty]").expect("it is there");
    let second = text[begins..]
        .replace("component.faulty", "component.second")
        .replace("panda/joint_state", "panda/passed_on")
        .replace("output = \"panda/passed_on\"", "output = \"panda/passed_on_again\"")
        .replace("mute", "none");
    std::fs::write(&graph, format!("{text}\n{second}")).expect("the graph can be written");
    let ended = run(&graph, &["--for", "1500 ms"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
    let second = ended.report().components.iter().find(|c| c.name == "second").expect("it is reported");
    assert!((50..=100).contains(&second.steps), "{second:?}");
}

#[test]
fn a_triggered_actuator_reaches_its_safe_state_in_silence() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let graph = folder.path().join("drive.toml");
    let text = std::fs::read_to_string(panda_reach()).expect("the graph can be read");
    let drive = "\n[component.drive]\nkind = \"physics.articulated\"\nrobot = \"panda\"\ntrigger = \
                 \"panda/joint_command\"\nsubscribe = { joint_command = \"panda/joint_command\" }\npublish = { \
                 joint_state = \"panda/driven\" }\n";
    std::fs::write(&graph, text + drive).expect("the graph can be written");
    let run = Run::start(&graph, &["--for", "60 s", "--set", "controller.on_failure=ignore"]);
    assert!(!run.is_safe("drive"));
    kill(run.pid_of("controller"));
    await_that("the safe state", || run.is_safe("drive"));
    run.await_steps("drive", 10);
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let steps = &ended.report().results["drive"]["steps_in_safe_state"];
    assert!(steps.as_u64().is_some_and(|steps| steps > 10), "{steps}");
}

#[test]
fn a_hung_lockstep_tick_can_be_interrupted() {
    let _machine = machine();
    for how in [Signal::INT, Signal::TERM] {
        let run = Run::start(&panda_reach(), &["--clock", "lockstep", "--for", "1000 s"]);
        let id = run.folder.id().to_string();
        signal(run.pid_of("controller"), Signal::STOP);
        let stopped = run.steps_of("physics");
        std::thread::sleep(Duration::from_millis(1_500));
        assert!(run.steps_of("physics") <= stopped + 1, "the others waited");
        signal(run.launcher(), how);
        let ended = run.finish();
        assert_eq!(ended.report().exit, Exit::Interrupted, "{}", ended.stderr);
        assert!(ended.stderr.contains("`controller` has been in tick"), "{}", ended.stderr);
        assert_eq!(leftovers(&id), Vec::<String>::new());
    }
}

#[test]
fn a_repeatedly_failing_component_waits_longer() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\", at_most = 100000 }";
    let (_folder, graph) = faulty("{ fault = \"panic\", at = 200 }", restart);
    let ended = run(&graph, &["--for", "3 s"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(7), &Exit::Finished), "{}", ended.stderr);
    let warnings = ended.report().warnings.join("; ");
    assert!(warnings.contains("`faulty` was restarted and did not step again"), "{warnings}");
    let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
    // delays of 0, 20, 40, 80, ... ms: no more than 8 fit into 3 s
    assert!((3..=9).contains(&faulty.restarts), "{} restarts", faulty.restarts);
    assert!(ended.stderr.contains("restarting in 40 ms"), "{}", ended.stderr);
}

#[test]
fn too_many_lost_steps_are_reported() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"stall\", at = 200 }", "priority = 1\nlost_steps = 0.05");
    let ended = run(&graph, &["--for", "2500 ms"]);
    assert_eq!(ended.report().exit, Exit::Finished, "{}", ended.stderr);
    assert!(ended.stderr.contains("of its steps in the last second"), "{}", ended.stderr);
    if ended.report().lost.is_empty() {
        assert_eq!(ended.code, Some(7), "{}", ended.stderr);
        let warnings = ended.report().warnings.join("; ");
        assert!(warnings.contains("`faulty` lost "), "{warnings}");
    }
}

#[test]
fn a_segmentation_fault_is_reported_and_restarted() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "policy.restart.when=failure"]);
    let policy = run.pid_of("policy");
    // Rust's handler for stack overflows treats the first external signal as an accident
    signal(policy, Signal::SEGV);
    std::thread::sleep(Duration::from_millis(50));
    if is_alive(policy) {
        signal(policy, Signal::SEGV);
    }
    await_that("a restart", || run.pid_of("policy") != policy);
    run.await_steps("policy", 100);
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    assert!(ended.stderr.contains("SIGSEGV"), "{}", ended.stderr);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
}

#[test]
fn an_infeasible_graph_is_refused_unless_forced() {
    let _machine = machine();
    let first = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = first.folder.id().to_string();
    let second = run(&panda_reach(), &["--for", "500 ms"]);
    assert_eq!(second.code, Some(1), "{}", second.stderr);
    let message = second.stderr.contains("cannot meet its deadlines next to") && second.stderr.contains(&id);
    assert!(message, "{}", second.stderr);
    let forced = run(&panda_reach(), &["--for", "500 ms", "--force"]);
    assert_eq!(forced.report().exit, Exit::Finished, "{}", forced.stderr);
    // on separate cores they do not interfere
    let elsewhere = ["--for", "500 ms", "--set", "cores={ realtime = [0], shared = [1] }"];
    let apart = run(&panda_reach(), &elsewhere);
    assert_eq!(apart.report().exit, Exit::Finished, "{}", apart.stderr);
    signal(first.launcher(), Signal::INT);
    assert_eq!(first.finish().report().exit, Exit::Interrupted);
}
