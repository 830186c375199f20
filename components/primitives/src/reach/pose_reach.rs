//! A hand on its way through a sequence of poses.

use std::time::Duration;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::leg::{Leg, ReachError, Repeat, SteerError, numbers};
use super::shape::plain;
use super::speed::Pace;
use super::twist::Twist;
use crate::dmp::{DiscreteDmp, DmpModel, MoveError, OrientationDmp};

/// Where in its sequence a hand is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReachPhase {
    /// Not started: there is no pose yet.
    Waiting,
    /// On the way to a goal.
    Moving,
    /// At a goal.
    Dwelling,
    /// At the last goal, for good.
    Finished,
}

/// Leads a hand from where it is through a sequence of goals and back to the first one, if asked.
///
/// Each leg is a [`DiscreteDmp`] for the position and an [`OrientationDmp`], both with the quintic goal: the hand leaves
/// at rest and unaccelerated, and is at the goal, at rest, exactly at the end of the duration (with a shape that was
/// fitted: within the error of the fit, which goes on to die out during the dwell). One leg takes over position,
/// velocity and acceleration from the other, so the motion has no jump anywhere.
///
/// Time is counted in whole nanoseconds, and legs change within a step where they end: neither drifts with the step.
/// All memory is taken by [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct PoseReach {
    legs: Vec<Route>,
    repeat: Repeat,
    orientation: OrientationDmp,
    pace: Pace,
    phase: ReachPhase,
    current: usize,
    /// Time of the current leg, and its two ends: arrival and departure.
    elapsed: u64,
    arrival: u64,
    departure: u64,
    goal: Isometry3<f64>,
    goals_set: u64,
}

#[derive(Clone, Debug)]
struct Route {
    goal: Isometry3<f64>,
    duration: u64,
    dwell: u64,
    position: DiscreteDmp,
}

/// Where the hand is and how it moves, in policy time.
#[derive(Clone, Copy)]
struct Motion {
    position: Vector3<f64>,
    orientation: UnitQuaternion<f64>,
    velocity: Twist,
    acceleration: Twist,
}

impl PoseReach {
    /// Prepares the legs, in their order.
    ///
    /// # Errors
    /// No leg, a goal that is not finite, a duration under 1 ms, or a shape that leads nowhere.
    pub fn new(legs: Vec<Leg>, repeat: Repeat) -> Result<Self, ReachError> {
        if legs.is_empty() {
            return Err(ReachError::NoLegs);
        }
        let routes = legs.into_iter().enumerate().map(|(index, leg)| Route::new(index, leg));
        Ok(Self {
            legs: routes.collect::<Result<_, _>>()?,
            repeat,
            orientation: OrientationDmp::new(plain()).expect("a plain model has three dimensions"),
            pace: Pace::new(),
            phase: ReachPhase::Waiting,
            current: 0,
            elapsed: 0,
            arrival: 0,
            departure: 0,
            goal: Isometry3::identity(),
            goals_set: 0,
        })
    }

    /// Sets out for the first goal, from rest at a pose in the world frame.
    ///
    /// # Errors
    /// A pose that is not finite.
    pub fn start(&mut self, pose: Isometry3<f64>) -> Result<(), SteerError> {
        self.start_with(0, pose)
    }

    /// As [`start`](Self::start), for the goal of a later leg.
    ///
    /// # Errors
    /// A leg that does not exist, or a pose that is not finite.
    pub fn start_with(&mut self, leg: usize, pose: Isometry3<f64>) -> Result<(), SteerError> {
        self.check_leg(leg)?;
        check("the pose to start from", &pose)?;
        let still = Twist::default();
        self.pace.jump();
        self.depart(
            leg,
            self.legs[leg].goal,
            Motion {
                position: pose.translation.vector,
                orientation: pose.rotation,
                velocity: still,
                acceleration: still,
            },
        )?;
        Ok(())
    }

    /// Replaces the goal of a leg from the next time it is set out for. See [`redirect`](Self::redirect) for the one
    /// that is under way.
    ///
    /// # Errors
    /// A leg that does not exist, or a pose that is not finite.
    pub fn aim(&mut self, leg: usize, goal: Isometry3<f64>) -> Result<(), SteerError> {
        self.check_leg(leg)?;
        check("the goal", &goal)?;
        self.legs[leg].goal = goal;
        Ok(())
    }

    /// Gives the way to a goal another shape from the next time it is set out for, without allocating: a primitive of the
    /// same settings.
    ///
    /// # Errors
    /// A leg that does not exist or is under way, or a primitive of other settings.
    pub fn reshape(&mut self, leg: usize, shape: &DmpModel) -> Result<(), SteerError> {
        self.check_leg(leg)?;
        if leg == self.current && self.phase == ReachPhase::Moving {
            return Err(SteerError::UnderWay { leg });
        }
        Ok(self.legs[leg].position.exchange(shape)?)
    }

    /// Sets the speed factor: 1 is the nominal speed, 0 stops where it is. Stretches movements and dwells alike, and
    /// is approached at [`SPEED_SLEW`](super::SPEED_SLEW).
    ///
    /// # Errors
    /// A negative factor, or one that is not finite.
    pub fn set_speed(&mut self, speed: f64) -> Result<(), SteerError> {
        if !(speed.is_finite() && speed >= 0.0) {
            return Err(SteerError::Speed { found: speed });
        }
        self.pace.command(speed);
        Ok(())
    }

    /// Replaces the goal of the current leg. On the way there, the hand changes course without a jump and arrives when
    /// it would have, or [half a duration](crate::dmp::REPLANNING_TIME) from now if that is later. At a goal, it sets
    /// out anew, with the duration and shape of the current leg. The sequence then goes on with the next leg.
    ///
    /// # Errors
    /// Not started yet, or a pose that is not finite.
    pub fn redirect(&mut self, goal: Isometry3<f64>) -> Result<(), SteerError> {
        check("the goal", &goal)?;
        match self.phase {
            ReachPhase::Waiting => return Err(SteerError::NotStarted),
            ReachPhase::Dwelling | ReachPhase::Finished => {
                return Ok(self.depart(self.current, goal, self.motion())?);
            }
            ReachPhase::Moving => {}
        }
        let leg = &mut self.legs[self.current];
        leg.position.set_goal(goal.translation.vector.as_slice())?;
        self.orientation.set_goal(goal.rotation)?;
        let end = leg.position.end().max(self.orientation.coordinates().end());
        self.arrival = self.arrival.max((end * leg.duration as f64).ceil() as u64);
        self.departure = self.arrival + leg.dwell;
        self.goal = goal;
        self.goals_set += 1;
        Ok(())
    }

    /// Advances by a step of real time.
    pub fn step(&mut self, dt: Duration) {
        if self.phase == ReachPhase::Waiting {
            return;
        }
        let mut left = self.pace.advance(u64::try_from(dt.as_nanos()).unwrap_or(u64::MAX));
        while left > 0 {
            if self.elapsed >= self.departure {
                if self.is_last() {
                    self.advance(left);
                    break;
                }
                let next = (self.current + 1) % self.legs.len();
                self.depart(next, self.legs[next].goal, self.motion())
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

    /// Pose of the hand in the world frame. The identity before the start.
    pub fn pose(&self) -> Isometry3<f64> {
        let motion = self.motion();
        Isometry3::from_parts(Translation3::from(motion.position), motion.orientation)
    }

    /// Velocity of the hand in world axes.
    pub fn twist(&self) -> Twist {
        self.motion().velocity * self.pace.rate()
    }

    /// Acceleration of the hand in world axes.
    pub fn acceleration(&self) -> Twist {
        let motion = self.motion();
        motion.acceleration * self.pace.rate().powi(2) + motion.velocity * self.pace.slope()
    }

    /// Where in its sequence the hand is.
    pub fn phase(&self) -> ReachPhase {
        self.phase
    }

    /// Number of legs.
    pub fn legs(&self) -> usize {
        self.legs.len()
    }

    /// The leg it is on, from 0.
    pub fn leg(&self) -> usize {
        self.current
    }

    /// Elapsed time of the current leg over its duration; 1 from the arrival on.
    pub fn progress(&self) -> f64 {
        if self.arrival == 0 { 1.0 } else { (self.elapsed as f64 / self.arrival as f64).min(1.0) }
    }

    /// The goal it is on the way to or at, in the world frame.
    pub fn goal(&self) -> Isometry3<f64> {
        self.goal
    }

    /// How many goals it has set out for, from 0.
    pub fn goals_set(&self) -> u64 {
        self.goals_set
    }

    fn motion(&self) -> Motion {
        let position = &self.legs[self.current].position;
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

    /// Sets out for a goal by the way of a leg, from a motion.
    fn depart(&mut self, leg: usize, goal: Isometry3<f64>, from: Motion) -> Result<(), MoveError> {
        let route = &mut self.legs[leg];
        let seconds = route.duration as f64 * 1e-9;
        route.position.start_moving(
            [from.position.as_slice(), from.velocity.linear.as_slice(), from.acceleration.linear.as_slice()],
            goal.translation.vector.as_slice(),
            seconds,
        )?;
        let turning = [from.velocity.angular, from.acceleration.angular];
        self.orientation.start_moving(from.orientation, turning, goal.rotation, seconds)?;
        self.current = leg;
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
        self.legs[self.current].position.step(seconds);
        self.orientation.step(seconds);
    }

    fn check_leg(&self, leg: usize) -> Result<(), SteerError> {
        let legs = self.legs.len();
        if leg < legs { Ok(()) } else { Err(SteerError::NoSuchLeg { leg, legs }) }
    }

    fn is_last(&self) -> bool {
        self.repeat == Repeat::Once && self.current + 1 == self.legs.len()
    }
}

impl Route {
    fn new(index: usize, leg: Leg) -> Result<Self, ReachError> {
        leg.check(index)?;
        let model = leg.shape.model().map_err(|source| ReachError::Shape { leg: index, source })?;
        let nanoseconds = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX / 4);
        Ok(Self {
            goal: leg.goal,
            duration: nanoseconds(leg.duration),
            dwell: nanoseconds(leg.dwell),
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
