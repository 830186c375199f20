//! Environment steps and steps of PPO.

use std::hint::black_box;
use std::path::Path;

use motorium_learners::environment::{Scene, VectorEnvironment};
use motorium_learners::ppo::{Ppo, PpoSettings};
use motorium_learners::task::Task;

/// Worlds of the environments.
pub(crate) const WORLDS: usize = 64;
/// Threads of the published figures.
const THREADS: usize = 2;
/// Tasks of the rows.
pub(crate) const TASKS: [&str; 2] = ["cart-pole", QUADRUPED];
const QUADRUPED: &str = "quadruped-velocity";
/// Hidden layers of the larger network of the quadruped.
pub(crate) const LARGER: &[usize] = &[256, 128, 64];

/// A measured call and its environment steps.
pub(crate) struct Row {
    pub(crate) name: String,
    pub(crate) steps: u64,
    pub(crate) run: Box<dyn FnMut()>,
}

/// Returns all rows of the comparison.
pub(crate) fn all() -> Vec<Row> {
    let mut rows = Vec::new();
    for name in TASKS {
        let (task, scene) = load(name);
        rows.push(physics(name, &task, &scene));
        rows.push(environment(name, &task, &scene));
        let settings = PpoSettings::from_table(&task.algorithms).expect("the settings of the task");
        rows.push(training(name, &task, &scene, settings.clone()));
        if name == QUADRUPED {
            let settings = PpoSettings { hidden: LARGER.to_vec(), ..settings };
            rows.push(training(name, &task, &scene, settings));
        }
    }
    rows
}

/// Loads one of the project's tasks and its scene.
pub(crate) fn load(name: &str) -> (Task, Scene) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tasks");
    let text = std::fs::read_to_string(folder.join(name).with_extension("toml"));
    let task = Task::parse(&text.expect("a task of the project")).expect("the project's tasks are valid");
    let scene = Scene::load(&task, &folder).expect("the robot of the catalogue");
    (task, scene)
}

/// Writes actions that change with `phase`.
pub(crate) fn change(actions: &mut [f32], phase: f32) {
    for (index, action) in actions.iter_mut().enumerate() {
        *action = (0.7 * phase + index as f32).sin();
    }
}

/// Returns the row of the physics of all worlds with the actions of the environment: the floor of the
/// environment's time.
fn physics(name: &str, task: &Task, scene: &Scene) -> Row {
    let worlds = VectorEnvironment::new(task, (WORLDS, THREADS), 1, || scene.simulation());
    let mut worlds = worlds.expect("a task of its robot");
    let mut actions = vec![0.0; WORLDS * worlds.terms().actions()];
    let mut phase = 0.0_f32;
    Row {
        name: format!("{name}_physics_{WORLDS}_worlds_{THREADS}_threads"),
        steps: WORLDS as u64,
        run: Box::new(move || {
            phase += 1.0;
            change(&mut actions, phase);
            worlds.step_physics(&actions);
        }),
    }
}

/// Returns the row of the steps of all worlds with actions that change from step to step.
fn environment(name: &str, task: &Task, scene: &Scene) -> Row {
    let worlds = VectorEnvironment::new(task, (WORLDS, THREADS), 1, || scene.simulation());
    let mut worlds = worlds.expect("a task of its robot");
    let mut actions = vec![0.0; WORLDS * worlds.terms().actions()];
    let mut phase = 0.0_f32;
    Row {
        name: format!("{name}_environment_{WORLDS}_worlds_{THREADS}_threads"),
        steps: WORLDS as u64,
        run: Box::new(move || {
            phase += 1.0;
            change(&mut actions, phase);
            black_box(worlds.step(&actions).expect("the next episode starts"));
        }),
    }
}

/// Returns the row of one update of PPO: its roll-outs and its epochs.
fn training(name: &str, task: &Task, scene: &Scene, settings: PpoSettings) -> Row {
    let layers: Vec<String> = settings.hidden.iter().map(usize::to_string).collect();
    let steps = (settings.worlds * settings.horizon) as u64;
    let run = Ppo::new(task, settings, (1, THREADS), || scene.simulation());
    let mut run = run.expect("a task of its robot");
    Row {
        name: format!("{name}_ppo_{}_{THREADS}_threads", layers.join("-")),
        steps,
        run: Box::new(move || {
            black_box(run.advance().expect("finite losses"));
        }),
    }
}
