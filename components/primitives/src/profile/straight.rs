//! Several coordinates along a straight line.

use super::{MotionLimits, Profile, Stop};
use crate::dmp::Jet;

/// Velocity profile of a motion along a straight line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// The fastest motion within the limits.
    #[default]
    TimeOptimal,
    /// The motion with the least integrated squared jerk.
    MinimumJerk,
}

/// A rest-to-rest motion along the straight line between two points. All coordinates start and arrive
/// simultaneously.
///
/// The motion is time-optimal on this line: one coordinate is always at one of its limits. If each coordinate
/// moved at its own limits, the motion would leave the line and the coordinates would arrive at different
/// times. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct StraightMove {
    from: Vec<f64>,
    way: Vec<f64>,
    limits: Vec<MotionLimits>,
    along: Along,
}

/// Motion along the line.
#[derive(Clone, Copy, Debug)]
enum Along {
    /// From the start to the end.
    Whole(Profile),
    /// From a fraction of the path covered to rest.
    Stop { covered: f64, stop: Stop },
}

impl Along {
    fn duration(&self) -> f64 {
        match self {
            Self::Whole(profile) => profile.duration(),
            Self::Stop { stop, .. } => stop.duration(),
        }
    }

    fn sample(&self, time: f64) -> Jet {
        match self {
            Self::Whole(profile) => profile.sample(time),
            Self::Stop { covered, stop } => {
                let jet = stop.sample(time);
                Jet { value: covered + jet.value, ..jet }
            }
        }
    }
}

impl StraightMove {
    /// Creates a motion that rests at 0, with limits for each coordinate.
    pub fn new(limits: Vec<MotionLimits>) -> Self {
        let zeros = vec![0.0; limits.len()];
        Self { from: zeros.clone(), way: zeros, limits, along: Along::Whole(Profile::rest()) }
    }

    /// Limits of the fraction of the path covered.
    fn limits_on(&self, way: impl Iterator<Item = f64>) -> MotionLimits {
        let mut along =
            MotionLimits { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        for (way, limits) in way.zip(&self.limits).filter(|(way, _)| *way != 0.0) {
            let way = way.abs();
            along.velocity = along.velocity.min(limits.velocity / way);
            along.acceleration = along.acceleration.min(limits.acceleration / way);
            along.jerk = along.jerk.min(limits.jerk / way);
        }
        along
    }

    /// Returns the shortest duration of a motion between two points \[s\].
    pub fn least_duration(&self, from: &[f64], to: &[f64], shape: Shape) -> f64 {
        if from == to {
            return 0.0;
        }
        let limits = self.limits_on(from.iter().zip(to).map(|(from, to)| to - from));
        match shape {
            Shape::TimeOptimal => Profile::time_optimal(1.0, &limits).duration(),
            Shape::MinimumJerk => Profile::minimum_jerk_duration(1.0, &limits),
        }
    }

    /// Plans the motion between two points. The motion lasts `duration` \[s\] or, if longer, the shortest
    /// duration within the limits.
    pub fn plan(&mut self, from: &[f64], to: &[f64], shape: Shape, duration: Option<f64>) {
        self.from.copy_from_slice(from);
        self.way.iter_mut().zip(from.iter().zip(to)).for_each(|(way, (from, to))| *way = to - from);
        let least = self.least_duration(from, to, shape);
        let wanted = duration.unwrap_or(0.0);
        self.along = Along::Whole(if from == to {
            Profile::rest().taking(wanted)
        } else {
            match shape {
                Shape::TimeOptimal => {
                    Profile::time_optimal(1.0, &self.limits_on(self.way.iter().copied())).taking(wanted)
                }
                Shape::MinimumJerk => Profile::minimum_jerk(1.0, least.max(wanted)),
            }
        });
    }

    /// From `time` \[s\] on, replaces the motion by the fastest stop along the same line. The stop ends
    /// before the motion would have ended. Afterwards, [`duration`](Self::duration) and
    /// [`sample`](Self::sample) count from `time`.
    pub fn brake(&mut self, time: f64) {
        let jet = self.along.sample(time);
        let limits = self.limits_on(self.way.iter().copied());
        let stop = Stop::new(jet.rate, jet.acceleration, &limits);
        self.along = Along::Stop { covered: jet.value, stop };
    }

    /// Returns the duration of the motion \[s\].
    pub fn duration(&self) -> f64 {
        self.along.duration()
    }

    /// Writes positions and velocities at a time \[s\].
    pub fn sample(&self, time: f64, position: &mut [f64], velocity: &mut [f64]) {
        let along = self.along.sample(time);
        for (index, way) in self.way.iter().enumerate() {
            position[index] = self.from[index] + along.value * way;
            velocity[index] = along.rate * way;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits() -> Vec<MotionLimits> {
        [(2.0, 7.5, 100.0), (0.5, 5.0, 50.0), (2.6, 20.0, 400.0)]
            .map(|(velocity, acceleration, jerk)| MotionLimits { velocity, acceleration, jerk })
            .to_vec()
    }

    #[test]
    fn one_coordinate_is_always_at_a_limit() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 4.0 - 2.0
        };
        for round in 0..60 {
            let shape = if round % 2 == 0 { Shape::TimeOptimal } else { Shape::MinimumJerk };
            let mut motion = StraightMove::new(limits());
            let (from, to) = ([random(), random(), random()], [random(), random(), random()]);
            motion.plan(&from, &to, shape, None);
            assert!((motion.duration() - motion.least_duration(&from, &to, shape)).abs() < 1e-12);
            let (mut q, mut v, mut before) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            let (mut a, dt) = ([0.0; 3], motion.duration() / 4000.0);
            let mut fullest = [0.0_f64; 3];
            for step in 0..=4000 {
                motion.sample(f64::from(step) * dt, &mut q, &mut v);
                for (joint, limits) in limits().into_iter().enumerate() {
                    let now = if step == 0 { 0.0 } else { (v[joint] - before[joint]) / dt };
                    let jerk = if step < 2 { 0.0 } else { (now - a[joint]) / dt };
                    fullest[0] = fullest[0].max(v[joint].abs() / limits.velocity);
                    fullest[1] = fullest[1].max(now.abs() / limits.acceleration);
                    fullest[2] = fullest[2].max(jerk.abs() / limits.jerk);
                    a[joint] = now;
                }
                before = v;
            }
            assert!(fullest.iter().all(|share| *share < 1.0 + 1e-6), "{shape:?} {fullest:?}");
            assert!(fullest.iter().any(|share| *share > 0.98), "{shape:?} {fullest:?}");
            motion.sample(motion.duration(), &mut q, &mut v);
            assert_eq!(v, [0.0; 3]);
            assert!(q.iter().zip(&to).all(|(q, to)| (q - to).abs() < 1e-12));
        }
    }

    #[test]
    fn brakes_within_limits_before_the_end() {
        let mut state = 5_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for round in 0..200 {
            let shape = if round % 2 == 0 { Shape::TimeOptimal } else { Shape::MinimumJerk };
            let mut motion = StraightMove::new(limits());
            let to = [4.0 * random() - 2.0, 4.0 * random() - 2.0, 4.0 * random() - 2.0];
            motion.plan(&[0.0; 3], &to, shape, None);
            let (mut q, mut v) = ([0.0; 3], [0.0; 3]);
            let at = random() * motion.duration();
            motion.sample(at, &mut q, &mut v);
            let (begin, speed) = (q, v);
            motion.brake(at);
            // a second stop continues the first
            if round % 3 == 0 {
                motion.brake(0.5 * motion.duration());
                motion.sample(0.0, &mut q, &mut v);
            } else {
                motion.sample(0.0, &mut q, &mut v);
                assert!(q.iter().zip(&begin).all(|(q, begin)| (q - begin).abs() < 1e-12), "{q:?} {begin:?}");
                assert!(v.iter().zip(&speed).all(|(v, speed)| (v - speed).abs() < 1e-12), "{v:?} {speed:?}");
            }
            let dt = motion.duration() / 2000.0;
            let (mut before, mut accelerations) = (v, None::<[f64; 3]>);
            for step in 1..=2000 {
                motion.sample(f64::from(step) * dt, &mut q, &mut v);
                let a: [f64; 3] = std::array::from_fn(|joint| (v[joint] - before[joint]) / dt);
                for (joint, limits) in limits().into_iter().enumerate() {
                    assert!(v[joint].abs() <= limits.velocity * (1.0 + 1e-9), "{round}");
                    assert!(a[joint].abs() <= limits.acceleration * (1.0 + 1e-6), "{round} {a:?}");
                    let jerk =
                        accelerations.map_or(0.0, |accelerations| (a[joint] - accelerations[joint]) / dt);
                    assert!(jerk.abs() <= limits.jerk * (1.0 + 1e-3), "{round} {jerk}");
                }
                (before, accelerations) = (v, Some(a));
            }
            assert_eq!(v, [0.0; 3]);
            assert!(q.iter().zip(&to).all(|(q, to)| q.abs() <= to.abs() + 1e-9), "{q:?} beyond {to:?}");
        }
    }

    #[test]
    fn requested_duration_is_met_unless_limits_need_more() {
        let mut motion = StraightMove::new(limits());
        for shape in [Shape::TimeOptimal, Shape::MinimumJerk] {
            motion.plan(&[0.0; 3], &[1.0, 0.5, -1.0], shape, Some(7.0));
            assert_eq!(motion.duration(), 7.0);
            motion.plan(&[0.0; 3], &[1.0, 0.5, -1.0], shape, Some(0.1));
            assert!(motion.duration() > 1.0, "{}", motion.duration());
            motion.plan(&[1.0; 3], &[1.0; 3], shape, Some(0.3));
            let (mut q, mut v) = ([0.0; 3], [9.0; 3]);
            motion.sample(0.2, &mut q, &mut v);
            assert_eq!((q, v, motion.duration()), ([1.0; 3], [0.0; 3], 0.3));
        }
    }
}
