use motorium::prelude::*;

/// The `config` table.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct CircleConfig {
    /// Centre in the world frame, m.
    centre: [f64; 3],
    /// Radius, m.
    radius: f64,
}

/// Moves the end effector along a circle.
struct Circle {
    target: Output<PoseTarget>,
    speed: Parameter<f64>,
    config: CircleConfig,
    angle: f64,
}

impl Component for Circle {
    const KIND: &'static str = "example.circle";
    const SUMMARY: &'static str = "moves the end effector along a circle";
    type Config = CircleConfig;

    fn declare(config: &CircleConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if !(0.0..=0.5).contains(&config.radius) {
            let message = format!("{} m, expected 0 to 0.5 m", config.radius);
            return Err(ConfigError::key("radius", message));
        }
        declare.output::<PoseTarget>("target", "desired pose of the end effector");
        declare.float("speed", 1.0, -3.0..=3.0, "rad/s", "angular speed along the circle");
        Ok(())
    }

    fn configure(config: CircleConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (target, speed) = (setup.output("target")?, setup.parameter("speed")?);
        Ok(Self { target, speed, config, angle: 0.0 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let (speed, radius) = (self.speed.get(), self.config.radius);
        self.angle += speed * tick.dt();
        let (sin, cos) = self.angle.sin_cos();
        let [x, y, z] = self.config.centre;
        let mut target = self.target.loan()?;
        *target = PoseTarget {
            position: [x + radius * cos, y + radius * sin, z],
            orientation: [1.0, 0.0, 0.0, 0.0], // x y z w: pointing down
            linear_velocity: [-radius * speed * sin, radius * speed * cos, 0.0],
            ..PoseTarget::default()
        };
        target.publish()
    }
}

motorium::main!(Circle);
