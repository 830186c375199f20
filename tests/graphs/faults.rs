//! Reactions of a graph to process deaths and faults: real processes, real signals.

use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{
    Ended, FAULTY, MOTORIUM, Run, await_end, await_that, kill, leftovers, machine, panda_reach, run, signal,
};
use motorium::launcher::Exit;
use motorium::region::{ComponentBlock, Phase};
use motorium::run_folder::RunFolder;
use rustix::process::Signal;

const COMPONENTS: [&str; 4] = ["physics", "encoder", "policy", "controller"];

#[test]
fn each_killed_component_restarts_and_goals_are_reached() {
    let _machine = machine();
    let restart: Vec<String> = COMPONENTS.iter().map(|name| format!("{name}.restart.when=failure")).collect();
    let mut arguments = vec!["--for", "12 s"];
    restart.iter().for_each(|setting| arguments.extend(["--set", setting]));
    let run = Run::start(&panda_reach(), &arguments);
    let id = run.folder.id().to_string();
    for component in COMPONENTS {
        run.await_steps(component, 100);
        let pid = run.pid_of(component);
        kill(pid);
        await_end(pid);
        let killed = Instant::now();
        while run.pid_of(component) == pid {
            assert!(killed.elapsed() < Duration::from_secs(10), "`{component}` is not restarted");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
    let ended = run.finish();
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
    assert!(ended.report().components.iter().all(|c| c.restarts == 1), "{:?}", ended.report().components);
    let error = &ended.report().results["controller"]["position_error_m"];
    assert!(error.as_f64().is_some_and(|error| error < 1e-3), "position error {error}");
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn each_component_killed_for_good_leads_to_the_safe_state() {
    let _machine = machine();
    for component in COMPONENTS {
        let run = Run::start(&panda_reach(), &["--for", "60 s"]);
        let id = run.folder.id().to_string();
        kill(run.pid_of(component));
        let ended = run.finish();
        assert_eq!(ended.code, Some(4), "{}", ended.stderr);
        let Exit::SafeStop { reason } = &ended.report().exit else { panic!("{:?}", ended.report().exit) };
        assert!(reason.contains(component) && reason.contains("SIGKILL"), "{reason}");
        if component != "physics" {
            assert!(ended.stderr.contains("all actuators in their safe state"), "{}", ended.stderr);
        }
        assert_eq!(leftovers(&id), Vec::<String>::new());
    }
}

#[test]
fn the_guard_makes_safe_when_the_launcher_is_killed() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    let workers: Vec<u32> = COMPONENTS.iter().map(|component| run.pid_of(component)).collect();
    let guard = run.guard();
    kill(run.launcher());
    await_end(guard);
    workers.into_iter().for_each(await_end);
    let ended = run.finish();
    assert!(ended.stderr.contains("`physics` in its safe state (hold)"), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

/// Longest permitted exit latency of a core's idle state, us; `None` if this user may not request one.
fn idle_exit_us() -> Option<i32> {
    let mut limits = std::fs::File::options().read(true).write(true).open("/dev/cpu_dma_latency").ok()?;
    let mut bytes = [0; 4];
    limits.read_exact(&mut bytes).ok()?;
    Some(i32::from_ne_bytes(bytes))
}

#[test]
fn the_cores_stay_awake_only_while_a_graph_runs() {
    let _machine = machine();
    let Some(before) = idle_exit_us() else {
        return eprintln!("skipped: this user may not limit idle states");
    };
    let run = Run::start(&panda_reach(), &["--for", "60 s", "--set", "realtime.idle_exit=7 us"]);
    assert_eq!(idle_exit_us(), Some(before.min(7)));
    let guard = run.guard();
    kill(run.launcher());
    await_end(guard);
    assert_eq!(idle_exit_us(), Some(before));
    run.finish();
    let run = Run::start(&panda_reach(), &["--for", "1 s", "--set", "realtime.idle_exit=1 s"]);
    assert_eq!(idle_exit_us(), Some(before));
    assert_eq!(run.finish().report().idle_exit_ns, None);
}

#[test]
fn a_killed_guard_is_replaced_and_the_run_goes_on() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "3 s"]);
    let first = run.guard();
    kill(first);
    let killed = Instant::now();
    while run.guard() == first {
        assert!(killed.elapsed() < Duration::from_secs(5), "no new guard");
        std::thread::sleep(Duration::from_millis(5));
    }
    let ended = run.finish();
    assert_eq!(ended.report().exit, Exit::Finished);
}

#[test]
fn components_end_when_launcher_and_guard_die() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    let workers: Vec<u32> = COMPONENTS.iter().map(|component| run.pid_of(component)).collect();
    let (guard, launcher) = (run.guard(), run.launcher());
    // A running launcher would replace its guard immediately.
    signal(launcher, rustix::process::Signal::STOP);
    kill(guard);
    kill(launcher);
    workers.into_iter().for_each(await_end);
    drop(run);
    assert_ne!(leftovers(&id), Vec::<String>::new());
    let output = Command::new(MOTORIUM).args(["doctor", "--clean", "--json"]).output().expect("it starts");
    assert!(!output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

/// The Panda with a faulty user component between encoder and policy.
pub(crate) fn faulty(fault: &str, settings: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("faulty.toml");
    let text = std::fs::read_to_string(panda_reach()).expect("the graph can be read");
    let added = format!(
        "\n[component.faulty]\nexec = \"{FAULTY}\"\ntrigger = \"panda/joint_state\"\n{settings}\nsubscribe = {{ input = \
         \"panda/joint_state\" }}\npublish = {{ output = \"panda/passed_on\" }}\nconfig = {fault}\n"
    );
    std::fs::write(&path, text + &added).expect("the graph can be written");
    (folder, path)
}

#[test]
fn failures_are_reported_with_component_and_tick() {
    let _machine = machine();
    for (fault, words) in [
        ("panic", "ordered to panic"),
        ("error", "ordered to fail"),
        ("nan", "output `output`: `position`[0] is NaN"),
        ("exit", "exit code 7"),
    ] {
        let (_folder, graph) = faulty(&format!("{{ fault = \"{fault}\", at = 200 }}"), "");
        let ended = run(&graph, &["--for", "20 s"]);
        assert_eq!(ended.code, Some(4), "{fault}: {}", ended.stderr);
        let Exit::SafeStop { reason } = &ended.report().exit else { panic!("{:?}", ended.report().exit) };
        assert!(
            reason.contains("`faulty` failed at tick 200") && reason.contains(words),
            "{fault}: {reason}"
        );
    }
}

#[test]
fn a_tolerated_error_is_counted() {
    let _machine = machine();
    for fault in ["error", "nan"] {
        let config = format!("{{ fault = \"{fault}\", at = 200 }}");
        let (_folder, graph) = faulty(&config, "on_error = \"hold\"");
        let ended = run(&graph, &["--for", "1 s"]);
        assert_eq!(ended.report().exit, Exit::Finished, "{fault}: {}", ended.stderr);
        let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
        assert!(faulty.errors > 100, "{fault}: {faulty:?}");
    }
}

#[test]
fn an_expendable_component_is_left_behind() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"panic\", at = 200 }", "on_failure = \"ignore\"");
    let ended = run(&graph, &["--for", "2 s"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(7), &Exit::Finished), "{}", ended.stderr);
    assert!(ended.stderr.contains("the graph continues without it"), "{}", ended.stderr);
}

#[test]
fn restarts_are_exhausted_by_constant_failure() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\", at_most = 3 }";
    let (_folder, graph) = faulty("{ fault = \"panic\", at = 200, once = true }", restart);
    let ended = run(&graph, &["--for", "2 s"]);
    assert_eq!(ended.report().exit, Exit::Finished, "{}", ended.stderr);
    let (_folder, graph) = faulty("{ fault = \"panic\", at = 200 }", restart);
    let ended = run(&graph, &["--for", "30 s"]);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
    assert_eq!(faulty.restarts, 3);
}

#[test]
fn a_failed_configuration_ends_the_launch_with_its_message() {
    let _machine = machine();
    for (fault, words) in [
        ("configure", "configured to fail"),
        ("configure_panic", "configured to panic"),
        ("configure_exit", "ended with exit code 7"),
    ] {
        let (_folder, graph) = faulty(&format!("{{ fault = \"{fault}\" }}"), "");
        let ended = run(&graph, &[]);
        assert_eq!(ended.code, Some(1));
        let reported =
            ended.stderr.contains("component `faulty` did not start") && ended.stderr.contains(words);
        assert!(reported, "{fault}: {}", ended.stderr);
    }
}

#[test]
fn a_hung_configuration_can_be_interrupted() {
    let machine = machine();
    let (_folder, graph) = faulty("{ fault = \"configure_hang\" }", "");
    let name = "hangs-at-first";
    let runs = || RunFolder::list().into_iter().filter(|folder| folder.id().to_string().starts_with(name));
    let waits = |folder: RunFolder| {
        let is_ready = |block: &ComponentBlock| block.phase() == Phase::Ready;
        folder.region().is_ok_and(|region| region.components().iter().any(is_ready))
    };
    let start = |arguments: &[&str]| {
        let mut command = Command::new(MOTORIUM);
        command.arg("run").arg(&graph).args(["--name", name]).args(arguments);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let child = child.expect("motorium starts");
        await_that("it waits for the last", || runs().any(waits));
        child
    };
    let interrupted = start(&[]);
    std::thread::sleep(Duration::from_millis(300));
    let asked = Instant::now();
    signal(interrupted.id(), Signal::INT);
    let output = interrupted.wait_with_output().expect("it ends");
    assert!(asked.elapsed() < Duration::from_secs(6), "{:?}", asked.elapsed());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));

    let forgotten = start(&["--clock", "lockstep"]);
    // Release the machine: nothing steps in this run, which takes half a minute.
    drop(machine);
    let ended = Ended::from_output(&forgotten.wait_with_output().expect("it ends"));
    assert_eq!(ended.code, Some(1));
    let message = "component `faulty` did not start: it is not ready after 30 s";
    assert!(ended.stderr.contains(message), "{}", ended.stderr);
    assert_eq!(runs().count(), 0, "nothing is left");
}

#[test]
fn failed_restart_stops_a_lockstep_run() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\", at_most = 1 }";
    let (_folder, graph) = faulty("{ fault = \"exit_again\", at = 200 }", restart);
    let ended = run(&graph, &["--for", "1 s", "--clock", "lockstep"]);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let Exit::SafeStop { reason } = &ended.report().exit else { panic!("{:?}", ended.report().exit) };
    assert!(reason.contains("`faulty`") && reason.contains("exit code 8"), "{reason}");
}

#[test]
fn a_hung_reconfiguration_is_killed_by_policy() {
    let _machine = machine();
    let restart = "restart = { when = \"failure\", at_most = 2, within = \"400 ms\" }";
    let (_folder, graph) = faulty("{ fault = \"configure_hang_again\" }", restart);
    let run = Run::start(&graph, &["--for", "60 s"]);
    let id = run.folder.id().to_string();
    kill(run.pid_of("faulty"));
    let ended = run.finish();
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    assert!(ended.stderr.contains("not stepping 400 ms after its restart"), "{}", ended.stderr);
    assert!(ended.stderr.contains("all actuators in their safe state"), "{}", ended.stderr);
    assert_eq!(leftovers(&id), Vec::<String>::new());
}

#[test]
fn a_stalled_step_counts_as_too_long() {
    let _machine = machine();
    let (_folder, graph) =
        faulty("{ fault = \"stall\", at = 200 }", "on_overrun = \"safe_stop\"\npriority = 1");
    let ended = run(&graph, &["--for", "20 s"]);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
    assert!(faulty.misses.long_step >= 1, "{faulty:?}");
}

#[test]
fn late_publications_are_withheld_if_configured() {
    let _machine = machine();
    for (policy, withheld) in [("hold", true), ("skip", false)] {
        let settings = format!("on_overrun = \"{policy}\"\npriority = 1");
        let (_folder, graph) = faulty("{ fault = \"stall\", at = 200 }", &settings);
        let ended = run(&graph, &["--for", "1 s"]);
        let report = ended.report();
        assert_eq!(report.exit, Exit::Finished, "{policy}: {}", ended.stderr);
        let faulty = report.components.iter().find(|c| c.name == "faulty").expect("it is reported");
        let misses = &faulty.misses;
        let late = misses.long_step + misses.late_wake + misses.stolen;
        assert!(late > 10, "{policy}: {faulty:?}");
        // each stalled step ends 19 ms after its deadline, and only its publications after the deadline are
        // withheld
        let refused = if withheld { late..=faulty.steps - 200 } else { 0..=0 };
        assert!(refused.contains(&faulty.refused), "{policy}: {faulty:?}");
        // publications in the meantime count as one wake-up
        assert!(misses.skipped > 5 * late, "{policy}: {faulty:?}");
    }
}

#[test]
fn a_slow_step_is_distinguished_from_a_delayed_one() {
    let _machine = machine();
    // on the shared core, so that only the faulty component is late
    let settings = "core = 0\nbudget = \"100 us\"";
    let (_folder, graph) = faulty("{ fault = \"work\", at = 200 }", settings);
    let ended = run(&graph, &["--for", "1 s"]);
    let report = ended.report();
    assert_eq!(report.exit, Exit::Finished, "{}", ended.stderr);
    let faulty = report.components.iter().find(|c| c.name == "faulty").expect("it is reported");
    let misses = faulty.misses;
    assert!(misses.long_step > 50, "{misses:?}");
    assert!(misses.long_step > 4 * (misses.late_wake + misses.stolen), "{misses:?}");
    assert!(misses.over_budget >= misses.long_step, "{misses:?}");
    assert!(faulty.cpu_ns.max >= 4_000_000, "{:?}", faulty.cpu_ns);
}

#[test]
fn overruns_stop_the_graph_beyond_the_tolerated_number() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"stall\", at = 200 }", "overruns_tolerated = 3\npriority = 1");
    let ended = run(&graph, &["--for", "20 s"]);
    assert_eq!(ended.code, Some(4), "{}", ended.stderr);
    let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
    assert!(faulty.misses.long_step >= 4, "{faulty:?}");
}

#[test]
fn allocations_in_a_step_are_counted() {
    let _machine = machine();
    let (_folder, graph) = faulty("{ fault = \"allocate\", at = 0 }", "");
    let ended = run(&graph, &["--for", "1 s", "--clock", "lockstep"]);
    let faulty = ended.report().components.iter().find(|c| c.name == "faulty").expect("it is reported");
    assert_eq!(faulty.allocations, Some(faulty.steps - 100), "{faulty:?}");
}

#[test]
fn slow_stop_is_killed_unless_given_time() {
    let _machine = machine();
    for (settings, stops) in [("", false), ("stop_within = \"10 s\"", true)] {
        let (_folder, graph) = faulty("{ fault = \"slow_stop\" }", settings);
        let ended = run(&graph, &["--for", "500 ms"]);
        let message = ended.stderr.contains("stopped after three seconds");
        assert_eq!(message, stops, "{settings}: {}", ended.stderr);
    }
}
