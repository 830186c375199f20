//! Wrenches between the links of a robot, computed from its motion.

use motorium_robots::{FrameId, Inertia, Kinematics, Model};
use nalgebra::{Isometry3, Point3, Vector3};

/// A force and a torque about the world origin, in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WorldWrench {
    /// Force \[N\].
    pub force: Vector3<f64>,
    /// Torque about the world origin \[Nm\].
    pub torque: Vector3<f64>,
}

impl WorldWrench {
    /// Returns the wrench as seen from a frame: the force \[N\] and the torque \[Nm\] about the frame's
    /// origin, in the axes of the frame. `frame` is the pose of the frame in the world.
    pub fn seen_from(&self, frame: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let torque = self.torque - frame.translation.vector.cross(&self.force);
        let inverse = frame.rotation.inverse();
        (inverse * self.force, inverse * torque)
    }
}

/// An external force on a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutsideForce {
    /// Index of the link among the frames of the model.
    pub link: usize,
    /// Point of application in the world \[m\].
    pub point: Point3<f64>,
    /// Force on the link in world axes \[N\].
    pub force: Vector3<f64>,
}

/// An external wrench on a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutsideWrench {
    /// Index of the link among the frames of the model.
    pub link: usize,
    /// Wrench on the link.
    pub wrench: WorldWrench,
}

impl From<OutsideForce> for OutsideWrench {
    fn from(OutsideForce { link, point, force }: OutsideForce) -> Self {
        Self { link, wrench: WorldWrench { force, torque: point.coords.cross(&force) } }
    }
}

/// Computes the wrenches between the links of a robot, averaged over the time between two samples of the
/// motion.
///
/// A link and everything it carries have the total momentum `P`, the angular momentum `L` about the world
/// origin, the mass `m` and the centre of mass `c`. Between two samples at `t` and `t + dt`, the movable or
/// fixed joint that carries the link must have exerted the mean wrench of force `F` and torque `T`:
///
/// ```text
/// F = (P(t + dt) - P(t)) / dt - m g - sum f_i
/// T = (L(t + dt) - L(t)) / dt - c(t + dt/2) x m g - sum r_i x f_i
/// ```
///
/// Here `g` is the gravitational acceleration, and the external forces `f_i` act at the points `r_i`. No
/// joint acceleration is needed, and an impact between the samples is fully included. Masses and inertias are
/// the values in the model, scaled by a factor per link.
///
/// ```
/// use motorium_robots::{Kinematics, load};
/// use motorium_sensors::loads::Loads;
/// use nalgebra::Vector3;
///
/// let model = load("pendulum", std::path::Path::new("."))?.model;
/// let mut kinematics = Kinematics::new(&model);
/// kinematics.update(&model, &[0.3]);
/// let mut loads = Loads::new(&model, Vector3::new(0.0, 0.0, -9.81));
/// assert!(!loads.sample(0, &model, &kinematics, []), "one sample is no interval");
/// assert!(loads.sample(1_000_000, &model, &kinematics, []));
/// let link = model.frame(&model.bodies()[0].name)?;
/// assert!((loads.through(link).force.z - 9.81 * model.mass()).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Loads {
    links: Vec<Link>,
    gravity: Vector3<f64>,
    last: Option<u64>,
    wrenches: Vec<WorldWrench>,
}

#[derive(Clone, Debug)]
struct Link {
    parent: Option<usize>,
    inertia: Inertia,
    factor: f64,
    now: Motion,
    before: Motion,
}

/// Momentum of one link.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    momentum: Vector3<f64>,
    /// Angular momentum about the world origin.
    angular: Vector3<f64>,
    /// Mass times centre position.
    moment: Vector3<f64>,
}

impl Loads {
    /// Creates the computation for a robot under the gravitational acceleration `gravity` \[m/s2\] in the
    /// world.
    pub fn new(model: &Model, gravity: Vector3<f64>) -> Self {
        let links = model.frames().iter().map(|frame| Link {
            parent: frame.parent,
            inertia: frame.inertia,
            factor: 1.0,
            now: Motion::default(),
            before: Motion::default(),
        });
        let links: Vec<_> = links.collect();
        Self { wrenches: vec![WorldWrench::default(); links.len()], links, gravity, last: None }
    }

    /// Sets the gravitational acceleration \[m/s2\] and the factor that scales each link's mass and inertia.
    /// `factor` is called with the index of each link.
    pub fn set_properties(&mut self, gravity: Vector3<f64>, factor: impl Fn(usize) -> f64) {
        self.gravity = gravity;
        self.links.iter_mut().enumerate().for_each(|(index, link)| link.factor = factor(index));
    }

    /// Discards all samples; the next sample starts a new interval.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// Adds the motion at a time and the mean external forces since the last sample. Returns `false` for the
    /// first sample. A time that is not after the previous sample's restarts the motion, and also returns
    /// `false`.
    pub fn sample(
        &mut self,
        time_ns: u64,
        model: &Model,
        kinematics: &Kinematics,
        outside: impl IntoIterator<Item = OutsideForce>,
    ) -> bool {
        self.sample_wrenches(time_ns, model, kinematics, outside.into_iter().map(OutsideWrench::from))
    }

    /// Adds the motion like [`sample`](Self::sample), but with mean external wrenches instead of forces.
    pub fn sample_wrenches(
        &mut self,
        time_ns: u64,
        model: &Model,
        kinematics: &Kinematics,
        outside: impl IntoIterator<Item = OutsideWrench>,
    ) -> bool {
        for (index, (link, frame)) in self.links.iter_mut().zip(model.frame_ids()).enumerate() {
            link.before = link.now;
            // links fixed to the world carry others but are not carried
            if link.inertia.mass > 0.0 && !model.frames()[index].in_world {
                link.now = link.motion(model, kinematics, frame);
            }
        }
        let since = self.last.replace(time_ns);
        let Some(dt) = since.and_then(|since| time_ns.checked_sub(since)).filter(|ns| *ns > 0) else {
            return false;
        };
        self.balance(dt as f64 * 1e-9, outside);
        true
    }

    /// Returns the time of the last sample \[ns\].
    pub fn last(&self) -> Option<u64> {
        self.last
    }

    fn balance(&mut self, dt: f64, outside: impl IntoIterator<Item = OutsideWrench>) {
        let Self { links, gravity, wrenches, .. } = self;
        for (wrench, Link { now, before, inertia, factor, .. }) in wrenches.iter_mut().zip(&*links) {
            let centre = (now.moment + before.moment) * 0.5;
            *wrench = WorldWrench {
                force: (now.momentum - before.momentum) / dt - *gravity * (factor * inertia.mass),
                torque: (now.angular - before.angular) / dt - centre.cross(gravity),
            };
        }
        for OutsideWrench { link, wrench: outside } in outside {
            if let Some(wrench) = wrenches.get_mut(link) {
                wrench.force -= outside.force;
                wrench.torque -= outside.torque;
            }
        }
        // Parents precede their children.
        for index in (0..links.len()).rev() {
            let Some(parent) = links[index].parent else { continue };
            let own = wrenches[index];
            wrenches[parent].force += own.force;
            wrenches[parent].torque += own.torque;
        }
    }

    /// Returns the mean wrench that the movable or fixed joint above a link exerted on the link during the
    /// interval before the last sample.
    pub fn through(&self, link: FrameId) -> WorldWrench {
        self.wrenches[link.index()]
    }
}

impl Link {
    fn motion(&self, model: &Model, kinematics: &Kinematics, frame: FrameId) -> Motion {
        let (pose, twist) = (kinematics.pose(model, frame), kinematics.velocity(model, frame));
        let mass = self.factor * self.inertia.mass;
        let arm = pose.rotation * self.inertia.com;
        let centre = pose.translation.vector + arm;
        let momentum = (twist.linear + twist.angular.cross(&arm)) * mass;
        let own = pose.rotation.inverse() * twist.angular;
        let spin = pose.rotation * (self.inertia.rotational * own) * self.factor;
        Motion { momentum, angular: centre.cross(&momentum) + spin, moment: centre * mass }
    }
}
