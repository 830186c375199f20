//! Velocity tasks, compared with finite differences of their quantities, on fixed and floating bases.

use motorium_control::{
    RobotState,
    tasks::{
        CartesianTask, CentreOfMassTask, ContactTask, GazeTask, MinimumVelocityTask, MomentumTask,
        PostureTask, VelocityTask,
    },
};
use motorium_robots::{Dynamics, FrameId, Momentum, lie::se3};
use nalgebra::{DVector, Isometry3, Point3, Quaternion, Unit, UnitQuaternion, Vector3};

use crate::robots::{Random, Robot};

const H: f64 = 1e-6;

fn state(robot: &Robot) -> RobotState<'_> {
    RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q }
}

/// Each robot in a random state, with a frame at the end of an arm and a direction of motion.
fn cases(seed: u64) -> impl Iterator<Item = (Robot, FrameId, DVector<f64>, Random)> {
    let links = [("panda", "panda_hand_tcp"), ("humanoid", "left_palm"), ("quadruped", "hind_right_foot")];
    links.into_iter().enumerate().flat_map(move |(index, (name, link))| {
        (0..5).map(move |round| {
            let mut random = Random(seed + 100 * index as u64 + round);
            let robot = Robot::new(name).moved(&mut random);
            let frame = robot.model.frame(link).unwrap_or_else(|_| robot.model.frame("base").unwrap());
            let v = DVector::from_fn(robot.model.nv(), |_, _| random.within(1.0));
            (robot, frame, v, random)
        })
    })
}

/// Rate of a quantity of the robot along the velocity `v`.
fn rate<const N: usize>(
    robot: &Robot,
    v: &DVector<f64>,
    figure: impl Fn(&Robot) -> nalgebra::SVector<f64, N>,
) -> nalgebra::SVector<f64, N> {
    let at = |h: f64| {
        let mut next = Robot::new(robot.model.name());
        next.model.integrate(&robot.q, (v * h).as_slice(), &mut next.q);
        next.update();
        figure(&next)
    };
    (at(H) - at(-H)) / (2.0 * H)
}

#[test]
fn pose_error_falls_as_predicted_by_its_rows() {
    for (robot, frame, v, mut random) in cases(1) {
        let pose = |robot: &Robot| robot.kinematics.pose(&robot.model, frame);
        let target = pose(&robot) * Isometry3::from_parts(random.vector(1.0).into(), random.rotation());
        let mut task = CartesianTask::new(&robot.model, frame);
        task.set_target(target);
        task.update(&state(&robot));
        let falls = -rate(&robot, &v, |robot| se3::log(&pose(robot).inv_mul(&target)));
        assert!((task.jacobian() * &v - falls).amax() < 1e-7, "{}", robot.model.name());
    }
}

#[test]
fn centre_of_mass_moves_as_predicted_by_its_rows() {
    for (robot, _, v, _) in cases(2) {
        let centre = |robot: &Robot| {
            let (model, q) = (&robot.model, &robot.q);
            let mut moment = Vector3::zeros();
            // links fixed to the world are ignored, a floating base is not
            if model.base().floating {
                let turned = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
                let inertia = &model.base().inertia;
                moment += (Vector3::new(q[0], q[1], q[2]) + turned * inertia.com) * inertia.mass;
            }
            for (index, body) in model.bodies().iter().enumerate() {
                let place = robot.kinematics.body_pose(index) * Point3::from(body.inertia.com);
                moment += place.coords * body.inertia.mass;
            }
            moment / model.mass()
        };
        let mut task = CentreOfMassTask::new(&robot.model);
        task.set_target(Vector3::new(0.1, 0.2, 0.3));
        task.update(&state(&robot));
        let missing = Vector3::new(0.1, 0.2, 0.3) - centre(&robot);
        assert!((task.error() - missing).amax() < 1e-9, "{}: {} {missing}", robot.model.name(), task.error());
        let moves = rate(&robot, &v, centre);
        assert!((task.jacobian() * &v - moves).amax() < 1e-7, "{}", robot.model.name());
    }
}

#[test]
fn gaze_turns_as_predicted_by_its_rows() {
    for (robot, frame, v, mut random) in cases(3) {
        let (point, axis) = (random.vector(2.0), Unit::new_normalize(random.vector(1.0)));
        let direction = |robot: &Robot| {
            let pose = robot.kinematics.pose(&robot.model, frame);
            pose.rotation.inverse_transform_vector(&(point - pose.translation.vector)).normalize()
        };
        let mut task = GazeTask::new(&robot.model, frame, axis);
        task.set_target(point);
        task.update(&state(&robot));
        let turns = -direction(&robot).cross(&rate(&robot, &v, direction));
        assert!((task.jacobian() * &v - turns).amax() < 1e-6, "{}", robot.model.name());
    }
}

#[test]
fn contact_and_posture_follow_their_residuals() {
    for (robot, frame, v, _) in cases(4) {
        let pose = |robot: &Robot| robot.kinematics.pose(&robot.model, frame);
        let slides = rate(&robot, &v, |robot| pose(robot).translation.vector);
        let mut point = ContactTask::point(&robot.model, frame);
        point.update(&state(&robot));
        assert!((point.cost().residual(v.as_slice()) - slides.norm()).abs() < 1e-7);
        let at = pose(&robot).rotation;
        let turns = rate(&robot, &v, |robot| (pose(robot).rotation * at.inverse()).scaled_axis());
        let mut surface = ContactTask::surface(&robot.model, frame);
        surface.update(&state(&robot));
        let moves = slides.norm().hypot(turns.norm());
        assert!((surface.cost().residual(v.as_slice()) - moves).abs() < 1e-7, "{}", robot.model.name());

        // at the target any joint velocity is an error, but a base velocity is not
        let mut posture = PostureTask::new(&robot.model, robot.model.joints_of_q(&robot.q));
        posture.update(&state(&robot));
        let joints = robot.model.joints_of_v(v.as_slice()).iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!((posture.residual(v.as_slice()) - joints).abs() < 1e-12, "{}", robot.model.name());
        let mut least = MinimumVelocityTask::new(&robot.model);
        least.update(&state(&robot));
        assert!((least.residual(v.as_slice()) - v.norm()).abs() < 1e-12);
        let before: Vec<f64> = v.iter().map(|v| 2.0 * v).collect();
        least.set_target(&before);
        assert!(
            (least.residual(v.as_slice()) - v.norm()).abs() < 1e-12,
            "residual at twice the velocity must equal the residual at rest"
        );
    }
}

#[test]
fn momentum_equals_the_sum_over_moving_bodies() {
    for (robot, _, v, mut random) in cases(5) {
        let of = Dynamics::new(&robot.model).momentum(&robot.model, &robot.q, v.as_slice());
        let target = Momentum { linear: random.vector(1.0), angular: random.vector(1.0) };
        let mut task = MomentumTask::angular(&robot.model).weights(1.0, 1.0);
        task.set_target(target);
        task.update(&state(&robot));
        let missed = (of.linear - target.linear).norm().hypot((of.angular - target.angular).norm());
        assert!(
            (task.residual(v.as_slice()) - missed).abs() < 1e-9 * (1.0 + missed),
            "{}",
            robot.model.name()
        );
    }
}
