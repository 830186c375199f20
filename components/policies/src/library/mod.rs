//! `policy.library`: moves an end effector, or joints, by a motion library, and recognises movements.

mod config;
mod episode;
mod messages;
mod outcome;
mod picture;
mod plane;
mod publish;
mod signal;
mod source;
mod watch;

pub use config::{EndEffectorConfig, LibraryPolicyConfig, RecognitionConfig};
pub use messages::{MAX_LABEL, MAX_WEIGHTS, MovementRequest, Recognition};

use motorium::component::{Component, ConfigureError, Episode, RunClock, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{JointState, PoseTarget};
use motorium::transport::{Input, Output, Parameter};
use motorium::units::TimeSpan;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use episode::{Current, Planned, Stage, plan};
use motorium_library::{Generator, MotionLibrary, Trace};
use motorium_primitives::reach::Repeat;
use plane::Plane;
use signal::EndEffector;
use watch::Watch;

use crate::robot::{required, too_few_joints};

/// A policy that executes the movements of a motion library one after the other, and recognises the movements
/// that it observes.
///
/// The policy starts with the first joint state. For each movement, it moves to the start along a
/// minimum-jerk path, rests, executes the movement, and rests. A [`MovementRequest`], or a new number of
/// eigenforces, takes effect at the next start, never within a movement. Every motion of the robot, whether
/// commanded by this policy or not, is recognised as soon as it comes to rest.
#[derive(Debug)]
pub struct LibraryPolicy {
    joint_state: Input<JointState>,
    request: Input<MovementRequest>,
    target: Option<Output<PoseTarget>>,
    setpoint: Option<Output<JointState>>,
    recognised: Output<Recognition>,
    speed: Parameter<f64>,
    eigenforces: Parameter<i64>,
    end_effector: Option<(EndEffector, Plane)>,
    joints: Vec<usize>,
    library: MotionLibrary,
    generator: Generator,
    planned: Vec<Planned>,
    traces: Vec<Trace>,
    watch: Watch,
    current: Current,
    index: usize,
    stage: Stage,
    repeat: Repeat,
    transit: f64,
    rest: f64,
    /// Number of requests received, and of movements started.
    requested: u64,
    begun: u64,
    on_request: bool,
    orientation: UnitQuaternion<f64>,
    /// Position of the last target.
    published: Vector3<f64>,
    /// Start of the transit, in space or in joints.
    from: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    measured: Vec<f64>,
    labels: Vec<[u8; MAX_LABEL]>,
    clock: RunClock,
    /// Time of the newest joint state, ns since the run began.
    state_ns: u64,
    /// Time of the previous step, ns since the run began.
    last_ns: Option<u64>,
    seen: Vec<(u64, [u8; MAX_LABEL], f64)>,
    picture: Option<String>,
}

/// Largest number of recognised movements in the result.
const LISTED: usize = 64;

impl Component for LibraryPolicy {
    const KIND: &'static str = "policy.library";
    const SUMMARY: &'static str =
        "moves an end effector or joints by a motion library, and recognises movements";
    const RESETS: bool = true;
    type Config = LibraryPolicyConfig;

    fn declare(config: &LibraryPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let robot = required(declare.robot(), "joints")?.clone();
        let library = source::load(config, Some(&robot.base))?;
        source::entries(config, &library)?;
        source::check(config, &library)?;
        if let Some(end_effector) = &config.end_effector {
            Plane::new(end_effector, &library)?;
            EndEffector::new(&robot, end_effector.frame.as_deref())?;
            declare.output::<PoseTarget>(
                "target",
                "target pose and velocity of the end effector, in the world frame",
            );
        } else {
            signal::joints(&robot, library.layout().names())?;
            declare.output::<JointState>(
                "setpoint",
                "positions and velocities of the library's degrees of freedom, in its order",
            );
        }
        declare.input::<JointState>(
            "joint_state",
            "joint state: start of the movement, and the motion to recognise",
        );
        declare.optional_input::<MovementRequest>(
            "request",
            "request of another movement, by label or by weights",
        );
        declare.output::<Recognition>(
            "recognised",
            "movement of the library nearest to the movement that just ended",
        );
        declare.float("speed", 1.0, 0.0..=2.0, "", "speed factor; 0 holds still");
        let rank = library.rank() as i64;
        declare.integer(
            "eigenforces",
            0,
            0..=rank,
            "number of eigenforces of the next movement; 0 uses the configured number",
        );
        Ok(())
    }

    fn configure(config: LibraryPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let library = source::load(&config, Some(&robot.base))?;
        let duration = config.duration.map(TimeSpan::as_secs_f64);
        let planned = plan(&library, &source::entries(&config, &library)?, &config.eigenforces, duration);
        let dofs = library.layout().dofs();
        let period = setup.period().as_secs_f64();
        let (mut end_effector, mut joints) = (None, Vec::new());
        if let Some(end_effector_config) = &config.end_effector {
            let plane = Plane::new(end_effector_config, &library)?;
            end_effector = Some((EndEffector::new(&robot, end_effector_config.frame.as_deref())?, plane));
        } else {
            joints = signal::joints(&robot, library.layout().names())?;
        }
        let steps = |p: &Planned| (p.movement.frame.duration / period).ceil() as usize * 2;
        let name =
            |entry: &motorium_library::Entry| messages::bytes(entry.label.as_ref().unwrap_or(&entry.id));
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            request: setup.input("request")?,
            target: if end_effector.is_some() { Some(setup.output("target")?) } else { None },
            setpoint: if end_effector.is_some() { None } else { Some(setup.output("setpoint")?) },
            recognised: setup.output("recognised")?,
            speed: setup.parameter("speed")?,
            eigenforces: setup.parameter("eigenforces")?,
            generator: Generator::new(&library),
            traces: planned.iter().map(|planned| Trace::new(dofs, steps(planned))).collect(),
            watch: Watch::new(&library, &config.recognition, period),
            current: Current::new(&library, &planned[0]),
            index: 0,
            stage: Stage::Waiting,
            repeat: config.repeat,
            transit: config.transit.as_secs_f64(),
            rest: config.rest.as_secs_f64(),
            requested: 0,
            begun: 0,
            on_request: false,
            orientation: UnitQuaternion::identity(),
            published: Vector3::zeros(),
            from: vec![0.0; dofs.max(3)],
            position: vec![0.0; dofs],
            velocity: vec![0.0; dofs],
            measured: vec![0.0; dofs],
            labels: library.entries().iter().map(name).collect(),
            clock: setup.clock(),
            state_ns: 0,
            last_ns: None,
            seen: Vec::with_capacity(LISTED),
            picture: config.picture,
            end_effector,
            joints,
            planned,
            library,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(pose) = self.read_state()? else { return Ok(()) };
        let now_ns = self.clock.grid_ns(tick, self.state_ns);
        let last_ns = self.last_ns.replace(now_ns);
        let periods = if last_ns.is_some() { tick.periods_since(last_ns, now_ns) } else { 0 };
        let dt = self.speed.get() * tick.dt() * f64::from(periods);
        self.advance(dt, &pose)?;
        self.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.generator = Generator::new(&self.library);
        self.current = Current::new(&self.library, &self.planned[0]);
        self.traces.iter_mut().for_each(Trace::clear);
        self.watch.reset();
        self.seen.clear();
        (self.index, self.stage, self.on_request, self.last_ns) = (0, Stage::Waiting, false, None);
        (self.requested, self.begun) = (0, 0);
        (self.orientation, self.published) = (UnitQuaternion::identity(), Vector3::zeros());
        for numbers in [&mut self.from, &mut self.position, &mut self.velocity, &mut self.measured] {
            numbers.fill(0.0);
        }
        Ok(())
    }

    fn stop(&mut self) {
        if let Some(file) = &self.picture {
            // the run is over; a failure to write the picture does not fail the run, but appears in the
            // result
            let folder = std::path::Path::new(file).parent().unwrap_or(std::path::Path::new(""));
            let written = std::fs::create_dir_all(folder)
                .and_then(|()| std::fs::write(file, picture::svg(&self.panels())));
            self.picture = match written {
                Ok(()) => Some(file.clone()),
                Err(error) => Some(format!("{file}: {error}")),
            };
        }
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.outcome())
    }
}

impl LibraryPolicy {
    /// Reads the joint state. Returns the pose of the end effector (identity without one), and records the
    /// observed motion.
    fn read_state(&mut self) -> Result<Option<Isometry3<f64>>, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(None) };
        self.state_ns = state.time_ns();
        let mut pose = Isometry3::identity();
        if let Some((end_effector, plane)) = &mut self.end_effector {
            pose = end_effector.pose(state.position())?;
            let place = self.index;
            self.measured.copy_from_slice(&plane.position(&pose.translation.vector, place));
        } else {
            for (measured, joint) in self.measured.iter_mut().zip(&self.joints) {
                let position = state.position().get(*joint);
                *measured = *position.ok_or_else(|| too_few_joints(*joint + 1, state.count()))?;
            }
        }
        let measured = &self.measured;
        if self.watch.observe(|d| measured[d]) {
            let seen = self.watch.recognition();
            let label = self.labels.get(seen.movement as usize).copied().unwrap_or_default();
            if self.seen.len() < LISTED {
                self.seen.push((seen.movement, label, seen.novelty));
            }
            let mut out = self.recognised.loan()?;
            *out = Recognition { label, ..*seen };
            out.publish()?;
        }
        Ok(Some(pose))
    }

    /// Advances by `dt` seconds.
    fn advance(&mut self, dt: f64, pose: &Isometry3<f64>) -> Result<(), StepError> {
        match self.stage {
            Stage::Waiting => {
                self.orientation = pose.rotation;
                self.choose();
                self.set_out(pose);
            }
            Stage::Transit(time) if time + dt < self.transit => self.stage = Stage::Transit(time + dt),
            Stage::Transit(_) => self.stage = Stage::Rest { after: false, time: 0.0 },
            Stage::Rest { after, time } if time + dt < self.rest => {
                self.stage = Stage::Rest { after, time: time + dt };
            }
            Stage::Rest { after: false, .. } => {
                self.current.start(&mut self.generator).map_err(|_| NO_MOVEMENT)?;
                if !self.on_request {
                    self.traces[self.index].clear();
                }
                self.begun += 1;
                self.stage = Stage::Moving;
            }
            Stage::Rest { after: true, .. } => self.next(pose),
            Stage::Moving => {
                self.generator.step(dt);
                if self.generator.progress() <= 1.0 && !self.on_request {
                    self.traces[self.index].add(self.generator.position(), Some(&self.measured));
                }
                if self.generator.is_finished() {
                    self.stage = Stage::Rest { after: true, time: 0.0 };
                }
            }
            Stage::Finished => {
                if self.take_request() {
                    self.set_out(pose);
                }
            }
        }
        Ok(())
    }

    /// Starts the next action after a movement: a request, the next movement, or the end.
    fn next(&mut self, pose: &Isometry3<f64>) {
        if self.take_request() {
            return self.set_out(pose);
        }
        let last = self.index + 1 == self.planned.len();
        if last && self.repeat == Repeat::Once {
            self.stage = Stage::Finished;
            return;
        }
        self.index = (self.index + 1) % self.planned.len();
        self.choose();
        self.set_out(pose);
    }

    /// Makes the planned movement the current one.
    fn choose(&mut self) {
        if self.take_request() {
            return;
        }
        self.on_request = false;
        let planned = &self.planned[self.index];
        let (entry, asked) = (planned.entry, usize::try_from(self.eigenforces.get()).unwrap_or(0));
        self.current.set_frame(&planned.movement.frame);
        if asked > 0 {
            self.current.set(&self.library.weights().column(entry).as_slice()[..asked]);
        } else {
            self.current.set(&planned.movement.weights);
        }
        if let Some((_, plane)) = &mut self.end_effector {
            plane.fit(entry);
        }
    }

    /// Accepts a new request if it can be fulfilled.
    fn take_request(&mut self) -> bool {
        let Some(request) = self.request.latest() else { return false };
        if request.sequence == self.requested || request.sequence == 0 {
            return false;
        }
        self.requested = request.sequence;
        let rank = self.library.rank();
        let count = usize::try_from(request.count).unwrap_or(0).min(MAX_WEIGHTS).min(rank);
        let label = messages::text(&request.label);
        if label.is_empty() {
            if count == 0 {
                return false;
            }
            self.current.set(&request.weights[..count]);
        } else {
            let Some(entry) = self.library.find(label) else { return false };
            let count = if count == 0 { rank } else { count };
            self.current.set(&self.library.weights().column(entry).as_slice()[..count]);
            self.current.set_frame(&self.library.entries()[entry].frame);
            if let Some((_, plane)) = &mut self.end_effector {
                plane.fit(entry);
            }
        }
        self.on_request = true;
        true
    }

    /// Starts the transit to the start of the current movement, from the policy's last position or,
    /// initially, from the robot's.
    fn set_out(&mut self, pose: &Isometry3<f64>) {
        let first = self.stage == Stage::Waiting;
        if self.end_effector.is_some() {
            let here = if first { pose.translation.vector } else { self.published };
            self.from[..3].copy_from_slice(here.as_slice());
        } else {
            let here = if first { self.measured.as_slice() } else { self.generator.position() };
            self.from[..here.len()].copy_from_slice(here);
        }
        self.stage = Stage::Transit(0.0);
    }
}
const NO_MOVEMENT: StepError = StepError::Failed(std::borrow::Cow::Borrowed(
    "the movement has a value that is not finite, or no duration",
));
