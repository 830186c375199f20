//! Wrenches between the links of a robot, computed from the true state that a simulation publishes.

use motorium::prelude::*;
use motorium::state::{ContactImpulses, Contacts, Randomisation};
use motorium_robots::{FrameId, Kinematics, Model};
use nalgebra::{Isometry3, Point3, Vector3};

use super::doubts::check_gravity;
use super::robot::{Mount, Needs, TrueMotion, name};
use crate::encoder::StateTimes;
use crate::loads::{Loads, OutsideForce, OutsideWrench, WorldWrench};

/// Parameters sampled by a simulation for the current episode, if their topic is wired.
pub(super) struct Drawn {
    input: Input<Randomisation>,
    seen: (u32, u32, u64),
}

impl Drawn {
    /// Declares the input.
    pub(super) fn declare(declare: &mut Declare) {
        declare.optional_input::<Randomisation>(
            "randomisation",
            "physical properties sampled by the simulation for the episode",
        );
    }

    /// Opens the input.
    pub(super) fn open(setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { input: setup.input("randomisation")?, seen: (0, 0, 0) })
    }

    /// Returns the parameters sampled for the episode of this step, if they are new.
    pub(super) fn newest(&mut self, tick: &Tick) -> Option<Reading<'_, Randomisation>> {
        let drawn = self.input.latest()?;
        let seen = name(&drawn.stamp());
        if drawn.episode != tick.episode || std::mem::replace(&mut self.seen, seen) == seen {
            return None;
        }
        Some(drawn)
    }

    /// Resets to the initial state.
    pub(super) fn reset(&mut self) {
        self.seen = (0, 0, 0);
    }
}

/// Mean contact wrenches between two samples, from impulses accumulated by a simulation.
struct MeanContacts {
    input: Input<ContactImpulses>,
    /// Sums at the last sample, one per link.
    before: Vec<WorldWrench>,
    /// Publisher and restart count of these sums.
    source: Option<(u32, u32)>,
    means: Vec<OutsideWrench>,
}

impl MeanContacts {
    fn declare(declare: &mut Declare) {
        declare.optional_input::<ContactImpulses>(
            "contact_impulses",
            "impulses of contacts since the start of the episode, instead of `contacts`",
        );
    }

    fn open(links: usize, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            input: setup.input("contact_impulses")?,
            before: vec![WorldWrench::default(); links],
            source: None,
            means: Vec::with_capacity(links),
        })
    }

    /// Returns the mean wrenches over the interval of `dt` \[s\] that ends now. `None` if no simulation
    /// provides them, for an empty interval, and across a restart of the simulation.
    fn newest(&mut self, dt: Option<f64>) -> Option<impl Iterator<Item = OutsideWrench>> {
        let sums = self.input.latest()?;
        let (origin, incarnation, _) = name(&sums.stamp());
        let is_same = self.source.replace((origin, incarnation)) == Some((origin, incarnation));
        if !is_same {
            self.before.fill(WorldWrench::default());
        }
        self.means.clear();
        for index in 0..sums.count() {
            let link = sums.link()[index] as usize;
            let Some(before) = self.before.get_mut(link) else { continue };
            let force =
                Vector3::new(sums.impulse_x()[index], sums.impulse_y()[index], sums.impulse_z()[index]);
            let torque = Vector3::new(sums.moment_x()[index], sums.moment_y()[index], sums.moment_z()[index]);
            if let Some(dt) = dt.filter(|_| is_same) {
                let wrench =
                    WorldWrench { force: (force - before.force) / dt, torque: (torque - before.torque) / dt };
                self.means.push(OutsideWrench { link, wrench });
            }
            *before = WorldWrench { force, torque };
        }
        Some(self.means.iter().copied())
    }

    fn forget(&mut self) {
        self.before.fill(WorldWrench::default());
        self.source = None;
    }
}

/// A frame whose pose in the middle of each interval is needed.
#[derive(Clone, Copy)]
pub(super) enum Axes {
    /// Fixed to a link, with its pose there.
    Link(FrameId, Isometry3<f64>),
    /// A body that is moved by a joint.
    Body(usize),
}

impl Axes {
    fn pose(self, model: &Model, kinematics: &Kinematics) -> Isometry3<f64> {
        match self {
            Self::Link(link, pose) => kinematics.pose(model, link) * pose,
            Self::Body(body) => kinematics.body_pose(body),
        }
    }
}

/// The wrenches between the links of a robot.
pub(super) struct TrueLoads {
    motion: TrueMotion,
    contacts: Input<Contacts>,
    impulses: MeanContacts,
    drawn: Drawn,
    loads: Loads,
    gravity: Vector3<f64>,
    /// Frames, and their poses at the last sample and at the newest.
    axes: Vec<(Axes, [Isometry3<f64>; 2])>,
    /// Number of samples with incomplete contacts.
    cut: u64,
}

impl TrueLoads {
    /// Declares the inputs and returns the model of the robot.
    pub(super) fn declare(gravity: [f64; 3], declare: &mut Declare) -> Result<Model, ConfigError> {
        check_gravity(gravity)?;
        let model = TrueMotion::declare(&Mount::default(), Needs::AllLinks, declare)?;
        declare.optional_input::<Contacts>("contacts", "true contact points on the robot");
        MeanContacts::declare(declare);
        Drawn::declare(declare);
        Ok(model)
    }

    /// Opens the inputs.
    pub(super) fn open(gravity: [f64; 3], setup: &mut Setup) -> Result<Self, ConfigureError> {
        let motion = TrueMotion::open(&Mount::default(), Needs::AllLinks, setup)?;
        let gravity = Vector3::from(gravity);
        Ok(Self {
            contacts: setup.input("contacts")?,
            impulses: MeanContacts::open(motion.model().frames().len(), setup)?,
            drawn: Drawn::open(setup)?,
            loads: Loads::new(motion.model(), gravity),
            gravity,
            motion,
            axes: Vec::new(),
            cut: 0,
        })
    }

    /// Returns the model of the robot.
    pub(super) fn model(&self) -> &Model {
        self.motion.model()
    }

    /// Tracks the poses of these frames.
    pub(super) fn follow(&mut self, axes: impl IntoIterator<Item = Axes>) {
        self.axes = axes.into_iter().map(|axes| (axes, [Isometry3::identity(); 2])).collect();
    }

    /// Returns the pose of the tracked frame with this index in the middle of the interval that the newest
    /// truth closed. A mean wrench in these axes has a second-order error in the length of the interval.
    pub(super) fn middle(&self, index: usize) -> Isometry3<f64> {
        let [before, now] = &self.axes[index].1;
        Isometry3::from_parts(
            before.translation.vector.lerp(&now.translation.vector, 0.5).into(),
            // Rotations half a turn apart have no mean.
            before.rotation.try_slerp(&now.rotation, 0.5, 1e-9).unwrap_or(now.rotation),
        )
    }

    /// Returns joint positions and velocities of the newest sample.
    pub(super) fn joints(&self) -> (&[f64], &[f64]) {
        self.motion.joints()
    }

    /// Returns the wrench through the joint above a link, in the interval that the newest truth closed.
    pub(super) fn through(&self, link: FrameId) -> WorldWrench {
        self.loads.through(link)
    }

    /// Reads the newest truth. Returns its times if it is new and completes an interval.
    pub(super) fn newest(&mut self, tick: &Tick) -> Result<Option<StateTimes>, StepError> {
        let Self { motion, contacts, impulses, drawn, loads, gravity, axes, cut } = self;
        let Some(times) = motion.newest()?.map(|motion| motion.times) else { return Ok(None) };
        if let Some(drawn) = drawn.newest(tick) {
            let model = motion.model();
            let factor = |link: usize| {
                let part = model.frames()[link].body.map_or(Randomisation::BASE, |body| body as u32);
                drawn.find(Randomisation::BODY_MASS, part).unwrap_or(1.0)
            };
            loads.set_properties(*gravity * drawn.find(Randomisation::GRAVITY, 0).unwrap_or(1.0), factor);
        }
        let (model, kinematics) = (motion.model(), motion.kinematics());
        let seconds = |since: u64| times.state.saturating_sub(since) as f64 * 1e-9;
        let dt = loads.last().map(seconds).filter(|dt| *dt > 0.0);
        let closed = match (impulses.newest(dt), contacts.latest()) {
            (Some(outside), _) => loads.sample_wrenches(times.state, model, kinematics, outside),
            (None, Some(points)) => {
                *cut += u64::from(points.cut > 0);
                let outside = (0..points.count()).map(|index| OutsideForce {
                    link: points.link()[index] as usize,
                    point: Point3::new(
                        points.position_x()[index],
                        points.position_y()[index],
                        points.position_z()[index],
                    ),
                    force: Vector3::new(
                        points.force_x()[index],
                        points.force_y()[index],
                        points.force_z()[index],
                    ),
                });
                loads.sample(times.state, model, kinematics, outside)
            }
            (None, None) => loads.sample(times.state, model, kinematics, []),
        };
        for (axes, [before, now]) in axes {
            let pose = axes.pose(model, kinematics);
            *before = if closed { *now } else { pose };
            *now = pose;
        }
        Ok(closed.then_some(times))
    }

    /// Returns the number of samples of this episode whose `contacts` were incomplete.
    pub(super) fn incomplete(&self) -> u64 {
        self.cut
    }

    /// Resets to the initial state.
    pub(super) fn reset(&mut self) {
        self.cut = 0;
        self.motion.reset();
        self.drawn.reset();
        self.loads.forget();
        self.impulses.forget();
        self.loads.set_properties(self.gravity, |_| 1.0);
    }
}
