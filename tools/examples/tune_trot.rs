//! Tunes the trot of the quadruped: frequency, amplitude, duty factor and the phase of the knees.
//!
//! The search samples a generation of gaits. Inline sessions, one per core, evaluate the gaits. A session
//! replaces the policy of `graphs/quadruped-trot.toml`, publishes the joint commands of its gait, and
//! measures the distance travelled by the base. The distance depends neither on the core nor on the gaits
//! that the core evaluated before.
//!
//! ```console
//! $ cargo run --release --example tune_trot -- --episodes 200
//! ```

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::Parser as _;
use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::plan::Plan;
use motorium::session::Session;
use motorium::state::{BaseState, JointCommand};
use motorium_learners::search::{
    CrossEntropy, CrossEntropySettings, Evaluation, Search as _, Start, Workers, maximise,
};
use motorium_tools::{allowed_cores, registry};

/// Tune the trot of the quadruped by a black-box search.
#[derive(Debug, clap::Parser)]
struct Arguments {
    /// Number of gaits to evaluate
    #[arg(long, default_value_t = 200)]
    episodes: usize,
    /// Parallel sessions, one per core [default: all cores that the program may run on]
    #[arg(long)]
    sessions: Option<usize>,
    /// Simulated time of an episode, s
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// Seed of the search
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Candidates of a generation.
const GENERATION: usize = 20;
/// The graph, and the topics of the component that is replaced.
const GRAPH: &str = "graphs/quadruped-trot.toml";
const POLICY: &str = "policy";
const COMMAND: &str = "quadruped/joint_command";
const BASE: &str = "quadruped/base_state";
/// Duration of the transition from standing to the gait, s.
const EASE: f64 = 0.5;
/// Height of the base below which the robot has fallen, m.
const FALLEN: f64 = 0.12;

/// A gait: the parameters of the search.
#[derive(Debug, Clone, Copy)]
struct Gait {
    /// Strides per second, Hz.
    frequency: f64,
    /// Factor of the amplitudes.
    amplitude: f64,
    /// Duty factor: the fraction of a stride in which a foot is in stance.
    duty: f64,
    /// Phase by which the knees lead, rad.
    phase: f64,
}

impl Gait {
    /// The trot of the graph file.
    const START: [f64; 4] = [2.0, 1.0, 0.5, 0.0];
    const DEVIATION: [f64; 4] = [0.6, 0.3, 0.08, 0.4];
    const BOUNDS: [[f64; 2]; 4] = [[0.5, 4.0], [0.2, 2.0], [0.3, 0.8], [-1.5, 1.5]];

    fn from_numbers(numbers: &[f64]) -> Self {
        let [frequency, amplitude, duty, phase] = [0, 1, 2, 3].map(|i| numbers[i]);
        Self { frequency, amplitude, duty, phase }
    }

    /// Returns the phase of a foot after `turns` strides: 0 to pi in stance, pi to 2 pi in swing.
    fn warped(&self, turns: f64) -> f64 {
        let share = turns.rem_euclid(1.0);
        if share < self.duty {
            PI * share / self.duty
        } else {
            PI + PI * (share - self.duty) / (1.0 - self.duty)
        }
    }

    /// Returns the position of a joint at `time`, rad.
    fn position(&self, joint: &Joint, time: f64) -> f64 {
        let lead = if joint.is_knee { self.phase } else { 0.0 };
        let angle = self.warped(self.frequency * time + joint.leg / TAU) + joint.phase + lead;
        let eased = (time / EASE).clamp(0.0, 1.0);
        joint.offset + eased * eased * (3.0 - 2.0 * eased) * self.amplitude * joint.amplitude * angle.cos()
    }
}

/// A joint of the gait, as configured in the graph file.
#[derive(Debug, Clone, Copy)]
struct Joint {
    /// Index in the commands.
    index: usize,
    is_knee: bool,
    /// Phase of its leg in the trot, rad.
    leg: f64,
    offset: f64,
    amplitude: f64,
    phase: f64,
}

/// The joints of the gait and the gains of all joints, from the configuration of the policy.
#[derive(Debug, Clone)]
struct Legs {
    joints: Vec<Joint>,
    kp: Vec<f64>,
    kd: Vec<f64>,
}

impl Legs {
    fn from_plan(plan: &Plan) -> anyhow::Result<Self> {
        let policy = plan.components.iter().find(|component| component.name == POLICY);
        let policy = policy.context("the graph has no policy")?;
        let robot = policy.robot.as_ref().context("the policy has no robot")?;
        let model = motorium_robots::load(&robot.urdf, &robot.base)?.model;
        // one number for all joints, or one for each
        let numbers = |value: &serde_json::Value| -> anyhow::Result<Vec<f64>> {
            let values = match value.as_array() {
                Some(values) => values.iter().filter_map(serde_json::Value::as_f64).collect(),
                None => vec![value.as_f64().context("the policy states no gains")?; model.joint_count()],
            };
            anyhow::ensure!(
                values.len() == model.joint_count(),
                "the policy has gains for {} joints",
                values.len()
            );
            Ok(values)
        };
        let number = |value: &serde_json::Value| value.as_f64().context("a number is missing");
        let mut joints = Vec::new();
        let legs = policy.config["legs"].as_array().context("the policy has no legs")?;
        for (leg, table) in legs.iter().enumerate() {
            // In a trot the legs of a diagonal move together: front left with hind right.
            let leg = if leg == 0 || leg == 3 { 0.0 } else { PI };
            for (place, joint) in table["joints"].as_array().into_iter().flatten().enumerate() {
                let name = joint["joint"].as_str().context("a joint without a name")?;
                joints.push(Joint {
                    index: model.joint_index(name).with_context(|| format!("no joint {name}"))?,
                    is_knee: place > 0,
                    leg,
                    offset: number(&joint["offset"])?,
                    amplitude: number(&joint["amplitude"])?,
                    phase: number(&joint["phase"])?,
                });
            }
        }
        let gains = &policy.config["joint_command"];
        Ok(Self { joints, kp: numbers(&gains["kp"])?, kd: numbers(&gains["kd"])? })
    }

    /// Writes the command of a gait at `time`, s.
    fn command(&self, gait: &Gait, time: f64, command: &mut JointCommand) {
        const DT: f64 = 1e-3;
        command.set_count(self.kp.len());
        command.kp_mut().copy_from_slice(&self.kp);
        command.kd_mut().copy_from_slice(&self.kd);
        for joint in &self.joints {
            let position = gait.position(joint, time);
            command.position_mut()[joint.index] = position;
            command.velocity_mut()[joint.index] = (gait.position(joint, time + DT) - position) / DT;
        }
    }
}

/// Evaluates a gait in a session from its start and returns the forward travel of the base, m; 0 if the robot
/// falls.
fn distance(session: &mut Session<'_>, legs: &Legs, gait: &Gait, seconds: f64) -> anyhow::Result<f64> {
    session.reset(session.plan().seed)?;
    let mut command = JointCommand::default();
    let end = Duration::from_secs_f64(seconds);
    let (mut start, mut here) = (None, 0.0);
    while session.time() < end {
        legs.command(gait, session.time().as_secs_f64(), &mut command);
        session.publish(COMMAND, &command)?;
        session.step()?;
        let Some(base) = session.read::<BaseState>(BASE)? else { continue };
        let [x, _, z] = base.value.position;
        (here, start) = (x, start.or(Some(x)));
        if z < FALLEN {
            return Ok(0.0);
        }
    }
    Ok(here - start.unwrap_or(here))
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(GRAPH);
    let settings = ["clock=lockstep".parse()?];
    let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let checked = graph::check(&file, text, &settings, &registry(), &Machine::detect())
        .map_err(|error| anyhow::anyhow!(error.render(false)))?;
    let legs = Legs::from_plan(&checked.plan)?;
    // `taskset` may restrict the cores
    let cores = allowed_cores(&Machine::detect());
    let sessions = arguments.sessions.unwrap_or(cores.len()).clamp(1, cores.len());
    let seconds = arguments.seconds.max(EASE + 0.5);
    let (mean, deviation) = (Gait::START.to_vec(), Gait::DEVIATION.to_vec());
    let settings = CrossEntropySettings { population: GENERATION, ..CrossEntropySettings::default() };
    let start = Start::new(mean, deviation, arguments.seed).within(Gait::BOUNDS.to_vec());
    // two generations are open at a time, so that no core idles while the last gait of a generation runs
    let mut search = CrossEntropy::new(start, settings)?.with_open_generations(2);
    let episodes = arguments.episodes.max(1);
    let workers = Workers { threads: sessions, ahead: usize::MAX, evaluations: episodes as u64 };
    let (mut first, mut left) = (0.0, episodes);
    let began = Instant::now();
    maximise(
        &mut search,
        workers,
        |index| -> anyhow::Result<Session<'static>> {
            let options = Options::inline().on_core(cores[index]).standing_in_for(POLICY);
            Ok(Session::launch(checked.plan.clone(), &registry(), &options)?)
        },
        |session, candidate| {
            let gait = Gait::from_numbers(&candidate.parameters);
            Ok(Evaluation::finished(distance(session, &legs, &gait, seconds)?))
        },
        |search, candidate, evaluation| {
            // the first candidate is the start of the search
            if candidate.id == 0 {
                first = evaluation.reward;
            }
            left -= 1;
            if left.is_multiple_of(GENERATION) {
                let best = search.best().map_or(0.0, |(_, distance)| distance);
                println!("{left:>5} episodes left, best {:.3} m/s", best / seconds);
            }
            Ok(())
        },
    )?;
    let took = began.elapsed().as_secs_f64();
    let (best, reached) = search.best().context("no gait was tried")?;
    let Gait { frequency, amplitude, duty, phase } = Gait::from_numbers(best);
    println!("before: {:.3} m/s", first / seconds);
    println!(
        "after:  {:.3} m/s with frequency {frequency:.2} Hz, amplitude {amplitude:.2}, duty factor {duty:.2}, phase {phase:.2} rad",
        reached / seconds
    );
    println!(
        "{:.2} episodes of {seconds} s per second, {:.1} times real time, {sessions} sessions",
        episodes as f64 / took,
        episodes as f64 * seconds / took
    );
    Ok(())
}
