//! Points whose positions and velocities a task or a policy observes: origins of links, centres of objects,
//! and the target.

use motorium_models::policy::{Policy, TARGET, Term};
use motorium_robots::{FrameId, Kinematics, Model};

use super::TaskError;

/// Position and velocity of a point in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMotion {
    /// Position \[m\].
    pub position: [f64; 3],
    /// Velocity \[m/s\].
    pub velocity: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Point {
    Link(FrameId),
    /// An object, by its index in [`Points::objects`].
    Object(usize),
    Target,
}

/// Indices in [`Points`] of a point that a term measures, and of its reference point.
pub(super) type Pair = (usize, Option<usize>);

/// Points on and around a robot with a fixed base. The positions of links are computed by forward kinematics
/// from the measured joint positions, so that an environment, `learner.task` and `policy.network` compute
/// identical points.
///
/// Only [`new`](Self::new) allocates. [`locate`](Self::locate) sets all points except the target, which
/// [`set_target`](Self::set_target) sets.
#[derive(Clone, Debug)]
pub struct Points {
    robot: Model,
    kinematics: Kinematics,
    points: Vec<Point>,
    motions: Vec<PointMotion>,
    objects: Vec<String>,
    /// Terms of points among the observations.
    observed: Vec<(Term, Pair)>,
    /// Position or velocity of each observed term.
    vectors: Vec<[f64; 3]>,
}

impl Points {
    /// Creates the points that a policy observes. Names that are neither links nor [`TARGET`] are objects.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if a point is a link of a robot with a floating base.
    pub fn new(policy: &Policy, robot: &Model) -> Result<Self, TaskError> {
        let mut points = Self {
            kinematics: Kinematics::new(robot),
            robot: robot.clone(),
            points: Vec::new(),
            motions: Vec::new(),
            objects: Vec::new(),
            observed: Vec::new(),
            vectors: Vec::new(),
        };
        for (index, observation) in policy.observations.iter().enumerate() {
            let Some(names) = &observation.points else { continue };
            let pair = points.pair(&format!("observations[{index}].points"), names)?;
            points.observed.push((observation.term, pair));
        }
        points.vectors = vec![[0.0; 3]; points.observed.len()];
        Ok(points)
    }

    /// Returns the indices of one or two points, and adds new points.
    pub(super) fn pair(&mut self, key: &str, names: &[String]) -> Result<Pair, TaskError> {
        let first = self.index(key, &names[0])?;
        Ok((first, names.get(1).map(|name| self.index(key, name)).transpose()?))
    }

    fn index(&mut self, key: &str, name: &str) -> Result<usize, TaskError> {
        let point = match self.robot.frame(name) {
            _ if name == TARGET => Point::Target,
            Ok(_) if self.robot.base().floating => {
                let expected = "a point that is not a link: the links of a robot with a floating base have no known position";
                return Err(TaskError::value(key, format!("\"{name}\""), expected));
            }
            Ok(frame) => Point::Link(frame),
            Err(_) => {
                let known = self.objects.iter().position(|known| known == name);
                Point::Object(known.unwrap_or_else(|| {
                    self.objects.push(name.to_owned());
                    self.objects.len() - 1
                }))
            }
        };
        let known = self.points.iter().position(|known| *known == point);
        Ok(known.unwrap_or_else(|| {
            self.points.push(point);
            self.motions.push(PointMotion::default());
            self.points.len() - 1
        }))
    }

    /// Returns the names of the objects whose motion [`locate`](Self::locate) requires.
    pub fn objects(&self) -> &[String] {
        &self.objects
    }

    /// Returns `true` if the target is one of the points.
    pub fn has_target(&self) -> bool {
        self.points.contains(&Point::Target)
    }

    /// Returns the number of joints that [`locate`](Self::locate) requires: all joints of the robot if a link
    /// is one of the points, otherwise 0.
    pub fn joints(&self) -> usize {
        let has_links = self.points.iter().any(|point| matches!(point, Point::Link(_)));
        if has_links { self.robot.joint_count() } else { 0 }
    }

    /// Locates links from the positions \[rad or m\] and velocities \[rad/s or m/s\] of the robot's joints,
    /// and objects from the motion of each of [`objects`](Self::objects).
    ///
    /// # Panics
    ///
    /// If there are fewer joints or objects than needed.
    pub fn locate(&mut self, (positions, velocities): (&[f64], &[f64]), objects: &[PointMotion]) {
        if self.joints() > 0 {
            let (q, v) = (&positions[..self.robot.nq()], &velocities[..self.robot.nv()]);
            self.kinematics.update_with_velocity(&self.robot, q, v);
        }
        for (motion, point) in self.motions.iter_mut().zip(&self.points) {
            *motion = match point {
                Point::Link(frame) => PointMotion {
                    position: self.kinematics.pose(&self.robot, *frame).translation.vector.into(),
                    velocity: self.kinematics.velocity(&self.robot, *frame).linear.into(),
                },
                Point::Object(index) => objects[*index],
                Point::Target => *motion,
            };
        }
    }

    /// Sets the position of the target \[m\], which is assumed to be at rest.
    pub fn set_target(&mut self, position: [f64; 3]) {
        for (motion, point) in self.motions.iter_mut().zip(&self.points) {
            if *point == Point::Target {
                *motion = PointMotion { position, velocity: [0.0; 3] };
            }
        }
    }

    /// Returns the position \[m\] or velocity \[m/s\] of each observed term, in the order of the
    /// observations.
    pub fn observed(&mut self) -> &[[f64; 3]] {
        for (index, (term, pair)) in self.observed.iter().enumerate() {
            let PointMotion { position, velocity } = self.motion(*pair);
            self.vectors[index] = if *term == Term::PointPosition { position } else { velocity };
        }
        &self.vectors
    }

    /// Returns the motion of a point relative to its reference point, or in the world.
    pub(super) fn motion(&self, (first, second): Pair) -> PointMotion {
        let first = self.motions[first];
        let Some(second) = second.map(|second| self.motions[second]) else { return first };
        let difference = |a: [f64; 3], b: [f64; 3]| core::array::from_fn(|axis| a[axis] - b[axis]);
        PointMotion {
            position: difference(first.position, second.position),
            velocity: difference(first.velocity, second.velocity),
        }
    }
}
