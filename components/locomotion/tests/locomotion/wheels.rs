//! Wheeled bases: kinematics compared with closed forms and finite differences, limits, odometry,
//! `control.wheels` in a graph.

use std::f64::consts::{FRAC_PI_2, PI};

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_locomotion::WheelController;
use motorium_locomotion::wheels::{
    Odometry as Reckoning, PlanarPose, PlanarTwist, Wheel, WheelBase, WheelDrive, WheelError, WheelLimits,
};

fn wheel(x: f64, y: f64) -> Wheel {
    Wheel { position: [x, y], radius: 0.05, ..Wheel::default() }
}

fn differential() -> WheelBase {
    WheelBase::differential(vec![wheel(0.0, 0.08), wheel(0.0, -0.08)]).unwrap()
}

fn car() -> WheelBase {
    let steered = |y| Wheel { steered: true, ..wheel(0.33, y) };
    WheelBase::ackermann(vec![steered(0.13), steered(-0.13), wheel(0.0, 0.13), wheel(0.0, -0.13)]).unwrap()
}

fn mecanum() -> WheelBase {
    let corners = [(0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15)];
    let rolling = |(x, y): (f64, f64)| Wheel { rollers: -(x * y).signum(), ..wheel(x, y) };
    WheelBase::mecanum(corners.map(rolling).to_vec()).unwrap()
}

fn twist(x: f64, y: f64, yaw: f64) -> PlanarTwist {
    PlanarTwist { x, y, yaw }
}

fn speeds(base: &WheelBase, twist: &PlanarTwist, steering: &[f64]) -> Vec<f64> {
    let mut speeds = vec![0.0; base.wheels().len()];
    base.speeds(twist, steering, &mut speeds);
    speeds
}

#[test]
fn wheel_speeds_match_the_textbook() {
    let found = speeds(&differential(), &twist(0.3, 0.0, 2.0), &[]);
    assert!((found[0] - (0.3 - 0.16) / 0.05).abs() < 1e-12 && (found[1] - (0.3 + 0.16) / 0.05).abs() < 1e-12);
    // forwards, sideways and turning: sums and differences of all four
    for (motion, signs) in [
        (twist(1.0, 0.0, 0.0), [1.0, 1.0, 1.0, 1.0]),
        (twist(0.0, 1.0, 0.0), [-1.0, 1.0, 1.0, -1.0]),
        (twist(0.0, 0.0, 1.0), [-0.35, 0.35, -0.35, 0.35]),
    ] {
        for (found, sign) in speeds(&mecanum(), &motion, &[]).iter().zip(signs) {
            assert!((found - sign / 0.05).abs() < 1e-12, "{motion:?}: {found}");
        }
    }
}

#[test]
fn steered_wheels_share_one_centre_of_rotation() {
    let base = car();
    for curvature in [-1.2, -0.3, 0.4, 1.1] {
        let radius = 1.0 / curvature;
        for wheel in 0..2 {
            let angle = base.steering(wheel, curvature);
            let [x, y] = base.wheels()[wheel].position;
            // from the centre of rotation, on the line of the rear axle, to the wheel
            let along = x * angle.cos() + (y - radius) * angle.sin();
            assert!(along.abs() < 1e-12, "{curvature}: {along}");
            let [low, high] = base.curvatures(wheel, angle, angle);
            assert!((low - curvature).abs() < 1e-12 && (high - curvature).abs() < 1e-12);
        }
        assert_eq!(base.steering(2, curvature), 0.0);
    }
}

#[test]
fn rolling_wheels_do_not_slip() {
    // each wheel's contact point is at rest: the motion of the base there equals the rolled distance, by
    // finite differences
    let cases = [
        (differential(), twist(0.4, 0.0, 1.3), vec![0.0; 2]),
        (car(), twist(0.7, 0.0, 0.5), (0..4).map(|wheel| car().steering(wheel, 0.5 / 0.7)).collect()),
    ];
    for (base, twist, steering) in cases {
        let h = 1e-6;
        let found = speeds(&base, &twist, &steering);
        for (wheel, speed) in base.wheels().iter().zip(&found) {
            let index = base.wheels().iter().position(|other| other == wheel).unwrap();
            let at = |time: f64| {
                let pose = PlanarPose::default().after(&twist.scaled(time));
                let (sin, cos) = pose.yaw.sin_cos();
                let [x, y] = wheel.position;
                [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y]
            };
            let (before, after) = (at(-h), at(h));
            let moved = [0, 1].map(|axis| (after[axis] - before[axis]) / (2.0 * h));
            let (sin, cos) = steering[index].sin_cos();
            assert!((moved[0] * cos + moved[1] * sin - 0.05 * speed).abs() < 1e-8, "{wheel:?}");
            assert!((moved[1] * cos - moved[0] * sin).abs() < 1e-8, "{wheel:?} slips sideways");
        }
    }
}

#[test]
fn displacement_survives_conversion_to_wheels_and_back() {
    for (base, motion) in [
        (differential(), twist(0.3, 0.0, -2.0)),
        (mecanum(), twist(0.3, -0.5, 1.1)),
        (WheelBase::planar(), twist(0.3, -0.5, 1.1)),
        (car(), twist(0.6, 0.0, 0.4)),
    ] {
        let steering: Vec<f64> =
            (0..base.wheels().len()).map(|wheel| base.steering(wheel, motion.yaw / motion.x)).collect();
        let steering = if base == car() { steering } else { Vec::new() };
        let way = base.way(&speeds(&base, &motion, &steering));
        let off = (way.x - motion.x).hypot(way.y - motion.y).hypot(way.yaw - motion.yaw);
        assert!(off < 1e-12, "{motion:?} came back as {way:?}");
    }
}

#[test]
fn base_frame_off_its_axle_swings_and_returns() {
    let base = WheelBase::differential(vec![wheel(-0.2, 0.1), wheel(-0.2, -0.1)]).unwrap();
    let motion = base.feasible(&twist(0.2, 0.7, 1.5));
    assert!((motion.y - 1.5 * 0.2).abs() < 1e-12, "{motion:?}");
    let way = base.way(&speeds(&base, &motion, &[]));
    assert!((way.x - 0.2).abs() < 1e-12 && (way.y - 0.3).abs() < 1e-12 && (way.yaw - 1.5).abs() < 1e-12);
}

#[test]
fn odometry_of_an_arc_is_exact_for_any_period() {
    for steps in [1, 7, 1000] {
        let mut odometry = Reckoning::default();
        let base = differential();
        let motion = twist(0.5, 0.0, 0.5);
        let turned = speeds(&base, &motion.scaled(1.5 * PI / 0.5 / f64::from(steps)), &[]);
        (0..steps).for_each(|_| {
            odometry.advance(&base, &turned);
        });
        let pose = odometry.pose();
        // three quarters of a circle with 1 m radius
        assert!((pose.x + 1.0).abs() < 1e-9 && (pose.y - 1.0).abs() < 1e-9, "{steps}: {pose:?}");
        assert!((pose.yaw - 1.5 * PI).abs() < 1e-9 && (odometry.distance() - 1.5 * PI).abs() < 1e-9);
    }
}

#[test]
fn odometry_covariance_matches_simulated_slip() {
    let (base, slip, steps) = (differential(), 0.004, 200);
    let mut state = 7_u64;
    let mut normal = move || {
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (-2.0 * uniform().ln()).sqrt() * (2.0 * PI * uniform()).cos()
    };
    let turned = speeds(&base, &twist(2.0, 0.0, 1.0).scaled(1.0 / f64::from(steps)), &[]);
    let mut odometry = Reckoning::new(PlanarPose::default(), slip);
    (0..steps).for_each(|_| {
        odometry.advance(&base, &turned);
    });
    let mean = odometry.pose();
    let (mut found, bases) = ([0.0; 3], 2000);
    for _ in 0..bases {
        let mut pose = PlanarPose::default();
        for _ in 0..steps {
            let slipped: Vec<f64> = turned
                .iter()
                .map(|turned| turned + slip * (0.05 * turned).abs().sqrt() * normal() / 0.05)
                .collect();
            pose = pose.after(&base.way(&slipped));
        }
        for (found, off) in found.iter_mut().zip([pose.x - mean.x, pose.y - mean.y, pose.yaw - mean.yaw]) {
            *found += off * off / f64::from(bases);
        }
    }
    for (axis, found) in found.into_iter().enumerate() {
        let stated = odometry.covariance()[(axis, axis)];
        assert!((found / stated - 1.0).abs() < 0.15, "axis {axis}: {found}, stated {stated}");
    }
}

fn limits(count: usize) -> WheelLimits {
    WheelLimits { speed: vec![10.0; count], acceleration: vec![40.0; count] }
}

/// Returns the curvature of the motion given by a base's wheels.
fn curvature(base: &WheelBase, speeds: &[f64]) -> f64 {
    let way = base.way(speeds);
    way.yaw / way.x
}

#[test]
fn velocity_beyond_the_limits_keeps_its_arc() {
    let mut drive = WheelDrive::new(differential(), limits(2), vec![[0.0; 3]; 2]);
    drive.begin(&[0.0; 2]);
    let (wanted, dt) = (twist(2.0, 0.0, 3.0), 1e-3);
    let mut before = drive.speeds().to_vec();
    for step in 0..600 {
        drive.follow(&wanted, 0.0, dt);
        for (now, before) in drive.speeds().iter().zip(&before) {
            assert!(now.abs() <= 10.0 + 1e-12 && (now - before).abs() <= 40.0 * dt + 1e-12, "step {step}");
        }
        assert!((curvature(drive.base(), drive.speeds()) - 1.5).abs() < 1e-9, "step {step}");
        before = drive.speeds().to_vec();
    }
    assert!((before[1] - 10.0).abs() < 1e-9, "the fastest wheel is at its limit: {before:?}");
    // to another arc, and to rest: acceleration limits hold
    for wanted in [twist(0.2, 0.0, -1.0), twist(0.0, 0.0, 0.0)] {
        for _ in 0..600 {
            drive.follow(&wanted, 0.0, dt);
            for (now, before) in drive.speeds().iter().zip(&before) {
                assert!((now - before).abs() <= 40.0 * dt + 1e-12);
            }
            before = drive.speeds().to_vec();
        }
        let way = drive.base().way(&before);
        assert!((way.x - wanted.x).abs() < 1e-9 && (way.yaw - wanted.yaw).abs() < 1e-9, "{way:?}");
    }
}

#[test]
fn car_steers_at_its_limit_and_rolls_without_slip() {
    let steering = vec![[-0.42, 0.42, 3.2], [-0.42, 0.42, 3.2], [0.0; 3], [0.0; 3]];
    let mut drive = WheelDrive::new(car(), limits(4), steering);
    drive.begin(&[0.0; 4]);
    let tightest = drive.curvatures()[1];
    let (dt, mut before) = (1e-3, [0.0; 4]);
    for (wanted, least) in
        [(twist(0.3, 0.0, 0.2), 0.0), (twist(0.3, 0.0, -5.0), 0.0), (twist(-0.2, 0.0, 0.1), 0.0)]
    {
        for step in 0..1500 {
            drive.follow(&wanted, 0.0, dt);
            for (wheel, before) in before.iter_mut().enumerate() {
                let angle = drive.steering()[wheel];
                assert!((angle - *before).abs() <= 3.2 * dt + 1e-9, "step {step} of {wanted:?}");
                assert!(angle.abs() <= 0.42 + 1e-9);
                *before = angle;
            }
            // all wheels move consistently
            let way = drive.base().way(drive.speeds());
            let again = speeds(drive.base(), &way, drive.steering());
            assert!(again.iter().zip(drive.speeds()).all(|(a, b)| (a - b).abs() < 1e-9));
        }
        let way = drive.base().way(drive.speeds());
        let asked = (wanted.yaw / wanted.x).clamp(-tightest, tightest);
        assert!((way.x - wanted.x).abs() < 1e-9 && (way.yaw / way.x - asked).abs() < 1e-9, "{way:?} {least}");
    }
}

#[test]
fn wheels_that_do_not_determine_the_motion_are_rejected() {
    let refused = |base: Result<WheelBase, WheelError>| base.unwrap_err();
    assert_eq!(refused(WheelBase::differential(vec![wheel(0.0, 0.1)])), WheelError::Fixed { found: 1 });
    let one_line = vec![wheel(0.0, 0.1), wheel(0.5, 0.1)];
    assert_eq!(refused(WheelBase::differential(one_line)), WheelError::OneLine);
    assert_eq!(refused(WheelBase::ackermann(vec![wheel(0.0, 0.1), wheel(0.0, -0.1)])), WheelError::Steered);
    let on_axle = Wheel { steered: true, ..wheel(0.0, 0.3) };
    let error = refused(WheelBase::ackermann(vec![wheel(0.0, 0.1), wheel(0.0, -0.1), on_axle]));
    assert_eq!(error, WheelError::OnAxle { wheel: 2 });
    assert_eq!(refused(WheelBase::mecanum(vec![wheel(0.2, 0.1); 4])), WheelError::Mecanum);
    let flat = Wheel { radius: 0.0, ..wheel(0.0, 0.1) };
    assert_eq!(
        refused(WheelBase::differential(vec![flat, wheel(0.0, -0.1)])),
        WheelError::Radius { wheel: 0, found: 0.0 }
    );
}

/// A robot with ideal joints and a wheel controller that follows a velocity.
fn graph(
    robot: &str,
    config: &str,
    joints: usize,
    target: impl FnMut(&Tick) -> Option<TwistTarget> + Send + 'static,
) -> Graph {
    let mut q = vec![0.0; joints];
    let config: toml::Table = format!("config = {config}").parse().unwrap();
    let plant =
        Function::new::<JointCommand, JointState>("plant", "command", "state", move |tick, command| {
            let mut state = JointState::default();
            state.set_count(q.len());
            if let Some(command) = command {
                for (joint, q) in q.iter_mut().enumerate() {
                    // position-controlled joints stop there, velocity-controlled joints continue
                    if command.velocity()[joint] == 0.0 {
                        *q = command.position()[joint];
                    } else {
                        *q += command.velocity()[joint] * tick.dt();
                    }
                    state.velocity_mut()[joint] = command.velocity()[joint];
                }
            }
            state.position_mut().copy_from_slice(&q);
            Some(state)
        });
    Graph::new("wheels-test")
        .robot("rover", robot)
        .with(plant)
        .with(Source::new("operator", "target", target))
        .with(
            Instance::of::<WheelController>("controller")
                .robot("rover")
                .trigger("state")
                .subscribe("joint_state", "state")
                .subscribe("target", "target")
                .publish("joint_command", "command")
                .publish("odometry", "odometry")
                .set("config", config["config"].clone()),
        )
}

fn steady(x: f64, y: f64, yaw: f64) -> impl FnMut(&Tick) -> Option<TwistTarget> + Send + 'static {
    move |_| Some(TwistTarget { linear: [x, y, 0.0], angular: [0.0, 0.0, yaw] })
}

fn number(report: &Report, key: &str) -> f64 {
    report.results["controller"][key].as_f64().unwrap_or_else(|| panic!("{}", report.results["controller"]))
}

#[test]
fn base_in_a_graph_drives_its_arc_without_allocating() {
    let (odometry, command) =
        (Probe::<Odometry>::for_topic("odometry"), Probe::<JointCommand>::for_topic("command"));
    let graph = graph("differential-drive", "{}", 2, steady(0.1, 0.0, 0.5)).with(&odometry).with(&command);
    let report = graph.run("4 s").unwrap();
    let last = *odometry.values().last().unwrap();
    assert!((last.velocity[0] - 0.1).abs() < 1e-9 && (last.yaw_rate - 0.5).abs() < 1e-9, "{last:?}");
    // it started at rest, and its whole path is on the circle with 0.2 m radius
    for odometry in odometry.values() {
        let [x, y] = odometry.position;
        assert!((x.hypot(y - 0.2) - 0.2).abs() < 1e-9, "{odometry:?}");
    }
    assert!((number(&report, "distance_m") - 0.4).abs() < 0.02, "{}", report.results["controller"]);
    assert!(number(&report, "position_deviation_m") > 0.0);
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
    let gains = *command.values().last().unwrap();
    assert_eq!(
        (gains.kd()[0], gains.kp()[0]),
        (0.05, 1.0),
        "the position gain of the wheels is 20/s times their damping"
    );
}

#[test]
fn base_without_a_fresh_target_brakes_within_limits() {
    let (odometry, config) = (Probe::<Odometry>::for_topic("odometry"), "{ acceleration = 0.5 }");
    let mut target = steady(0.15, 0.0, 0.0);
    let silent = move |tick: &Tick| if tick.time() < 1.0 { target(tick) } else { None };
    let report = graph("differential-drive", config, 2, silent).with(&odometry).run("2 s").unwrap();
    let speed = |time: f64| {
        let samples = odometry.samples();
        samples.iter().rev().find(|sample| sample.tick.time() <= time).unwrap().value.velocity[0]
    };
    assert!((speed(1.09) - 0.15).abs() < 1e-9, "a target is valid for 100 ms");
    // 0.15 m/s at 0.5 m/s2: 0.3 s
    assert!((speed(1.25) - 0.075).abs() < 0.01, "{}", speed(1.25));
    assert_eq!(speed(1.9), 0.0);
    let late = number(&report, "steps_without_fresh_target");
    assert!((895.0..=905.0).contains(&late), "{late}");
}

#[test]
fn omnidirectional_base_moves_sideways_while_turning() {
    let (odometry, command) =
        (Probe::<Odometry>::for_topic("odometry"), Probe::<JointCommand>::for_topic("command"));
    let graph = graph("mobile-manipulator", "{}", 9, steady(0.0, 0.2, 0.4)).with(&odometry).with(&command);
    let report = graph.run("4 s").unwrap();
    let last = *odometry.values().last().unwrap();
    assert!((last.velocity[1] - 0.2).abs() < 1e-3 && last.velocity[0].abs() < 1e-3, "{last:?}");
    // a circle of 0.5 m about a point behind
    let [x, y] = last.position;
    let radius = (x + 0.5).hypot(y);
    assert!((radius - 0.5).abs() < 0.02, "{radius}");
    assert!((number(&report, "yaw_rad") - last.yaw).abs() < 1e-9 && last.yaw > 1.3);
    let command = *command.values().last().unwrap();
    assert_eq!(command.velocity()[3..], [0.0; 6]);
    assert!(command.effort()[4].abs() > 10.0, "the arm is held against its weight: {:?}", command.effort());
}

#[test]
fn car_in_a_graph_follows_its_curvature() {
    let odometry = Probe::<Odometry>::for_topic("odometry");
    let report = graph("ackermann", "{}", 6, steady(0.5, 0.0, 0.4)).with(&odometry).run("3 s").unwrap();
    let last = *odometry.values().last().unwrap();
    assert!((last.velocity[0] - 0.5).abs() < 1e-6 && (last.yaw_rate - 0.4).abs() < 1e-6, "{last:?}");
    assert!(number(&report, "distance_m") > 1.2);
}

#[test]
fn undrivable_robots_are_rejected_with_a_reason() {
    for (robot, config, joints, words) in [
        ("panda", "{}", 8, "has no wheels"),
        ("differential-drive", "{ acceleration = 0.0 }", 2, "expected a number from 0.001"),
        ("differential-drive", "{ speed = -1.0 }", 2, "expected a number from"),
        ("differential-drive", "{ wheel_kd = -0.1 }", 2, "expected a number from 0"),
    ] {
        let error =
            graph(robot, config, joints, steady(0.0, 0.0, FRAC_PI_2)).check().expect_err("it is rejected");
        assert!(error.render(false).contains(words), "{}", error.render(false));
    }
}
