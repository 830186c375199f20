//! Conversion of a robot's measurements to the observation of its policy.

use core::f64::consts::TAU;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{Assembly, Policy, PolicyError, Term};

/// Motion of the base of a robot, in the axes of the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseMotion {
    /// Linear velocity \[m/s\].
    pub linear_velocity: [f64; 3],
    /// Angular velocity \[rad/s\].
    pub angular_velocity: [f64; 3],
    /// Unit vector along gravity; zero for a robot without a floating base.
    pub gravity: [f64; 3],
}

/// Returns the unit vector along gravity in the frame of a base. `orientation` is the quaternion of the base
/// in the world (x y z w), which is normalised first. Returns `None` if the norm of the quaternion is below
/// 0.5.
///
/// ```
/// use motorium_models::policy::projected_gravity;
///
/// assert_eq!(projected_gravity([0.0, 0.0, 0.0, 1.0]), Some([0.0, 0.0, -1.0]));
/// assert_eq!(projected_gravity([0.0; 4]), None);
/// ```
pub fn projected_gravity([x, y, z, w]: [f64; 4]) -> Option<[f64; 3]> {
    let quaternion = Quaternion::new(w, x, y, z);
    if quaternion.norm() < 0.5 {
        return None;
    }
    Some(UnitQuaternion::from_quaternion(quaternion).inverse_transform_vector(&-Vector3::z()).into())
}

/// Measurements at one step of a policy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measurements<'a> {
    /// Positions of the robot's joints, in the robot's order \[rad or m\].
    pub positions: &'a [f64],
    /// Velocities of the robot's joints, in the robot's order \[rad/s or m/s\].
    pub velocities: &'a [f64],
    /// Motion of the base.
    pub base: BaseMotion,
    /// Desired motion of the base: forward velocity, velocity to the left \[m/s\] and yaw rate \[rad/s\].
    pub command: [f64; 3],
    /// Action of the previous step, within its bounds; zero at the start of an episode.
    pub last_action: &'a [f64],
    /// Heights of the surface around the robot \[m\].
    pub heights: &'a [f32],
    /// Position or velocity for each term with a point, in the order of the observations \[m or m/s\].
    pub points: &'a [[f64; 3]],
    /// The pixels of each image, in the order of the observations. Pixels are depths \[m\], where 0 means no
    /// depth, or grey levels, 0 to 255.
    pub images: &'a [f32],
    /// Time since the start of the episode \[s\].
    pub time: f64,
}

/// Computes the observation of a policy: selects the joints, applies bounds and scales, and keeps histories.
/// Only [`new`](Self::new) allocates.
///
/// The learning environments, `learner.task` and `policy.network` share this type, so a policy observes the
/// same values in training and on a robot.
///
/// ```
/// use motorium_models::policy::{Measurements, Observer, Policy};
///
/// let policy = Policy::parse(
///     r#"
///     network = "policy.onnx"
///     rate = 50.0
///     observations = [{ term = "joint_positions" }, { term = "last_action" }]
///     action = { joints = ["knee", "hip"], default_pose = [0.5, 0.0] }
///     "#,
/// )?;
/// let mut observer = Observer::new(&policy, &["hip", "knee"])?;
/// observer.observe(&Measurements {
///     positions: &[0.25, 2.0],
///     velocities: &[0.0; 2],
///     last_action: &[0.0, 1.0],
///     ..Measurements::default()
/// });
/// let mut observation = [0.0; 4];
/// observer.write(&mut observation);
/// assert_eq!(observation, [1.5, 0.25, 0.0, 1.0]);
/// # Ok::<(), motorium_models::policy::PolicyError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Observer {
    terms: Vec<ObservedTerm>,
    assembly: Assembly,
    /// Index of each joint of the policy in the robot, and its default position.
    joints: Vec<(usize, f64)>,
    /// Values of one term.
    scratch: Vec<f64>,
}

/// A term and its settings.
#[derive(Clone, Copy, Debug)]
struct ObservedTerm {
    term: Term,
    /// Duration of the cycle of a phase \[s\].
    period: f64,
    /// Depths that become 0 and 1 \[m\].
    range: [f64; 2],
}

impl Observer {
    /// Creates the observer of a policy on a robot with these joints.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Joints`] if the robot lacks a joint of the policy.
    pub fn new(policy: &Policy, robot: &[impl AsRef<str>]) -> Result<Self, PolicyError> {
        let targets = policy.joint_targets(robot)?;
        let joints = targets.targets().iter().map(|target| target.joint);
        let joints = joints.zip(policy.action.default_pose.iter().copied()).collect();
        let terms = policy.observations.iter();
        let widest = terms.clone().map(|observation| policy.width(observation)).max().unwrap_or(0);
        Ok(Self {
            terms: terms
                .map(|each| ObservedTerm {
                    term: each.term,
                    period: each.period.unwrap_or(1.0),
                    range: each.range.unwrap_or([0.0, 1.0]),
                })
                .collect(),
            assembly: Assembly::new(policy),
            joints,
            scratch: vec![0.0; widest],
        })
    }

    /// Returns the minimum number of joints in the measurements.
    pub fn joints(&self) -> usize {
        self.joints.iter().map(|(joint, _)| joint + 1).max().unwrap_or(0)
    }

    /// Returns the number of heights in the measurements; `None` without a height scan.
    pub fn heights(&self) -> Option<usize> {
        let scan = self.terms.iter().position(|observed| observed.term == Term::HeightScan);
        scan.map(|index| self.assembly.width(index))
    }

    /// Returns the number of pixels of all images in measurements.
    pub fn pixels(&self) -> usize {
        let widths = self.terms.iter().enumerate().filter(|(_, observed)| observed.term.is_image());
        widths.map(|(index, _)| self.assembly.width(index)).sum()
    }

    /// Clears all histories. Call this at the start of an episode.
    pub fn reset(&mut self) {
        self.assembly.reset();
    }

    /// Adds the measurements of one step to the observation.
    ///
    /// # Panics
    ///
    /// If measurements that a term reads have the wrong length. There must be at least
    /// [`joints`](Self::joints) joints, exactly [`heights`](Self::heights) heights and
    /// [`pixels`](Self::pixels) pixels, one value for each action of the policy, and one point for each term
    /// with a point.
    pub fn observe(&mut self, measured: &Measurements<'_>) {
        let mut points = measured.points.iter();
        let mut images = measured.images;
        assert_eq!(images.len(), self.pixels(), "pixels of the images");
        let Self { terms, assembly, joints, scratch } = self;
        for (index, ObservedTerm { term, period, range }) in terms.iter().enumerate() {
            let values = &mut scratch[..assembly.width(index)];
            match term {
                Term::BaseLinearVelocity => values.copy_from_slice(&measured.base.linear_velocity),
                Term::BaseAngularVelocity => values.copy_from_slice(&measured.base.angular_velocity),
                Term::ProjectedGravity => values.copy_from_slice(&measured.base.gravity),
                Term::Command => values.copy_from_slice(&measured.command),
                Term::LastAction => values.copy_from_slice(measured.last_action),
                Term::JointPositions => {
                    for (value, (joint, default)) in values.iter_mut().zip(&*joints) {
                        *value = measured.positions[*joint] - default;
                    }
                }
                Term::JointVelocities => {
                    for (value, (joint, _)) in values.iter_mut().zip(&*joints) {
                        *value = measured.velocities[*joint];
                    }
                }
                Term::HeightScan => {
                    assert_eq!(values.len(), measured.heights.len(), "heights of the scan");
                    let heights = measured.heights.iter().map(|height| f64::from(*height));
                    values.iter_mut().zip(heights).for_each(|(value, height)| *value = height);
                }
                Term::PointPosition | Term::PointVelocity => {
                    values.copy_from_slice(points.next().expect("a vector for each term of a point"));
                }
                Term::DepthImage => {
                    let pixels = split_pixels(&mut images, values.len());
                    let normalised = |depth: &f32| normalised_depth(*depth, *range);
                    values.iter_mut().zip(pixels.iter().map(normalised)).for_each(|(value, x)| *value = x);
                }
                Term::GreyImage => {
                    let levels = split_pixels(&mut images, values.len()).iter();
                    let shares = levels.map(|level| f64::from(*level) / 255.0);
                    values.iter_mut().zip(shares).for_each(|(value, share)| *value = share);
                }
                Term::Phase => {
                    let (sin, cos) = (TAU * measured.time / period).sin_cos();
                    values.copy_from_slice(&[sin, cos]);
                }
            }
            assembly.push(index, values);
        }
    }

    /// Writes the observation after the last step.
    ///
    /// # Panics
    ///
    /// If the length of `observation` is wrong.
    pub fn write(&self, observation: &mut [f32]) {
        self.assembly.write(observation);
    }
}

/// Splits the pixels of the next image off.
fn split_pixels<'a>(images: &mut &'a [f32], count: usize) -> &'a [f32] {
    let (first, rest) = images.split_at(count);
    *images = rest;
    first
}

/// Returns the share of a depth in a range \[m\], 0 to 1; 1 for a pixel without a depth (0 or less).
fn normalised_depth(depth: f32, [near, far]: [f64; 2]) -> f64 {
    if depth > 0.0 { ((f64::from(depth) - near) / (far - near)).clamp(0.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_become_numbers_from_zero_to_one() {
        let text = r#"
            network = "policy.onnx"
            rate = 50.0
            observations = [
                { term = "depth_image", camera = "front", pixels = [3, 2], range = [0.5, 2.5], scale = 2.0 },
                { term = "grey_image", camera = "front", pixels = [2, 1], history = 2 },
            ]
            action = { joints = ["hip"], default_pose = [0.0] }
        "#;
        let policy = Policy::parse(text).expect("a policy");
        let mut observer = Observer::new(&policy, &["hip"]).expect("joints");
        assert_eq!((observer.pixels(), policy.inputs()), (8, Ok(10)));
        let images = [0.0, 0.25, 0.5, 1.0, 2.5, 9.0, 51.0, 255.0];
        observer.observe(&Measurements { positions: &[0.0], images: &images, ..Measurements::default() });
        let mut observation = [0.0; 10];
        observer.write(&mut observation);
        assert_eq!(observation, [2.0, 0.0, 0.0, 0.5, 2.0, 2.0, 0.2, 1.0, 0.2, 1.0]);
    }
}
