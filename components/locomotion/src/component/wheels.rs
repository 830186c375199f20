//! `control.wheels`: a controller that drives a wheeled base at a target velocity and publishes odometry.

use motorium::prelude::*;
use motorium_control::checks::in_range;
use motorium_control::measured::{check_joint_count, load_robot, period_ns, required_robot};
use nalgebra::Matrix3;

use crate::wheels::{
    BaseKind, Odometry as DeadReckoning, PlanarPose, PlanarTwist, RobotWheels, StartConfig, WheelsConfig,
};

/// A controller that converts a target velocity of the base to commands of its wheels and steering joints;
/// see [`RobotWheels`]. All other joints follow `arm_command`, or hold their initial positions.
///
/// Odometry is computed from the measured wheel angles and continues after a crash. Without a fresh joint
/// state the controller commands nothing; without a fresh target the base brakes.
pub struct WheelController {
    joint_state: Input<JointState>,
    target: Input<TwistTarget>,
    arm: Input<JointCommand>,
    joint_command: Output<JointCommand>,
    odometry: Output<Odometry>,
    speed_factor: Parameter<f64>,
    wheels: RobotWheels,
    /// Joints outside the base.
    others: Vec<usize>,
    reckoning: DeadReckoning,
    config: WheelsConfig,
    start: PlanarPose,
    q: Vec<f64>,
    v: Vec<f64>,
    /// Angles of the wheels and steering joints, with the sign convention of the base.
    angles: Vec<f64>,
    /// `true` if the angles have not changed since the previous sample.
    reckons: bool,
    turned: Vec<f64>,
    checkpoint: Checkpoint,
    last_ns: Option<u64>,
    limited: u64,
    stale: u64,
    without_target: u64,
}

/// Number of checkpoint entries before the wheel angles: pose, distance, covariance.
const REMEMBERED: usize = 13;

impl Component for WheelController {
    const KIND: &'static str = "control.wheels";
    const SUMMARY: &'static str = "drives a wheeled base at a target velocity, with odometry";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = WheelsConfig;

    fn declare(config: &WheelsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        load(config, required_robot(declare)?)?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        declare.input::<TwistTarget>("target", "target velocity of the base, in its own axes");
        declare.optional_input::<JointCommand>("arm_command", "command of the joints outside the base");
        declare.output::<JointCommand>("joint_command", "setpoints and gains of all joints");
        declare
            .output::<Odometry>("odometry", "pose and velocity of the base, from the angles of its wheels");
        declare.float("speed_factor", 1.0, 0.0..=1.0, "", "factor of the target velocity");
        Ok(())
    }

    fn configure(config: WheelsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let wheels = load(&config, &robot)?;
        let (joints, count) = (wheels.position().len(), wheels.wheels().len());
        let StartConfig { position: [x, y], yaw } = config.start;
        let start = PlanarPose { x, y, yaw };
        let mut checkpoint = setup.checkpoint(REMEMBERED + count)?;
        let mut reckoning = DeadReckoning::new(start, config.slip);
        let mut angles = vec![0.0; count];
        let mut reckons = false;
        if let Some(numbers) = checkpoint.resume().filter(|numbers| numbers.len() == REMEMBERED + count) {
            let pose = PlanarPose { x: numbers[0], y: numbers[1], yaw: numbers[2] };
            let covariance = Matrix3::from_row_slice(&numbers[4..REMEMBERED]);
            reckoning = DeadReckoning::resumed(pose, covariance, numbers[3], config.slip);
            angles.copy_from_slice(&numbers[REMEMBERED..]);
            reckons = true;
        }
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            target: setup.input("target")?,
            arm: setup.input("arm_command")?,
            joint_command: setup.output("joint_command")?,
            odometry: setup.output("odometry")?,
            speed_factor: setup.parameter("speed_factor")?,
            q: vec![0.0; joints],
            v: vec![0.0; joints],
            turned: vec![0.0; count],
            angles,
            reckons,
            checkpoint,
            last_ns: None,
            limited: 0,
            stale: 0,
            without_target: 0,
            others: (0..joints).filter(|joint| !wheels.is_of_base(*joint)).collect(),
            wheels,
            reckoning,
            start,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.read_state()? {
            return Ok(());
        }
        let way = self.reckon();
        let unbroken =
            |last| tick.time_ns.saturating_sub(last) <= self.config.state_timeout.ns.max(2 * period_ns(tick));
        if !self.last_ns.is_some_and(unbroken) {
            self.wheels.begin(&self.q);
        }
        self.last_ns = Some(tick.time_ns);
        let target = self.target();
        let follows = self.wheels.follow(&target, &self.q, tick.dt());
        self.limited += u64::from(!follows);
        self.publish_command()?;
        self.remember();
        self.publish_odometry(way)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.reckoning = DeadReckoning::new(self.start, self.config.slip);
        (self.reckons, self.last_ns) = (false, None);
        (self.limited, self.stale, self.without_target) = (0, 0, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let (pose, covariance) = (self.reckoning.pose(), self.reckoning.covariance());
        Some(serde_json::json!({
            "distance_m": self.reckoning.distance(),
            "position_m": [pose.x, pose.y],
            "yaw_rad": pose.yaw,
            "position_deviation_m": (covariance[(0, 0)] + covariance[(1, 1)]).sqrt(),
            "yaw_deviation_rad": covariance[(2, 2)].sqrt(),
            "steps_within_limits": self.limited,
            "steps_without_fresh_state": self.stale,
            "steps_without_fresh_target": self.without_target,
        }))
    }
}

impl WheelController {
    /// Reads the newest joint state. Returns `false` without a fresh one.
    fn read_state(&mut self) -> Result<bool, StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(false) };
        if state.age_ns() > self.config.state_timeout.ns {
            self.stale += 1;
            self.last_ns = None;
            return Ok(false);
        }
        check_joint_count(state.count(), self.q.len())?;
        self.q.copy_from_slice(state.position());
        self.v.copy_from_slice(state.velocity());
        Ok(true)
    }

    /// Integrates the distance travelled since the previous sample and returns the velocity of the base.
    fn reckon(&mut self) -> PlanarTwist {
        let measured = self.wheels.wheels().iter().zip(&mut self.angles).zip(&mut self.turned);
        for ((joint, angle), turned) in measured {
            let now = joint.sign * self.q[joint.index];
            (*turned, *angle) = (now - *angle, now);
        }
        let base = self.wheels.drive().base();
        if base.kind() == BaseKind::Planar {
            let at = &self.angles;
            self.reckoning.set_pose(PlanarPose { x: at[0], y: at[1], yaw: at[2] }, self.reckons);
        } else if self.reckons {
            self.reckoning.advance(base, &self.turned);
        }
        self.reckons = true;
        for (joint, turned) in self.wheels.wheels().iter().zip(&mut self.turned) {
            *turned = joint.sign * self.v[joint.index];
        }
        let way = base.way(&self.turned);
        if base.kind() != BaseKind::Planar {
            return way;
        }
        let (sin, cos) = self.reckoning.pose().yaw.sin_cos();
        PlanarTwist { x: cos * way.x + sin * way.y, y: cos * way.y - sin * way.x, yaw: way.yaw }
    }

    /// Returns the target velocity: zero without a fresh target.
    fn target(&mut self) -> PlanarTwist {
        let fresh = self.target.latest().filter(|target| target.age_ns() <= self.config.target_timeout.ns);
        let Some(target) = fresh else {
            self.without_target += 1;
            return PlanarTwist::default();
        };
        let twist = PlanarTwist { x: target.linear[0], y: target.linear[1], yaw: target.angular[2] };
        twist.scaled(self.speed_factor.get())
    }

    fn publish_command(&mut self) -> Result<(), StepError> {
        let Self { wheels, others, .. } = self;
        let count = self.q.len();
        let mut command = self.joint_command.loan()?;
        command.set_count(count);
        command.position_mut().copy_from_slice(wheels.position());
        command.velocity_mut().copy_from_slice(wheels.velocity());
        command.kp_mut().copy_from_slice(wheels.gains().kp.as_slice());
        command.kd_mut().copy_from_slice(wheels.gains().kd.as_slice());
        command.effort_mut().copy_from_slice(wheels.effort());
        let timeout = self.config.state_timeout.ns;
        let arm = self.arm.latest().filter(|arm| arm.age_ns() <= timeout && arm.count() == count);
        if let Some(arm) = arm {
            for index in others.iter().copied() {
                command.position_mut()[index] = arm.position()[index];
                command.velocity_mut()[index] = arm.velocity()[index];
                command.effort_mut()[index] = arm.effort()[index];
                command.kp_mut()[index] = arm.kp()[index];
                command.kd_mut()[index] = arm.kd()[index];
                wheels.hold(index, arm.position()[index]);
            }
        }
        command.publish()
    }

    fn remember(&mut self) {
        let (pose, covariance) = (self.reckoning.pose(), self.reckoning.covariance());
        let pose = [pose.x, pose.y, pose.yaw, self.reckoning.distance()];
        // symmetric, so columns equal rows
        let numbers = pose.into_iter().chain(covariance.iter().copied()).chain(self.angles.iter().copied());
        self.checkpoint.save(numbers);
    }

    fn publish_odometry(&mut self, velocity: PlanarTwist) -> Result<(), StepError> {
        let pose = self.reckoning.pose();
        let mut odometry = self.odometry.loan()?;
        odometry.position = [pose.x, pose.y];
        odometry.yaw = pose.yaw;
        odometry.velocity = [velocity.x, velocity.y];
        odometry.yaw_rate = velocity.yaw;
        odometry.covariance.copy_from_slice(self.reckoning.covariance().as_slice());
        odometry.distance = self.reckoning.distance();
        odometry.publish()
    }
}

/// Checks the configuration and loads the wheels of a robot.
fn load(config: &WheelsConfig, robot: &RobotReference) -> Result<RobotWheels, ConfigError> {
    let loaded = load_robot(robot)?;
    config.check()?;
    RobotWheels::new((&robot.name, &loaded.model), loaded.profile.as_ref(), config).map_err(|error| {
        let refused = ConfigError::key("robot", error.to_string());
        match error.help() {
            Some(help) => refused.advise(help),
            None => refused,
        }
    })
}

impl WheelsConfig {
    /// Checks the range of every number.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] with the key.
    pub fn check(&self) -> Result<(), ConfigError> {
        if let Some(speed) = self.speed {
            in_range("speed", speed, 1e-6..=1e3)?;
        }
        in_range("acceleration", self.acceleration, 1e-3..=1e3)?;
        in_range("max_lead", self.max_lead, 1e-4..=1e3)?;
        in_range("slip", self.slip, 0.0..=1.0)?;
        for (key, gain) in [("wheel_kp", self.wheel_kp), ("wheel_kd", self.wheel_kd)] {
            if let Some(gain) = gain {
                in_range(key, gain, 0.0..=1e9)?;
            }
        }
        for number in [self.start.position[0], self.start.position[1], self.start.yaw] {
            in_range("start", number, -1e6..=1e6)?;
        }
        Ok(())
    }
}
