//! Runs controlled by a program: hosting, episodes, pace, and clean-up.

use std::process::Command;
use std::time::Duration;

use motorium::graph::{self, Machine, Override};
use motorium::launcher::{Exit, Options};
use motorium::plan::Plan;
use motorium::prelude::*;
use motorium::session::{Session, SessionError};
use motorium::worker::{Kind, Registry, RobotSource};
use rustix::process::Signal;

use crate::support::{MOTORIUM, Run, leftovers, machine, panda_reach, run, workspace};

/// Returns the plan of a graph file in lockstep.
fn plan(file: &str, settings: &[&str]) -> Plan {
    let path = workspace().join("graphs").join(file);
    let text = std::fs::read_to_string(&path).expect("the graph is there");
    let settings: Vec<Override> =
        settings.iter().chain(&["clock=lockstep"]).map(|one| one.parse().expect("an override")).collect();
    let checked = graph::check(&path, text, &settings, &motorium_tools::registry(), &Machine::detect());
    checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan
}

fn launch(plan: Plan, options: &Options) -> Session<'static> {
    Session::launch(plan, &motorium_tools::registry(), options).expect("it starts")
}

const MS: Duration = Duration::from_millis(1);

#[test]
fn all_hosting_modes_publish_identical_values() {
    for file in ["panda-reach.toml", "quadruped-trot.toml"] {
        let graph = workspace().join("graphs").join(file);
        let hash = |hosting: &str| {
            let ended = run(&graph, &["--clock", "lockstep", "--for", "700 ms", "--hosting", hosting]);
            assert_eq!(ended.report().exit, Exit::Finished, "{hosting}: {}", ended.stderr);
            ended.report().state_hash.clone().expect("a hash")
        };
        let processes = hash("processes");
        assert_eq!([hash("threads"), hash("inline")], [processes.clone(), processes], "{file}");
    }
}

#[test]
fn episodes_are_equal_only_with_equal_seeds() {
    for file in ["panda-reach.toml", "quadruped-trot.toml"] {
        let graph = workspace().join("graphs").join(file);
        let lockstep = ["--clock", "lockstep", "--for", "400 ms"];
        let whole = run(&graph, &lockstep).report().state_hash.clone().expect("a hash");
        let mut of_seeds = Vec::new();
        for hosting in ["processes", "threads", "inline"] {
            let episodes = |more: &[&str]| {
                let arguments = [&lockstep[..], &["--hosting", hosting, "--episodes", "3"], more].concat();
                let ended = run(&graph, &arguments);
                let episodes = ended.report().episodes.clone();
                assert_eq!(episodes.len(), 3, "{hosting}: {}{}", ended.stdout, ended.stderr);
                episodes.into_iter().map(|episode| episode.state_hash.expect("a hash")).collect::<Vec<_>>()
            };
            assert_eq!(episodes(&[]), [whole.clone(), whole.clone(), whole.clone()], "{file} in {hosting}");
            of_seeds.push(episodes(&["--vary-seed"]));
        }
        let [first, second, third] = of_seeds[0].as_slice() else { panic!("three episodes") };
        assert_eq!(*first, whole, "{file}: the first has the seed of the graph");
        assert!(first != second && second != third && first != third, "{file}: {of_seeds:?}");
        assert!(of_seeds.iter().all(|hashes| *hashes == of_seeds[0]), "{file}: {of_seeds:?}");
        let alone = run(&graph, &[&lockstep[..], &["--set", "seed=2"]].concat());
        assert_eq!(
            alone.report().state_hash.as_ref(),
            Some(second),
            "{file}: the seed of the report repeats it"
        );
    }
}

/// Moves the arm of a session to a goal in place of its policy; returns the joint states along the motion,
/// bit by bit.
fn reach(session: &mut Session<'_>, height: f64) -> Vec<Vec<u64>> {
    let mut seen = Vec::new();
    session.step_until(5 * MS).expect("it steps");
    for part in 0..40 {
        let target = PoseTarget {
            position: [0.45, 0.1, height],
            orientation: [1.0, 0.0, 0.0, 0.0],
            goal: 1,
            ..PoseTarget::default()
        };
        session.publish("panda/target", &target).expect("the session stands in for the policy");
        session.step_until((5 + 10 * (part + 1)) * MS).expect("it steps");
        let state = session.read::<JointState>("panda/joint_state").expect("a state").expect("was published");
        seen.push(state.value.position().iter().map(|q| q.to_bits()).collect());
    }
    seen
}

#[test]
fn a_reset_arm_repeats_its_motion_exactly() {
    let options = Options::inline().standing_in_for("policy");
    let mut session = launch(plan("panda-reach.toml", &[]), &options);
    let seed = session.plan().seed;
    let first = reach(&mut session, 0.4);
    let hash = session.state_hash();
    assert_ne!(first[0], first[39], "it moves");

    session.reset(seed).expect("all its components can be set back");
    assert_eq!((session.time(), session.episode()), (Duration::ZERO, 1));
    assert!(session.read::<JointState>("panda/joint_state").expect("a state").is_none());
    assert_eq!(reach(&mut session, 0.4), first);
    assert_eq!(session.state_hash(), hash);

    session.reset(seed).expect("all its components can be set back");
    assert_ne!(reach(&mut session, 0.5), first, "another goal");
    session.reset(seed + 1).expect("all its components can be set back");
    assert_ne!(reach(&mut session, 0.4), first, "other noise");
    let newest = session.read::<JointState>("panda/joint_state").expect("a state").expect("was published");
    assert_eq!(newest.stamp.episode, 3);
    let report = session.stop();
    let hashes: Vec<&str> =
        report.episodes.iter().filter_map(|episode| episode.state_hash.as_deref()).collect();
    assert_eq!((hashes[0], hashes[1], report.exit), (hash.as_str(), hash.as_str(), Exit::Finished));
}

#[test]
fn a_value_published_by_a_session_has_its_measurement_time() {
    let mut session = launch(plan("panda-reach.toml", &[]), &Options::inline().standing_in_for("policy"));
    session.step_until(30 * MS).expect("it steps");
    let now_ns = session.stamp_ns();
    let target = PoseTarget { orientation: [1.0, 0.0, 0.0, 0.0], ..PoseTarget::default() };
    session.publish_from("panda/target", &target, now_ns - 20_000_000).expect("a time in the past");
    let stamp = session.read::<PoseTarget>("panda/target").expect("a topic").expect("was published").stamp;
    assert_eq!((stamp.source_time, stamp.publish_time), (now_ns - 20_000_000, now_ns));
    let ahead = session
        .publish_from("panda/target", &target, now_ns + 20_000_000)
        .map_err(|error| error.to_string())
        .unwrap_err();
    assert!(ahead.contains("future") || ahead.contains("ahead"), "{ahead}");
    session.publish("panda/target", &target).expect("at the present time");
    let stamp = session.read::<PoseTarget>("panda/target").expect("a topic").expect("was published").stamp;
    assert_eq!(stamp.source_time, now_ns);
}

#[test]
fn session_in_processes_steps_like_an_inline_one() {
    let in_processes = Options::processes(MOTORIUM.into()).standing_in_for("policy");
    let mut inline = launch(plan("panda-reach.toml", &[]), &Options::inline().standing_in_for("policy"));
    let mut processes = launch(plan("panda-reach.toml", &[]), &in_processes);
    let expected = reach(&mut inline, 0.4);
    assert_eq!(reach(&mut processes, 0.4), expected);
    processes.reset(inline.plan().seed).expect("all its components can be set back");
    assert_eq!(reach(&mut processes, 0.4), expected);
}

#[test]
fn two_threads_run_two_sessions_independently() {
    let hash = |core: usize| {
        let mut session = launch(plan("quadruped-trot.toml", &[]), &Options::inline().on_core(core));
        session.step_until(200 * MS).expect("it steps");
        session.state_hash()
    };
    let alone = hash(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let both = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|core| scope.spawn(move || hash(core % cores))).collect();
        threads.into_iter().map(|thread| thread.join().expect("it ends")).collect::<Vec<_>>()
    });
    assert_eq!(both, [alone.clone(), alone]);
}

#[test]
fn an_aborted_session_cleans_up_and_restores_its_thread() {
    let cores = || std::fs::read_to_string("/proc/thread-self/status").expect("its status");
    let allowed =
        |status: String| status.lines().find(|l| l.starts_with("Cpus_allowed:")).map(str::to_string);
    let before = allowed(cores());
    for stops in [true, false] {
        let mut session = launch(plan("panda-reach.toml", &[]), &Options::inline().on_core(0));
        let id = session.id().to_string();
        session.step_until(30 * MS).expect("it steps");
        assert!(!leftovers(&id).is_empty(), "it lives in shared memory");
        if stops {
            let report = session.stop();
            assert_eq!(report.components[0].steps, 30);
            assert!(report.results.contains_key("physics"));
        } else {
            drop(session);
        }
        assert_eq!(leftovers(&id), Vec::<String>::new());
        assert_eq!(allowed(cores()), before);
    }
}

#[test]
fn unsupported_session_requests_are_refused() {
    let mut session = launch(plan("panda-reach.toml", &[]), &Options::inline());
    let message = |error: SessionError| error.to_string();
    let topic = session.read::<JointState>("panda/joint_stat").map_err(message).unwrap_err();
    assert!(topic.contains("did you mean `panda/joint_state`?"), "{topic}");
    let other = session.read::<PoseTarget>("panda/joint_state").map_err(message).unwrap_err();
    assert!(other.contains("the type of topic"), "{other}");
    let not_ours = session.publish("panda/target", &PoseTarget::default()).map_err(message).unwrap_err();
    assert!(not_ours.contains("standing_in_for(\"policy\")"), "{not_ours}");
    let range = session.set("policy", "speed", 9.0).map_err(message).unwrap_err();
    assert!(range.contains("expected from 0 to 2"), "{range}");
    assert!(session.pace(Some(0.0)).is_err());

    let realtime = Plan { clock: motorium::plan::ClockKind::Realtime, ..plan("panda-reach.toml", &[]) };
    let error = Session::launch(realtime, &motorium_tools::registry(), &Options::inline());
    let error = error.map(|_| ()).map_err(message).unwrap_err();
    assert!(error.contains("hosting inline") && error.contains("real time"), "{error}");
}

#[test]
fn a_parameter_set_before_an_episode_holds_in_it() {
    let mut session = launch(plan("panda-reach.toml", &[]), &Options::inline());
    let seed = session.plan().seed;
    let mut hash = |speed: f64| {
        session.set("policy", "speed", speed).expect("it has this parameter");
        session.reset(seed).expect("all its components can be set back");
        session.step_until(300 * MS).expect("it steps");
        session.state_hash()
    };
    let (slow, fast) = (hash(0.5), hash(1.5));
    assert_ne!(slow, fast);
    assert_eq!(hash(0.5), slow, "nothing of the episode between is left");
}

#[test]
fn an_episode_ends_when_its_policy_has_finished() {
    let goals = "policy.config.goals=[{ offset = [0.05, 0.0, 0.0], duration = \"200 ms\" }]";
    let settings = [goals, "policy.config.repeat=once", "policy.ends_episode=true", "episodes.count=2"];
    let mut session = launch(plan("panda-reach.toml", &settings), &Options::inline());
    session.run().expect("it runs");
    let report = session.stop();
    let durations: Vec<f64> = report.episodes.iter().map(|episode| episode.duration_s).collect();
    assert_eq!(durations[0], durations[1]);
    assert!(durations[0] > 0.2 && durations[0] < 1.0, "{durations:?}, not the 10 s of the graph");
}

#[test]
fn check_refuses_episodes_that_cannot_be_reset() {
    let message = |graph: &std::path::Path, arguments: &[&str]| {
        let ended = run(graph, arguments);
        assert_eq!(ended.code, Some(3), "{}", ended.stderr);
        format!("{}{}", ended.stdout, ended.stderr)
    };
    let graph = workspace().join("graphs/panda-bridge.toml");
    let refused = message(&graph, &["--clock", "lockstep", "--episodes", "2", "--for", "1 s"]);
    assert!(refused.contains("cannot be reset for a new episode"), "{refused}");
    let ends = message(&panda_reach(), &["--set", "encoder.ends_episode=true", "--clock", "lockstep"]);
    assert!(ends.contains("component `encoder` cannot end an episode"), "{ends}");
}

#[test]
fn simulated_time_never_runs_fast_and_ctrl_c_ends_it() {
    let _machine = machine();
    let arguments = ["--clock", "lockstep", "--hosting", "inline", "--pace", "2"];
    let paced = run(&panda_reach(), &[&arguments[..], &["--for", "600 ms"]].concat());
    let free = run(&panda_reach(), &["--clock", "lockstep", "--hosting", "inline", "--for", "600 ms"]);
    assert_eq!(paced.report().state_hash, free.report().state_hash);
    assert!(paced.report().realtime_factor < 2.05, "{}", paced.report().realtime_factor);

    for hosting in ["inline", "processes"] {
        let arguments = ["--clock", "lockstep", "--hosting", hosting, "--pace", "1", "--for", "60 s"];
        let run = Run::start(&panda_reach(), &arguments);
        let id = run.folder.id().to_string();
        crate::support::signal(run.launcher(), Signal::INT);
        let ended = run.finish();
        assert_eq!((ended.code, &ended.report().exit), (Some(0), &Exit::Interrupted), "{}", ended.stderr);
        assert!(ended.report().duration_s < 30.0);
        assert_eq!(leftovers(&id), Vec::<String>::new());
    }
}

#[test]
fn a_held_run_advances_by_granted_rounds_until_released() {
    let _machine = machine();
    let arguments = ["--clock", "lockstep", "--hosting", "inline", "--pace", "1", "--for", "3 s"];
    let run = Run::start(&panda_reach(), &arguments);
    let id = run.folder.id().to_string();
    let step = |arguments: &[&str]| -> serde_json::Value {
        let mut command = Command::new(MOTORIUM);
        let output = command.arg("step").args(arguments).args(["--json", "--run", &id]).output();
        let output = output.expect("it starts");
        let message = String::from_utf8_lossy(&output.stderr);
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{arguments:?}: {message}"))
    };
    assert_eq!(step(&["--hold"])["held"], true);
    std::thread::sleep(Duration::from_millis(100));
    let time_s = |outcome: &serde_json::Value| outcome["time_s"].as_f64().expect("a time");
    let before = time_s(&step(&["1"]));
    let after = time_s(&step(&["25"]));
    assert!((after - before - 0.025).abs() < 1e-6, "{before} and {after}");
    assert_eq!(time_s(&step(&["--hold"])), after, "time is paused");
    assert_eq!(step(&["--go"])["held"], false);
    assert_eq!(run.finish().report().exit, Exit::Finished);
}

/// Counts steps, and fails in step 5: with an error, by a panic, or on reset.
struct Failing {
    count: Output<Wrench>,
    how: How,
}

#[derive(Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum How {
    Error,
    Panic,
    AtReset,
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FailingConfig {
    how: How,
}

impl Component for Failing {
    const KIND: &'static str = "test.failing";
    const SUMMARY: &'static str = "fails";
    const RESETS: bool = true;
    type Config = FailingConfig;

    fn declare(_: &FailingConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("count", "the number of the step");
        Ok(())
    }

    fn configure(config: FailingConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { count: setup.output("count")?, how: config.how })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        match self.how {
            How::Error if tick.index == 5 => Err(StepError::failed("the fifth is too many")),
            How::Panic if tick.index == 5 => panic!("the fifth is too many"),
            _ => self.count.send(&Wrench { force: [tick.index as f64, 0.0, 0.0], ..Wrench::default() }),
        }
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        if self.how == How::AtReset { Err(StepError::failed("no way back")) } else { Ok(()) }
    }
}

fn failing(how: &str, more: &str) -> Session<'static> {
    let text = format!(
        "name = \"failing\"\nclock = \"lockstep\"\n[component.counter]\nkind = \"test.failing\"\nrate = \"1 kHz\"\n\
         publish = {{ count = \"count\" }}\nconfig = {{ how = \"{how}\" }}\n{more}"
    );
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Failing>()]);
    let checked = graph::check("failing.toml".as_ref(), text, &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    Session::launch(plan, &registry, &Options::inline()).expect("it starts")
}

#[test]
fn an_inline_failure_ends_the_run_with_its_error() {
    for how in ["error", "panic"] {
        let mut session = failing(how, "");
        let id = session.id().to_string();
        session.step_until(5 * MS).expect("the first steps are good");
        let error = session.step().unwrap_err();
        assert!(error.to_string().contains("the fifth is too many"), "{how}: {error}");
        assert!(matches!(session.step(), Err(SessionError::Ended(Exit::SafeStop { .. }))), "it stays ended");
        let report = session.stop();
        assert!(matches!(&report.exit, Exit::SafeStop { reason } if reason.contains("`counter`")));
        assert_eq!((report.components[0].steps, leftovers(&id)), (6, Vec::new()));
    }
}

#[test]
fn an_inline_component_restarts_within_the_same_run() {
    let mut session = failing("error", "restart = { when = \"failure\" }\n");
    session.step_until(9 * MS).expect("its restart is granted");
    let newest = session.read::<Wrench>("count").expect("a state").expect("was published");
    assert_eq!((newest.value.force[0], newest.stamp.restart_count), (8.0, 1));
    assert_eq!(session.stop().components[0].restarts, 1);
}

#[test]
fn component_without_reset_ends_the_run_at_the_reset() {
    let mut session = failing("at_reset", "");
    session.step_until(2 * MS).expect("it steps");
    let error = session.reset(3).unwrap_err().to_string();
    assert!(error.contains("its reset for episode 1: no way back"), "{error}");
}

#[test]
fn a_session_does_not_swallow_panics_of_its_program() {
    let session = failing("error", "");
    let outcome = std::panic::catch_unwind(|| panic!("mine"));
    assert_eq!(outcome.unwrap_err().downcast_ref::<&str>(), Some(&"mine"));
    session.stop();
}
