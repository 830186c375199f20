//! Processor time of an environment step by part, `--parts`: physics, the terms of the task, the roll-out and
//! the update of PPO. Uses one thread, so that other programs on the machine hardly affect the figures.

use motorium_learners::environment::{Scene, VectorEnvironment};
use motorium_learners::ppo::{Ppo, PpoSettings};
use motorium_learners::task::Task;
use motorium_physics::{Articulated, Batch, JointSetpoint};
use rustix::time::{ClockId, clock_gettime};

use crate::training::{LARGER, TASKS, WORLDS, change, load};

/// Turns, of which the median counts, and steps of all worlds in a turn.
const TURNS: usize = 15;
const STEPS: usize = 48;
/// Hidden layers of the measured networks.
const NETWORKS: [&[usize]; 2] = [&[128, 64, 32], LARGER];

/// A part, and the processor time that it has spent per environment step \[us\], one entry a turn.
struct Part {
    name: String,
    turn: Box<dyn FnMut()>,
    steps: usize,
    times: Vec<f64>,
}

/// Prints the parts of the tasks whose names contain one of `chosen`, or of all.
pub(crate) fn print(chosen: &[String]) {
    for name in TASKS.into_iter().filter(|name| chosen.is_empty() || chosen.iter().any(|c| name.contains(c)))
    {
        let (task, scene) = load(name);
        let mut parts = parts(&task, &scene);
        for _ in 0..TURNS {
            // in turns, so that a slow moment of the machine affects all parts
            for part in &mut parts {
                let start = processor_micros();
                (part.turn)();
                part.times.push((processor_micros() - start) / part.steps as f64);
            }
        }
        println!("{name}: processor time of an environment step [us], median of {TURNS} turns on one thread");
        let medians: Vec<f64> = parts.iter_mut().map(|part| median(&mut part.times)).collect();
        for (part, micros) in parts.iter().zip(&medians) {
            println!("  {:<44} {micros:8.2}", part.name);
        }
        println!("  physics with changing actions / environment {:.3}", medians[1] / medians[2]);
        for (network, medians) in NETWORKS.iter().zip(medians[3..].chunks_exact(2)) {
            let epoch = medians[1] - medians[0];
            println!("  {network:?}: an epoch {epoch:.2}, roll-out {:.2}", medians[0] - epoch);
        }
    }
}

/// Returns the measured parts: physics at rest and with the actions of the environment, the environment, then
/// for each network PPO with one epoch and with two.
fn parts(task: &Task, scene: &Scene) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut add = |name: String, steps: usize, turn: Box<dyn FnMut()>| {
        parts.push(Part { name, turn, steps, times: Vec::new() });
    };
    let mut batch: Batch<Articulated> =
        Batch::new(WORLDS, 1, |_| scene.simulation()).expect("the robot of the task");
    hold(task, scene, &mut batch);
    let (dt, decimation) = (task.step, task.decimation);
    let physics = move || {
        for _ in 0..STEPS {
            batch.step(dt, decimation);
        }
    };
    add("physics alone, drives at rest".to_owned(), WORLDS * STEPS, Box::new(physics));
    for is_judged in [false, true] {
        let worlds = VectorEnvironment::new(task, (WORLDS, 1), 1, || scene.simulation());
        let mut worlds = worlds.expect("a task of its robot");
        let mut actions = vec![0.0; WORLDS * worlds.terms().actions()];
        let mut step = 0;
        let turn = move || {
            for _ in 0..STEPS {
                step += 1;
                change(&mut actions, step as f32);
                if is_judged {
                    worlds.step(&actions).expect("the next episode starts");
                } else {
                    worlds.step_physics(&actions);
                }
            }
        };
        let part = if is_judged { "environment" } else { "physics alone" };
        add(format!("{part}, changing actions"), WORLDS * STEPS, Box::new(turn));
    }
    let settings = PpoSettings::from_table(&task.algorithms).expect("the settings of the task");
    for network in NETWORKS {
        for epochs in [1, 2] {
            let settings = PpoSettings { epochs, hidden: network.to_vec(), ..settings.clone() };
            let steps = settings.worlds * settings.horizon;
            let run = Ppo::new(task, settings, (1, 1), || scene.simulation());
            let mut run = run.expect("a task of its robot");
            let turn = move || {
                run.advance().expect("finite losses");
            };
            add(format!("PPO, {network:?}, epochs: {epochs}"), steps, Box::new(turn));
        }
    }
    parts
}

/// Holds the default pose of the action, and steps until the robots stand.
fn hold(task: &Task, scene: &Scene, batch: &mut Batch<Articulated>) {
    let worlds = VectorEnvironment::new(task, (1, 1), 1, || scene.simulation());
    let worlds = worlds.expect("a task of its robot");
    let (targets, (_, gains)) = (worlds.terms().targets().targets(), worlds.terms().drives());
    let drives = batch.commands_mut().len() / WORLDS;
    for robot in batch.commands_mut().chunks_exact_mut(drives) {
        for (target, [kp, kd]) in targets.iter().zip(gains) {
            robot[target.joint] = JointSetpoint::hold(target.offset, *kp, *kd);
        }
    }
    batch.step(task.step, (1.0 / task.step) as usize);
}

fn processor_micros() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
