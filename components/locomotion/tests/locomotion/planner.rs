//! The planner of `control.mpc` as a library: footholds independent of the heading, forces of the first step,
//! slopes, early and late touchdown.

use std::path::Path;

use motorium_control::inverse_dynamics::MotionState;
use motorium_locomotion::mpc::{
    CentroidalMpc, CentroidalState, Gait, GroundModel, GroundPlane, Landing, LegPlanner, MpcSettings,
    PlanarVelocity, PlannedFoot, PlannerSettings, Reference, Stepping,
};
use motorium_robots::{Kinematics, Loaded, load};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

const FEET: [&str; 4] = ["front_left", "front_right", "hind_left", "hind_right"];

fn quadruped() -> Loaded {
    load("quadruped", Path::new(".")).unwrap()
}

/// Returns the home configuration of the quadruped, rotated about the vertical.
fn turned(robot: &Loaded, heading: f64) -> Vec<f64> {
    let home = robot.profile.as_ref().unwrap().configuration(&robot.model, "standing").unwrap();
    let mut q = home.as_slice().to_vec();
    let base = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
    let base = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * base;
    q[3..7].copy_from_slice(base.coords.as_slice());
    q
}

/// Creates a trot planner for the robot at `rest`.
fn planner(robot: &Loaded, rest: &[f64], step: f64) -> LegPlanner {
    planner_on(robot, rest, step, GroundModel::Level)
}

fn planner_on(robot: &Loaded, rest: &[f64], step: f64, ground: GroundModel) -> LegPlanner {
    let feet = &robot.profile.as_ref().unwrap().feet;
    let feet = FEET.map(|name| PlannedFoot {
        frame: robot.model.frame(&feet[name].frame).unwrap(),
        points: vec![Vector3::zeros()],
        radius: 0.0,
        friction: 0.6,
    });
    let stepping = Stepping::new(Gait::new(0.4, 0.5, vec![0.0, 0.5, 0.5, 0.0]).unwrap());
    let settings = PlannerSettings {
        mpc: MpcSettings { steps: 8, step, ..MpcSettings::default() },
        solve_every: 0.0,
        acceleration: 2.0,
        height: None,
        max_lead: 0.2,
        max_turn: 0.5,
        clearance: 0.05,
        max_capture: 0.1,
        ramp: 0.02,
        ground,
        landing: Landing::default(),
    };
    LegPlanner::new(&robot.model, feet.to_vec(), stepping, settings, rest)
}

/// Plans `count` steps of `dt` seconds for a stationary robot with a forward target velocity.
fn plan(robot: &Loaded, planner: &mut LegPlanner, q: &[f64], (dt, count): (f64, usize)) {
    let v = vec![0.0; robot.model.nv()];
    let mut kinematics = Kinematics::new(&robot.model);
    kinematics.update_with_acceleration(&robot.model, q, &v, &v);
    let state = MotionState { model: &robot.model, kinematics: &kinematics, q, v: &v };
    planner.begin(&state);
    let ahead = PlanarVelocity { linear: Vector2::new(0.4, 0.0), yaw_rate: 0.0 };
    for _ in 0..count {
        planner.step(&state, &ahead, true, dt).unwrap();
    }
}

#[test]
fn footholds_do_not_depend_on_the_initial_heading() {
    let robot = quadruped();
    let targets = |heading: f64| {
        let q = turned(&robot, heading);
        let mut planner = planner(&robot, &q, 0.03);
        plan(&robot, &mut planner, &q, (0.005, 70));
        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading);
        let from_base =
            |foot| back * (planner.target(foot).0.translation.vector - Vector3::new(q[0], q[1], 0.0));
        [0, 1, 2, 3].map(from_base)
    };
    let straight = targets(0.0);
    for heading in [0.5, std::f64::consts::FRAC_PI_2, -2.5] {
        for (foot, target) in targets(heading).iter().enumerate() {
            assert!((target - straight[foot]).norm() < 1e-6, "{heading} rad: {target} {}", straight[foot]);
        }
    }
}

#[test]
fn step_as_long_as_the_horizon_step_uses_its_first_force() {
    let robot = quadruped();
    let q = turned(&robot, 0.0);
    let mut planner = planner(&robot, &q, 0.03);
    // the contacts now change in the second step of the horizon
    plan(&robot, &mut planner, &q, (0.03, 7));
    let standing: Vec<usize> = (0..4).filter(|foot| planner.load(*foot) > 0.0).collect();
    assert_eq!(standing.len(), 2);
    for foot in standing {
        let first = planner.mpc().force(0, foot);
        assert!(first.z > 1.0 && (planner.wrench(foot).linear - first).norm() < 1e-12, "{first}");
        assert!(
            (planner.mpc().force(1, foot) - first).norm() > 1.0,
            "the steps must differ for this test to be valid"
        );
    }
}

#[test]
fn forces_on_a_slope_respect_friction_about_its_normal() {
    let tilt = 0.3_f64;
    let axes = Rotation3::from_axis_angle(&Vector3::y_axis(), -tilt);
    let settings = MpcSettings { mass: 10.0, steps: 6, ..MpcSettings::default() };
    let solve = |friction: f64| {
        let mut mpc = CentroidalMpc::new(settings, &[friction; 2]);
        mpc.set_ground_axes(axes.matrix());
        let place = |along: f64| axes * Vector3::new(along, 0.0, 0.0);
        for step in mpc.horizon_mut() {
            step.position = Vector3::new(0.0, 0.0, 0.3);
            step.points[0] = Some(place(0.2));
            step.points[1] = Some(place(-0.2));
        }
        let state = CentroidalState { position: Vector3::new(0.0, 0.0, 0.3), ..CentroidalState::default() };
        mpc.solve(&state, (&(Matrix3::identity() * 0.2), 0.0), 0.0).unwrap();
        [0, 1].map(|point| mpc.force(0, point))
    };
    // tan 0.3 = 0.309, within 0.6 / sqrt(2)
    let [one, other] = solve(0.6);
    assert!((one + other - Vector3::new(0.0, 0.0, 98.1)).norm() < 1e-6, "{one} {other}");
    // beyond 0.3 / sqrt(2): the force is at that face of the cone
    for force in solve(0.3) {
        let seen = axes.inverse() * force;
        assert!(
            seen.z > 1.0 && (seen.x / seen.z - 0.3 * std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-6,
            "{seen}"
        );
    }
}

/// Returns the quadruped in its home pose on a slope that rises by `tilt` along x, with its base parallel to
/// the slope.
fn on_a_slope(robot: &Loaded, tilt: f64) -> Vec<f64> {
    let mut q = turned(robot, 0.0);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -tilt);
    let place = rotation * Vector3::new(q[0], q[1], q[2]);
    q[..3].copy_from_slice(place.as_slice());
    q[3..7].copy_from_slice(rotation.coords.as_slice());
    q
}

#[test]
fn planner_estimates_the_slope_and_steps_along_it() {
    let robot = quadruped();
    let tilt = 0.15_f64;
    let (level, slope) = (turned(&robot, 0.0), on_a_slope(&robot, tilt));
    let mut planner = planner_on(&robot, &level, 0.03, GroundModel::Fitted { smoothing: 0.2 });
    plan(&robot, &mut planner, &slope, (0.005, 70));
    let ground = *planner.reference().ground();
    assert!((ground.slope() - Vector2::new(tilt.tan(), 0.0)).norm() < 1e-3, "{}", ground.slope());
    // the base is parallel to the slope, as desired
    assert!(planner.state().turn.norm() < 1e-3, "{}", planner.state().turn);
    let (height, feet) = (ground.height(&Vector2::zeros()), 4);
    for foot in 0..feet {
        let place = planner.target(foot).0.translation.vector;
        let above = place.z - ground.height(&place.xy());
        // a swing foot is above it by up to its clearance
        assert!((-1e-3..0.06).contains(&above), "foot {foot}: {above} m above {height}");
    }
    // the reference climbs
    let (_, velocity, _) = planner.reference().after(0.0);
    assert!((velocity.z - tilt.tan() * velocity.x).abs() < 1e-3 && velocity.x > 0.3, "{velocity}");
    // with level ground, the same robot appears rotated
    let mut unaware = planner_on(&robot, &level, 0.03, GroundModel::Level);
    plan(&robot, &mut unaware, &slope, (0.005, 70));
    assert!((unaware.state().turn.norm() - tilt).abs() < 1e-3);
    // a configured normal
    let normal = Vector3::new(-tilt.sin(), 0.0, tilt.cos());
    let mut told = planner_on(&robot, &level, 0.03, GroundModel::Normal(normal));
    plan(&robot, &mut told, &slope, (0.005, 70));
    assert!((told.reference().ground().normal() - normal).norm() < 1e-12);
    assert!((told.reference().ground().height(&Vector2::zeros()) - height).abs() < 1e-3);
}

#[test]
fn base_crossing_a_slope_diagonally_keeps_its_direction() {
    let robot = quadruped();
    let (tilt, heading) = (20.0_f64.to_radians(), 45.0_f64.to_radians());
    let slope = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -tilt);
    let mut q = turned(&robot, heading);
    let place = slope * Vector3::new(q[0], q[1], q[2]);
    let base = slope * UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
    q[..3].copy_from_slice(place.as_slice());
    q[3..7].copy_from_slice(base.coords.as_slice());
    let ground = GroundModel::Normal(slope * Vector3::z());
    let mut planner = planner_on(&robot, &turned(&robot, 0.0), 0.03, ground);
    plan(&robot, &mut planner, &q, (0.005, 70));
    // a robot in its desired pose has no orientation error, at the start and while stepping
    assert!(planner.state().turn.norm() < 1e-9, "{}", planner.state().turn);
    // it moves in its forward direction
    let (ahead, velocity) = (base * Vector3::x(), planner.reference().after(0.0).1);
    assert!((ahead - velocity.normalize()).norm() < 1e-9, "{ahead} {velocity}");
}

#[test]
fn turning_base_stays_parallel_to_the_slope() {
    let normal = Vector3::new(-0.3, 0.2, 1.0).normalize();
    for heading in [0.0, 0.8, 2.0, -2.5] {
        let mut reference = Reference::new(0.3);
        reference.set_ground(GroundPlane::through(&Vector3::zeros(), &normal));
        reference.begin(&Vector3::zeros(), heading);
        let turning = PlanarVelocity { linear: Vector2::new(0.4, 0.0), yaw_rate: 0.7 };
        reference.follow(&turning, f64::INFINITY, 1.0);
        for time in [0.0, 0.6] {
            let base = reference.orientation(time);
            assert!((base * Vector3::z() - normal).norm() < 1e-12);
            assert!((base.matrix().determinant() - 1.0).abs() < 1e-12);
            // it walks straight ahead
            let (ahead, velocity) = (base * Vector3::x(), reference.after(time).1);
            assert!((ahead - velocity.normalize()).norm() < 1e-12, "{ahead} {velocity}");
            let step = 1e-3;
            let turned = reference.orientation(time + step) * reference.orientation(time - step).inverse();
            let (found, expected) = (turned.scaled_axis() / (2.0 * step), reference.angular_velocity(time));
            assert!((found - expected).norm() < 1e-6, "{found} {expected}");
        }
    }
}

/// Runs 5 ms steps of a trot whose first swing moves the feet 1 and 2; `touches` is the contact sensor of
/// foot 1 over time.
fn strides(touches: impl Fn(f64) -> bool) -> (LegPlanner, Vec<(f64, Vector3<f64>)>) {
    let robot = quadruped();
    let q = turned(&robot, 0.0);
    let v = vec![0.0; robot.model.nv()];
    let mut planner = planner(&robot, &q, 0.03);
    let mut kinematics = Kinematics::new(&robot.model);
    kinematics.update_with_acceleration(&robot.model, &q, &v, &v);
    let state = MotionState { model: &robot.model, kinematics: &kinematics, q: &q, v: &v };
    planner.begin(&state);
    let mut seen = Vec::new();
    for step in 0..100 {
        for foot in [0, 2, 3] {
            planner.set_touching(foot, None);
        }
        planner.set_touching(1, Some(touches(0.005 * f64::from(step))));
        planner.step(&state, &PlanarVelocity::default(), true, 0.005).unwrap();
        seen.push((planner.load(1), planner.target(1).0.translation.vector));
    }
    (planner, seen)
}

/// Returns the first step, at or after `from`, in which the foot carries load.
fn carries(seen: &[(f64, Vector3<f64>)], from: usize) -> usize {
    from + seen[from..].iter().position(|(load, _)| *load > 0.0).expect("the foot lands")
}

#[test]
fn early_touchdown_ends_the_swing_unless_much_too_early() {
    let (_, as_planned) = strides(|_| true);
    let lifted = as_planned.iter().position(|(load, _)| *load == 0.0).expect("the foot swings");
    let lifted_at = 0.005 * lifted as f64;
    // it lifts off immediately, and touches down again at 0.7 of its swing of 0.2 s
    let (planner, seen) = strides(|time| time < lifted_at || time >= lifted_at + 0.14);
    assert_eq!(carries(&seen, lifted), lifted + 28);
    assert_eq!(planner.early_and_late(1), [1, 0]);
    // a contact in the first half of the swing belongs to the lift-off: with a constant contact, the swing
    // ends at half of its duration
    assert_eq!(carries(&as_planned, lifted), lifted + 20);
}

#[test]
fn late_foot_is_lowered_until_contact() {
    let (_, as_planned) = strides(|_| true);
    let lifted = as_planned.iter().position(|(load, _)| *load == 0.0).expect("the foot swings");
    let lifted_at = 0.005 * lifted as f64;
    let (planner, seen) = strides(|time| time < lifted_at || time >= lifted_at + 0.23);
    assert_eq!(carries(&seen, lifted), lifted + 46);
    assert_eq!(planner.early_and_late(1), [0, 1]);
    // 25 ms after the end of its swing, at 0.3 m/s
    let (end, later) = (seen[lifted + 40].1.z, seen[lifted + 45].1.z);
    assert!((end - later - 0.3 * 0.025).abs() < 1e-6, "{end} {later}");
    // a foot that never touches counts as standing 80 ms later
    let (_, never) = strides(|time| time < lifted_at);
    assert_eq!(carries(&never, lifted), lifted + 56);
}
