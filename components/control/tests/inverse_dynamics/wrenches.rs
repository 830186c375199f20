//! Contact wrenches, minimum accelerations, and rolling wheels.

use motorium_control::tasks::PostureTask;
use motorium_control::tasks::{AccelerationMinimum, ContactWrench, Feedback};
use motorium_control::{
    DifferentialIk, RobotState,
    inverse_dynamics::{AccelerationTask, InverseDynamics},
    tasks::{CartesianSettings, CartesianTask, RollingTask, VelocityTask},
};
use motorium_robots::{BaseMode, Dynamics, Kinematics, LoadOptions, Twist, parse_urdf_with};
use nalgebra::{DVector, Unit, Vector3};

use crate::robots::{Random, Robot};
use crate::tasks::rows;

#[test]
fn a_wrench_task_follows_its_target_summed_over_its_points() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let weight = model.mass() * 9.81;
    let mut control = InverseDynamics::new(model, robot.feet());
    let mut posture = PostureTask::new(model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1e-2);
    let mut push = ContactWrench::new(&control, 0).weights(10.0, 100.0);
    let target =
        Twist { linear: Vector3::new(5.0, -3.0, 0.55 * weight), angular: Vector3::new(1.5, -4.0, 0.5) };
    push.set_target(target);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut push);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap().clone();
    let found = control.wrench(0);
    assert!((found.linear - target.linear).norm() < 1e-2 * weight, "{found:?}");
    assert!((found.angular - target.angular).norm() < 0.1, "{found:?}");
    let x = DVector::from_iterator(
        control.variables(),
        solution.acceleration.iter().chain(solution.forces.iter()).copied(),
    );
    let left = rows(push.cost(), &x);
    assert!((left.fixed_rows::<3>(0) - (found.linear - target.linear)).amax() < 1e-6);
    assert!((left.fixed_rows::<3>(3) - (found.angular - target.angular)).amax() < 1e-6);
    // the derivative by each force is the wrench of a unit of it
    for force in 0..12 {
        let mut one = DVector::zeros(control.variables());
        one[model.nv() + force] = 1.0;
        let step = rows(push.cost(), &(&x + &one)) - &left;
        let sole = robot.kinematics.pose(model, control.contacts().next().unwrap().frame);
        let (u, v) = [(0.1, 0.045), (0.1, -0.045), (-0.1, -0.045), (-0.1, 0.045)][force / 3];
        let unit = sole.rotation * Vector3::ith(force % 3, 1.0);
        let moment = (sole.rotation * Vector3::new(u, v, 0.0)).cross(&unit);
        assert!((step.fixed_rows::<3>(0) - unit).amax() < 1e-6, "force {force}");
        assert!((step.fixed_rows::<3>(3) - moment).amax() < 1e-6, "force {force}");
    }
}

#[test]
fn an_arm_at_zero_acceleration_has_the_bias_torques() {
    let mut random = Random(81);
    let robot = Robot::new("iiwa14").moved(&mut random);
    let model = &robot.model;
    let mut control = InverseDynamics::new(model, Vec::new());
    let mut least = AccelerationMinimum::new(model).weight(1.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut least);
    let solution = control.solve().unwrap();
    assert!(solution.acceleration.amax() < 1e-5, "{}", solution.acceleration);
    let mut bias = vec![0.0; model.nv()];
    Dynamics::new(model).bias(model, &robot.q, &robot.v, Vector3::new(0.0, 0.0, -9.81), &mut bias);
    for (torque, bias) in solution.torque.iter().zip(&bias) {
        assert!((torque - bias).abs() < 1e-4, "{torque} {bias}");
    }
    // the minimised accelerations include the base, which falls freely nevertheless
    let robot = Robot::new("humanoid");
    let mut control = InverseDynamics::new(&robot.model, Vec::new());
    let mut least = AccelerationMinimum::new(&robot.model);
    least.set_share(2, 0.0);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut least);
    let a = &control.solve().unwrap().acceleration;
    assert!((a[2] + 9.81).abs() < 1e-3 && a.rows(3, 3).amax() < 1e-3, "{a}");
    assert!(control.residual(&least) < 1e-2);
}

#[test]
fn the_contact_point_of_a_wheel_moves_as_its_rows_predict() {
    let mut random = Random(83);
    for name in ["panda", "humanoid"] {
        for _ in 0..5 {
            let robot = Robot::new(name).moved(&mut random);
            let model = &robot.model;
            let frame = model.frame(&model.frames().last().unwrap().name).unwrap();
            let (axis, normal) =
                (Unit::new_normalize(random.vector(1.0)), Unit::new_normalize(random.vector(1.0)));
            let mut task = RollingTask::new(model, frame, axis, 0.12).on(normal);
            let state = RobotState { model, kinematics: &robot.kinematics, q: &robot.q };
            VelocityTask::update(&mut task, &state);
            let pose = robot.kinematics.pose(model, frame);
            assert!((task.contact().norm() - 0.12).abs() < 1e-12);
            assert!(task.contact().dot(&(pose.rotation * axis)).abs() < 1e-12);
            assert!(task.contact().dot(&normal) < 0.0, "towards the ground");
            // the wheel point that is now at the contact, shortly afterwards
            let on_wheel = pose.rotation.inverse() * task.contact();
            let v = DVector::from_fn(model.nv(), |_, _| random.within(1.0));
            let at = |h: f64| {
                let (mut q, mut kinematics) = (robot.q.clone(), Kinematics::new(model));
                model.integrate(&robot.q, (&v * h).as_slice(), &mut q);
                kinematics.update(model, &q);
                (kinematics.pose(model, frame) * nalgebra::Point3::from(on_wheel)).coords
            };
            let h = 1e-6;
            let expected = (at(h) - at(-h)) / (2.0 * h);
            assert!((rows(task.cost(), &v) - expected).amax() < 1e-6, "{name}");
            assert!((task.residual(v.as_slice()) - expected.norm()).abs() < 1e-6, "{name}");
        }
    }
}

#[test]
fn a_rolling_wheel_turns_by_distance_over_radius() {
    let urdf = r#"<robot name="cart">
        <link name="body"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <link name="wheel"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="turn" type="continuous"><parent link="body"/><child link="wheel"/><axis xyz="0 1 0"/>
            <limit lower="0" upper="0" velocity="100" effort="1"/></joint>
    </robot>"#;
    let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
    let model = parse_urdf_with(urdf, None, &options).unwrap().model;
    let q = model.neutral();
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &q);
    let state = RobotState { model: &model, kinematics: &kinematics, q: &q };
    let mut wheel = RollingTask::new(&model, model.frame("wheel").unwrap(), Vector3::y_axis(), 0.2);
    // a large weight, so that the body does not tilt to move sideways
    let settings = CartesianSettings { orientation_weight: 100.0, ..CartesianSettings::default() };
    let mut body = CartesianTask::new(&model, model.frame("body").unwrap()).with(settings);
    body.set_moving_target(
        nalgebra::Isometry3::identity(),
        Twist { linear: Vector3::new(1.0, 0.5, 0.0), angular: Vector3::zeros() },
        Twist::zero(),
    );
    let mut ik = DifferentialIk::new(&model).levels(&[3, 6]);
    ik.begin();
    ik.add_task(&state, 0, &mut wheel);
    ik.add_task(&state, 1, &mut body);
    let v = ik.solve().unwrap();
    // moves forwards as requested, but not sideways, where the wheel would slide
    assert!((v[0] - 1.0).abs() < 1e-5 && v[1].abs() < 1e-5, "{v:?}");
    assert!((v[6] - 1.0 / 0.2).abs() < 1e-4, "{v:?}");
}
