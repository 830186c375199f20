//! Recordings replayed into live graphs: robots that move to the start of the recording and come to rest, and
//! episodes.

use std::path::Path;
use std::time::Duration;

use motorium::launcher::{Exit, Options};
use motorium::plan::Plan;
use motorium::prelude::*;
use motorium::session::{Session, SessionError};
use motorium::units::TimeSpan;
use motorium::worker::Registry;
use motorium_bridges::recording::{Recording, ease_in, loggers, replay_kind, replayed};

use crate::recording::{motorium, recorded, text, verified};
use crate::support::machine;

const MS: Duration = Duration::from_millis(1);

/// Returns the report of a replay and its messages.
fn replay(file: &Path, arguments: &[&str]) -> (serde_json::Value, String) {
    let output = motorium(&[&["replay", text(file), "--speed", "0", "--json"], arguments].concat());
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}")), errors)
}

/// Returns the plan of a replay to a Panda that starts this far from home in each joint \[rad or m\], and the
/// home pose.
fn to_a_panda_elsewhere(recording: &Recording, offset: f64) -> (Plan, Vec<f64>) {
    let panda = motorium_robots::load("panda", Path::new(".")).expect("in the catalogue");
    let home = panda.profile.as_ref().expect("a profile").home(&panda.model).expect("a pose");
    // The fingers keep their positions.
    let there: Vec<f64> = home.iter().enumerate().map(|(i, q)| if i < 7 { q + offset } else { *q }).collect();
    let live = ["physics".to_string(), "encoder".to_string()];
    let mut plan = replayed(recording, &live, None).expect("a plan");
    let physics = plan.components.iter_mut().find(|component| component.name == "physics").expect("physics");
    physics.config["position"] = serde_json::json!(there);
    let [lead, ramp_down] = ["2 s", "500 ms"].map(|time| time.parse::<TimeSpan>().expect("a time"));
    assert_eq!(ease_in(&mut plan, &live, lead, ramp_down), ["controller"]);
    (plan, home.as_slice().to_vec())
}

fn launch(plan: Plan) -> Session<'static> {
    let registry = motorium_tools::registry();
    let kinds = registry.kinds().iter().copied().chain([replay_kind()]);
    let options = Options { stand_in: loggers(&plan), ..Options::inline() };
    Session::launch(plan, &Registry::new(registry.robots(), kinds), &options).expect("it starts")
}

#[test]
fn replay_allocates_all_memory_before_it_steps() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "1 s"]);
    let (report, said) = replay(&file, &[]);
    // A recorded state has about 200 slots, each of which caused up to one page fault at its first use.
    let faults: u64 = report["components"]
        .as_array()
        .expect("components")
        .iter()
        .filter_map(|component| component["page_faults"].as_u64())
        .sum();
    assert!(faults < 40, "{faults} page faults: {said}");
}

#[test]
fn arm_moves_to_the_start_of_a_recording_and_to_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    // It ends in the middle of a movement.
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "700 ms"]);
    let recording = Recording::open(&file).expect("a recording");
    let (plan, home) = to_a_panda_elsewhere(&recording, 0.3);
    assert_eq!(plan.duration_ns, Some(3_200_000_000), "2 s, the recording, 500 ms");
    let mut session = launch(plan);
    let panda = motorium_robots::load("panda", Path::new(".")).expect("in the catalogue").model;
    let state = |session: &mut Session<'_>, time: Duration| {
        session.step_until(time).expect("the run continues");
        session.read::<JointState>("panda/true_joint_state").expect("a state").map(|state| state.value)
    };
    let begin = state(&mut session, 2 * MS).expect("measured");
    assert!((begin.position()[0] - home[0] - 0.3).abs() < 1e-3, "{:?}", begin.position());
    let (mut fastest, mut before) = (vec![0.0_f64; 7], begin);
    for step in 3..2000 {
        let now = state(&mut session, step * MS).expect("measured");
        for (joint, most) in fastest.iter_mut().enumerate() {
            let [v, last] = [&now, &before].map(|state| state.velocity()[joint]);
            *most = most.max(v.abs());
            // The recorded stiffness follows the quintic: half of the limit is kept, within 1 % of a rad/s.
            assert!(v.abs() <= 0.5 * panda.velocity_limit()[joint] + 0.01, "joint {joint} at {step} ms: {v}");
            assert!((v - last).abs() < 7.5e-3 * 1.5, "joint {joint} at {step} ms: from {last} to {v}");
        }
        before = now;
    }
    // 0.3 rad in 2 s at 15/8 of the mean speed: 0.281 rad/s. The drives follow within a fifth of that,
    // because gravity compensation comes only from the recording and is faded in.
    let mean = 0.3 / 2.0;
    assert!(fastest.iter().all(|v| (v / (1.875 * mean) - 1.0).abs() < 0.2), "{fastest:?}");
    for (joint, (q, home)) in before.position().iter().zip(&home).enumerate().take(7) {
        assert!((q - home).abs() < 5e-3, "joint {joint} is at {q}, the recording begins at {home}");
    }
    let moving = state(&mut session, 2699 * MS).expect("measured");
    let speed = |state: &JointState| state.velocity()[..7].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    assert!(speed(&moving) > 0.1, "the recording ends in the middle of a movement: {:?}", moving.velocity());
    let resting = state(&mut session, 3199 * MS).expect("measured");
    assert!(speed(&resting) < 2e-3, "{:?}", resting.velocity());
    let report = session.stop();
    assert_eq!(report.exit, Exit::Finished);
    let physics = report.components.iter().find(|component| component.name == "physics").expect("it ran");
    let gate = serde_json::to_value(physics.gate.as_ref().expect("an actuator")).expect("JSON");
    assert_eq!(gate["refused"], serde_json::json!([]), "{gate}");
}

#[test]
fn arm_too_far_from_a_recording_is_not_moved() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "100 ms"]);
    let (plan, home) = to_a_panda_elsewhere(&Recording::open(&file).expect("a recording"), 1.2);
    let mut session = launch(plan);
    let ended = session.step_until(1000 * MS).expect_err("it ends");
    let SessionError::Ended(Exit::SafeStop { reason }) = &ended else { panic!("{ended}") };
    // 15/8 of 1.2 rad at half of 2.175 rad/s.
    assert!(reason.contains("`panda_joint1` is 1.200") && reason.contains("takes 2.07 s"), "{reason}");
    assert!(reason.contains("--ease-in"), "{reason}");
    let state =
        session.read::<JointState>("panda/true_joint_state").expect("a state").expect("measured").value;
    assert!((state.position()[0] - home[0] - 1.2).abs() < 0.01, "{:?}", state.position());
}

#[test]
fn command_lists_robots_moved_to_the_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = recorded(folder.path(), "panda-reach.toml", &["--for", "200 ms"]);
    let both = ["--live", "physics", "--live", "encoder"];
    let (report, said) =
        replay(&file, &[&both[..], &["--ease-in", "500 ms", "--ramp-down", "300 ms"]].concat());
    assert!(said.contains("`controller`: 500 ms to the first recorded pose"), "{said}");
    assert_eq!(report["duration_s"], 1.0, "{said}");
    let controller = &report["results"]["controller"];
    assert_eq!((&controller["left"], &controller["refused"]), (&0.into(), &0.into()), "{controller}");
    // A command at each of 500 and of 300 ticks, plus or minus a few at the transitions.
    let eased = controller["eased"].as_u64().expect("a number");
    assert!((795..=805).contains(&eased), "{controller}");

    let (report, said) = replay(&file, &["--live", "physics", "--ease-in", "400 ms"]);
    assert!(said.contains("warning:") && said.contains("`physics` starts the recording"), "{said}");
    assert_eq!(report["results"]["controller"]["eased"], 0);
    let (report, said) = replay(&file, &[&both[..], &["--ease-in", "0 s"]].concat());
    assert!(!said.contains("first recorded pose") && report["duration_s"] == 0.2, "{said}");
}

#[test]
fn one_or_all_episodes_are_replayed_and_verified() {
    let folder = tempfile::tempdir().expect("a folder");
    let file =
        recorded(folder.path(), "panda-reach.toml", &["--for", "200 ms", "--episodes", "3", "--vary-seed"]);
    let (report, said) = replay(&file, &[]);
    assert_eq!(report["episodes"].as_array().map(Vec::len), Some(3), "{said}");
    for component in ["physics", "encoder", "policy", "controller"] {
        let result = &report["results"][component];
        assert_eq!(
            (&result["published"], &result["left"]),
            (&600.into(), &0.into()),
            "{component}: {result}"
        );
    }
    let (report, _) = replay(&file, &["--episode", "1"]);
    assert_eq!(
        (&report["duration_s"], &report["results"]["encoder"]["published"]),
        (&0.2.into(), &200.into())
    );
    let none = motorium(&["replay", text(&file), "--episode", "3"]);
    let said = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(said.contains("the recording has no episode 3; it has 3, counted from 0"), "{said}");

    assert_eq!(verified(&file, &[]).0, Some(0));
    let (code, said) =
        verified(&file, &["--replace", "physics", "--replace", "encoder", "--replace", "policy"]);
    assert_eq!(code, Some(0), "the controller repeats each episode: {said}");
}

#[test]
fn early_end_of_an_episode_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let goals =
        r#"policy.config.goals=[{ offset = [0.01, 0.0, 0.0], duration = "150 ms", dwell = "20 ms" }]"#;
    let once = ["--set", "policy.config.repeat=once", "--set", "policy.ends_episode=true", "--set", goals];
    let arguments = [&once[..], &["--for", "2 s", "--episodes", "2", "--no-expect"]].concat();
    let file = recorded(folder.path(), "panda-reach.toml", &arguments);
    let recording = Recording::open(&file).expect("a recording");
    let stamps =
        recording.samples().map(|sample| sample.expect("readable").stamp).filter(|stamp| stamp.episode == 1);
    let last_ns = stamps.map(|stamp| stamp.publish_time).max().expect("two episodes");
    assert!(last_ns < 1_000_000_000, "it was over at {last_ns} ns");
    let (report, _) = replay(&file, &[]);
    let episodes = report["episodes"].as_array().expect("episodes");
    assert_eq!(episodes.len(), 2);
    for episode in episodes {
        let duration_ns = episode["duration_s"].as_f64().expect("a number") * 1e9;
        assert!((duration_ns - last_ns as f64).abs() < 1.1e6, "{duration_ns} and {last_ns}");
    }
    // The recorded end conditions of the episodes end the replayed episodes, too.
    let (code, said) = verified(&file, &["--replace", "policy"]);
    assert_eq!(code, Some(0), "{said}");
}
