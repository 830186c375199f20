//! Chunks of actions from a process that delays, loses and repeats them, and is killed.

use std::path::Path;
use std::process::{Child, Command};

use motorium::launcher::Exit;
use motorium::state::{ActionChunk, JointCommand, JointState, StateBuffer, from_bytes};
use motorium_bridges::recording::Recording;
use motorium_robots::{Loaded, load};
use rustix::process::Signal;

use crate::recording::text;
use crate::support::{Run, await_that, leftovers, machine, signal};

const PRODUCER: &str = env!("CARGO_BIN_EXE_chunk-producer");
/// Fraction of the robot's limits that setpoints use.
const FRACTION: f64 = 0.9;
/// Period of the loop, s.
const DT: f64 = 1e-3;
/// `hold` of the graph: 1.5 periods of its policy, ns.
const HOLD: u64 = 60_000_000;
/// Steps from the kill to the end of the longest chunk, the hold, the longest braking and a second of rest.
const STEPS_TO_REST: u64 = 3_500;
/// Time before the end of a chunk in which the arm still moves, ns, and its least velocity, rad/s.
const ENDING: u64 = 100_000_000;
const MOVING: f64 = 0.1;
/// Velocity below which a measured joint rests, rad/s.
const STILL: f64 = 0.01;

/// A process; killed with SIGKILL when dropped.
struct Producer(Child);

impl Producer {
    fn start(run: &str, seed: u64) -> Self {
        Self(Command::new(PRODUCER).args([run, &seed.to_string()]).spawn().expect("the producer starts"))
    }

    fn has_ended(&mut self) -> bool {
        self.0.try_wait().expect("the process can be asked").is_some()
    }
}

impl Drop for Producer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The limits of a joint: velocity, and acceleration.
fn limits() -> Vec<(f64, f64)> {
    let Loaded { model, profile, .. } = load("panda", Path::new(".")).expect("the catalogue has it");
    let acceleration = profile.expect("it has a profile").acceleration_limit(&model).expect("valid limits");
    // without a limit, the velocity limit is reached in half a second
    let limit = |joint: usize| {
        let velocity = model.velocity_limit()[joint];
        let acceleration = acceleration[joint];
        (velocity, if acceleration.is_finite() { acceleration } else { 2.0 * velocity })
    };
    (0..model.joint_count()).map(limit).collect()
}

/// A recorded value with the number and the times of its stamp: of the state and of its publication, ns.
struct Seen<T> {
    sequence: u64,
    time: u64,
    published: u64,
    value: T,
}

fn values<T: StateBuffer>(recording: &Recording, topic: &str) -> Vec<Seen<T>> {
    let topic = recording.topic(topic).expect("the topic is recorded");
    let samples = recording.samples().map(|sample| sample.expect("readable"));
    samples
        .filter(|sample| sample.topic == topic)
        .map(|sample| Seen {
            sequence: sample.stamp.sequence,
            time: sample.stamp.state_time,
            published: sample.stamp.publish_time,
            value: from_bytes(&sample.bytes).expect("a value of its type"),
        })
        .collect()
}

/// Checks velocity and acceleration between every two consecutive commands.
fn assert_within_limits(commands: &[Seen<JointCommand>], limits: &[(f64, f64)]) {
    let consecutive: Vec<_> =
        commands.windows(2).filter(|pair| pair[1].sequence == pair[0].sequence + 1).collect();
    assert!(2 * consecutive.len() > commands.len(), "{} of {}", consecutive.len(), commands.len());
    for pair in consecutive {
        let [before, now] = [&pair[0].value, &pair[1].value];
        for (joint, (velocity, acceleration)) in limits.iter().enumerate() {
            let [was, is] = [before, now].map(|command| command.velocity()[joint]);
            let moved = now.position()[joint] - before.position()[joint];
            assert!((moved - is * DT).abs() < 1e-9, "joint {joint} moves {moved} at {is} per second");
            assert!(is.abs() <= FRACTION * velocity * (1.0 + 1e-9), "joint {joint}: {is} of {velocity}");
            let change = (is - was).abs();
            let most = FRACTION * acceleration * DT * (1.0 + 1e-6);
            assert!(change <= most, "joint {joint}: {change} per step, at most {most}");
        }
    }
}

/// Checks that the arm plays the newest chunk to its end and then rests at its last action, wherever the next
/// chunk is late enough. Returns the number of such rests.
fn assert_rests(
    chunks: &[Seen<ActionChunk>],
    commands: &[Seen<JointCommand>],
    states: &[Seen<JointState>],
    limits: &[(f64, f64)],
) -> usize {
    // the chunks move the first joints; setpoints approach a target with half of their acceleration
    let moved = &limits[..chunks[0].value.width as usize];
    let braking = moved.iter().map(|(velocity, acceleration)| 2.0 * velocity / acceleration);
    let braking = (braking.fold(0.0, f64::max) * 1e9) as u64;
    let (mut rests, mut newest) = (0, &chunks[0].value);
    for (index, chunk) in chunks.iter().enumerate() {
        if chunk.value.time > newest.time {
            newest = &chunk.value;
        }
        let actions = newest.value().chunks_exact(newest.width as usize);
        let end = newest.time + (actions.len() as u64 - 1) * newest.period;
        let last_action = actions.last().expect("a chunk has actions");
        let next = chunks.get(index + 1).map_or(u64::MAX, |next| next.published);
        let resting = |time: u64| (end + HOLD + braking..next).contains(&time);
        let resting_commands: Vec<_> = commands.iter().filter(|command| resting(command.time)).collect();
        let Some(first) = resting_commands.first() else { continue };
        rests += 1;
        let missed = first.value.position().iter().zip(last_action).map(|(q, action)| (q - action).abs());
        let missed = missed.fold(0.0, f64::max);
        assert!(missed < 1e-6, "the arm rests {missed} rad from the last action");
        let is_ending = |command: &&Seen<JointCommand>| (end - ENDING..end).contains(&command.time);
        let mut ending = commands.iter().filter(is_ending).flat_map(|command| command.value.velocity());
        assert!(ending.any(|velocity| velocity.abs() > MOVING), "the chunk is not played to its end");
        for command in &resting_commands {
            let velocity = command.value.velocity();
            assert!(velocity.iter().all(|velocity| velocity.abs() < 1e-9), "{velocity:?}");
            let moved = command.value.position().iter().zip(first.value.position());
            assert!(moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-9);
        }
        let last = resting_commands[resting_commands.len() - 1].time;
        let state = states.iter().rfind(|state| state.time <= last).expect("a state");
        assert!(state.value.velocity().iter().all(|v| v.abs() < STILL), "{:?}", state.value.velocity());
    }
    rests
}

#[test]
fn the_arm_brakes_and_holds_when_its_chunk_producer_is_killed() {
    let _machine = machine();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("chunks.mcap");
    let graph = Path::new("graphs/panda-chunks.toml");
    let run = Run::start(graph, &["--for", "120 s", "--record", text(&file)]);
    let name = run.folder.id().to_string();
    for seed in [1, 2] {
        let before = run.published("panda/chunk");
        let mut producer = Producer::start(&name, seed);
        await_that("chunks arrive", || run.published("panda/chunk") >= before + 15);
        assert!(!producer.has_ended(), "the producer ended before it was killed");
        drop(producer);
        let killed = run.steps_of("controller");
        await_that("the arm rests", || run.steps_of("controller") >= killed + STEPS_TO_REST);
    }
    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let report = ended.report();
    assert_eq!(report.exit, Exit::Interrupted, "{}", ended.stderr);
    let result = &report.results["controller"];
    let count = |key: &str| result["chunks"][key].as_u64().unwrap_or_else(|| panic!("no {key} in {result}"));
    assert!(count("played") >= 10 && count("late_actions") > count("played"), "{result}");
    assert!(count("repeated") > 0 && count("refused") == 0, "{result}");
    assert!(result["stale"].as_u64() >= Some(2), "each kill leaves the actions stale: {result}");

    let recording = Recording::open(&file).expect("a recording");
    let (commands, states) =
        (values(&recording, "panda/joint_command"), values(&recording, "panda/joint_state"));
    let (chunks, limits) = (values(&recording, "panda/chunk"), limits());
    assert_within_limits(&commands, &limits);
    let rests = assert_rests(&chunks, &commands, &states, &limits);
    assert!(rests >= 2, "the arm rests after each kill, found {rests} rests");
    let moved = commands.iter().any(|command| command.value.velocity().iter().any(|v| v.abs() > 0.5));
    assert!(moved, "chunks move the arm");
    assert_eq!(leftovers(&name), Vec::<String>::new());
}
