//! `motorium learn imitate`: record, fit, reproduce.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context as _, ensure};
use motorium::graph::{self, Machine, Override};
use motorium::launcher::Options;
use motorium::plan::Plan;
use motorium::session::Session;
use motorium::state::{JointState, PoseTarget, StateBuffer};
use motorium::worker::Registry;
use motorium_learners::imitation::movements::{Model, Movements, distances};
use motorium_library::Trajectory;
use motorium_library::statistics::mean_and_error;
use motorium_pictures::chart::{Panel, panels};
use motorium_robots::{FrameId, Kinematics, Model as RobotModel};
use nalgebra::{DMatrix, Isometry3};
use serde_json::json;

use crate::commands::loading::graph_file;
use crate::out::{errln, outln};
use crate::output::{Overwrite, make_folder, write_file};
use crate::{complete, registry, robots};

/// Record the movement of a policy from several starts, fit models to it, and reproduce it.
///
/// The graph runs in lockstep, with one episode per demonstration. A DMP, a ProMP and a motion library learn
/// the path of the end effector. Then each model moves the robot from other starts, in place of the policy.
/// Its path is compared with the policy's from the same start, and with a replay of the first demonstration.
///
/// Example: motorium learn imitate graphs/imitate/loop.toml --output out/imitate
#[derive(Debug, clap::Args)]
pub(super) struct Imitate {
    /// The graph, with a policy that publishes pose targets
    #[arg(value_name = "GRAPH", add = complete::graphs(), value_parser = graph_file())]
    graph: PathBuf,
    /// Number of demonstrations, each from another start
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u64).range(2..=1000))]
    demonstrations: u64,
    /// Number of starts from which the movement is reproduced
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u64).range(1..=1000))]
    tests: u64,
    /// Seed of the first demonstration; it increases by one per episode
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    seed: u64,
    /// The folder to write to
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// The part of a graph in which a movement is recorded and reproduced.
struct Stage {
    plan: Plan,
    registry: Registry,
    /// Component that publishes pose targets, and its topics.
    policy: String,
    target: String,
    joints: String,
    model: RobotModel,
    frame: FrameId,
    /// Time of a step of the policy, and steps in an episode.
    step: Duration,
    steps: u32,
}

impl Stage {
    fn new(plan: Plan, registry: Registry) -> anyhow::Result<Self> {
        let targets: Vec<usize> = (0..plan.topics.len())
            .filter(|topic| plan.topics[*topic].layout.type_name == PoseTarget::NAME)
            .collect();
        ensure!(
            targets.len() == 1,
            "graph `{}` has {} topics of type {}, expected one, from the policy that moves an end effector",
            plan.name,
            targets.len(),
            PoseTarget::NAME
        );
        let topic = &plan.topics[targets[0]];
        let policy = &plan.components[topic.writer];
        let name = &policy.name;
        let joints = policy.inputs.iter().find(|input| input.layout.type_name == JointState::NAME);
        let joints = joints.and_then(|input| input.topic).with_context(|| {
            format!("component `{name}` reads no {}, expected the measured joints", JointState::NAME)
        })?;
        let robot = policy.robot.as_ref().with_context(|| format!("component `{name}` names no robot"))?;
        let loaded = robots::load_in_world(robot)?;
        ensure!(
            !loaded.model.base().floating,
            "robot `{}` has a floating base, expected a fixed base",
            robot.name
        );
        let frame = loaded.end_effector(None)?;
        let duration =
            plan.duration_ns.context("the graph has no `duration`, expected the time of a movement")?;
        let step_ns = plan.components[plan.topics[joints].writer].period_ns().max(1_000_000);
        Ok(Self {
            policy: name.clone(),
            target: topic.name.clone(),
            joints: plan.topics[joints].name.clone(),
            model: loaded.model,
            frame,
            step: Duration::from_nanos(step_ns),
            steps: u32::try_from(duration / step_ns).context("the duration of the graph")?,
            plan,
            registry,
        })
    }

    fn duration(&self) -> f64 {
        self.step.as_secs_f64() * f64::from(self.steps)
    }

    fn session(&self, options: &Options) -> anyhow::Result<Session<'static>> {
        Ok(Session::launch(self.plan.clone(), &self.registry, options)?)
    }

    /// Returns the pose of the end effector, from the measured joints.
    fn pose(&self, session: &mut Session<'_>, kinematics: &mut Kinematics) -> anyhow::Result<Isometry3<f64>> {
        let state = session.read::<JointState>(&self.joints)?;
        let state = state.with_context(|| format!("no measured joints on `{}`", self.joints))?;
        let positions = state.value.position().get(..self.model.nq());
        let positions = positions.with_context(|| {
            format!("`{}` has fewer joints than the robot, expected {}", self.joints, self.model.nq())
        })?;
        kinematics.update(&self.model, positions);
        Ok(kinematics.pose(&self.model, self.frame))
    }

    /// Runs an episode and returns the path of the end effector, samples x 3. `act` is called before each
    /// step with its number and the present pose.
    fn episode(
        &self,
        session: &mut Session<'_>,
        seed: u64,
        mut act: impl FnMut(&mut Session<'_>, u32, &Isometry3<f64>) -> anyhow::Result<()>,
    ) -> anyhow::Result<DMatrix<f64>> {
        session.reset(seed)?;
        let mut kinematics = Kinematics::new(&self.model);
        // the first measurement
        session.step_until(self.step)?;
        let mut path = DMatrix::zeros(self.steps as usize, 3);
        for step in 0..self.steps {
            let pose = self.pose(session, &mut kinematics)?;
            path.row_mut(step as usize).copy_from(&pose.translation.vector.transpose());
            act(session, step, &pose)?;
            session.step_until(self.step * (step + 2))?;
        }
        Ok(path)
    }

    /// Paths of the policy of the graph.
    fn record(&self, seeds: impl Iterator<Item = u64>) -> anyhow::Result<Vec<DMatrix<f64>>> {
        let mut session = self.session(&Options::inline())?;
        let paths = seeds.map(|seed| self.episode(&mut session, seed, |_, _, _| Ok(())));
        let paths = paths.collect::<anyhow::Result<_>>()?;
        session.stop();
        Ok(paths)
    }

    /// Returns the path of the robot when a model commands it; the orientation stays as it is at the start.
    fn reproduce(
        &self,
        session: &mut Session<'_>,
        seed: u64,
        (movements, model): (&Movements, Model),
    ) -> anyhow::Result<DMatrix<f64>> {
        let (mut path, mut orientation) = (DMatrix::zeros(0, 3), [0.0; 4]);
        let (count, seconds) = (self.steps as usize, self.step.as_secs_f64());
        self.episode(session, seed, |session, step, pose| {
            if step == 0 {
                let positions = movements.path(model, pose.translation.vector.as_slice())?;
                let (id, label, duration) = (String::new(), None, self.duration());
                path = Trajectory { id, label, duration, positions }.splined(count).positions;
                let turn = pose.rotation.coords;
                orientation = [turn.x, turn.y, turn.z, turn.w];
            }
            let sample = step as usize;
            let next = (sample + 1).min(count - 1);
            let coordinate = |k: usize| [0, 1, 2].map(|d| path[(k, d)]);
            let (position, following) = (coordinate(sample), coordinate(next));
            let linear_velocity = [0, 1, 2].map(|d| (following[d] - position[d]) / seconds);
            let target = PoseTarget {
                position,
                orientation,
                linear_velocity,
                goal: 1,
                at_goal: u64::from(next == sample),
                ..PoseTarget::default()
            };
            Ok(session.publish(&self.target, &target)?)
        })
    }
}

impl Imitate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let registry = registry::registry();
        let lockstep = Override { path: "clock".to_owned(), value: "\"lockstep\"".to_owned() };
        let checked = graph::load_with(&self.graph, &[], &[lockstep], &registry, &Machine::detect());
        let plan = match checked {
            Ok(checked) => checked.plan,
            Err(error) => return Ok(super::tune::refuse(&error)),
        };
        let stage = Stage::new(plan, registry)?;
        let [plot, summary_file] = ["imitation.svg", "imitation.json"].map(|name| self.output.join(name));
        let files = Movements::FILES.map(|name| self.output.join(name));
        self.overwrite.check([&self.graph], files.iter().chain([&plot, &summary_file]))?;
        make_folder(&plot)?;
        let first_test = self.seed + self.demonstrations;
        let shown = stage.record(self.seed..first_test)?;
        errln!("{} demonstrations of {:.2} s", shown.len(), stage.duration());
        let names = ["x", "y", "z"].map(str::to_owned);
        let movements = Movements::fit(&names, stage.duration(), &shown)?;
        movements.write(&self.output)?;

        let tests = first_test..first_test + self.tests;
        let expected = stage.record(tests.clone())?;
        let mut session = stage.session(&Options::inline().standing_in_for(&stage.policy))?;
        let mut reproduced = Vec::new();
        for model in Model::ALL {
            let paths = tests.clone().map(|seed| stage.reproduce(&mut session, seed, (&movements, model)));
            reproduced.push((model, paths.collect::<anyhow::Result<Vec<_>>>()?));
        }
        session.stop();

        let mut page = Vec::new();
        for (axis, name) in names.iter().enumerate() {
            let mut panel = Panel::new(&format!("{name}, m"));
            let curve = |path: &DMatrix<f64>| {
                let points =
                    (0..path.nrows()).map(|k| (stage.step.as_secs_f64() * k as f64, path[(k, axis)]));
                points.collect::<Vec<_>>()
            };
            panel.reference(curve(&expected[0]));
            for (_, paths) in reproduced.iter().filter(|(model, _)| *model != Model::Replay) {
                panel.line(curve(&paths[0]));
            }
            page.push(panel);
        }
        write_file(&plot, panels(&page, ["recorded", "primitive"]))?;
        let rows: Vec<_> = reproduced
            .iter()
            .map(|(model, paths)| {
                let found = paths.iter().zip(&expected).map(|(path, expected)| distances(path, expected));
                let found: Vec<[f64; 2]> = found.collect();
                let errors: Vec<f64> = found.iter().map(|[rms, _]| *rms).collect();
                let largest = found.iter().map(|[_, largest]| *largest).fold(0.0, f64::max);
                (*model, mean_and_error(&errors), largest)
            })
            .collect();
        let summary = json!({
            "graph": self.graph.display().to_string(),
            "demonstrations": self.demonstrations,
            "seconds": stage.duration(),
            "models": rows.iter().map(|(model, (mean, error), largest)| json!({
                "model": model, "rms_m": mean, "rms_standard_error_m": error, "largest_m": largest,
            })).collect::<Vec<_>>(),
        });
        write_file(&summary_file, serde_json::to_string_pretty(&summary)?)?;
        if self.json {
            outln!("{summary}");
            return Ok(ExitCode::SUCCESS);
        }
        for (model, (mean, error), largest) in rows {
            outln!(
                "{:<20} {:.1} +- {:.1} mm from the policy's path, at most {:.1} mm",
                model.name(),
                1e3 * mean,
                1e3 * error,
                1e3 * largest
            );
        }
        Ok(ExitCode::SUCCESS)
    }
}
