//! Acceleration and velocity limits of joints under commands that the gate accepts.

use motorium::plan::{GateRules, LimitPolicy, ResumeRule, SafeState};
use motorium::region::{LimitKind, Refusal};
use motorium::safety::{Account, Gate, JointLimits, Measured, Offer, Verdict};
use motorium::state::JointCommand;
use motorium_physics::{ArticulatedSimulator, JointSetpoint, Object, ObjectShape, Options, Simulator, World};
use motorium_robots::{Dynamics, Kinematics};
use nalgebra::Vector3;
use std::cell::Cell;
use std::sync::LazyLock;

use crate::panda;

const DT: f64 = 1e-3;
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// Counts limited accelerations.
#[derive(Default)]
struct Counts {
    accelerations: Cell<u64>,
}

impl Account for Counts {
    fn limited(&self, _: usize, kind: LimitKind) {
        self.accelerations.set(self.accelerations.get() + u64::from(kind == LimitKind::Acceleration));
    }

    fn refused(&self, reason: Refusal) {
        panic!("refused: {reason:?}");
    }
}

/// Uniformly distributed in 0 to 1.
fn uniform(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64
}

/// The limits of the catalogue's Panda, as the physics component sets them.
static LIMITS: LazyLock<Vec<JointLimits>> = LazyLock::new(|| {
    let panda = panda::loaded();
    let (model, profile) = (&panda.model, panda.profile.unwrap());
    let (acceleration, effort_rate) =
        (profile.acceleration_limit(model).unwrap(), profile.effort_rate_limit(model).unwrap());
    let gains = profile.gains(model).unwrap();
    let joint = |i: usize| {
        JointLimits {
            lower: model.lower()[i],
            upper: model.upper()[i],
            velocity: model.velocity_limit()[i],
            acceleration: acceleration[i],
            effort_rate: effort_rate[i],
            kp: gains.kp[i],
            kd: gains.kd[i],
            ..JointLimits::new(&model.joint_names()[i])
        }
        .with_effort(model.effort_limit()[i].abs())
    };
    (0..model.joint_count()).map(joint).collect()
});

fn limits() -> Vec<JointLimits> {
    LIMITS.clone()
}

/// A world in which the arm touches nothing, not even itself.
fn free() -> (World, Options) {
    (World::default(), Options { self_collision: false, ..Options::default() })
}

/// A simulated Panda behind a command gate.
struct Arm {
    simulation: ArticulatedSimulator,
    gate: Gate,
    limits: Vec<JointLimits>,
    counts: Counts,
    /// False to remove the acceleration limits from the setpoints.
    bounded: bool,
    dynamics: Dynamics,
    gravity: Vec<f64>,
    /// Largest acceleration and velocity as a fraction of the limits.
    acceleration: f64,
    velocity: f64,
    touched: bool,
}

impl Arm {
    fn new(q: &[f64], (world, options): (World, Options), bounded: bool) -> Self {
        let (model, limits) = (panda::loaded().model, limits());
        let rules =
            GateRules { safe_state: SafeState::Hold, limits: LimitPolicy::Clamp, resume: ResumeRule::AtOnce };
        Self {
            gate: Gate::new(limits.clone(), rules),
            dynamics: Dynamics::new(&model),
            gravity: vec![0.0; limits.len()],
            simulation: ArticulatedSimulator::new(model, world, q, options).unwrap(),
            limits,
            counts: Counts::default(),
            bounded,
            acceleration: 0.0,
            velocity: 0.0,
            touched: false,
        }
    }

    /// Efforts against gravity at the current pose.
    fn gravity(&mut self) -> Vec<f64> {
        let model = self.simulation.articulations()[0].model();
        self.dynamics.gravity(model, self.simulation.configuration(), GRAVITY, &mut self.gravity);
        self.gravity.clone()
    }

    fn step(&mut self, command: &JointCommand) {
        let (q, v) = (self.simulation.positions().to_vec(), self.simulation.velocities().to_vec());
        let mut gravity = |effort: &mut [f64]| effort.fill(0.0);
        let measured = Measured { position: &q, velocity: &v, gravity: &mut gravity };
        self.gate.note_restrained(self.simulation.restrained(), &q, DT, &self.counts);
        let verdict = self.gate.offer(Offer { command, is_new: true, ahead: DT }, measured, DT, &self.counts);
        assert_eq!(verdict, Verdict::Applied);
        self.simulation.commands_mut().copy_from_slice(self.gate.setpoints());
        if !self.bounded {
            for setpoint in self.simulation.commands_mut() {
                (setpoint.max_acceleration, setpoint.arrival_velocity) = (f64::INFINITY, None);
            }
        }
        self.touched |= self.simulation.step(DT).unwrap().near_contact;
        for (i, limits) in self.limits.iter().enumerate() {
            let now = self.simulation.velocities()[i];
            self.acceleration = self.acceleration.max((now - v[i]).abs() / DT / limits.acceleration);
            self.velocity = self.velocity.max(now.abs() / limits.velocity);
        }
    }
}

/// The motion that a random case commands for one joint.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// Jumps to a position within the range, after this number of steps.
    Steps(usize),
    /// A sine of this amplitude and angular frequency, with or without its velocity.
    Wave(f64, f64, bool),
    /// Jumps to a velocity, after this number of steps, without position feedback.
    Velocity(usize),
    /// Random positions and velocities in every step, of this size.
    Noise(f64),
}

#[derive(Debug)]
struct Case {
    start: Vec<f64>,
    kp: f64,
    kd: f64,
    compensated: bool,
    motions: Vec<Motion>,
}

impl Case {
    fn random(seed: &mut u64) -> Self {
        let start = panda::home().into_iter().zip(limits()).map(|(home, limits)| {
            (home + 1.2 * (uniform(seed) - 0.5)).clamp(limits.lower + 0.01, limits.upper - 0.01)
        });
        let start: Vec<f64> = start.collect();
        let motions = start.iter().map(|_| match (4.0 * uniform(seed)) as usize {
            0 => Motion::Steps(50 + (600.0 * uniform(seed)) as usize),
            1 => Motion::Wave(uniform(seed), 30.0 * uniform(seed).powi(2), uniform(seed) < 0.5),
            2 => Motion::Velocity(50 + (600.0 * uniform(seed)) as usize),
            _ => Motion::Noise(10_f64.powf(-4.0 + 4.0 * uniform(seed))),
        });
        let motions = motions.collect();
        let (kp, kd) = (10_f64.powf(-6.0 + 9.0 * uniform(seed)), 100.0 * uniform(seed));
        Self { start, kp, kd, compensated: uniform(seed) < 0.5, motions }
    }

    /// Runs the case for 2 s.
    fn run(&self, world: (World, Options), bounded: bool, mut seed: u64) -> Arm {
        let mut arm = Arm::new(&self.start, world, bounded);
        let mut command = JointCommand::default();
        command.set_count(self.start.len());
        for step in 0..2_000 {
            if self.compensated {
                command.effort_mut().copy_from_slice(&arm.gravity());
            }
            for (i, motion) in self.motions.iter().enumerate() {
                let limits = &arm.limits[i];
                let noise = [uniform(&mut seed), uniform(&mut seed)].map(|number| 2.0 * number - 1.0);
                let range = limits.upper - limits.lower;
                let (kp, kd) = (if matches!(motion, Motion::Velocity(_)) { 0.0 } else { self.kp }, self.kd);
                let (position, velocity) = match *motion {
                    Motion::Steps(every) if step % every == 0 => {
                        (limits.lower + range * 0.5 * (1.0 + noise[0]), 0.0)
                    }
                    Motion::Velocity(every) if step % every == 0 => (0.0, limits.velocity * noise[0]),
                    Motion::Steps(_) | Motion::Velocity(_) => (command.position()[i], command.velocity()[i]),
                    Motion::Wave(amplitude, omega, stated) => {
                        let phase = omega * step as f64 * DT;
                        let velocity = if stated { amplitude * omega * phase.cos() } else { 0.0 };
                        (self.start[i] + amplitude * phase.sin(), velocity)
                    }
                    Motion::Noise(size) => (self.start[i] + size * noise[0], 10.0 * size * noise[1]),
                };
                command.position_mut()[i] = position;
                command.velocity_mut()[i] = velocity;
                command.kp_mut()[i] = kp;
                command.kd_mut()[i] = kd;
            }
            arm.step(&command);
        }
        arm
    }
}

#[test]
fn random_commands_keep_acceleration_and_velocity_limits() {
    let (mut seed, mut beyond, mut without) = (7, Vec::new(), 0);
    let mut worst = [0.0_f64; 2];
    for index in 0..200 {
        let case = Case::random(&mut seed);
        let run = |bounded: bool| case.run(free(), bounded, index);
        let is_beyond = |arm: &Arm| arm.acceleration > 1.1 || arm.velocity > 1.05;
        let arm = run(true);
        worst = [worst[0].max(arm.acceleration), worst[1].max(arm.velocity)];
        if is_beyond(&arm) {
            beyond
                .push(format!("{index}: {} and {} of the limits, {case:?}", arm.acceleration, arm.velocity));
        }
        without += usize::from(is_beyond(&run(false)));
    }
    println!("at most {worst:?} of the limits; beyond without the bound: {without} of 200");
    assert!(beyond.is_empty(), "{} of 200 are beyond: {beyond:#?}", beyond.len());
    assert!(without > 150, "the cases reach the limits: {without} of 200 without the bound");
}

/// The feed-forward of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FeedForward {
    /// Gravity at the measured pose, and no velocities.
    Gravity,
    /// Gravity at the measured pose, and velocities.
    Velocity,
    /// The inverse dynamics of the commanded motion, and velocities.
    Dynamics,
}

#[test]
fn random_commands_do_not_diverge_in_self_collisions() {
    let (mut seed, mut touched) = (7, 0);
    for index in 0..60 {
        let case = Case::random(&mut seed);
        // A step fails if a joint diverges.
        touched += usize::from(case.run((World::default(), Options::default()), true, index).touched);
    }
    assert!(touched > 10, "{touched} of 60 collide");
}

/// Runs sines that reach this share of the velocity and acceleration limits in all joints. Returns the
/// largest lag in the last 4 s \[rad\], and the number of limited accelerations.
fn lag(share: f64, feed_forward: FeedForward, bounded: bool) -> (f64, u64) {
    let limits = limits();
    let mut centre = panda::home();
    for (centre, limits) in centre.iter_mut().zip(&limits).take(7) {
        *centre = 0.5 * (limits.lower + limits.upper);
    }
    let mut arm = Arm::new(&centre, free(), bounded);
    let mut command = JointCommand::default();
    command.set_count(centre.len());
    let (mut lag, mut acceleration) = (0.0_f64, vec![0.0; centre.len()]);
    for step in 0..8_000 {
        let time = f64::from(step) * DT;
        // The amplitude rises smoothly for 4 s.
        let part = (time / 4.0).min(1.0);
        let rise = part * part * (3.0 - 2.0 * part);
        let rising = [6.0 * part * (1.0 - part) / 4.0, 6.0 * (1.0 - 2.0 * part) / 16.0];
        let [rate, curvature] = if time < 4.0 { rising } else { [0.0; 2] };
        for (i, limits) in limits.iter().enumerate() {
            let omega = if i < 7 { limits.acceleration / limits.velocity } else { 1.0 };
            let amplitude = if i < 7 { share * limits.velocity / omega } else { 0.0 };
            let (sin, cos) = (omega * time).sin_cos();
            command.position_mut()[i] = centre[i] + amplitude * rise * sin;
            command.velocity_mut()[i] = amplitude * (rate * sin + rise * omega * cos);
            acceleration[i] =
                amplitude * ((curvature - rise * omega * omega) * sin + 2.0 * rate * omega * cos);
            command.kp_mut()[i] = limits.kp;
            command.kd_mut()[i] = limits.kd;
            if i < 7 && time > 4.0 {
                lag = lag.max((command.position()[i] - arm.simulation.positions()[i]).abs());
            }
        }
        if feed_forward == FeedForward::Dynamics {
            let model = arm.simulation.articulations()[0].model().clone();
            let (q, v) = (command.position().to_vec(), command.velocity().to_vec());
            arm.dynamics.rnea(&model, &q, &v, &acceleration, GRAVITY, command.effort_mut());
        } else {
            let gravity = arm.gravity();
            command.effort_mut().copy_from_slice(&gravity);
        }
        if feed_forward == FeedForward::Gravity {
            command.velocity_mut().fill(0.0);
        }
        arm.step(&command);
    }
    assert!(!bounded || arm.acceleration <= 1.1, "{} of the limit", arm.acceleration);
    (lag, arm.counts.accelerations.get())
}

#[test]
fn sines_at_the_limits_are_followed() {
    for feed_forward in [FeedForward::Gravity, FeedForward::Velocity, FeedForward::Dynamics] {
        for share in [0.7, 0.9, 1.0] {
            let [(with, count), (without, _)] =
                [true, false].map(|bounded| lag(share, feed_forward, bounded));
            println!(
                "{share} of the limits, {feed_forward:?}: lag {with:.4} rad, {without:.4} without, {count} limited"
            );
            // Without the effort of the motion the drives ask for more than the limits to follow it.
            let more = match (feed_forward, share) {
                (FeedForward::Dynamics, _) | (_, 0.7) => 1e-3,
                (_, 0.9) => 0.05,
                _ => 0.1,
            };
            assert!(with < without + more, "{share}, {feed_forward:?}: {with} rad, {without} without");
        }
    }
}

/// Returns the largest overshoot of steps of 1 rad of each joint with the profile's gains, and the time until
/// all joints stay within 10 mrad.
fn overshoot(bounded: bool) -> (f64, f64) {
    let home = panda::home();
    let mut arm = Arm::new(&home, free(), bounded);
    let limits = arm.limits.clone();
    let mut command = JointCommand::default();
    command.set_count(home.len());
    let (mut overshoot, mut settled) = (0.0_f64, 0.0);
    for step in 0..4_000 {
        let effort = arm.gravity();
        command.effort_mut().copy_from_slice(&effort);
        for (i, home) in home.iter().enumerate().take(7) {
            let sign = if i % 2 == 0 { 1.0 } else { -0.5 };
            command.position_mut()[i] = home + sign;
            let ahead = sign.signum() * (arm.simulation.positions()[i] - home - sign);
            overshoot = overshoot.max(ahead);
            if ahead.abs() > 0.01 {
                settled = f64::from(step) * DT;
            }
        }
        command.position_mut()[7] = home[7];
        for (i, limits) in limits.iter().enumerate() {
            command.kp_mut()[i] = limits.kp;
            command.kd_mut()[i] = limits.kd;
        }
        arm.step(&command);
    }
    assert!(!bounded || arm.acceleration <= 1.1, "{} of the limit", arm.acceleration);
    (overshoot, settled)
}

#[test]
fn steps_within_acceleration_limits_do_not_overshoot() {
    let ((with, settled), (without, before)) = (overshoot(true), overshoot(false));
    println!(
        "overshoot {with:.4} rad, settled after {settled} s; without the bound {without:.4} rad, {before} s"
    );
    assert!(with < 0.01, "{with} rad");
}

/// Pushes the hand down on a block with the shoulder. Returns the largest effort of the drives as a fraction
/// of their limits.
fn push(bounded: bool) -> f64 {
    let (model, home) = (panda::loaded().model, panda::home());
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &home);
    let tip = kinematics.pose(&model, model.frame("panda_hand_tcp").unwrap()).translation;
    let height = tip.z - 0.05;
    let block = Object {
        name: "block".to_owned(),
        shape: ObjectShape::Box { size: [0.3, 0.3, height] },
        mass: None,
        position: [tip.x, tip.y, 0.5 * height],
        ..Object::default()
    };
    let world = World { objects: vec![block], ..World::default() };
    let mut arm = Arm::new(&home, (world, Options::default()), bounded);
    let limits = arm.limits.clone();
    let mut command = JointCommand::default();
    command.set_count(home.len());
    let mut largest = 0.0_f64;
    for step in 0..1_500 {
        let effort = arm.gravity();
        command.effort_mut().copy_from_slice(&effort);
        command.position_mut().copy_from_slice(&home);
        let time = f64::from(step) * DT;
        command.position_mut()[1] += 0.2 * time.min(1.0);
        for (i, limits) in limits.iter().enumerate() {
            command.kp_mut()[i] = 100.0;
            command.kd_mut()[i] = 10.0;
            let effort = arm.simulation.efforts()[i].abs() / limits.effort;
            largest = if i < 7 { largest.max(effort) } else { largest };
        }
        arm.step(&command);
    }
    assert!(arm.touched, "the hand reaches the block");
    largest
}

#[test]
fn a_bounded_arm_does_not_push_against_what_stops_it() {
    let (with, without) = (push(true), push(false));
    println!("largest effort {with:.3} of the limits, {without:.3} without the bound");
    assert!(with < 1.1 * without, "{with} of the limits, {without} without the bound");
}

#[test]
fn motion_within_the_limits_is_equal_to_the_bit() {
    let run = |bounded: bool| {
        let home = panda::home();
        let mut arm = Arm::new(&home, free(), bounded);
        let limits = arm.limits.clone();
        let mut command = JointCommand::default();
        command.set_count(home.len());
        for step in 0..2_000 {
            let effort = arm.gravity();
            command.effort_mut().copy_from_slice(&effort);
            for i in 0..home.len() {
                let phase = 2.0 * f64::from(step) * DT;
                let amplitude = if i < 7 { 0.3 } else { 0.0 };
                command.position_mut()[i] = home[i] + amplitude * (1.0 - phase.cos());
                command.velocity_mut()[i] = 2.0 * amplitude * phase.sin();
                command.kp_mut()[i] = limits[i].kp;
                command.kd_mut()[i] = limits[i].kd;
            }
            arm.step(&command);
        }
        assert_eq!(arm.counts.accelerations.get(), 0);
        assert!(arm.acceleration < 1.0 && arm.acceleration > 0.1, "{} of the limit", arm.acceleration);
        let numbers = arm.simulation.positions().iter().chain(arm.simulation.efforts());
        numbers.map(|number| number.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn pure_efforts_are_not_bounded() {
    let home = panda::home();
    let mut arm = Arm::new(&home, free(), true);
    let mut command = JointCommand::default();
    command.set_count(home.len());
    arm.step(&command);
    assert!(arm.gate.setpoints().iter().all(|setpoint| *setpoint
        == JointSetpoint {
            min_velocity: setpoint.min_velocity,
            max_velocity: setpoint.max_velocity,
            ..JointSetpoint::default()
        }));
    (0..100).for_each(|_| arm.step(&command));
    assert!(arm.acceleration > 1.1, "the arm falls: {} of the limit", arm.acceleration);
}
