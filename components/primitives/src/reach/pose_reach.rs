//! The motion of an end effector through a sequence of poses.

use std::time::Duration;

use motorium_robots::Twist;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::segment::{ReachError, Repeat, Segment, SteerError, numbers};
use super::shape::unshaped;
use super::speed::TimeScale;
use crate::dmp::{Coupling, DiscreteDmp, DmpModel, MoveError, OrientationDmp};

/// State of a reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReachPhase {
    /// The reach has not started, so it has no pose yet.
    Waiting,
    /// The end effector moves to a goal.
    Moving,
    /// The end effector dwells at a goal.
    Dwelling,
    /// The end effector stays at the last goal permanently.
    Finished,
}

/// Motion of an end effector from its current pose through a sequence of goals. The sequence optionally
/// repeats from the first goal.
///
/// Each segment consists of a [`DiscreteDmp`] for the position and an [`OrientationDmp`], both of the variant
/// with a quintic goal. The end effector starts at rest without acceleration and rests at the goal exactly at
/// the end of the duration. A fitted shape arrives within its fit error, which decays during the dwell. Each
/// segment continues position, velocity and acceleration of the previous segment, so the motion has no
/// discontinuities.
///
/// Time is counted in whole nanoseconds, and segments can change within a step at the exact time, so the
/// schedule does not depend on the step width. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct PoseReach {
    segments: Vec<Route>,
    repeat: Repeat,
    orientation: OrientationDmp,
    time_scale: TimeScale,
    phase: ReachPhase,
    current: usize,
    /// Elapsed time of the current segment, and its arrival and departure times.
    elapsed: u64,
    arrival: u64,
    departure: u64,
    goal: Isometry3<f64>,
    goals_set: u64,
    /// Acceleration that pushes the position off its path, m/s^2.
    push: Vector3<f64>,
}

#[derive(Clone, Debug)]
struct Route {
    goal: Isometry3<f64>,
    duration: u64,
    dwell: u64,
    position: DiscreteDmp,
}

/// Pose, velocity and acceleration of the end effector, in policy time.
#[derive(Clone, Copy)]
struct Motion {
    position: Vector3<f64>,
    orientation: UnitQuaternion<f64>,
    velocity: Twist,
    acceleration: Twist,
}

/// Speed \[m/s\] and acceleration \[m/s2\] below which the end effector counts as at rest.
const AT_REST: f64 = 1e-6;

impl PoseReach {
    /// Creates a reach with these segments, in order.
    ///
    /// # Errors
    /// [`ReachError`] if there is no segment, a goal is not finite, a duration is under 1 ms, or a shape is
    /// invalid.
    pub fn new(segments: Vec<Segment>, repeat: Repeat) -> Result<Self, ReachError> {
        if segments.is_empty() {
            return Err(ReachError::NoSegments);
        }
        let routes = segments.into_iter().enumerate().map(|(index, segment)| Route::new(index, segment));
        Ok(Self {
            segments: routes.collect::<Result<_, _>>()?,
            repeat,
            orientation: OrientationDmp::new(unshaped()).expect("a plain model has three dimensions"),
            time_scale: TimeScale::new(),
            phase: ReachPhase::Waiting,
            current: 0,
            elapsed: 0,
            arrival: 0,
            departure: 0,
            goal: Isometry3::identity(),
            goals_set: 0,
            push: Vector3::zeros(),
        })
    }

    /// Starts the motion to the first goal, from rest at a pose in the world frame.
    ///
    /// # Errors
    /// [`SteerError`] if the pose is not finite.
    pub fn start(&mut self, pose: Isometry3<f64>) -> Result<(), SteerError> {
        self.start_with(0, pose)
    }

    /// Starts like [`start`](Self::start), but with the segment `segment` instead of the first segment.
    ///
    /// # Errors
    /// [`SteerError`] if the segment does not exist, or the pose is not finite.
    pub fn start_with(&mut self, segment: usize, pose: Isometry3<f64>) -> Result<(), SteerError> {
        self.check_segment(segment)?;
        check("the pose to start from", &pose)?;
        let still = Twist::default();
        self.time_scale.jump();
        self.start_segment(
            segment,
            self.segments[segment].goal,
            Motion {
                position: pose.translation.vector,
                orientation: pose.rotation,
                velocity: still,
                acceleration: still,
            },
        )?;
        Ok(())
    }

    /// Abandons the movement and waits for the next [`start`](Self::start). The pose stays unchanged.
    pub fn halt(&mut self) {
        self.phase = ReachPhase::Waiting;
    }

    /// Replaces the goal of a segment, effective from the segment's next start. For the segment in progress,
    /// see [`redirect`](Self::redirect).
    ///
    /// # Errors
    /// [`SteerError`] if the segment does not exist, or the pose is not finite.
    pub fn set_goal(&mut self, segment: usize, goal: Isometry3<f64>) -> Result<(), SteerError> {
        self.check_segment(segment)?;
        check("the goal", &goal)?;
        self.segments[segment].goal = goal;
        Ok(())
    }

    /// Changes the shape of the path to a goal, effective from the segment's next start, without allocating.
    /// The new primitive must have the settings of the current primitive.
    ///
    /// # Errors
    /// [`SteerError`] if the segment does not exist or is in progress, or the primitive has different
    /// settings.
    pub fn reshape(&mut self, segment: usize, shape: &DmpModel) -> Result<(), SteerError> {
        self.check_segment(segment)?;
        if segment == self.current && self.phase == ReachPhase::Moving {
            return Err(SteerError::UnderWay { segment });
        }
        Ok(self.segments[segment].position.exchange(shape)?)
    }

    /// Sets the target speed factor: 1 is nominal speed, 0 holds the current position. The factor stretches
    /// movements and dwells alike. The current factor approaches the target at a rate of at most
    /// [`SPEED_SLEW`](super::SPEED_SLEW).
    ///
    /// # Errors
    /// [`SteerError`] if the factor is negative or not finite.
    pub fn set_speed(&mut self, speed: f64) -> Result<(), SteerError> {
        if !(speed.is_finite() && speed >= 0.0) {
            return Err(SteerError::Speed { found: speed });
        }
        self.time_scale.command(speed);
        Ok(())
    }

    /// Replaces the goal of the current segment. During a movement, the end effector changes course without a
    /// discontinuity and arrives at the original time, or after [half a
    /// duration](crate::dmp::REPLANNING_TIME) if that is later. At a goal, the end effector starts again with
    /// the duration and shape of the current segment. The sequence then continues with the next segment.
    ///
    /// # Errors
    /// [`SteerError`] if the reach has not started, or the pose is not finite.
    pub fn redirect(&mut self, goal: Isometry3<f64>) -> Result<(), SteerError> {
        check("the goal", &goal)?;
        match self.phase {
            ReachPhase::Waiting => return Err(SteerError::NotStarted),
            ReachPhase::Dwelling | ReachPhase::Finished => {
                return Ok(self.start_segment(self.current, goal, self.motion())?);
            }
            ReachPhase::Moving => {}
        }
        let segment = &mut self.segments[self.current];
        segment.position.set_goal(goal.translation.vector.as_slice())?;
        self.orientation.set_goal(goal.rotation)?;
        let end = segment.position.end().max(self.orientation.coordinates().end());
        self.arrival = self.arrival.max((end * segment.duration as f64).ceil() as u64);
        self.departure = self.arrival + segment.dwell;
        self.goal = goal;
        self.goals_set += 1;
        Ok(())
    }

    /// Pushes the position off its path by an acceleration \[m/s2\] until the next call. The acceleration may
    /// come from an obstacle or a force ([`Coupling::acceleration`](crate::dmp::Coupling)). The effect of the
    /// acceleration decays with the spring of the primitive. A non-finite value is ignored.
    pub fn push(&mut self, acceleration: Vector3<f64>) {
        let is_finite = acceleration.iter().all(|part| part.is_finite());
        self.push = if is_finite { acceleration } else { Vector3::zeros() };
    }

    /// Advances by `dt` of real time.
    pub fn step(&mut self, dt: Duration) {
        if self.phase == ReachPhase::Waiting {
            return;
        }
        let mut left = self.time_scale.advance(u64::try_from(dt.as_nanos()).unwrap_or(u64::MAX));
        while left > 0 {
            if self.elapsed >= self.departure {
                if self.is_last() {
                    self.advance(left);
                    break;
                }
                let next = (self.current + 1) % self.segments.len();
                self.start_segment(next, self.segments[next].goal, self.motion())
                    .expect("the goals were checked at construction and a motion in progress is finite");
            }
            let end = if self.elapsed < self.arrival { self.arrival } else { self.departure };
            let span = left.min(end - self.elapsed);
            self.advance(span);
            self.elapsed += span;
            left -= span;
        }
        self.phase = if self.elapsed < self.arrival {
            ReachPhase::Moving
        } else if self.elapsed >= self.departure && self.is_last() {
            ReachPhase::Finished
        } else {
            ReachPhase::Dwelling
        };
    }

    /// Returns the pose of the end effector in the world frame; the identity before the start.
    pub fn pose(&self) -> Isometry3<f64> {
        let motion = self.motion();
        Isometry3::from_parts(Translation3::from(motion.position), motion.orientation)
    }

    /// Returns the velocity of the end effector in world axes.
    pub fn twist(&self) -> Twist {
        self.motion().velocity * self.time_scale.rate()
    }

    /// Returns the acceleration of the end effector in world axes.
    pub fn acceleration(&self) -> Twist {
        let motion = self.motion();
        motion.acceleration * self.time_scale.rate().powi(2) + motion.velocity * self.time_scale.slope()
    }

    /// Returns the state of the reach.
    pub fn phase(&self) -> ReachPhase {
        self.phase
    }

    /// Returns the number of segments.
    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Returns the index of the current segment, from 0.
    pub fn segment(&self) -> usize {
        self.current
    }

    /// Returns the elapsed time of the current segment divided by its duration; 1 after arrival.
    pub fn progress(&self) -> f64 {
        if self.arrival == 0 { 1.0 } else { (self.elapsed as f64 / self.arrival as f64).min(1.0) }
    }

    /// Returns the goal of the current segment, in the world frame.
    pub fn goal(&self) -> Isometry3<f64> {
        self.goal
    }

    /// Returns the number of goals set so far: one for each start of a segment and each redirection.
    pub fn goals_set(&self) -> u64 {
        self.goals_set
    }

    fn motion(&self) -> Motion {
        let position = &self.segments[self.current].position;
        let vector = Vector3::from_column_slice;
        Motion {
            position: vector(position.position()),
            orientation: self.orientation.orientation(),
            velocity: Twist {
                linear: vector(position.velocity()),
                angular: self.orientation.angular_velocity(),
            },
            acceleration: Twist {
                linear: vector(position.acceleration()),
                angular: self.orientation.angular_acceleration(),
            },
        }
    }

    /// Starts to a goal along the path of a segment, from a given motion.
    fn start_segment(&mut self, segment: usize, goal: Isometry3<f64>, from: Motion) -> Result<(), MoveError> {
        let route = &mut self.segments[segment];
        let seconds = route.duration as f64 * 1e-9;
        let goal_position = goal.translation.vector;
        let (position, velocity) = (from.position, from.velocity.linear);
        if velocity.norm() < AT_REST && from.acceleration.linear.norm() < AT_REST {
            // Start at rest with the shape's own acceleration: a polynomial that cancelled it would bend the
            // whole path.
            route.position.start(position.as_slice(), goal_position.as_slice(), seconds)?;
        } else {
            let motion = [position.as_slice(), velocity.as_slice(), from.acceleration.linear.as_slice()];
            route.position.start_moving(motion, goal_position.as_slice(), seconds)?;
        }
        let turning = [from.velocity.angular, from.acceleration.angular];
        self.orientation.start_moving(from.orientation, turning, goal.rotation, seconds)?;
        self.current = segment;
        self.goal = goal;
        self.goals_set += 1;
        self.elapsed = 0;
        self.arrival = route.duration;
        self.departure = route.duration + route.dwell;
        self.phase = ReachPhase::Moving;
        Ok(())
    }

    fn advance(&mut self, nanoseconds: u64) {
        let seconds = nanoseconds as f64 * 1e-9;
        let position = &mut self.segments[self.current].position;
        let coupling = Coupling { acceleration: self.push.as_slice(), phase_rate: 1.0 };
        position.step_coupled(seconds, &coupling).expect("a finite push of three dimensions");
        self.orientation.step(seconds);
    }

    fn check_segment(&self, segment: usize) -> Result<(), SteerError> {
        let segments = self.segments.len();
        if segment < segments { Ok(()) } else { Err(SteerError::NoSuchSegment { segment, segments }) }
    }

    fn is_last(&self) -> bool {
        self.repeat == Repeat::Once && self.current + 1 == self.segments.len()
    }
}

impl Route {
    fn new(index: usize, segment: Segment) -> Result<Self, ReachError> {
        segment.check(index)?;
        let model = segment.shape.model().map_err(|source| ReachError::Shape { segment: index, source })?;
        let nanoseconds = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX / 4);
        Ok(Self {
            goal: segment.goal,
            duration: nanoseconds(segment.duration),
            dwell: nanoseconds(segment.dwell),
            position: DiscreteDmp::new(model),
        })
    }
}

fn check(name: &'static str, pose: &Isometry3<f64>) -> Result<(), MoveError> {
    match numbers(pose).find(|value| !value.is_finite()) {
        Some(value) => Err(MoveError::NotFinite { name, value }),
        None => Ok(()),
    }
}
