//! Comparisons with golden vectors, quantity by quantity.

use motorium_robots::{Dynamics, Kinematics, Model, Momentum, Reference, Wrench};
use nalgebra::{DMatrix, Isometry3, Vector3};
use serde_json::Value;

use super::{Errors, Golden, arrange_matrix, matrix, numbers};

impl Golden {
    pub(super) fn compare_case(
        &self,
        model: &Model,
        gravity: Vector3<f64>,
        case: &Value,
        errors: &mut Errors,
    ) {
        let columns = self.columns(model);
        let n = model.nv();
        let joint_space = |key: &str| {
            let mut arranged = vec![0.0; n];
            columns.iter().zip(numbers(&case[key])).for_each(|(&column, value)| arranged[column] = value);
            arranged
        };
        let q = self.configuration(model, case);
        let (v, a, tau) = (joint_space("v"), joint_space("a"), joint_space("tau"));

        let mut dynamics = Dynamics::new(model);
        let mut out = vec![f64::NAN; n];
        dynamics.gravity(model, &q, gravity, &mut out);
        errors.add("gravity", &out, &joint_space("gravity"));
        dynamics.bias(model, &q, &v, gravity, &mut out);
        errors.add("nle", &out, &joint_space("nle"));
        dynamics.rnea(model, &q, &v, &a, gravity, &mut out);
        errors.add("rnea", &out, &joint_space("rnea"));
        let mut mass = DMatrix::from_element(n, n, f64::NAN);
        dynamics.crba(model, &q, &mut mass);
        errors.add("M", mass.as_slice(), self.mass(&columns, &numbers(&case["M_upper"])).as_slice());
        dynamics.forward(model, &q, &v, &tau, gravity, &mut out).unwrap();
        errors.add("aba", &out, &joint_space("aba"));
        if let Some(outside) = case.get("fext") {
            let frame = model.frame(outside["frame"].as_str().unwrap()).unwrap();
            let wrench = numbers(&outside["wrench_local"]);
            let wrench = Wrench {
                force: Vector3::from_column_slice(&wrench[..3]),
                moment: Vector3::from_column_slice(&wrench[3..]),
            };
            dynamics.rnea_external(model, &q, &v, &a, gravity, &[(frame, wrench)], &mut out);
            errors.add("rnea_fext", &out, &joint_space("rnea_fext"));
            dynamics.forward_external(model, &q, &v, &tau, gravity, &[(frame, wrench)], &mut out).unwrap();
            errors.add("aba_fext", &out, &joint_space("aba_fext"));
        }
        if case.get("Ag").is_some() {
            self.compare_whole(model, gravity, case, (&q, &v, &a), errors);
        }

        let mut moving = Kinematics::new(model);
        moving.update_with_velocity(model, &q, &v);
        let mut accelerating = Kinematics::new(model);
        accelerating.update_with_acceleration(model, &q, &v, &a);
        for (name, golden) in case["frames"].as_object().unwrap() {
            compare_frame(model, [&moving, &accelerating], &columns, (name, golden), errors);
        }
    }

    /// Centre of mass, momentum, energies and the configuration manifold.
    fn compare_whole(
        &self,
        model: &Model,
        gravity: Vector3<f64>,
        case: &Value,
        (q, v, a): (&[f64], &[f64], &[f64]),
        errors: &mut Errors,
    ) {
        let n = model.nv();
        let columns = self.columns(model);
        let mut kinematics = Kinematics::new(model);
        kinematics.update_with_acceleration(model, q, v, a);
        let com = kinematics.centre_of_mass(model);
        errors.add("com", com.position.as_slice(), &numbers(&case["com"]));
        errors.add("vcom", com.velocity.as_slice(), &numbers(&case["vcom"]));
        errors.add("acom", com.acceleration.as_slice(), &numbers(&case["acom"]));
        let mut jacobian = DMatrix::from_element(3, n, f64::NAN);
        kinematics.com_jacobian(model, &mut jacobian);
        errors.add("J_com", jacobian.as_slice(), arrange_matrix(&columns, &case["J_com"]).as_slice());

        let mut dynamics = Dynamics::new(model);
        let mut map = DMatrix::zeros(6, n);
        dynamics.centroidal_map(model, q, &mut map);
        errors.add("Ag", map.as_slice(), arrange_matrix(&columns, &case["Ag"]).as_slice());
        let six = |momentum: Momentum| [momentum.linear.as_slice(), momentum.angular.as_slice()].concat();
        errors.add("hg", &six(dynamics.momentum(model, q, v)), &numbers(&case["hg"]));
        errors.add("dhg", &six(dynamics.momentum_rate(model, q, v, a)), &numbers(&case["dhg"]));
        let drift = dynamics.momentum_rate(model, q, v, &vec![0.0; n]);
        errors.add("Agdot_v", &six(drift), &numbers(&case["Agdot_v"]));
        let scalar = |key: &str| [case[key].as_f64().unwrap()];
        errors.add("kinetic_energy", &[dynamics.kinetic_energy(model, q, v)], &scalar("kinetic_energy"));
        let potential = dynamics.potential_energy(model, q, gravity);
        errors.add("potential_energy", &[potential], &scalar("potential_energy"));

        let dt = self.document["dt"].as_f64().unwrap();
        let step: Vec<f64> = v.iter().map(|v| v * dt).collect();
        let mut next = vec![f64::NAN; model.nq()];
        model.integrate(q, &step, &mut next);
        errors.add("q_integrated", &self.in_their_order(model, &next), &numbers(&case["q_integrated"]));
        let mut difference = vec![f64::NAN; n];
        model.difference(q, &next, &mut difference);
        let mut theirs = vec![0.0; n];
        columns.iter().zip(numbers(&case["q_difference"])).for_each(|(&column, x)| theirs[column] = x);
        errors.add("q_difference", &difference, &theirs);
    }
}

fn compare_frame(
    model: &Model,
    [moving, accelerating]: [&Kinematics; 2],
    columns: &[usize],
    (name, golden): (&str, &Value),
    errors: &mut Errors,
) {
    let frame = model.frame(name).unwrap();
    let pose: Isometry3<f64> = moving.pose(model, frame);
    errors.add("p", pose.translation.vector.as_slice(), &numbers(&golden["p"]));
    let rotation = pose.rotation.to_rotation_matrix();
    errors.add("R", rotation.matrix().transpose().as_slice(), &matrix(&golden["R"]).concat());
    for (reference, jacobian_key, velocity_key) in [
        (Reference::LocalWorldAligned, "J_lwa", "v_lwa"),
        (Reference::Local, "J_local", "v_local"),
        (Reference::World, "J_world", "v_world"),
    ] {
        let Some(theirs) = golden.get(jacobian_key) else { continue };
        let theirs = arrange_matrix(columns, theirs);
        let mut jacobian = DMatrix::from_element(6, model.nv(), f64::NAN);
        moving.jacobian(model, frame, reference, &mut jacobian);
        errors.add(jacobian_key, jacobian.as_slice(), theirs.as_slice());
        let twist = moving.velocity_in(model, frame, reference).vector();
        errors.add(velocity_key, twist.as_slice(), &numbers(&golden[velocity_key]));
    }
    for (key, ours) in [
        ("a_classical_lwa", accelerating.acceleration(model, frame)),
        ("a_spatial_local", accelerating.acceleration_in(model, frame, Reference::Local)),
        ("Jdot_v_lwa", moving.acceleration_in(model, frame, Reference::LocalWorldAligned)),
    ] {
        if let Some(theirs) = golden.get(key) {
            errors.add(key, ours.vector().as_slice(), &numbers(theirs));
        }
    }
}
