//! Distils the trot of `control.mpc` into a network: regression, then three rounds of DAgger.
//!
//! Sessions hosted inline run `graphs/policies/quadruped-trot/teacher.toml`: the quadruped, its sensors, and
//! the teacher, which reads the observations that the policy will read. Episodes differ in commands, pushes,
//! friction and slope. The label of an observation consists of the position targets at which the drives exert
//! the teacher's torques. In the first round, the teacher's targets move the robot. In later rounds, the
//! network's targets gradually replace them. The result does not depend on the number of sessions.
//!
//! ```console
//! $ cargo run --release -p motorium-tools --example distil_trot -- --output graphs/policies/quadruped-trot
//! ```

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::Parser as _;
use motorium::graph::{self, Machine, Override};
use motorium::launcher::Options;
use motorium::plan::Plan;
use motorium::session::Session;
use motorium::state::{Action, BaseState, JointCommand, JointState, TwistTarget};
use motorium_learners::imitation::{ImitationSettings, Regression};
use motorium_learners::random::{Counter, Purpose};
use motorium_learners::task::robot_digest;
use motorium_models::onnx::Model;
use motorium_models::policy::{
    BaseMotion, JointTargets, Measurements, Numbers, Observer, Policy, PolicyFolder, PolicyNetwork,
    projected_gravity,
};
use motorium_tools::{allowed_cores, registry};

/// Distil the trot of `control.mpc` into a network.
#[derive(Debug, clap::Parser)]
struct Arguments {
    /// Folder that receives policy.toml and policy.onnx
    #[arg(long, default_value = "out/quadruped-trot")]
    output: PathBuf,
    /// Rounds of DAgger after the first round, in which only the teacher acts
    #[arg(long, default_value_t = 3)]
    rounds: u64,
    /// Episodes of a round
    #[arg(long, default_value_t = 30)]
    episodes: u64,
    /// Simulated time of an episode, s
    #[arg(long, default_value_t = 8.0)]
    seconds: f64,
    /// Passes over all labels after a round
    #[arg(long, default_value_t = 20)]
    epochs: usize,
    /// Parallel sessions, one per core [default: all cores that the program may run on]
    #[arg(long)]
    sessions: Option<usize>,
    /// Seed of episodes and network
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

const RECIPE: &str = "graphs/policies/quadruped-trot";
const COMMAND: &str = "quadruped/command";
const ACTION: &str = "quadruped/action";
/// Probability that the teacher acts in round `i`: `DECAY^i`.
const DECAY: f64 = 0.3;
/// Number of episodes that evaluate the network after each round.
const JUDGED: u64 = 6;
/// Acceleration of the reference, as in the graph [m/s2, rad/s2].
const ACCELERATION: f64 = 1.0;
/// Lead of the targets as a fraction of a period: the drives hold a target for a period while the joints
/// move.
const LEAD: f64 = 0.3;
/// Cosine of the tilt of the base beyond which the robot has fallen.
const UPRIGHT: f64 = 0.7;

/// Returns a uniformly distributed number from 0 to 1.
fn uniform(counter: Counter, purpose: Purpose) -> f64 {
    (counter.number(purpose) >> 11) as f64 / (1_u64 << 53) as f64
}

/// An episode: settings of the graph, and the command from each time on.
struct Scenario {
    settings: Vec<Override>,
    commands: Vec<(f64, [f64; 3])>,
}

impl Scenario {
    /// Samples an episode of a round.
    fn draw(counter: Counter, seconds: f64) -> anyhow::Result<Self> {
        let mut draws = 0;
        let mut between = |low: f64, high: f64| {
            draws += 1;
            low + (high - low) * uniform(Counter { step: draws, ..counter }, Purpose::Command)
        };
        let (mut commands, mut time) = (Vec::new(), 0.0);
        while time < seconds {
            let mut command = [between(-0.3, 0.5), between(-0.25, 0.25), between(-0.7, 0.7)];
            // some move along or about one axis only, or not at all
            match between(0.0, 8.0) as usize {
                axis @ 0..3 => (0..3).filter(|k| *k != axis).for_each(|k| command[k] = 0.0),
                3 => command = [0.0; 3],
                _ => {}
            }
            commands.push((time, command));
            time += between(1.5, 4.0);
        }
        let (mut pushes, mut time) = (Vec::new(), between(0.5, 2.5));
        while time < seconds {
            let (size, angle) = (between(5.0, 20.0), between(0.0, core::f64::consts::TAU));
            let force = [size * angle.cos(), size * angle.sin(), 0.0];
            pushes.push(format!(
                "{{ at = \"{:.0} ms\", duration = \"100 ms\", force = {force:?} }}",
                time * 1e3
            ));
            time += between(1.5, 4.0);
        }
        let (friction, slope) = (between(0.6, 1.0), between(-0.12, 0.12));
        let world = if counter.episode.is_multiple_of(2) {
            format!("world={{ ground = {{ friction = {friction} }} }}")
        } else {
            format!(
                "world={{ terrain = {{ size = [24.0, 24.0], spacing = 0.1, flat = 0.35, friction = {friction}, \
                 layers = [{{ slope = {{ angle = {slope}, from = 0.5 }} }}] }} }}"
            )
        };
        let pushes = format!("physics.config={{ pushes = [{}] }}", pushes.join(", "));
        let seed = format!("seed={}", counter.number(Purpose::Start) >> 12);
        Ok(Self { settings: vec![world.parse()?, pushes.parse()?, seed.parse()?], commands })
    }

    /// Returns the command at the time `time`, s.
    fn command(&self, time: f64) -> [f64; 3] {
        let held = self.commands.iter().rev().find(|(from, _)| *from <= time);
        held.map_or([0.0; 3], |(_, command)| *command)
    }
}

/// The policy under construction.
#[derive(Clone)]
struct Student {
    policy: Policy,
    joints: Vec<String>,
    /// The policy's network; without one, only the teacher acts.
    network: Option<PolicyNetwork>,
    /// Probability that the teacher acts.
    beta: f64,
}

/// The result of an episode.
#[derive(Default)]
struct Rollout {
    observations: Vec<f32>,
    labels: Vec<f32>,
    tracking: Tracking,
    has_fallen: bool,
}

/// Velocity of the base against its command.
#[derive(Default)]
struct Tracking {
    /// Command, limited in its acceleration as in the graph.
    reference: [f64; 3],
    /// Sums of squared errors: planar velocity [(m/s)^2] and turn rate [(rad/s)^2].
    squares: [f64; 2],
    count: usize,
}

impl Tracking {
    fn push(&mut self, command: [f64; 3], base: &BaseState, dt: f64) {
        let limit = ACCELERATION * dt;
        for (reference, command) in self.reference.iter_mut().zip(command) {
            *reference += (command - *reference).clamp(-limit, limit);
        }
        let [forward, left, turn] = self.reference;
        let [x, y, _] = base.linear_velocity;
        self.squares[0] += (x - forward).powi(2) + (y - left).powi(2);
        self.squares[1] += (base.angular_velocity[2] - turn).powi(2);
        self.count += 1;
    }

    /// Returns the root mean square errors: m/s, rad/s.
    fn errors(&self) -> [f64; 2] {
        self.squares.map(|sum| (sum / self.count.max(1) as f64).sqrt())
    }
}

/// Returns the position targets, in the order of the policy, at which the drives exert the torques of a
/// command.
fn label(
    policy: &Policy,
    targets: &JointTargets,
    (state, command): (&JointState, &JointCommand),
) -> anyhow::Result<Vec<f64>> {
    let action = &policy.action;
    let (Some(kp), Some(kd)) = (&action.kp, &action.kd) else { anyhow::bail!("the policy has no gains") };
    let gain = |numbers: &Numbers, k| numbers.get(k);
    let label = targets.targets().iter().enumerate().map(|(k, target)| {
        let j = target.joint;
        let (q, v) = (state.position()[j], state.velocity()[j]);
        let torque = command.effort()[j]
            + command.kp()[j] * (command.position()[j] - q)
            + command.kd()[j] * (command.velocity()[j] - v);
        let position = q + LEAD / policy.rate * v + (torque + gain(kd, k) * v) / gain(kp, k);
        targets.clipped((position - target.offset) / target.scale)
    });
    Ok(label.collect())
}

/// Runs an episode with the student and labels its observations.
fn roll_out(
    plan: Plan,
    core: usize,
    mut student: Student,
    (scenario, counter): (&Scenario, Counter),
    seconds: f64,
) -> anyhow::Result<Rollout> {
    let options = Options::inline().on_core(core).standing_in_for("policy").standing_in_for("commands");
    let mut session = Session::launch(plan, &registry(), &options)?;
    let policy = student.policy.clone();
    let targets = policy.joint_targets(&student.joints)?;
    let mut observer = Observer::new(&policy, &student.joints)?;
    let width = policy.inputs()?;
    let period = policy.rate.recip();
    let mut found = Rollout::default();
    let mut observation = vec![0.0_f32; width];
    let (mut acted, zeros) = (0_u64, vec![0.0; policy.action.joints.len()]);
    for k in 1.. {
        let time = k as f64 * period;
        if time > seconds {
            break;
        }
        let command = scenario.command(time);
        let [x, y, turn] = command;
        session.publish(COMMAND, &TwistTarget { linear: [x, y, 0.0], angular: [0.0, 0.0, turn] })?;
        session.step_until(Duration::from_secs_f64(time))?;
        let base = session.read::<BaseState>("quadruped/base_state")?;
        let state = session.read::<JointState>("quadruped/joint_state")?;
        let teacher = session.read::<JointCommand>("quadruped/teacher_command")?;
        let (Some(base), Some(state), Some(teacher)) = (base, state, teacher) else { continue };
        let (base, state) = (base.value, state.value);
        let gravity = projected_gravity(base.orientation).context("no orientation")?;
        observer.observe(&Measurements {
            positions: state.position(),
            velocities: state.velocity(),
            base: BaseMotion {
                linear_velocity: base.linear_velocity,
                angular_velocity: base.angular_velocity,
                gravity,
            },
            command,
            last_action: &zeros,
            heights: &[],
            points: &[],
            images: &[],
            time: acted as f64 * period,
        });
        observer.write(&mut observation);
        let label = label(&policy, &targets, (&state, &teacher.value))?;
        let chance = uniform(Counter { step: acted, ..counter }, Purpose::Mixture);
        let mut action = Action::default();
        (action.episode, action.step) = (session.episode(), acted);
        action.set_count(label.len());
        match student.network.as_mut().filter(|_| chance >= student.beta) {
            None => action.value_mut().copy_from_slice(&label),
            Some(network) => {
                network.observation_mut().copy_from_slice(&observation);
                for (value, output) in action.value_mut().iter_mut().zip(network.run()) {
                    *value = targets.clipped(f64::from(*output));
                }
            }
        }
        session.publish(ACTION, &action)?;
        acted += 1;
        found.observations.extend_from_slice(&observation);
        found.labels.extend(label.iter().map(|number| *number as f32));
        let Some(truth) = session.read::<BaseState>("quadruped/true_base_state")? else { continue };
        let upright = projected_gravity(truth.value.orientation).map_or(-1.0, |gravity| -gravity[2]);
        if upright < UPRIGHT {
            found.has_fallen = true;
            break;
        }
        found.tracking.push(command, &truth.value, period);
    }
    Ok(found)
}

/// Runs episodes on several cores and returns their results in order.
fn roll_outs(
    teacher: &Teacher,
    student: &Student,
    (seed, round, episodes): (u64, u64, u64),
    seconds: f64,
) -> anyhow::Result<Vec<Rollout>> {
    let slots: Vec<Mutex<Option<anyhow::Result<Rollout>>>> =
        (0..episodes).map(|_| Mutex::default()).collect();
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for core in teacher.cores.iter().copied() {
            let (slots, next) = (&slots, &next);
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(slot) = slots.get(index) else { break };
                    let counter = Counter { seed, world: round, episode: index as u64, step: 0 };
                    let run = || {
                        let scenario = Scenario::draw(counter, seconds)?;
                        let plan = teacher.plan(&scenario.settings)?;
                        roll_out(plan, core, student.clone(), (&scenario, counter), seconds)
                    };
                    *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(run());
                }
            });
        }
    });
    let found = slots.into_iter().map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner));
    found.map(|rollout| rollout.context("an episode was not run")?).collect()
}

/// The graph of the teacher.
struct Teacher {
    file: PathBuf,
    text: String,
    /// Folder of the policy.
    folder: PathBuf,
    cores: Vec<usize>,
}

impl Teacher {
    fn plan(&self, settings: &[Override]) -> anyhow::Result<Plan> {
        let mut settings = settings.to_vec();
        for component in ["policy", "drives"] {
            settings.push(format!("{component}.config.policy=\"{}\"", self.folder.display()).parse()?);
        }
        let checked = graph::check(&self.file, self.text.clone(), &settings, &registry(), &Machine::detect())
            .map_err(|error| anyhow::anyhow!(error.render(false)))?;
        Ok(checked.plan)
    }
}

/// Falls and mean tracking errors of episodes: m/s, rad/s.
fn judge(rollouts: &[Rollout]) -> (usize, [f64; 2]) {
    let falls = rollouts.iter().filter(|rollout| rollout.has_fallen).count();
    let errors = rollouts.iter().map(|rollout| rollout.tracking.errors());
    let sum = errors.fold([0.0; 2], |sum, error| [sum[0] + error[0], sum[1] + error[1]]);
    (falls, sum.map(|sum| sum / rollouts.len().max(1) as f64))
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(RECIPE);
    let file = recipe.join("teacher.toml");
    let read = |path: &Path| std::fs::read_to_string(path).with_context(|| path.display().to_string());
    let policy = PolicyFolder::read(&recipe)?.policy;
    let robot = policy.robot.clone().context("the policy names no robot")?;
    let loaded = motorium_robots::load(&robot, Path::new("."))?;
    let digest = robot_digest(&loaded, &policy.action.joints).context("the robot lacks a joint")?;
    // digests of the robot's current files
    let replaced = policy
        .robot_digest
        .map_or_else(Vec::new, |old| vec![(old.joints, digest.joints), (old.dynamics, digest.dynamics)]);
    let description = replaced.iter().fold(read(&recipe.join("policy.toml"))?, |text, (old, new)| {
        text.replace(&format!("{old:016x}"), &format!("{new:016x}"))
    });
    std::fs::create_dir_all(&arguments.output)?;
    let folder = std::path::absolute(&arguments.output)?;
    std::fs::write(folder.join("policy.toml"), description)?;

    let cores = allowed_cores(&Machine::detect());
    let sessions = arguments.sessions.unwrap_or(cores.len()).clamp(1, cores.len());
    let teacher =
        Teacher { text: read(&file)?, file, folder: folder.clone(), cores: cores[..sessions].to_vec() };
    let settings = ImitationSettings {
        epochs: arguments.epochs,
        minibatch: 256,
        rate: 1e-3,
        anneal: true,
        hidden: vec![128, 128],
        ..ImitationSettings::default()
    };
    let active = vec![true; policy.action.joints.len()];
    let mut regression = Regression::new(policy.inputs()?, active, settings, arguments.seed)?;
    let write = |regression: &Regression| -> anyhow::Result<PolicyNetwork> {
        let bytes = regression.policy().to_onnx(&[("teacher", "control.mpc"), ("algorithm", "dagger")]);
        std::fs::write(folder.join(&policy.network), &bytes)?;
        Ok(PolicyNetwork::new(&policy, Model::read(&bytes)?.program(1)?)?)
    };
    // the check of the graph requires a network
    write(&regression)?;
    let joints = loaded.model.joint_names().to_vec();
    let mut student = Student { policy: policy.clone(), joints, network: None, beta: 1.0 };
    let (seed, seconds) = (arguments.seed, arguments.seconds);
    let judged = (seed, u64::MAX, JUDGED);
    let (falls, [velocity, turn]) = judge(&roll_outs(&teacher, &student, judged, seconds)?);
    println!("teacher: {falls} falls in {JUDGED} episodes, errors {velocity:.4} m/s, {turn:.4} rad/s");
    let began = Instant::now();
    for round in 0..=arguments.rounds {
        student.beta = DECAY.powi(i32::try_from(round)?);
        let rollouts = roll_outs(&teacher, &student, (seed, round, arguments.episodes), seconds)?;
        for rollout in &rollouts {
            regression.push(&rollout.observations, &rollout.labels);
        }
        let fallen = judge(&rollouts).0;
        let loss = regression.fit()?;
        student.network = Some(write(&regression)?);
        student.beta = 0.0;
        let (falls, [velocity, turn]) = judge(&roll_outs(&teacher, &student, judged, seconds)?);
        println!(
            "round {round}: {} labels, {fallen} falls; loss {loss:.5}; judged: {falls} falls, errors {velocity:.4} \
             m/s, {turn:.4} rad/s; {:.0} s",
            regression.labels(),
            began.elapsed().as_secs_f64()
        );
    }
    println!("{}: SHA-256 {}", folder.join(&policy.network).display(), regression.weights_sha256());
    Ok(())
}
