//! Series elasticity and backlash compared with closed forms.

use motorium_robots::{Actuator, ActuatorSettings, DriveCommand, Drivetrain, Motor};

/// A motor, a drivetrain, and a load inertia that is otherwise moved only by a torque.
struct Pair {
    actuator: Actuator,
    inertia: f64,
    joint: Motor,
}

impl Pair {
    fn new(drivetrain: Drivetrain, inertia: f64, joint: Motor, limit: f64) -> Self {
        let settings = ActuatorSettings { drivetrain: Some(drivetrain), ..ActuatorSettings::default() };
        let mut actuator = Actuator::new(&settings, limit).unwrap();
        actuator.begin(Motor { position: 0.0, velocity: 0.0 });
        Self { actuator, inertia, joint }
    }

    /// Performs a step after which the joint velocity `x` satisfies
    /// `inertia (x - v) / h = effort(x) + torque`. Returns the effort.
    fn step(&mut self, command: &DriveCommand, torque: f64, h: f64) -> f64 {
        let law = self.actuator.joint_law(command, self.joint, h).unwrap();
        let rate = self.inertia / h;
        let x = |effort: f64, slope: f64| (rate * self.joint.velocity + effort + torque) / (rate + slope);
        // the effort decreases with x, the joint's own line increases: both have the same bounds
        let end = x(law.effort, law.slope).clamp(x(law.low, 0.0), x(law.high, 0.0));
        let effort = law.at(end);
        self.joint.velocity = end;
        self.joint.position += h * end;
        self.actuator.apply_load(command, effort, h);
        effort
    }

    fn motor(&self) -> Motor {
        self.actuator.motor().unwrap()
    }

    fn momentum(&self, motor_inertia: f64) -> f64 {
        motor_inertia * self.motor().velocity + self.inertia * self.joint.velocity
    }
}

const FREE: f64 = f64::INFINITY;

#[test]
fn two_inertias_on_a_spring_oscillate_as_predicted() {
    let (motor_inertia, stiffness, inertia) = (0.2, 180.0, 0.3);
    let drivetrain = Drivetrain { motor_inertia, stiffness, damping: 0.0, backlash: 0.0 };
    let mut pair = Pair::new(drivetrain, inertia, Motor { position: 0.0, velocity: 1.0 }, FREE);
    let h = 1e-5;
    let omega = (stiffness * (1.0 / motor_inertia + 1.0 / inertia)).sqrt();
    let (whole, idle) = (motor_inertia + inertia, DriveCommand::effort(0.0));
    for step in 1..=30_000 {
        let effort = pair.step(&idle, 0.0, h);
        let time = h * f64::from(step);
        // the mean moves uniformly and the twist oscillates: 0.3 s is one and three quarters of a period
        let twist = -(omega * time).sin() / omega;
        assert!(
            (pair.motor().position - pair.joint.position - twist).abs() < 2e-3 / omega + 5e-5,
            "{time} s"
        );
        assert!((effort - stiffness * twist).abs() < 0.02 * stiffness / omega, "{time} s: {effort}");
        assert!((pair.momentum(motor_inertia) - inertia).abs() < 1e-9, "{time} s");
    }
    let centre = (motor_inertia * pair.motor().position + inertia * pair.joint.position) / whole;
    assert!((centre - inertia / whole * 0.3).abs() < 1e-9);
}

#[test]
fn damped_spring_decays_like_an_oscillator() {
    let (motor_inertia, stiffness, damping, inertia) = (0.1, 500.0, 0.4, 0.4);
    let drivetrain = Drivetrain { motor_inertia, stiffness, damping, backlash: 0.0 };
    let mut pair = Pair::new(drivetrain, inertia, Motor { position: 0.01, velocity: 0.0 }, FREE);
    let h = 1e-5;
    let reduced = motor_inertia * inertia / (motor_inertia + inertia);
    let (decay, idle) = (0.5 * damping / reduced, DriveCommand::effort(0.0));
    let omega = (stiffness / reduced - decay * decay).sqrt();
    for step in 1..=20_000 {
        pair.step(&idle, 0.0, h);
        let time = h * f64::from(step);
        let swing = (omega * time).cos() + decay / omega * (omega * time).sin();
        let twist = -0.01 * (-decay * time).exp() * swing;
        let found = pair.motor().position - pair.joint.position;
        assert!((found - twist).abs() < 1e-4, "{time} s: {found}, {twist}");
    }
}

#[test]
fn load_deflects_a_held_joint_by_both_stiffnesses() {
    let drivetrain = Drivetrain { motor_inertia: 0.2, stiffness: 400.0, damping: 3.0, backlash: 0.0 };
    let mut pair = Pair::new(drivetrain, 0.5, Motor::default(), 50.0);
    let hold = DriveCommand { kp: 1000.0, kd: 40.0, ..DriveCommand::effort(0.0) };
    for _ in 0..20_000 {
        pair.step(&hold, -12.0, 1e-3);
    }
    // the drive holds its motor, not the joint
    assert!((pair.motor().position + 12.0 / 1000.0).abs() < 1e-9);
    assert!((pair.joint.position + 12.0 / 1000.0 + 12.0 / 400.0).abs() < 1e-9);
    assert!((pair.actuator.effort() - 12.0).abs() < 1e-6);
}

#[test]
fn motor_limit_applies_behind_a_soft_spring() {
    let drivetrain = Drivetrain { motor_inertia: 0.1, stiffness: 50.0, damping: 1.0, backlash: 0.0 };
    let mut pair = Pair::new(drivetrain, 1e9, Motor::default(), 5.0);
    let far = DriveCommand { position: 10.0, kp: 300.0, kd: 5.0, ..DriveCommand::effort(0.0) };
    let mut effort = 0.0;
    for _ in 0..10_000 {
        effort = pair.step(&far, 0.0, 1e-3);
        assert!(pair.actuator.effort() <= 5.0);
    }
    assert!((effort - 5.0).abs() < 1e-6 && (pair.motor().position - 0.1).abs() < 1e-6, "{effort}");
}

#[test]
fn drive_brakes_its_motor_beyond_the_velocity_limits() {
    let drivetrain = Drivetrain { motor_inertia: 0.1, stiffness: 1e4, damping: 10.0, backlash: 0.0 };
    let mut pair = Pair::new(drivetrain, 0.4, Motor::default(), 20.0);
    let limits = DriveCommand { velocity_limits: [-2.0, 2.0], braking: 400.0, ..DriveCommand::effort(20.0) };
    for _ in 0..4000 {
        pair.step(&limits, 0.0, 1e-3);
    }
    // where the maximum effort has decreased to zero
    assert!((pair.motor().velocity - 2.05).abs() < 1e-6, "{:?}", pair.motor());
    assert!((pair.joint.velocity - 2.05).abs() < 1e-6);
}

const GEAR: Drivetrain = Drivetrain { motor_inertia: 0.2, stiffness: 2e5, damping: 40.0, backlash: 0.02 };

#[test]
fn sides_are_decoupled_within_the_backlash() {
    let mut pair = Pair::new(GEAR, 0.3, Motor { position: 0.0, velocity: 0.5 }, FREE);
    let (h, idle) = (1e-4, DriveCommand::effort(0.0));
    // half the gap at 0.5 rad/s: 20 ms
    for step in 1..=198 {
        assert_eq!(pair.step(&idle, 0.0, h), 0.0, "step {step}");
        assert_eq!((pair.motor().velocity, pair.joint.velocity), (0.0, 0.5));
    }
    let efforts: Vec<f64> = (0..20).map(|_| pair.step(&idle, 0.0, h)).collect();
    assert!(efforts.iter().any(|effort| *effort < 0.0), "they meet: {efforts:?}");
    for _ in 0..20_000 {
        // teeth push and never pull; the total momentum is conserved
        let twist = pair.motor().position - pair.joint.position;
        let effort = pair.step(&idle, 0.0, h);
        assert!(effort == 0.0 || effort.signum() == twist.signum(), "{effort} at {twist}");
        assert!((pair.momentum(0.2) - 0.15).abs() < 1e-12);
    }
}

#[test]
fn joint_behind_a_held_motor_moves_by_the_backlash() {
    let mut pair = Pair::new(GEAR, 0.3, Motor::default(), 1e4);
    let hold = DriveCommand { kp: 1e6, kd: 1e3, ..DriveCommand::effort(0.0) };
    let mut ends = [0.0; 2];
    for (end, torque) in ends.iter_mut().zip([4.0, -4.0]) {
        for _ in 0..20_000 {
            pair.step(&hold, torque, 1e-3);
        }
        *end = pair.joint.position;
    }
    let play = ends[0] - ends[1];
    // the gap, plus twice the load divided by the stiffness of teeth and drive
    let expected = 0.02 + 2.0 * 4.0 * (1.0 / 2e5 + 1.0 / 1e6);
    assert!((play - expected).abs() < 1e-9, "{play}, {expected}");
}

#[test]
fn reversed_motor_crosses_the_gap_before_the_joint_moves() {
    let mut pair = Pair::new(GEAR, 0.3, Motor::default(), FREE);
    let turn = |velocity| DriveCommand { velocity, kd: 500.0, ..DriveCommand::effort(0.0) };
    // a little friction after the gear; otherwise the joint would keep moving
    let mut run = |velocity: f64, steps: usize| {
        for _ in 0..steps {
            let friction = -20.0 * pair.joint.velocity;
            pair.step(&turn(velocity), friction, 1e-4);
        }
        (pair.motor().position, pair.joint.position)
    };
    let (motor, joint) = run(1.0, 5000);
    assert!((motor - joint - 0.01).abs() < 1e-3, "the motor leads by half the gap: {motor}, {joint}");
    let (motor, joint) = run(-1.0, 5000);
    assert!(
        (motor - joint + 0.01).abs() < 1e-3,
        "then it leads by half the gap in the other direction: {motor}, {joint}"
    );
}

#[test]
fn stiff_teeth_and_long_steps_stay_stable() {
    let stiff = Drivetrain { motor_inertia: 0.01, stiffness: 1e8, damping: 0.0, backlash: 1e-3 };
    let mut pair = Pair::new(stiff, 0.3, Motor { position: 0.0, velocity: 3.0 }, FREE);
    let hold = DriveCommand { kp: 100.0, kd: 10.0, ..DriveCommand::effort(0.0) };
    for _ in 0..5000 {
        pair.step(&hold, 2.0, 2e-3);
        assert!(pair.joint.velocity.abs() < 4.0 && pair.joint.position.abs() < 1.0, "{:?}", pair.joint);
    }
    assert!((pair.joint.position - 2.0 / 100.0 - 0.5e-3).abs() < 1e-5, "{:?}", pair.joint);
}

#[test]
fn invalid_drivetrain_is_rejected_by_name() {
    let refused = |change: fn(&mut Drivetrain)| {
        let mut drivetrain = GEAR;
        change(&mut drivetrain);
        let settings = ActuatorSettings { drivetrain: Some(drivetrain), ..ActuatorSettings::default() };
        settings.check().unwrap_err().to_string()
    };
    assert_eq!(
        refused(|it| it.motor_inertia = 0.0),
        "drivetrain.motor_inertia = 0: expected a positive number"
    );
    assert!(refused(|it| it.stiffness = f64::INFINITY).starts_with("drivetrain.stiffness = inf"));
    assert_eq!(refused(|it| it.backlash = -0.1), "drivetrain.backlash = -0.1: expected a number from 0 up");
}
