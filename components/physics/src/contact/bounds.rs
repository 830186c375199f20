//! Bounds on the travel and speed of colliders. These bounds extend a lower bound of the distance between two
//! colliders from step to step.

use motorium_robots::{Collisions, Kinematics, Twist};
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::colliders::{Collider, Owner};
use super::objects::FreeBody;

/// Smallest margin within which contact points are found \[m\].
pub(super) const FORESIGHT: f64 = 0.002;

/// Margin per distance covered at the current speed.
const HASTE: f64 = 1.5;

/// Motion of a collider.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Largest distance of any point of the collider from the origin \[m\]; zero for a collider that never
    /// moves.
    reach: f64,
    /// Pose at the last update; `None` at the start.
    last: Option<(Matrix3<f64>, Vector3<f64>)>,
    /// Bound of the distance travelled by any point of the collider, in the world and relative to the robot's
    /// base \[m\].
    way: [f64; 2],
    /// Bound of the speed of any point of the collider \[m/s\], likewise.
    speed: [f64; 2],
}

/// Motion of the base of an articulation since the last update.
#[derive(Clone, Debug)]
struct BaseMotion {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    /// Rotation since the last update.
    turn: Matrix3<f64>,
    /// Position at the last update.
    before: Vector3<f64>,
    velocity: Twist,
}

/// Motions of all colliders.
///
/// Two colliders at a measured distance stay at least that far apart, minus the distances both have
/// travelled. The pair needs no new measurement until their travel exceeds the measured distance. Within a
/// floating robot, travel is relative to its base, so flight and fall do not count.
#[derive(Clone, Debug)]
pub(super) struct Motions {
    colliders: Vec<Motion>,
    /// One entry per articulation with a floating base.
    bases: Vec<Option<BaseMotion>>,
    /// One entry per articulation: true for a floating base.
    floating: Vec<bool>,
}

/// Returns the index of the motion bound that applies to a pair: 1 if both belong to one articulation and so
/// share its base.
pub(super) fn part([a, b]: [&Collider; 2]) -> usize {
    usize::from(a.owner.is_robot() && a.owner.articulation() == b.owner.articulation())
}

impl Motions {
    pub(super) fn new(colliders: &[Collider]) -> Self {
        let motion = |collider: &Collider| {
            let moves = collider.owner != Owner::World;
            let reach = if moves { collider.shape.bounding_radius() } else { 0.0 };
            Motion { reach, last: None, way: [0.0; 2], speed: [0.0; 2] }
        };
        let count = colliders.iter().filter_map(|collider| collider.owner.articulation()).max();
        let floats = |of| colliders.iter().any(|collider| collider.owner == Owner::Base(of));
        let floating: Vec<bool> = (0..count.map_or(0, |last| last + 1)).map(floats).collect();
        Self {
            colliders: colliders.iter().map(motion).collect(),
            bases: vec![None; floating.len()],
            floating,
        }
    }

    /// Resets all motions to zero.
    pub(super) fn forget(&mut self) {
        for motion in &mut self.colliders {
            (motion.last, motion.way, motion.speed) = (None, [0.0; 2], [0.0; 2]);
        }
        self.bases.fill(None);
    }

    /// Updates the motions of all colliders to their current `places`. `kinematics` and `objects` provide the
    /// velocities of articulations and objects.
    pub(super) fn follow<'a>(
        &mut self,
        colliders: &[Collider],
        places: &Collisions,
        (kinematics, bases): (impl Fn(usize) -> &'a Kinematics, &[Isometry3<f64>]),
        objects: &[FreeBody],
    ) {
        for (of, base) in bases.iter().enumerate().take(self.bases.len()) {
            if self.floating[of] {
                self.follow_base(of, base, kinematics(of).body_velocity(None));
            }
        }
        for (index, (motion, collider)) in self.colliders.iter_mut().zip(colliders).enumerate() {
            let (linear, angular, centre) = match collider.owner {
                Owner::World => continue,
                Owner::Base(of) | Owner::Body(of, _) => {
                    let kinematics = kinematics(of);
                    let body = if let Owner::Body(_, body) = collider.owner { Some(body) } else { None };
                    let twist = kinematics.body_velocity(body);
                    (twist.linear, twist.angular, kinematics.body_position(body))
                }
                Owner::Object(object) => {
                    let body = &objects[object];
                    (body.linear, body.angular, body.pose.translation.vector)
                }
            };
            let pose = places.pose(index);
            let (rotation, position) = (*pose.rotation.matrix(), pose.translation.vector);
            let velocity = linear + angular.cross(&(position - centre));
            motion.speed[0] = velocity.norm() + angular.norm() * motion.reach;
            if let Some((turned, moved)) = &motion.last {
                motion.way[0] += apart((turned, moved), (&rotation, &position), motion.reach);
            }
            let base = collider.owner.articulation().and_then(|of| self.bases[of].as_ref());
            if let Some(base) = base {
                let carrier = &base.velocity;
                let carried = carrier.linear + carrier.angular.cross(&(position - base.position));
                let turning = (angular - carrier.angular).norm();
                motion.speed[1] = (velocity - carried).norm() + turning * motion.reach;
                if let Some((turned, moved)) = &motion.last {
                    let turned = base.turn * turned;
                    let moved = base.position + base.turn * (moved - base.before);
                    motion.way[1] += apart((&turned, &moved), (&rotation, &position), motion.reach);
                }
            } else {
                (motion.speed[1], motion.way[1]) = (motion.speed[0], motion.way[0]);
            }
            motion.last = Some((rotation, position));
        }
    }

    fn follow_base(&mut self, of: usize, base: &Isometry3<f64>, velocity: Twist) {
        let rotation = *base.rotation.to_rotation_matrix().matrix();
        let position = base.translation.vector;
        let (turn, before) = match &self.bases[of] {
            Some(last) => (rotation * last.rotation.transpose(), last.position),
            None => (Matrix3::identity(), position),
        };
        self.bases[of] = Some(BaseMotion { rotation, position, turn, before, velocity });
    }

    /// Returns a bound of the speed of any point of a collider \[m/s\].
    pub(super) fn speed(&self, index: usize) -> f64 {
        self.colliders[index].speed[0]
    }

    /// Returns the longest distance a collider has travelled since `start` \[m\] and the highest current
    /// speed \[m/s\], for the relevant `parts`.
    pub(super) fn most_since(&self, start: &[[f64; 2]], parts: [bool; 2]) -> (f64, f64) {
        let mut most = (0.0_f64, 0.0_f64);
        for part in (0..2).filter(|part| parts[*part]) {
            for (motion, start) in self.colliders.iter().zip(start) {
                most.0 = most.0.max(motion.way[part] - start[part]);
                most.1 = most.1.max(motion.speed[part]);
            }
        }
        most
    }

    /// Copies the distances travelled by all colliders, in the world and relative to their robot's base.
    pub(super) fn copy_ways(&self, ways: &mut [[f64; 2]]) {
        for (way, motion) in ways.iter_mut().zip(&self.colliders) {
            *way = motion.way;
        }
    }

    /// Returns the sum of the distances travelled by two colliders \[m\] and the sum of their speeds \[m/s\].
    pub(super) fn of_pair(&self, part: usize, first: usize, second: usize) -> (f64, f64) {
        let (first, second) = (&self.colliders[first], &self.colliders[second]);
        (first.way[part] + second.way[part], first.speed[part] + second.speed[part])
    }
}

/// Returns the distance within which surfaces that move at `speed` \[m/s\] may touch in a step of `h` \[s\].
pub(super) fn margin(h: f64, speed: f64) -> f64 {
    FORESIGHT + HASTE * h * speed
}

/// Returns a bound of the distance travelled between two poses by any point within `reach` of the origin.
fn apart(
    (from, start): (&Matrix3<f64>, &Vector3<f64>),
    (to, end): (&Matrix3<f64>, &Vector3<f64>),
    reach: f64,
) -> f64 {
    // Chord of the rotation at unit distance: the Frobenius norm of the difference is sqrt(2) times the
    // chord.
    let chord = (0.5 * (to - from).norm_squared()).sqrt();
    (end - start).norm() + reach * chord
}
