//! Whole graphs, run as a user runs them.

use std::process::{Command, Stdio};

use crate::support::{MOTORIUM, Run, is_root, leftovers, machine, panda_reach, run, workspace};
use motorium::launcher::{Exit, Report};
use motorium::region::Refusal;
use rustix::process::Signal;

fn assert_goals_reached(report: &Report) {
    let result = &report.results["controller"];
    let position = result["position_error_m"].as_f64().expect("the controller reports its position error");
    let orientation = result["orientation_error_rad"].as_f64().expect("and its orientation error");
    assert!(result["goals_reached"].as_u64().expect("and how many goals it came to") >= 2, "{result}");
    assert!(position < 1e-3, "position error {position} m");
    assert!(orientation < 0.5_f64.to_radians(), "orientation error {orientation} rad");
}

#[test]
fn the_panda_reaches_its_goals_with_separate_processes() {
    let _machine = machine();
    let ended = run(&panda_reach(), &[]);
    let report = ended.report();
    assert_eq!((ended.code, &report.exit), (Some(0), &Exit::Finished));
    assert_goals_reached(report);
    let mut pids: Vec<u32> = report.components.iter().map(|component| component.pid).collect();
    pids.sort_unstable();
    pids.dedup();
    assert!(pids.len() >= 4 && pids.len() == report.components.len(), "{pids:?}");
    for latency in &report.latencies {
        assert!(latency.count > 1_000, "{latency:?}");
    }
}

#[test]
fn built_in_components_do_not_allocate_in_steady_state() {
    let _machine = machine();
    let ended = run(&panda_reach(), &["--for", "4 s"]);
    for component in &ended.report().components {
        assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)), "{component:?}");
        if is_root() {
            assert_eq!(component.page_faults, 0, "{component:?}");
            assert!(component.memory_locked || component.fifo_priority == 0, "{component:?}");
        }
    }
}

/// Purpose of a worker's system call.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Call {
    Wait,
    Wake,
    /// Reads the CPU time of its thread; the first call of a worker after a step.
    Charge,
    /// Reads other accounting of its thread.
    Account,
}

/// Parses a line of strace.
fn call(line: &str) -> Option<Call> {
    let name = line.split('(').next().unwrap_or_default();
    match name {
        "clock_nanosleep" | "sched_yield" | "restart_syscall" => Some(Call::Wait),
        "futex" if line.contains("FUTEX_WAKE") => Some(Call::Wake),
        "futex" => Some(Call::Wait),
        "clock_gettime" if line.contains("CPUTIME") => Some(Call::Charge),
        "pread64" | "getrusage" => Some(Call::Account),
        _ => None,
    }
}

/// Returns `true` if a wake comes before the next wait.
fn wakes_next(calls: &[Call]) -> bool {
    calls.iter().find(|call| matches!(call, Call::Wait | Call::Wake)) == Some(&Call::Wake)
}

#[test]
fn step_only_makes_wait_and_wake_system_calls() {
    let _machine = machine();
    if Command::new("strace").arg("--version").output().is_err() {
        eprintln!("skipped: strace is not installed");
        return;
    }
    let run = Run::start(&panda_reach(), &["--for", "8 s"]);
    for component in ["physics", "encoder", "policy", "controller"] {
        // At the end of its warm-up, after 100 steps, each worker reads its page faults once.
        crate::support::await_that("the warm-up is over", || run.steps_of(component) > 120);
        let trace = tempfile::NamedTempFile::new().expect("a file");
        let traced = Command::new("timeout")
            .args(["--signal=INT", "1", "strace", "-o"])
            .arg(trace.path())
            .args(["-p", &run.pid_of(component).to_string()])
            .output()
            .expect("strace starts");
        let text = std::fs::read_to_string(trace.path()).expect("strace traces");
        if text.is_empty() {
            eprintln!("skipped: strace may not trace here: {}", String::from_utf8_lossy(&traced.stderr));
            continue;
        }
        // the last line may be truncated, and some lines are about signals and the end instead of calls
        let lines: Vec<&str> =
            text.lines().filter(|line| line.contains('(') && line.contains(" = ")).collect();
        let mut calls: Vec<Call> =
            lines.iter().map(|line| call(line).unwrap_or_else(|| panic!("{component}: {line}"))).collect();
        // A component that has not slept for long yields: it checks before and after whether it has slept,
        // which counts as waiting.
        let asks = |at: usize| lines[at].starts_with("getrusage");
        for at in 2..calls.len() {
            if asks(at) && calls[at - 1] == Call::Wait && asks(at - 2) {
                (calls[at - 2], calls[at]) = (Call::Wait, Call::Wait);
            }
        }
        assert!(calls.iter().filter(|call| **call == Call::Charge).count() > 100, "{component}: {text}");
        // A wait is followed by the wake, or, if the step's follower was awake, by the charge; never by other
        // accounting.
        let after_wait = |at: &usize| *at > 0 && calls[at - 1] == Call::Wait && calls[*at] != Call::Wait;
        let first: Vec<usize> = (0..calls.len()).filter(after_wait).collect();
        let too_early = first.iter().find(|at| calls[**at] == Call::Account);
        assert_eq!(too_early.map(|at| &lines[at.saturating_sub(6)..=*at]), None, "{component}");
        // The charge precedes a wake only if the step had no one to wake and the next one began immediately.
        let charged_first =
            first.iter().filter(|at| calls[**at] == Call::Charge && wakes_next(&calls[**at..]));
        assert!(charged_first.count() <= first.len() / 10, "{component}: charged before its wake: {text}");
    }
    crate::support::signal(run.launcher(), Signal::INT);
    run.finish();
}

#[test]
fn lockstep_runs_are_identical_only_with_equal_seeds() {
    let once = run(&panda_reach(), &["--clock", "lockstep"]);
    let twice = run(&panda_reach(), &["--clock", "lockstep"]);
    let other = run(&panda_reach(), &["--clock", "lockstep", "--set", "seed=7"]);
    assert_goals_reached(once.report());
    assert!(once.report().state_hash.is_some());
    assert_eq!(once.report().state_hash, twice.report().state_hash);
    assert_ne!(once.report().state_hash, other.report().state_hash);
    assert!(once.report().realtime_factor > 1.0, "{}", once.report().realtime_factor);
}

#[test]
fn hosting_in_one_process_does_not_change_publications() {
    let _machine = machine();
    let arguments = ["--clock", "lockstep", "--for", "2 s"];
    let apart = run(&panda_reach(), &arguments);
    let hosted = run(&panda_reach(), &[&arguments[..], &["--in-process"]].concat());
    assert_eq!(apart.report().state_hash, hosted.report().state_hash);
    assert!(hosted.report().components.iter().all(|c| c.pid == hosted.report().components[0].pid));
}

#[test]
fn hosted_components_run_in_real_time() {
    let _machine = machine();
    let ended = run(&panda_reach(), &["--in-process", "--for", "2 s"]);
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished));
    // releases that a busy host skipped count: the clock of the run is the machine's
    let [physics, others @ ..] = &ended.report().components[..] else { panic!("no components") };
    assert!(physics.steps + physics.misses.skipped > 1_900, "{physics:?}");
    assert!(others.iter().all(|component| component.steps > physics.steps / 2), "{others:?}");
}

#[test]
fn ctrl_c_and_sigterm_end_a_run_cleanly() {
    let _machine = machine();
    for signal in [Signal::INT, Signal::TERM] {
        let run = Run::start(&panda_reach(), &["--for", "60 s"]);
        let id = run.folder.id().to_string();
        crate::support::signal(run.launcher(), signal);
        let ended = run.finish();
        assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
        assert_eq!(leftovers(&id), Vec::<String>::new());
    }
}

#[test]
fn run_without_privileges_completes_and_lists_them() {
    let _machine = machine();
    if !is_root() {
        eprintln!("skipped: only root can drop its privileges");
        return;
    }
    use std::os::unix::process::CommandExt as _;
    // The build folder may be closed to other users, but a copy of the program is not.
    let folder = tempfile::tempdir().expect("a folder");
    let open = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(folder.path(), open).expect("the folder can be opened to all");
    let program = folder.path().join("motorium");
    std::fs::copy(MOTORIUM, &program).expect("the program can be copied");
    let graph = folder.path().join("panda-reach.toml");
    std::fs::copy(panda_reach(), &graph).expect("the graph can be copied");
    let output = Command::new(program)
        .args(["run", "panda-reach.toml", "--json", "--for", "2 s"])
        .args(crate::support::ANY_LOSS)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .uid(65534)
        .gid(65534)
        .output()
        .expect("motorium starts");
    let ended = crate::support::Ended::from_output(&output);
    assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Finished), "{}", ended.stderr);
    let lost = ended.report().lost.join("; ");
    assert!(lost.contains("real-time priority") && lost.contains("locked memory"), "{lost}");
    let lines: Vec<&str> = ended.stderr.lines().filter(|line| line.contains("without")).collect();
    assert_eq!(lines.len(), 1, "{}", ended.stderr);
}

#[test]
fn a_strict_graph_refuses_to_run_without_privileges() {
    let _machine = machine();
    if !is_root() {
        let ended = run(&panda_reach(), &["--set", "realtime.on_denied=strict", "--for", "1 s"]);
        assert_eq!(ended.code, Some(1));
        assert!(ended.stderr.contains("denied by the system"), "{}", ended.stderr);
    }
}

#[test]
fn tools_read_a_running_graph_without_disturbing_it() {
    let _machine = machine();
    let run = Run::start(&panda_reach(), &["--for", "4 s"]);
    // The guard of a run that a test has just killed may still be active, so name the run.
    let id = run.folder.id().to_string();
    let tool = |arguments: &[&str]| {
        let mut command = Command::new(MOTORIUM);
        command.args(arguments).args(["--run", &id]).current_dir(workspace());
        let output = command.output().expect("it starts");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let topics: serde_json::Value = serde_json::from_str(&tool(&["topic", "list", "--json"])).expect("JSON");
    assert!(topics.to_string().contains("panda/joint_command"), "{topics}");
    let echoed = tool(&["topic", "echo", "panda/joint_state", "--count", "3", "--json"]);
    assert_eq!(echoed.lines().count(), 3, "{echoed}");
    let parameters = tool(&["param", "list", "--json"]);
    assert!(serde_json::from_str::<serde_json::Value>(&parameters).is_ok(), "{parameters}");
    let ended = run.finish();
    assert_eq!(ended.report().exit, Exit::Finished);
    assert!(ended.report().components.iter().all(|component| component.restarts == 0));
}

#[test]
fn commands_with_an_old_source_are_refused_unless_allowed() {
    let _machine = machine();
    let stale = |report: &Report| -> u64 {
        let gate = report.components.iter().find_map(|component| component.gate.as_ref()).expect("a gate");
        gate.refused.iter().filter(|refused| refused.reason == Refusal::StaleSource).map(|r| r.count).sum()
    };
    // commands are computed from the newest reading, whether or not there is a new target
    let trigger = "controller.trigger=panda/joint_state";
    let latency = ["--for", "500 ms", "--set", "encoder.config.latency=30 ms", "--set", trigger];
    let allowed = [&latency[..], &["--set", "safety.source_stale_after=45 ms"]].concat();
    let ended = run(&panda_reach(), &[&latency[..], &["--clock", "lockstep"]].concat());
    assert!(stale(ended.report()) > 400, "{:?}", ended.report().components);
    let ended = run(&panda_reach(), &[&allowed[..], &["--clock", "lockstep"]].concat());
    assert_eq!(stale(ended.report()), 0);
    for more in [&["--clock", "lockstep"][..], &[]] {
        let ended = run(&panda_reach(), &[&allowed[..], more].concat());
        let latency = &ended.report().latencies[0];
        assert!(latency.count > 100 && latency.missed == latency.count, "{latency:?}");
        assert!(latency.latency_ns.p50 >= 29_000_000, "{latency:?}");
    }
}
