//! Conversion of a robot's measurements to the observation of its policy.

use core::f64::consts::TAU;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{Assembly, Policy, PolicyError, Term};

/// Motion of the base of a robot in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseMotion {
    /// Linear velocity \[m/s\].
    pub linear_velocity: [f64; 3],
    /// Angular velocity \[rad/s\].
    pub angular_velocity: [f64; 3],
    /// Unit vector along gravity; zero for a robot without a floating base.
    pub gravity: [f64; 3],
}

/// Returns the unit vector along gravity in the frame of a base with this orientation in the world (x y z w).
/// The quaternion is normalised first. Returns `None` if its norm is below 0.5.
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
    /// Desired velocity: forwards and to the left \[m/s\], yaw rate \[rad/s\].
    pub command: [f64; 3],
    /// Action of the previous step, within its bounds; zero at the start of an episode.
    pub last_action: &'a [f64],
    /// Heights of the surface around the robot \[m\].
    pub heights: &'a [f32],
    /// Position or velocity for each term with a point, in the order of the observations \[m or m/s\].
    pub points: &'a [[f64; 3]],
    /// Time since the start of the episode \[s\].
    pub time: f64,
}

/// Computes the observation of a policy: selects the joints, applies bounds and scales, and keeps histories.
/// Only [`new`](Self::new) allocates.
///
/// The learning environments, `learner.task` and `policy.network` share this type, so a policy observes the
/// same values in all of them.
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
    /// Each term, and the duration of its cycle \[s\].
    terms: Vec<(Term, f64)>,
    assembly: Assembly,
    /// Index of each joint of the policy in the robot, and its default position.
    joints: Vec<(usize, f64)>,
    /// Values of one term.
    scratch: Vec<f64>,
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
            terms: terms.map(|each| (each.term, each.period.unwrap_or(1.0))).collect(),
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
        let scan = self.terms.iter().position(|(term, _)| *term == Term::HeightScan);
        scan.map(|index| self.assembly.width(index))
    }

    /// Clears all histories. Call this at the start of an episode.
    pub fn reset(&mut self) {
        self.assembly.reset();
    }

    /// Adds the measurements of one step to the observation.
    ///
    /// # Panics
    ///
    /// If measurements that a term reads have the wrong length: fewer joints than [`joints`](Self::joints),
    /// another number of actions than the policy's, another number of heights than
    /// [`heights`](Self::heights), or too few points.
    pub fn observe(&mut self, measured: &Measurements<'_>) {
        let Self { terms, assembly, joints, scratch } = self;
        let mut points = measured.points.iter();
        for (index, (term, period)) in terms.iter().enumerate() {
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
