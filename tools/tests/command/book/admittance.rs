use motorium::prelude::*;
use motorium_robots::{BasePose, FrameId, Kinematics, Loaded, Model, RobotSource};
use nalgebra::{Isometry3, Vector3};

/// The `config` table.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdmittanceConfig {
    /// Link in whose axes the wrench is measured.
    sensor: String,
    /// Apparent mass, kg.
    mass: f64,
    /// Damping, N s/m.
    damping: f64,
    /// Stiffness of the spring that draws the tool back to where it started, N/m.
    stiffness: f64,
}

/// A mass on a spring and a damper: `mass x'' + damping x' + stiffness x = force`.
struct Spring {
    mass: f64,
    damping: f64,
    stiffness: f64,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl Spring {
    fn advance(&mut self, force: Vector3<f64>, dt: f64) {
        let resistance = self.damping * self.velocity + self.stiffness * self.position;
        self.velocity += (force - resistance) / self.mass * dt;
        self.position += self.velocity * dt;
    }
}

/// Lets the tool of a robot yield to forces at its wrist, without turning.
pub struct Admittance {
    joint_state: Input<JointState>,
    wrench: Input<Wrench>,
    target: Output<PoseTarget>,
    model: Model,
    kinematics: Kinematics,
    sensor: FrameId,
    tool: FrameId,
    spring: Spring,
    /// Pose of the tool at the start, and the first reading in world axes: the weight that the sensor
    /// carries.
    start: Option<(Isometry3<f64>, Vector3<f64>)>,
}

/// The robot of the graph: its file, its profile, its place.
fn load(robot: &RobotReference) -> Result<Loaded, ConfigError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    };
    source.load().map_err(|error| ConfigError::new(error.to_string()))
}

/// The robot with the link of the sensor and the frame of its tool.
fn frames(
    config: &AdmittanceConfig,
    robot: &RobotReference,
) -> Result<(Model, FrameId, FrameId), ConfigError> {
    let loaded = load(robot)?;
    let refused = |error: &dyn std::error::Error| ConfigError::key("robot", error.to_string());
    let tool = loaded.end_effector(None).map_err(|error| refused(&error))?;
    let sensor = loaded.model.frame(&config.sensor);
    let sensor = sensor.map_err(|error| ConfigError::key("sensor", error.to_string()))?;
    Ok((loaded.model, sensor, tool))
}

impl Component for Admittance {
    const KIND: &'static str = "example.admittance";
    const SUMMARY: &'static str = "lets the tool of a robot yield to forces at its wrist";
    type Config = AdmittanceConfig;

    fn declare(config: &AdmittanceConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let AdmittanceConfig { mass, damping, stiffness, .. } = *config;
        for (key, value) in [("mass", mass), ("damping", damping), ("stiffness", stiffness)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError::key(key, format!("{value}, expected a number above 0")));
            }
        }
        let robot = declare.robot().ok_or_else(|| ConfigError::new("it needs a robot"))?;
        frames(config, robot)?;
        declare.input::<JointState>("joint_state", "measured joint state of the robot");
        declare.input::<Wrench>("wrench", "reading of the sensor in its wrist");
        declare.output::<PoseTarget>("target", "desired pose of the tool");
        Ok(())
    }

    fn configure(config: AdmittanceConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (model, sensor, tool) = frames(&config, setup.robot()?)?;
        let AdmittanceConfig { mass, damping, stiffness, .. } = config;
        let (position, velocity) = (Vector3::zeros(), Vector3::zeros());
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            wrench: setup.input("wrench")?,
            target: setup.output("target")?,
            kinematics: Kinematics::new(&model),
            model,
            sensor,
            tool,
            spring: Spring { mass, damping, stiffness, position, velocity },
            start: None,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let (Some(state), Some(wrench)) = (self.joint_state.latest(), self.wrench.latest()) else {
            return Ok(());
        };
        if state.count() != self.model.nq() {
            return Err(StepError::failed("the joint state belongs to another robot"));
        }
        self.kinematics.update(&self.model, state.position());
        let tool = self.kinematics.pose(&self.model, self.tool);
        let sensor = self.kinematics.pose(&self.model, self.sensor);
        let reading = sensor.rotation * Vector3::from(wrench.force);
        let (start, weight) = self.start.get_or_insert((tool, reading));
        // The wrist feels less of what it carries where something else pushes it.
        self.spring.advance(*weight - reading, tick.dt());
        let mut target = self.target.loan()?;
        *target = PoseTarget {
            position: (start.translation.vector + self.spring.position).into(),
            orientation: start.rotation.coords.into(), // x y z w
            linear_velocity: self.spring.velocity.into(),
            ..PoseTarget::default()
        };
        target.publish()
    }
}

#[cfg(test)]
mod tests {
    use motorium::testing::{Graph, Instance, Probe, Source};

    use super::*;

    /// The Panda at rest in its ready pose, in which the axes of its hand are x, -y and -z of the world.
    fn arm() -> Source {
        let ready = [0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398, 0.035];
        Source::new("arm", "arm/joint_state", move |_| {
            let mut state = JointState::default();
            state.set_count(8);
            state.position_mut().copy_from_slice(&ready);
            Some(state)
        })
    }

    /// A sensor that carries a hand of 7 N, which is pushed with 10 N along y of the world after half a
    /// second.
    fn wrist() -> Source {
        Source::new("wrist", "arm/wrench", |tick| {
            let push = if tick.time_ns < 500_000_000 { 0.0 } else { 10.0 };
            Some(Wrench { force: [0.0, push, -7.0], ..Wrench::default() })
        })
    }

    #[test]
    fn tool_yields_along_the_push_by_the_spring() {
        let targets = Probe::<PoseTarget>::for_topic("arm/target");
        let admittance = Instance::of::<Admittance>("admittance")
            .rate("1 kHz")
            .robot("arm")
            .subscribe("joint_state", "arm/joint_state")
            .subscribe("wrench", "arm/wrench")
            .publish("target", "arm/target")
            .config("sensor", "panda_hand")
            .config("mass", 2.0)
            .config("damping", 40.0)
            .config("stiffness", 200.0);
        let graph = Graph::new("admittance").robot("arm", "panda").with(arm()).with(wrist());
        graph.with(admittance).with(&targets).run("3 s").unwrap();

        let targets = targets.values();
        let (first, last) = (targets[0].position, targets[targets.len() - 1].position);
        let moved: Vec<f64> = last.iter().zip(first).map(|(last, first)| last - first).collect();
        // 10 N / (200 N/m), critically damped: it has come to rest.
        assert!((moved[1] - 0.05).abs() < 1e-4, "{moved:?}");
        assert!(moved[0].abs() < 1e-6 && moved[2].abs() < 1e-6, "{moved:?}");
        assert!(targets.iter().all(|target| target.orientation[0].abs() > 0.999), "it does not turn");
    }
}
