//! Returns of policies after equal steps with equal settings, compared with Stable-Baselines3. Both sides
//! train and are evaluated on motorium's worlds.

use std::fmt::Display;
use std::path::Path;

use motorium_benches::peers::Peer;
use motorium_learners::environment::{Environment, Scene, VectorEnvironment};
use motorium_learners::evaluation::quantile;
use motorium_learners::learner::Algorithm;
use motorium_learners::task::Task;
use motorium_learners::training::{settings, start};
use motorium_models::onnx::Model;
use serde_json::json;

/// Episodes of an evaluation, and the seed of their starts.
const EPISODES: usize = 20;
const EVALUATION_SEED: u64 = 1 << 32;

/// A task that both sides learn by an algorithm.
struct Comparison {
    name: String,
    task: Task,
    scene: Scene,
    algorithm: Algorithm,
    /// Settings of the algorithm.
    settings: toml::Table,
    /// Steps of all worlds together.
    steps: u64,
}

/// Trains both sides in turn, seed by seed, and prints the mean return of each policy, then medians and
/// quartiles. `words` are comparisons, each a task, an algorithm and a number of steps, then the number of
/// seeds.
pub(crate) fn compare(words: &[String]) -> Result<(), String> {
    let usage = "expected --returns \"TASK ALGORITHM STEPS\"... SEEDS";
    let (seeds, comparisons) = words.split_last().ok_or(usage)?;
    let seeds: u64 = seeds.parse().map_err(|_| format!("\"{seeds}\" seeds, {usage}"))?;
    let comparisons: Vec<Comparison> =
        comparisons.iter().map(|words| Comparison::parse(words, usage)).collect::<Result<_, _>>()?;
    let mut peer = Peer::start("returns.py", "stable-baselines3")?;
    println!("mean return of {EPISODES} episodes; last lines: median [quartiles] of {seeds} seeds\n");
    println!("{:<32} {:>5} {:>26} {:>26}", "task, algorithm, steps", "seed", "motorium", "stable-baselines3");
    let mut columns = vec![[vec![], vec![]]; comparisons.len()];
    for seed in 1..=seeds {
        for (comparison, column) in comparisons.iter().zip(&mut columns) {
            let found = [comparison.train(seed)?, comparison.train_peer(&mut peer, seed)?];
            println!("{:<32} {seed:>5} {:>26.2} {:>26.2}", comparison.name, found[0], found[1]);
            column.iter_mut().zip(found).for_each(|(column, found)| column.push(found));
        }
    }
    println!();
    for (comparison, column) in comparisons.iter().zip(&columns) {
        let [ours, theirs] =
            column.each_ref().map(|values| [0.25, 0.5, 0.75].map(|share| quantile(values, share)));
        let verdict = if ours[1] < theirs[0] {
            "below"
        } else if ours[1] > theirs[2] {
            "above"
        } else {
            "inside"
        };
        let shown = |[low, median, high]: [f64; 3]| format!("{median:.2} [{low:.2}, {high:.2}]");
        println!("{:<32} {:>5} {:>26} {:>26} {verdict}", comparison.name, "", shown(ours), shown(theirs));
    }
    Ok(())
}

impl Comparison {
    fn parse(words: &str, usage: &str) -> Result<Self, String> {
        let invalid = || format!("\"{words}\", {usage}");
        let [name, algorithm, steps] = words.split_whitespace().collect::<Vec<_>>()[..] else {
            return Err(invalid());
        };
        let algorithm: Algorithm = algorithm.parse().map_err(text)?;
        let steps: u64 = steps.parse().map_err(|_| invalid())?;
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tasks");
        let file = folder.join(name).with_extension("toml");
        let source =
            std::fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
        let mut task = Task::parse(&source).map_err(text)?;
        if algorithm == Algorithm::Dqn {
            // like the peer, which has no double Q-learning
            let settings = task.algorithms.entry("dqn").or_insert_with(|| toml::Table::new().into());
            let settings = settings.as_table_mut().ok_or_else(invalid)?;
            settings.insert("double".to_owned(), false.into());
        }
        let scene = Scene::load(&task, &folder).map_err(text)?;
        let mut settings = settings(algorithm, &task).map_err(text)?;
        settings.insert("steps".to_owned(), i64::try_from(steps).map_err(|_| invalid())?.into());
        Ok(Self { name: words.to_owned(), task, scene, algorithm, settings, steps })
    }

    /// Returns the mean return after training by motorium on one thread.
    fn train(&self, seed: u64) -> Result<f64, String> {
        let mut learner =
            start(self.algorithm, &self.task, &self.scene, Some(self.steps), (seed, 1)).map_err(text)?;
        while !learner.is_finished() {
            learner.advance().map_err(text)?;
        }
        let network = Model::read(&learner.policy().to_onnx(&[])).map_err(text)?;
        let mut program = network.program(1).map_err(text)?;
        self.evaluate(|observation, action| {
            program.input_mut(0).copy_from_slice(observation);
            program.run();
            action.copy_from_slice(program.output(0));
            Ok(())
        })
    }

    /// Returns the mean return after training by the peer, which chooses the actions of worlds that are
    /// stepped here.
    fn train_peer(&self, peer: &mut Peer, seed: u64) -> Result<f64, String> {
        let name = peer.name();
        let invalid = |answer: &str| format!("{name} answers `{}`", answer.trim());
        let count = self.settings.get("worlds").and_then(toml::Value::as_integer).unwrap_or(1);
        let count = usize::try_from(count).map_err(text)?;
        let mut worlds =
            VectorEnvironment::new(&self.task, (count, 1), seed, || self.scene.simulation()).map_err(text)?;
        let inputs = worlds.terms().inputs();
        // actions without effect are hidden from the peer
        let active = worlds.terms().active_actions();
        let width = active.iter().filter(|active| **active).count();
        let spread = |chosen: &[f32], actions: &mut [f32]| {
            let mut chosen = chosen.iter();
            for (action, _) in actions.iter_mut().zip(&active).filter(|(_, active)| **active) {
                *action = chosen.next().copied().unwrap_or_default();
            }
        };
        let bounds = worlds.terms().policy().action.bounds().ok_or("the task's action has no `clip`")?;
        let rows = |numbers: &[f32]| numbers.chunks_exact(inputs).map(<[f32]>::to_vec).collect::<Vec<_>>();
        let run = json!({
            "algorithm": self.algorithm,
            "seed": seed,
            "settings": self.settings,
            "actions": width,
            "bounds": bounds,
            "observations": rows(worlds.observations()),
        });
        let mut answer = peer.exchange(&run.to_string())?;
        let mut actions = vec![0.0; count * active.len()];
        loop {
            let chosen: Option<Vec<Vec<f32>>> =
                serde_json::from_str(&answer).map_err(|_| invalid(&answer))?;
            let Some(chosen) = chosen else { break };
            for (chosen, actions) in chosen.iter().zip(actions.chunks_exact_mut(active.len())) {
                spread(chosen, actions);
            }
            worlds.step(&actions).map_err(text)?;
            let ends = worlds.steps().iter().enumerate().map(|(world, step)| {
                let end = step.end?;
                let observation = worlds.final_observation(world);
                Some(json!({ "truncated": !end.is_terminal(), "observation": observation }))
            });
            let step = json!({
                "observations": rows(worlds.observations()),
                "rewards": worlds.steps().iter().map(|step| step.reward).collect::<Vec<_>>(),
                "ends": ends.collect::<Vec<_>>(),
            });
            answer = peer.exchange(&step.to_string())?;
        }
        let found = self.evaluate(|observation, action| {
            let answer = peer.exchange(&json!(observation).to_string())?;
            let chosen: Vec<f32> = serde_json::from_str(&answer).map_err(|_| invalid(&answer))?;
            spread(&chosen, action);
            Ok(())
        })?;
        peer.send("null")?;
        Ok(found)
    }

    /// Returns the mean return of a policy over the episodes of the evaluation.
    fn evaluate(&self, mut act: impl FnMut(&[f32], &mut [f32]) -> Result<(), String>) -> Result<f64, String> {
        let simulation = self.scene.simulation().map_err(text)?;
        let mut environment = Environment::new(&self.task, simulation, EVALUATION_SEED, 0).map_err(text)?;
        let mut action = vec![0.0; environment.terms().actions()];
        let mut total = 0.0;
        for _ in 0..EPISODES {
            environment.reset().map_err(text)?;
            loop {
                act(environment.observation(), &mut action)?;
                let step = environment.step(&action);
                total += step.reward;
                if step.end.is_some() {
                    break;
                }
            }
        }
        Ok(total / EPISODES as f64)
    }
}

fn text(error: impl Display) -> String {
    error.to_string()
}
