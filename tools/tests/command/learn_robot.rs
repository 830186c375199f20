//! `motorium learn tune --real-time`: episodes as processes, each permitted and judged by an operator.

use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use motorium::run_folder::RunFolder;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value as Json;

use crate::program::{json, machine, motorium, run};

/// A simulated cart-pole whose force limit is tuned, judged by its task. The machine may lose any step.
const GRAPH: &str = r#"
name     = "balance"
duration = "20 s"
seed     = 1

[realtime]
lost_steps = 1

[robot.cart]
urdf = "cart-pole"

[component.physics]
kind      = "physics.articulated"
robot     = "cart"
rate      = "100 Hz"
subscribe = { joint_command = "cart/joint_command" }
publish   = { joint_state = "cart/joint_state" }
config    = { pose = "upright", randomise = { start = [-0.05, 0.05] } }

[component.task]
kind         = "learner.task"
robot        = "cart"
rate         = "50 Hz"
ends_episode = true
subscribe    = { joint_state = "cart/joint_state", action = "cart/action" }
publish      = { observation = "cart/observation", reward = "cart/reward" }
config       = { task = "task.toml" }

[component.policy]
kind      = "policy.network"
robot     = "cart"
rate      = "50 Hz"
subscribe = { joint_state = "cart/joint_state" }
publish   = { action = "cart/action" }
config    = { policy = "POLICY" }

[component.drives]
kind      = "policy.joint_targets"
robot     = "cart"
trigger   = "cart/joint_state"
subscribe = { joint_state = "cart/joint_state", action = "cart/action" }
publish   = { joint_command = "cart/joint_command" }

[component.drives.config.policy]
rate   = 50.0
action = { joints = ["slider", "hinge"], kind = "effort", scale = [10.0, 0.0], default_pose = [0.0, 3.141592653589793], clip = [-1.0, 1.0] }

[safety]
stale_after = "2 s"
safe_state  = "hold"
settle      = "100 ms"
"#;

/// Writes the graph, with episodes of a task of `seconds`.
fn write_graph(folder: &Path, seconds: f64) -> String {
    let policy = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/cart-pole-policy");
    let task = include_str!("../../../tasks/cart-pole.toml");
    let task = task.replace("duration = 10.0", &format!("duration = {seconds:?}"));
    std::fs::write(folder.join("task.toml"), task).expect("a task");
    let graph = folder.join("balance.toml");
    std::fs::write(&graph, GRAPH.replace("POLICY", policy)).expect("a graph");
    text(&graph)
}

fn text(path: &Path) -> String {
    path.to_str().expect("a path of text").to_string()
}

const TUNE: [&str; 9] = [
    "--parameter",
    "drives.config.policy.action.scale.0=5:15",
    "--reward",
    "task.mean_return",
    "--method",
    "random",
    "--evaluations",
    "3",
    "--json",
];

/// Starts a command with the operator's lines on its standard input, which then ends.
fn answered(arguments: &[&str], lines: &str) -> Child {
    let mut child = motorium(arguments).stdin(Stdio::piped()).spawn().expect("the program starts");
    let mut input = child.stdin.take().expect("standard input");
    input.write_all(lines.as_bytes()).expect("the pipe holds the lines");
    child
}

fn ended(child: Child) -> (Output, String) {
    let output = child.wait_with_output().expect("a child");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (output, errors)
}

fn parsed(output: &Output) -> Json {
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// The questions about an evaluation on standard error.
fn questions(errors: &str, evaluation: u64) -> Vec<String> {
    let start = format!("\nevaluation {evaluation} of 3, ");
    let parts = errors.split(&start).skip(1);
    parts.filter_map(|part| part.split_once("> ")).map(|(question, _)| question.to_string()).collect()
}

/// The cells of a row of the table, from 0.
fn row(table: &Path, index: usize) -> Vec<String> {
    let text = std::fs::read_to_string(table).expect("a table");
    text.lines().nth(1 + index).map(|line| line.split(',').map(str::to_string).collect()).unwrap_or_default()
}

#[test]
fn operator_tunes_in_real_time_and_resumes() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let graph = write_graph(folder.path(), 0.4);
    let (inline, robot) = (text(&folder.path().join("inline")), text(&folder.path().join("robot")));
    let tune = [&["learn", "tune", &graph][..], &TUNE].concat();
    json(&[&tune[..], &["--for", "2s", "--output", &inline]].concat());

    let start = [&tune[..], &["--for", "2s", "--real-time", "--output", &robot]].concat();
    let (output, errors) = ended(answered(&start, "run\naccept\nrun\nrepeat\nskip\n"));
    assert!(output.status.success(), "{errors}");
    let found = parsed(&output);
    assert_eq!(found["outcomes"], serde_json::json!({ "finished": 1, "skipped": 1 }), "{errors}");
    // 20 steps of reward 1, fewer after a fall
    let reward = found["reward"].as_f64().expect("a number");
    assert!((1.0..=20.0).contains(&reward), "{found}");
    assert!(errors.contains("stopped after 2 of 3 evaluations"), "{errors}");
    let [permit, judge] = &questions(&errors, 1)[..] else { panic!("{errors}") };
    assert!(permit.contains("scale.0 ") && permit.contains("(5 to 15)"), "{permit}");
    assert!(permit.contains("an episode of 2 s on the robot: run, skip or stop?"), "{permit}");
    assert!(judge.contains("reward ") && judge.contains("accept, repeat or stop?"), "{judge}");
    let second = questions(&errors, 2);
    assert!(second.len() == 3 && second[0] == second[2], "{errors}");
    let third = questions(&errors, 3);

    let (output, errors) = ended(answered(&["learn", "resume", &robot, "--json"], "run\naccept\n"));
    assert!(output.status.success(), "{errors}");
    assert_eq!(questions(&errors, 3)[0], third[0]);
    let finished = parsed(&output);
    assert_eq!((&finished["evaluations"], &finished["outcomes"]["finished"]), (&3.into(), &2.into()));
    // the proposals of the two roads are equal to the bit
    let tables = [&inline, &robot].map(|folder| Path::new(folder).join("evaluations.csv"));
    for index in 0..3 {
        let [simulated, real] = [0, 1].map(|which| row(&tables[which], index));
        assert_eq!((simulated.len(), &simulated[3]), (5, &real[3]), "row {index}");
    }
    let overlay = finished["overlay"].as_str().expect("a file");
    assert!(run(&["check", &graph, "--with", overlay]).status.success());
    let refused = run(&["learn", "resume", &robot, "--threads", "2"]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("one episode at a time"), "{refused:?}");
}

/// Waits for the run of a command in which every component has stepped, other than a known one.
fn await_run(child: &mut Child, other: Option<&str>) -> RunFolder {
    let began = Instant::now();
    loop {
        let own = RunFolder::list().into_iter().find(|folder| {
            other != Some(folder.id())
                && folder.region().is_ok_and(|region| {
                    let components = region.components();
                    region.header().launcher.load(Relaxed) == child.id()
                        && !components.is_empty()
                        && components.iter().all(|block| block.steps.load(Relaxed) > 5)
                })
        });
        if let Some(folder) = own {
            return folder;
        }
        assert!(child.try_wait().expect("a child").is_none(), "the command ended");
        assert!(began.elapsed() < Duration::from_secs(120), "no episode");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn pid_of(folder: &RunFolder, component: &str) -> Pid {
    let plan = folder.plan().expect("a plan");
    let index = plan.components.iter().position(|each| each.name == component).expect("a component");
    let region = folder.region().expect("a region");
    Pid::from_raw(region.components()[index].pid.load(Relaxed) as i32).expect("a process")
}

#[test]
fn dead_controller_and_ctrl_c_count_as_no_evaluation() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let graph = write_graph(folder.path(), 15.0);
    let robot = text(&folder.path().join("robot"));
    let tune = [&["learn", "tune", &graph, "--real-time", "--output", &robot][..], &TUNE].concat();
    let mut child = answered(&tune, "run\naccept\nrepeat\nrun\n");
    let first = await_run(&mut child, None);
    kill_process(pid_of(&first, "policy"), Signal::KILL).expect("the policy runs");
    let id = first.id().to_string();
    let second = await_run(&mut child, Some(&id));
    kill_process(Pid::from_child(&child), Signal::INT).expect("the command runs");
    let (output, errors) = ended(child);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("interrupted after 0 of 3 evaluations"), "{errors}");
    // the pole swings on
    assert_eq!(errors.matches("`physics` in its safe state").count(), 2, "{errors}");
    assert!(!RunFolder::list().iter().any(|folder| folder.id() == second.id()), "a run is left behind");
    let asked = questions(&errors, 1);
    let stopped = &asked[1];
    assert!(stopped.contains("stopped: ") && stopped.contains("`policy`"), "{errors}");
    assert!(stopped.contains("SIGKILL") && stopped.ends_with("\nrepeat or stop?\n"), "{stopped}");
    assert!(errors.contains("found `accept`, expected repeat or stop"), "{errors}");
    assert_eq!(asked[3], asked[0], "{errors}");
    let table = Path::new(&robot).join("evaluations.csv");
    assert_eq!(row(&table, 0), Vec::<String>::new());

    // a closed input stops, and the question is the same
    let (output, errors) = ended(answered(&["learn", "resume", &robot, "--json"], ""));
    assert!(output.status.success(), "{errors}");
    assert_eq!(questions(&errors, 1), [asked[0].clone()]);
    assert_eq!((&parsed(&output)["evaluations"], &parsed(&output)["reward"]), (&0.into(), &Json::Null));
}

#[test]
fn robot_is_refused_without_a_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = text(&folder.path().join("robot"));
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/panda-can-socket.toml");
    let arguments = ["--parameter", "controller.config.damping=1e-5:1e-3:log", "--for", "1s", "--output"];
    let tune = [&["learn", "tune", graph, "--real-time"][..], &arguments, &[&output]].concat();
    let (refused, errors) = ended(answered(&tune, "run\naccept\n"));
    assert_eq!(refused.status.code(), Some(1), "{errors}");
    assert!(errors.contains("standard input is not a terminal"), "{errors}");
    assert!(!Path::new(&output).exists());
    let threads = run(&[&tune[..], &["--threads", "2"]].concat());
    assert_eq!(threads.status.code(), Some(2), "one episode at a time has no threads");
}
