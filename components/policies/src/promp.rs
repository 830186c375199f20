//! `policy.promp`: joints that follow a probabilistic, kernelised or polynomial primitive, or a recording.

use std::path::Path;

use motorium::component::{Component, ConfigureError, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::transport::Parameter;
use motorium::units::TimeSpan;
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::joint_command::{CommandedJoints, JointCommandConfig, JointCommandWriter, earth};
use crate::text_or_table::text_or_table;
use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::mean::{MeanMovement, MeanRunner};
use motorium_primitives::promp::{ProMp, StoredProMp};
use motorium_primitives::reach::Repeat;
use motorium_recordings::{Interpolation, Recording, Selection};
use motorium_robots::PerJoint;

/// Configuration of `policy.promp`.
///
/// ```toml
/// joints = ["panda_joint1"]
/// via    = [{ at = 0.5, position = [0.2], deviation = 0.01 }]
///
/// # a table, or a file such as "wave.json"
/// [[primitives]]
/// basis      = { kind = "gaussian", count = 3, overlap = 0.5 }
/// dimensions = 1
/// duration   = 2.0
/// noise      = 1e-6
/// mean       = [0.0, 0.3, 0.0]
/// covariance = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProMpPolicyConfig {
    /// Primitives from which the parameter `primitive` selects one: paths of files written by `motorium
    /// primitive fit`, paths of recordings (`.csv`, `.jsonl`, `.mcap`), or tables. Paths are relative to the
    /// graph file. Recordings are followed exactly.
    pub primitives: Vec<ProMpSource>,
    /// Names of the moved joints, in the order of the primitive's dimensions. Default: the joints named by
    /// the columns of a recording, otherwise all joints in order.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Via points that the movement passes.
    #[serde(default)]
    pub via: Vec<ViaConfig>,
    /// Duration of a movement, such as "2 s". Default: the duration of the demonstrations.
    #[serde(default)]
    pub duration: Option<TimeSpan>,
    /// Time to stay at the end of a movement, such as "500 ms". Default 0.
    #[serde(default)]
    pub dwell: TimeSpan,
    /// Behaviour after a movement: "once" stays at its end, "forever" starts the next movement.
    #[serde(default)]
    pub repeat: Repeat,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Gains, easing and feed-forward of joint commands.
    #[serde(default)]
    pub joint_command: JointCommandConfig,
}

/// Source of a primitive.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum ProMpSource {
    /// Path of a file, relative to the graph file.
    File(#[schemars(extend("format" = "path"))] String),
    /// A probabilistic primitive, given in full.
    Table(StoredProMp),
}

impl<'de> Deserialize<'de> for ProMpSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer, "the path of a file, or a table", Self::File, Self::Table)
    }
}

/// A point that the movement passes.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViaConfig {
    /// Phase at which the point is passed: 0 at the start of the movement, 1 at its end.
    pub at: f64,
    /// Positions of the moved joints, rad or m: one number for all joints, or one per joint.
    pub position: PerJoint,
    /// Standard deviation of the positions at the via point, rad or m. Default 0.001.
    #[serde(default = "precise")]
    pub deviation: f64,
}

fn precise() -> f64 {
    1e-3
}

/// A policy that moves joints along the mean of a probabilistic, kernelised or polynomial primitive, or along
/// a recording. Probabilistic and kernelised primitives are conditioned on the via points.
///
/// A movement starts with the first joint state, at the robot's current position; the initial offset from the
/// primitive fades out along the movement. A change of the parameter `primitive` takes effect with the next
/// movement, without a discontinuity; `speed` scales time.
#[derive(Debug)]
pub struct ProMpPolicy {
    writer: JointCommandWriter,
    runners: Vec<MeanRunner<Box<dyn MeanMovement + Send>>>,
    durations: Vec<f64>,
    /// Velocities at the start of a recording, which may begin in motion.
    first_rates: Vec<Option<Vec<f64>>>,
    repeat: Repeat,
    dwell: f64,
    primitive: Parameter<i64>,
    speed: Parameter<f64>,
    running: Option<usize>,
    rested: f64,
    movements: u64,
    exchanges: u64,
    setpoint: Vec<f64>,
    rate: Vec<f64>,
    squares: f64,
    samples: u64,
}

impl Component for ProMpPolicy {
    const KIND: &'static str = "policy.promp";
    const SUMMARY: &'static str = "moves joints by a probabilistic movement primitive";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = ProMpPolicyConfig;

    fn declare(config: &ProMpPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let driven = CommandedJoints::new(
            &config.joint_command,
            config.gravity,
            declare.robot(),
            named(config, declare.robot())?.iter().map(borrowed),
        )?;
        let base = declare.robot().map(|robot| robot.base.clone()).unwrap_or_default();
        primitives(config, &base, &driven.names())?;
        CommandedJoints::declare(declare);
        let last = config.primitives.len() as i64 - 1;
        declare.integer("primitive", 0, 0..=last, "the primitive of the next movement, counted from 0");
        declare.float("speed", 1.0, 0.0..=2.0, "", "speed factor; 0 holds the present position");
        Ok(())
    }

    fn configure(config: ProMpPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let driven = CommandedJoints::new(
            &config.joint_command,
            config.gravity,
            Some(&robot),
            named(&config, Some(&robot))?.iter().map(borrowed),
        )?;
        let primitives = primitives(&config, &robot.base, &driven.names())?;
        let joints = driven.names().len();
        let time = config.duration.map(|duration| duration.as_secs_f64());
        let durations: Vec<f64> =
            primitives.iter().map(|movement| time.unwrap_or(movement.movement.duration())).collect();
        let first_rates = primitives.iter().zip(&durations);
        Ok(Self {
            writer: JointCommandWriter::new(driven, &config.joint_command, setup)?,
            first_rates: first_rates.map(|(movement, duration)| movement.first_rates(*duration)).collect(),
            durations,
            runners: primitives.into_iter().map(|movement| MeanRunner::new(movement.movement)).collect(),
            repeat: config.repeat,
            dwell: config.dwell.as_secs_f64(),
            primitive: setup.parameter("primitive")?,
            speed: setup.parameter("speed")?,
            running: None,
            rested: 0.0,
            movements: 0,
            exchanges: 0,
            setpoint: vec![0.0; joints],
            rate: vec![0.0; joints],
            squares: 0.0,
            samples: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.writer.read()? {
            return Ok(());
        }
        let (dt, speed) = (tick.dt(), self.speed.get());
        match self.running {
            None => {
                for (place, setpoint) in self.setpoint.iter_mut().enumerate() {
                    *setpoint = self.writer.position(place);
                }
                self.begin()?;
            }
            Some(current) => {
                let runner = &mut self.runners[current];
                runner.step(speed * dt);
                if runner.is_over() {
                    self.rested += speed * dt;
                    if self.repeat == Repeat::Forever && self.rested >= self.dwell {
                        self.begin()?;
                    }
                }
            }
        }
        let Some(current) = self.running else { return Ok(()) };
        let runner = &self.runners[current];
        self.setpoint.copy_from_slice(runner.position());
        for (rate, velocity) in self.rate.iter_mut().zip(runner.velocity()) {
            *rate = speed * velocity;
        }
        for place in 0..self.setpoint.len() {
            self.squares += (self.setpoint[place] - self.writer.position(place)).powi(2);
            self.samples += 1;
        }
        self.writer.command(dt, &self.setpoint, &self.rate)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.writer.reset();
        (self.running, self.rested, self.movements, self.exchanges) = (None, 0.0, 0, 0);
        (self.squares, self.samples) = (0.0, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let error = (self.squares / self.samples.max(1) as f64).sqrt();
        Some(serde_json::json!({
            "movements": self.movements,
            "primitive": self.running,
            "exchanges": self.exchanges,
            "tracking_error": error,
        }))
    }
}

impl ProMpPolicy {
    /// Starts a movement from the current setpoint with the selected primitive.
    fn begin(&mut self) -> Result<(), StepError> {
        let chosen = usize::try_from(self.primitive.get()).unwrap_or(0).min(self.runners.len() - 1);
        self.exchanges += u64::from(self.running.is_some_and(|running| running != chosen));
        match &self.first_rates[chosen] {
            Some(rates) if self.movements == 0 => self.rate.copy_from_slice(rates),
            _ => self.rate.fill(0.0),
        }
        self.runners[chosen]
            .start(&self.setpoint, &self.rate, self.durations[chosen])
            .map_err(|_| StepError::failed("the robot has no finite position to start from"))?;
        self.running = Some(chosen);
        self.rested = 0.0;
        self.movements += 1;
        Ok(())
    }
}

fn borrowed((name, key): &(String, String)) -> (&str, String) {
    (name.as_str(), key.clone())
}

/// Returns the moved joints with their keys.
fn named(
    config: &ProMpPolicyConfig,
    robot: Option<&motorium::declare::RobotReference>,
) -> Result<Vec<(String, String)>, ConfigError> {
    if let Some(joints) = &config.joints {
        let keyed = |(i, name): (usize, &String)| (name.clone(), format!("joints[{i}]"));
        return Ok(joints.iter().enumerate().map(keyed).collect());
    }
    let Some(robot) = robot else { return Ok(Vec::new()) };
    let loaded = crate::robot::load(robot)?;
    if let Some((file, key)) = config.recordings().next() {
        let recording = recorded(&robot.base.join(file), &key, &[])?;
        let is_joint = |name: &&String| loaded.model.joint_index(name).is_some();
        let unknown: Vec<&str> =
            recording.names().iter().filter(|name| !is_joint(name)).map(String::as_str).collect();
        if unknown.is_empty() {
            return Ok(recording.names().iter().map(|name| (name.clone(), key.clone())).collect());
        }
        if unknown.len() < recording.names().len() {
            let message = format!("robot `{}` has no joints {}", robot.name, unknown.join(", "));
            let known = loaded.model.joint_names().join(", ");
            return Err(ConfigError::key(key, message).advise(format!(
                "name the columns to follow in `joints`; the joints of the robot are {known}"
            )));
        }
    }
    Ok(loaded.model.joint_names().iter().map(|name| (name.clone(), "joints".to_string())).collect())
}

/// A recording as a movement, followed sample by sample.
#[derive(Debug)]
struct Recorded(Interpolation);

impl MeanMovement for Recorded {
    fn dimensions(&self) -> usize {
        self.0.channels()
    }

    fn duration(&self) -> f64 {
        self.0.duration()
    }

    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]) {
        let duration = self.0.duration();
        self.0.evaluate(phase * duration, position, slope);
        slope.iter_mut().for_each(|slope| *slope *= duration);
    }
}

/// A movement to follow.
struct Followed {
    movement: Box<dyn MeanMovement + Send>,
    /// Derivative by the phase at the start of a recording.
    first_slope: Option<Vec<f64>>,
}

impl Followed {
    fn recording(recording: &Recording) -> Self {
        let mut movement = Recorded(recording.interpolation());
        let (mut position, mut slope) = (vec![0.0; movement.dimensions()], vec![0.0; movement.dimensions()]);
        movement.mean_into(0.0, &mut position, &mut slope);
        Self { movement: Box::new(movement), first_slope: Some(slope) }
    }

    /// Velocities at the start of a recording that lasts `duration` \[s\].
    fn first_rates(&self, duration: f64) -> Option<Vec<f64>> {
        Some(self.first_slope.as_ref()?.iter().map(|slope| slope / duration).collect())
    }
}

impl ProMpPolicyConfig {
    /// The sources that are recordings, with their keys.
    fn recordings(&self) -> impl Iterator<Item = (&str, String)> {
        self.primitives.iter().enumerate().filter_map(|(index, source)| match source {
            ProMpSource::File(file) if is_followed(file) => {
                Some((file.as_str(), format!("primitives[{index}]")))
            }
            _ => None,
        })
    }
}

/// Returns `true` for a file of samples; JSON files contain primitives.
fn is_followed(file: &str) -> bool {
    let path = Path::new(file);
    motorium_recordings::is_recording(path) && path.extension().is_some_and(|extension| extension != "json")
}

/// Reads a recording: the columns with these names, or all columns if none of them exists.
fn recorded(path: &Path, key: &str, joints: &[String]) -> Result<Recording, ConfigError> {
    let read = |channels: &[String]| {
        let selection = Selection { channels: channels.to_vec(), ..Selection::default() };
        motorium_recordings::read(path, &selection)
    };
    let all = read(&[]);
    let named = match &all {
        Ok(recording) if joints.iter().all(|joint| !recording.names().contains(joint)) => all,
        _ => read(joints),
    };
    named.map(|recording| recording.continuous().0).map_err(|error| ConfigError::key(key, error.to_string()))
}

/// Reads, checks and conditions the primitives.
fn primitives(
    config: &ProMpPolicyConfig,
    base: &Path,
    names: &[String],
) -> Result<Vec<Followed>, ConfigError> {
    let joints = names.len();
    if config.primitives.is_empty() {
        return Err(ConfigError::key("primitives", "no primitive given, expected at least one"));
    }
    if config.duration.is_some_and(|duration| duration.ns < 1_000_000) {
        return Err(ConfigError::key("duration", "expected at least 1 ms"));
    }
    let mut found = Vec::new();
    for (index, source) in config.primitives.iter().enumerate() {
        let key = format!("primitives[{index}]");
        if let ProMpSource::File(file) = source
            && is_followed(file)
        {
            found.push(followed(config, &base.join(file), &key, names)?);
            continue;
        }
        let mut primitive = match source {
            ProMpSource::Table(stored) => Primitive::Probabilistic(
                ProMp::try_from(stored.clone()).map_err(|error| ConfigError::key(&key, error.to_string()))?,
            ),
            ProMpSource::File(file) => {
                let read = PrimitiveFile::read(&base.join(file));
                read.map_err(|error| ConfigError::key(&key, error.to_string()))?.primitive
            }
        };
        if primitive.dimensions() != joints {
            let message = format!(
                "the primitive has {} dimensions, but {joints} joints are moved",
                primitive.dimensions()
            );
            return Err(ConfigError::key(&key, message).advise("name the joints to move in `joints`"));
        }
        for (v, via) in config.via.iter().enumerate() {
            primitive =
                conditioned(primitive, via).map_err(|error| ConfigError::key(format!("via[{v}]"), error))?;
        }
        let kind = primitive.kind();
        let movement = primitive.mean().ok_or_else(|| {
            ConfigError::key(&key, format!("it is a {kind} primitive")).advise(
                "fit one with `motorium primitive fit --model probabilistic`, kernelised or polynomial",
            )
        })?;
        found.push(Followed { movement, first_slope: None });
    }
    Ok(found)
}

/// Reads and checks a recording.
fn followed(
    config: &ProMpPolicyConfig,
    path: &Path,
    key: &str,
    names: &[String],
) -> Result<Followed, ConfigError> {
    if !config.via.is_empty() {
        let message = "a recording cannot pass through via points";
        return Err(
            ConfigError::key("via", message).advise("fit a primitive to it (`motorium primitive fit`)")
        );
    }
    let recording = recorded(path, key, names)?;
    let found = recording.names().len();
    if found != names.len() {
        let message = format!("the recording has {found} columns, but {} joints are moved", names.len());
        return Err(ConfigError::key(key, message).advise("name the joints to move in `joints`"));
    }
    Ok(Followed::recording(&recording))
}

/// Returns the primitive conditioned on a via point, or the reason why this fails.
fn conditioned(primitive: Primitive, via: &ViaConfig) -> Result<Primitive, String> {
    if !((0.0..=1.0).contains(&via.at) && via.deviation >= 0.0 && via.deviation.is_finite()) {
        return Err("expected `at` from 0 to 1 and a `deviation` of at least 0".to_string());
    }
    let place = via.position.resolve(primitive.dimensions());
    let place = place.map_err(|error| format!("`position` has {error}"))?;
    let place = DVector::from_vec(place);
    match primitive {
        Primitive::Probabilistic(promp) => {
            let noise = DMatrix::identity(promp.dimensions(), promp.dimensions()) * via.deviation.powi(2);
            let bent = promp.conditioned(via.at, &place, &noise);
            bent.map(Primitive::Probabilistic).map_err(|error| error.to_string())
        }
        Primitive::Kernelised(movement) => {
            let bent = movement.conditioned(via.at, &place, via.deviation);
            bent.map(Primitive::Kernelised).map_err(|error| error.to_string())
        }
        other => Err(format!("a {} primitive cannot be conditioned on via points", other.kind())),
    }
}
