//! Friction cones compared with pyramids, and the centre of pressure of soles.

use motorium_control::inverse_dynamics::{
    ConstraintName, Contact, ContactShape, FrictionModel, InverseDynamics, InverseDynamicsError,
    InverseDynamicsSettings, MotionState,
};
use motorium_control::tasks::{AccelerationMinimum, Feedback, ForceRegularisation};
use motorium_control::tasks::{CentreOfMassTask, MomentumTask, PostureTask};
use motorium_robots::{BaseMode, Dynamics, Kinematics, LoadOptions, Model, Momentum, parse_urdf_with};
use nalgebra::{UnitQuaternion, Vector3};

use crate::robots::{Random, Robot};

const GRAVITY: f64 = 9.81;

/// A flat block of 8 kg with a small wheel on it, which provides a joint.
const BLOCK: &str = r#"<robot name="block">
    <link name="block">
        <inertial><mass value="7.9"/><inertia ixx="0.1" iyy="0.1" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial>
    </link>
    <link name="wheel">
        <inertial><mass value="0.1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
    </link>
    <link name="sole"/>
    <joint name="spin" type="continuous"><parent link="block"/><child link="wheel"/><axis xyz="0 0 1"/>
        <limit lower="0" upper="0" velocity="10" effort="1"/></joint>
    <joint name="under" type="fixed"><parent link="block"/><child link="sole"/><origin xyz="0 0 -0.02"/></joint>
</robot>"#;

struct Block {
    model: Model,
    kinematics: Kinematics,
    q: Vec<f64>,
    v: Vec<f64>,
}

impl Block {
    /// At rest on a slope with this angle \[rad\] that descends towards `azimuth` \[rad\] in the block's
    /// axes.
    fn on_slope(angle: f64, azimuth: f64) -> Self {
        let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
        let model = parse_urdf_with(BLOCK, None, &options).unwrap().model;
        let mut q = model.neutral();
        // rotated about the horizontal axis perpendicular to the descent: the block slides down towards
        // `azimuth`
        let across = Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0);
        let tilt = UnitQuaternion::from_scaled_axis(across * angle);
        q[3..7].copy_from_slice(tilt.coords.as_slice());
        let v = vec![0.0; model.nv()];
        let mut kinematics = Kinematics::new(&model);
        kinematics.update_with_velocity(&model, &q, &v);
        Self { model, kinematics, q, v }
    }

    /// Force on the sole in its axes if the block can rest with a friction of `mu`.
    fn rests(&self, mu: f64, friction_model: FrictionModel) -> Result<Vector3<f64>, InverseDynamicsError> {
        let sole = self.model.frame("sole").unwrap();
        let shape = ContactShape::Sole { sides: [0.4, 0.4] };
        let contact = Contact { friction: mu, ..Contact::new("sole", sole, shape) };
        let settings = InverseDynamicsSettings { friction_model, relaxation: None, ..Default::default() };
        let mut control = InverseDynamics::with_settings(&self.model, vec![contact], settings);
        let state = MotionState { model: &self.model, kinematics: &self.kinematics, q: &self.q, v: &self.v };
        let mut still = PostureTask::new(&self.model, &[0.0]).feedback(Feedback::critical(5.0)).weight(1.0);
        let mut even = ForceRegularisation::new(&control);
        let mut least = AccelerationMinimum::new(&self.model).weight(1.0);
        control.begin(&state, 1e-3);
        control.add_task(&state, 0, &mut still);
        control.add_task(&state, 0, &mut least);
        control.add_task(&state, 0, &mut even);
        control.solve()?;
        for force in control.solution().forces.as_slice().chunks_exact(3) {
            assert!(force[0].hypot(force[1]) <= mu * force[2] + 1e-5, "{force:?} outside of its cone");
        }
        let turn = self.kinematics.pose(&self.model, sole).rotation.inverse();
        Ok(turn * control.wrench(0).linear)
    }
}

#[test]
fn a_block_rests_on_slopes_up_to_the_friction_angle() {
    let mu = 0.6;
    for eighth in 0..8 {
        let azimuth = f64::from(eighth) * std::f64::consts::FRAC_PI_4;
        // the slope whose tangent is `share` times the friction coefficient
        let block = |share: f64| Block::on_slope((share * mu).atan(), azimuth);
        let steep = block(0.999);
        let force = steep.rests(mu, FrictionModel::Cone).unwrap_or_else(|error| panic!("{azimuth}: {error}"));
        let angle = (0.999 * mu).atan();
        let normal = 8.0 * GRAVITY * angle.cos();
        assert!((force.z - normal).abs() < 1e-3, "{azimuth}: {force} {normal}");
        assert!((force.xy().norm() - 8.0 * GRAVITY * angle.sin()).abs() < 1e-3, "{azimuth}: {force}");
        // friction points uphill
        let uphill = -Vector3::new(azimuth.cos(), azimuth.sin(), 0.0);
        assert!(force.xy().normalize().dot(&uphill.xy()) > 1.0 - 1e-6, "{azimuth}: {force}");
        // with cones the solver does not always prove infeasibility
        let slips = block(1.05).rests(mu, FrictionModel::Cone);
        let none = matches!(slips, Err(InverseDynamicsError::Infeasible(_) | InverseDynamicsError::Solve(_)));
        assert!(none, "{azimuth}: {slips:?}");

        // a pyramid provides full friction on the diagonals and 71 % along the axes
        let most = if eighth % 2 == 1 { 1.0 } else { std::f64::consts::FRAC_1_SQRT_2 };
        assert!(block(0.999 * most).rests(mu, FrictionModel::Pyramid).is_ok(), "{azimuth}");
        let slips = block(1.001 * most).rests(mu, FrictionModel::Pyramid);
        assert!(matches!(slips, Err(InverseDynamicsError::Infeasible(_))), "{azimuth}: {slips:?}");
    }
}

/// Solves for a humanoid with a desired acceleration of its centre of mass. Returns the controller and its
/// cost.
fn pushed(robot: &Robot, aim: Vector3<f64>, model: FrictionModel, mu: f64) -> (InverseDynamics, f64) {
    let mut contacts = robot.feet();
    contacts.iter_mut().for_each(|contact| contact.friction = mu);
    let settings = InverseDynamicsSettings { friction_model: model, relaxation: None, ..Default::default() };
    let mut control = InverseDynamics::with_settings(&robot.model, contacts, settings);
    let mut centre = CentreOfMassTask::new(&robot.model).feedback(Feedback::critical(5.0));
    centre.set_target(robot.kinematics.centre_of_mass(&robot.model).position + aim);
    let mut posture =
        PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(0.1);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut centre);
    control.add_task(&robot.state(), 0, &mut posture);
    let solution = control.solve().unwrap().clone();
    let x: Vec<f64> = solution.acceleration.iter().chain(solution.forces.iter()).copied().collect();
    let problem = control.problem();
    let mut cost = 0.0;
    for j in 0..x.len() {
        cost += problem.gradient[j] * x[j];
        for i in 0..x.len() {
            cost += 0.5 * x[i] * problem.hessian[(i.min(j), i.max(j))] * x[j];
        }
    }
    (control, cost)
}

#[test]
fn the_cost_of_a_cone_lies_between_inner_and_outer_pyramid() {
    let robot = Robot::new("humanoid");
    let mut random = Random(41);
    let mut slipping = 0;
    for case in 0..10 {
        let aim = Vector3::new(random.within(0.3), random.within(0.3), 0.0);
        let mu = 0.15;
        let (control, cone) = pushed(&robot, aim, FrictionModel::Cone, mu);
        let (_, inside) = pushed(&robot, aim, FrictionModel::Pyramid, mu);
        let (_, around) = pushed(&robot, aim, FrictionModel::Pyramid, mu * std::f64::consts::SQRT_2);
        let close = 1e-5 * (1.0 + cone.abs());
        assert!(cone <= inside + close, "case {case}: {cone} {inside}");
        assert!(cone >= around - close, "case {case}: {cone} {around}");
        for force in control.solution().forces.as_slice().chunks_exact(3) {
            let (tangential, most) = (force[0].hypot(force[1]), mu * force[2]);
            assert!(force[2] > -1e-5 && tangential <= most + 1e-5, "case {case}: {force:?}");
            slipping += u32::from(force[2] > 1.0 && tangential > most * (1.0 - 1e-6));
        }
        let mut named = Vec::new();
        control.visit_active(&mut |name| {
            if let ConstraintName::Friction { contact, point } = name {
                named.push(control.point_number(contact, point));
            }
        });
        for (point, force) in control.solution().forces.as_slice().chunks_exact(3).enumerate() {
            let share = force[0].hypot(force[1]) / (mu * force[2]);
            if force[2] > 1.0 && !(0.999..1.0 - 1e-7).contains(&share) {
                assert_eq!(named.contains(&point), share > 0.999, "case {case}, point {point}: {share}");
            }
        }
    }
    assert!(slipping > 10, "{slipping} forces on the surface of their cones");
}

#[test]
fn inactive_contact_has_no_force_within_cones() {
    let robot = Robot::new("humanoid");
    let settings = InverseDynamicsSettings { friction_model: FrictionModel::Cone, ..Default::default() };
    let mut control = InverseDynamics::with_settings(&robot.model, robot.feet(), settings);
    let mut posture =
        PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(1.0);
    control.set_active(1, false);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    assert!(control.solve().unwrap().slack.is_none());
    assert!(control.wrench(1).linear.norm() < 1e-4, "{}", control.wrench(1).linear);
    assert!(control.wrench(0).linear.z > 100.0);
    control.set_active(1, true);
    control.begin(&robot.state(), 1e-3);
    control.add_task(&robot.state(), 0, &mut posture);
    control.solve().unwrap();
    assert!(control.wrench(1).linear.z > 10.0);
}

#[test]
fn the_centre_of_pressure_reaches_but_stays_within_the_margin() {
    let robot = Robot::new("humanoid");
    for margin in [0.0, 0.03] {
        for direction in [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()] {
            let mut contacts = robot.feet();
            contacts.iter_mut().for_each(|contact| contact.margin = margin);
            let mut control = InverseDynamics::new(&robot.model, contacts);
            let mut centre =
                CentreOfMassTask::new(&robot.model).feedback(Feedback::critical(5.0)).weight(10.0);
            centre.set_target(robot.kinematics.centre_of_mass(&robot.model).position + direction * 0.2);
            let mut upright = MomentumTask::angular(&robot.model).rate(5.0).weights(0.0, 1.0);
            let mut posture =
                PostureTask::new(&robot.model, &robot.q[7..]).feedback(Feedback::critical(5.0)).weight(0.01);
            control.begin(&robot.state(), 1e-3);
            control.add_task(&robot.state(), 0, &mut centre);
            control.add_task(&robot.state(), 0, &mut upright);
            control.add_task(&robot.state(), 0, &mut posture);
            assert!(control.solve().unwrap().slack.is_none());
            let mut farthest = 0.0_f64;
            for foot in 0..2 {
                let Some(pressure) = control.centre_of_pressure(foot) else { continue };
                for (place, half) in pressure.iter().zip([0.1, 0.045]) {
                    assert!(place.abs() <= half - margin + 1e-9, "{margin} {direction}: {pressure:?}");
                }
                // the ground pushes forwards, from the rear of the soles
                farthest = farthest.max(-pressure[0] * direction.x);
            }
            // for sideways motion the load moves to the other foot instead
            let edge = direction.x == 0.0 || (farthest - (0.1 - margin)).abs() < 1e-6;
            assert!(edge, "{margin} {direction}: {farthest}");
        }
    }
}

#[test]
fn both_centres_of_pressure_form_the_zero_moment_point() {
    let mut random = Random(43);
    for case in 0..10 {
        let robot = Robot::new("humanoid");
        let model = &robot.model;
        let aim = Vector3::new(random.within(0.03), random.within(0.02), random.within(0.02));
        let (control, _) = pushed(&robot, aim, FrictionModel::Pyramid, 0.6);
        // from the rate of the momentum, independently of the forces: x and y of (c - p) x (m (c'' - g)) + L'
        // are zero
        let a = control.solution().acceleration.as_slice();
        let Momentum { linear, angular } = Dynamics::new(model).momentum_rate(model, &robot.q, &robot.v, a);
        let force = linear + Vector3::new(0.0, 0.0, model.mass() * GRAVITY);
        let centre = robot.kinematics.centre_of_mass(model).position;
        let expected = Vector3::new(
            centre.x - (centre.z * force.x + angular.y) / force.z,
            centre.y - (centre.z * force.y - angular.x) / force.z,
            0.0,
        );
        let (mut moment, mut normal) = (Vector3::zeros(), 0.0);
        for (foot, contact) in control.contacts().enumerate() {
            let Some([x, y]) = control.centre_of_pressure(foot) else { continue };
            let load = control.wrench(foot).linear.z;
            moment += (robot.kinematics.pose(model, contact.frame) * nalgebra::Point3::new(x, y, 0.0)).coords
                * load;
            normal += load;
        }
        let found = moment / normal;
        assert!((found.xy() - expected.xy()).norm() < 1e-6, "case {case}: {found} {expected}");
    }
}
