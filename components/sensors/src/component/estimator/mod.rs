//! `estimator.base`: pose and velocity of a legged robot's base.

mod config;
mod score;

use motorium::prelude::*;
use motorium::state::{BaseEstimate, FootContacts, MAX_FEET};
use motorium_robots::{BaseMode, FrameId, Kinematics, Loaded, Model, Reference, lie::so3};
use nalgebra::{Isometry3, Matrix3, Matrix6xX, Unit, UnitQuaternion, Vector3};

pub use config::{BaseEstimatorConfig, StartPose};
use score::{Estimate, Score};

use super::robot::{self, name, too_few_joints};
use crate::estimation::{ContactKinematics, FilterState, InvariantFilter};

/// A component that estimates the pose and velocity of a legged robot's base with an [`InvariantFilter`].
///
/// Each IMU reading propagates the filter. Feet in contact correct the filter, using the latest joint state
/// and contacts.
pub struct BaseEstimator {
    imu: Input<ImuSample>,
    joints: Input<JointState>,
    contacts: Input<FootContacts>,
    reference: Input<BaseState>,
    base_state: Output<BaseState>,
    estimate: Output<BaseEstimate>,
    config: BaseEstimatorConfig,
    filter: InvariantFilter,
    legs: Legs,
    /// Pose of the sensor in the frame of the base.
    mount: Isometry3<f64>,
    /// Initial position of the base and its initial yaw.
    start: (Vector3<f64>, f64),
    alignment: Alignment,
    /// Sequence and time \[ns\] of the last used sample.
    last: ((u32, u32, u64), Option<u64>),
    last_joints: (u32, u32, u64),
    score: Score,
    counts: Counts,
}

/// The legs and the frames of their feet.
struct Legs {
    model: Model,
    kinematics: Kinematics,
    feet: Vec<Foot>,
    jacobian: Matrix6xX<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
}

struct Foot {
    frame: FrameId,
    /// Radius of a spherical foot or wheel \[m\].
    radius: f64,
    /// Start of the current contact, ns.
    since: Option<u64>,
}

/// Readings at rest during the alignment.
#[derive(Clone, Copy, Debug, Default)]
struct Alignment {
    begin: Option<u64>,
    count: f64,
    force: Vector3<f64>,
    rate: Vector3<f64>,
    done: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    steps: u64,
    corrections: u64,
    refused: u64,
    innovations: f64,
}

impl Component for BaseEstimator {
    const KIND: &'static str = "estimator.base";
    const SUMMARY: &'static str =
        "pose and velocity of a legged base from inertial unit, joints and contacts";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = BaseEstimatorConfig;

    fn declare(config: &BaseEstimatorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        config.check()?;
        let loaded = robot::load(robot::named(declare, "the feet of a robot")?, BaseMode::Floating)?;
        Legs::new(&loaded, config)?;
        sensor_on_base(config, &loaded)?;
        start(config, &loaded)?;
        declare.input::<ImuSample>("imu", "readings of the inertial measurement unit");
        declare.input::<JointState>("joint_state", "measured joint state");
        declare.input::<FootContacts>("feet", "contacts of the feet");
        declare.optional_input::<BaseState>("reference", "true base state, for scoring the estimate");
        declare.output::<BaseState>("base_state", "estimated pose and velocity of the base");
        declare.output::<BaseEstimate>("estimate", "the estimate with its biases and its covariance");
        Ok(())
    }

    fn configure(config: BaseEstimatorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let loaded = robot::load(setup.robot()?, BaseMode::Floating)?;
        let legs = Legs::new(&loaded, &config)?;
        Ok(Self {
            imu: setup.input("imu")?,
            joints: setup.input("joint_state")?,
            contacts: setup.input("feet")?,
            reference: setup.input("reference")?,
            base_state: setup.output("base_state")?,
            estimate: setup.output("estimate")?,
            filter: InvariantFilter::new(legs.feet.len(), config.noise, Vector3::from(config.gravity)),
            mount: sensor_on_base(&config, &loaded)?,
            start: start(&config, &loaded)?,
            alignment: Alignment::default(),
            last: ((0, 0, 0), None),
            last_joints: (0, 0, 0),
            score: Score::new(),
            counts: Counts::default(),
            legs,
            config,
        })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        if let Some(truth) = self.reference.latest() {
            self.score.push(truth.stamp().source_time, &truth);
        }
        let Some(imu) = self.imu.latest() else { return Ok(()) };
        let (stamp, time) = (imu.stamp(), imu.time_ns());
        if name(&stamp) == self.last.0 {
            return Ok(());
        }
        let (rate, force) = (Vector3::from(imu.angular_velocity), Vector3::from(imu.specific_force));
        self.last.0 = name(&stamp);
        let since = self.last.1.replace(time);
        if !self.alignment.done {
            if !self.alignment.add(time, self.config.align.ns, &rate, &force) {
                return Ok(());
            }
            self.begin();
        } else if let Some(since) = since.filter(|since| time > *since) {
            let dt = (time - since) as f64 * 1e-9;
            self.filter.propagate(&rate, &force, dt);
            self.correct(time, dt, &rate)?;
        }
        self.counts.steps += 1;
        self.publish(stamp.source_time, &rate)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.alignment = Alignment::default();
        (self.last, self.last_joints) = (((0, 0, 0), None), (0, 0, 0));
        self.legs.feet.iter_mut().for_each(|foot| foot.since = None);
        self.score.reset();
        self.counts = Counts::default();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Counts { steps, corrections, refused, innovations } = self.counts;
        let state = self.filter.state();
        let mut result = serde_json::json!({
            "estimates": steps,
            "corrections": corrections,
            "refused": refused,
            "normalised_innovation_squared": innovations / (3.0 * corrections.max(1) as f64),
            "gyroscope_bias": state.gyroscope_bias.as_slice(),
            "accelerometer_bias": state.accelerometer_bias.as_slice(),
        });
        if let Some(score) = self.score.result() {
            result["score"] = score;
        }
        Some(result)
    }
}

impl BaseEstimator {
    /// Starts the filter from the mean of the readings at rest.
    fn begin(&mut self) {
        let Alignment { force, rate, count, .. } = self.alignment;
        let up = Unit::new_normalize(-Vector3::from(self.config.gravity));
        let level = so3::least_rotation(&Unit::new_normalize(force), &up);
        // The yaw is the base's, from which the mount may rotate the sensor.
        let base = level * self.mount.rotation.inverse();
        let yaw = base.euler_angles().2;
        let (position, wanted) = self.start;
        let base = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), wanted - yaw) * base;
        let state = FilterState {
            rotation: base * self.mount.rotation,
            position: position + base * self.mount.translation.vector,
            gyroscope_bias: rate / count,
            ..FilterState::default()
        };
        self.filter.start(&state, &self.config.start_deviations);
    }

    /// Corrects by the feet if there is a new joint state.
    fn correct(&mut self, time: u64, dt: f64, rate: &Vector3<f64>) -> Result<(), StepError> {
        let Some(joints) = self.joints.latest() else { return Ok(()) };
        if joints.count() < self.legs.model.joint_count() {
            return Err(too_few_joints(self.legs.model.joint_count(), joints.count()));
        }
        let omega = self.mount.rotation * (rate - self.filter.state().gyroscope_bias);
        let is_new = name(&joints.stamp()) != self.last_joints;
        self.last_joints = name(&joints.stamp());
        self.legs.update_kinematics(joints.position(), joints.velocity(), &omega);
        let Some(contacts) = self.contacts.latest() else { return Ok(()) };
        if contacts.count() != self.legs.feet.len() {
            let (expected, found) = (self.legs.feet.len(), contacts.count());
            return Err(StepError::failed(format!("contacts: expected {expected} feet, found {found}")));
        }
        let delay = self.config.contact_delay.ns;
        for index in 0..self.legs.feet.len() {
            if contacts.contact()[index] == 0 {
                self.legs.feet[index].since = None;
                self.filter.lift(index);
                continue;
            }
            let since = *self.legs.feet[index].since.get_or_insert(time);
            if time - since < delay {
                continue;
            }
            let up = self.filter.state().rotation.inverse_transform_vector(&Vector3::z());
            let roll = self.legs.roll(index, &(self.mount.rotation * up)) * dt;
            self.filter.roll(index, &self.mount.rotation.inverse_transform_vector(&roll));
            if is_new {
                let contact = self.legs.contact(index, &self.mount, self.config.encoder_noise);
                let was_there = self.filter.foot(index).is_some();
                match self.filter.correct(index, &contact) {
                    Ok(size) => {
                        self.counts.innovations += size;
                        self.counts.corrections += u64::from(was_there);
                    }
                    Err(_) => self.counts.refused += 1,
                }
            }
        }
        Ok(())
    }

    /// Publishes the estimate of the base, computed from the sensor's estimate and the mount.
    fn publish(&mut self, source: u64, rate: &Vector3<f64>) -> Result<(), StepError> {
        let state = *self.filter.state();
        let rotation = state.rotation * self.mount.rotation.inverse();
        let position = state.position - rotation * self.mount.translation.vector;
        let omega = self.mount.rotation * (rate - state.gyroscope_bias);
        let linear =
            rotation.inverse_transform_vector(&state.velocity) - omega.cross(&self.mount.translation.vector);
        let mut base = self.base_state.loan()?;
        base.position = position.into();
        base.orientation.copy_from_slice(rotation.coords.as_slice());
        base.linear_velocity = linear.into();
        base.angular_velocity = omega.into();
        base.publish_from(source)?;
        let covariance = self.covariance(&rotation, &(rotation * linear), &position);
        let invariant = self.filter.invariant_covariance();
        let mut estimate = self.estimate.loan()?;
        estimate.position = position.into();
        estimate.orientation.copy_from_slice(rotation.coords.as_slice());
        estimate.linear_velocity = linear.into();
        estimate.angular_velocity = omega.into();
        estimate.gyroscope_bias = state.gyroscope_bias.into();
        estimate.accelerometer_bias = state.accelerometer_bias.into();
        // symmetric, so rows equal columns
        estimate.covariance.copy_from_slice(covariance.as_slice());
        for (index, deviation) in estimate.bias_deviation.iter_mut().enumerate() {
            *deviation = invariant[(9 + index, 9 + index)].max(0.0).sqrt();
        }
        let feet = 0..self.legs.feet.len();
        estimate.contacts =
            feet.filter(|foot| self.filter.foot(*foot).is_some()).map(|foot| 1_u64 << foot).sum();
        estimate.publish_from(source)?;
        self.score.add(&Estimate { source, position, rotation, covariance: &covariance });
        Ok(())
    }

    /// Returns the covariance of the errors of the base, given pose and velocity in world axes. The invariant
    /// pose error is the same for every point of a body; the velocity error also depends on the gyroscope
    /// bias.
    fn covariance(
        &self,
        rotation: &UnitQuaternion<f64>,
        velocity: &Vector3<f64>,
        position: &Vector3<f64>,
    ) -> nalgebra::SMatrix<f64, 9, 9> {
        let state = self.filter.state();
        let invariant = self.filter.invariant_covariance();
        let sensor = state.rotation.to_rotation_matrix().into_inner();
        let arm = rotation * self.mount.translation.vector;
        let mut map = nalgebra::SMatrix::<f64, 9, 15>::zeros();
        map.fixed_view_mut::<9, 9>(0, 0).fill_with_identity();
        map.fixed_view_mut::<3, 3>(3, 0).copy_from(&-velocity.cross_matrix());
        map.fixed_view_mut::<3, 3>(6, 0).copy_from(&-position.cross_matrix());
        // v_base = v - omega x arm, and omega = R (reading - bias)
        map.fixed_view_mut::<3, 3>(3, 9).copy_from(&(-arm.cross_matrix() * sensor));
        map * invariant * map.transpose()
    }
}

impl Alignment {
    /// Adds a reading; returns `true` at the end of the alignment.
    fn add(&mut self, time: u64, span: u64, rate: &Vector3<f64>, force: &Vector3<f64>) -> bool {
        let begin = *self.begin.get_or_insert(time);
        self.count += 1.0;
        self.rate += rate;
        self.force += force;
        self.done = time.saturating_sub(begin) >= span && self.force.norm() > 0.0;
        self.done
    }
}

impl Legs {
    fn new(robot: &Loaded, config: &BaseEstimatorConfig) -> Result<Self, ConfigError> {
        let model = robot.model.clone();
        let profile = robot.profile.iter().flat_map(|profile| profile.feet.values());
        let feet = profile.map(|foot| {
            let frame = model.frame(&foot.frame).map_err(|error| ConfigError::new(error.to_string()))?;
            let radius = if config.rolling { foot.radius.unwrap_or(0.0) } else { 0.0 };
            Ok(Foot { frame, radius, since: None })
        });
        let feet: Vec<_> = feet.collect::<Result<_, ConfigError>>()?;
        if feet.is_empty() || feet.len() > MAX_FEET {
            let message = format!("the robot has {} feet, expected 1 to {MAX_FEET}", feet.len());
            return Err(
                ConfigError::key("robot", message).advise("name its feet in its profile: `[feet.NAME]`")
            );
        }
        if model.joint_count() > MAX_JOINTS {
            let message =
                format!("the robot has {} joints, expected at most {MAX_JOINTS}", model.joint_count());
            return Err(ConfigError::key("robot", message));
        }
        let mut q = vec![0.0; model.nq()];
        q[6] = 1.0;
        Ok(Self {
            kinematics: Kinematics::new(&model),
            feet,
            jacobian: Matrix6xX::zeros(model.nv()),
            q,
            v: vec![0.0; model.nv()],
            model,
        })
    }

    /// Computes the positions of the feet in the axes of the base, which rotates with `omega` \[rad/s\] in
    /// its own axes.
    fn update_kinematics(&mut self, position: &[f64], velocity: &[f64], omega: &Vector3<f64>) {
        let count = self.model.joint_count();
        self.q[7..].copy_from_slice(&position[..count]);
        self.v[3..6].copy_from_slice(omega.as_slice());
        self.v[6..].copy_from_slice(&velocity[..count]);
        self.kinematics.update_with_velocity(&self.model, &self.q, &self.v);
    }

    /// Returns the velocity of the centre of a round foot that rolls on level ground, in base axes \[m/s\];
    /// `up` is the vertical in these axes.
    fn roll(&self, foot: usize, up: &Vector3<f64>) -> Vector3<f64> {
        let Foot { frame, radius, .. } = self.feet[foot];
        self.kinematics.velocity(&self.model, frame).angular.cross(up) * radius
    }

    /// Returns a foot as seen from the sensor.
    fn contact(&mut self, foot: usize, mount: &Isometry3<f64>, encoder_noise: f64) -> ContactKinematics {
        let Self { model, kinematics, feet, jacobian, .. } = self;
        let frame = feet[foot].frame;
        let centre = kinematics.pose(model, frame).translation.vector;
        kinematics.jacobian(model, frame, Reference::LocalWorldAligned, jacobian);
        let mut spread = Matrix3::zeros();
        for column in jacobian.column_iter().skip(6) {
            let linear = Vector3::new(column[0], column[1], column[2]);
            spread += linear * linear.transpose();
        }
        let turn = mount.rotation.inverse().to_rotation_matrix().into_inner();
        let covariance = turn * spread * turn.transpose() * encoder_noise.powi(2);
        ContactKinematics { position: mount.inverse_transform_point(&centre.into()).coords, covariance }
    }
}

/// Returns the pose of the sensor in the frame of the base.
fn sensor_on_base(config: &BaseEstimatorConfig, robot: &Loaded) -> Result<Isometry3<f64>, ConfigError> {
    let frame = config.mount.frame(&robot.model)?;
    let frame = &robot.model.frames()[frame.index()];
    if frame.body.is_some() || frame.in_world {
        let message = format!("link `{}` is not fixed to the base", frame.name);
        return Err(
            ConfigError::key("mount.frame", message).advise("name the root link or a link fixed to it")
        );
    }
    Ok(frame.placement * config.mount.pose()?)
}

/// Returns the initial position of the base and its initial yaw.
fn start(config: &BaseEstimatorConfig, robot: &Loaded) -> Result<(Vector3<f64>, f64), ConfigError> {
    if let Some(StartPose { position, yaw }) = config.start {
        return Ok((Vector3::from(position), yaw));
    }
    let pose = robot.profile.as_ref().and_then(|profile| profile.base_poses.get(&profile.home));
    let pose = pose.ok_or_else(|| {
        ConfigError::key("start", "the profile has no base pose for the home pose")
            .advise("write `start = { position = [x, y, z] }`")
    })?;
    let pose = pose.isometry();
    Ok((pose.translation.vector, pose.rotation.euler_angles().2))
}
