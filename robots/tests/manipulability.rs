//! Yoshikawa's measure and its gradient.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, FrameId, Kinematics, LoadOptions, Model, Reference, TaskRows, load_with, parse_urdf_with,
};
use nalgebra::{Matrix6xX, Vector3};

fn configuration(model: &Model, seed: f64) -> Vec<f64> {
    let v: Vec<f64> = (0..model.nv()).map(|i| ((i as f64 + 1.0) * 12.9898 + seed * 78.233).sin()).collect();
    let (start, mut q) = (model.neutral(), model.neutral());
    model.integrate(&start, &v, &mut q);
    q
}

fn manipulability_at(model: &Model, q: &[f64], frame: FrameId, rows: TaskRows) -> f64 {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    kinematics.manipulability(model, frame, rows)
}

#[test]
fn two_link_arm_has_the_textbook_manipulability() {
    let link = |name: &str| format!("<link name=\"{name}\"/>");
    let joint = |name: &str, parent: &str, child: &str, x: f64, kind: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><origin xyz=\"{x} 0 0\"/><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"0 0 1\"/></joint>"
        )
    };
    let text = format!(
        "<robot name=\"r\">{}{}{}{}{}{}{}</robot>",
        link("base"),
        link("one"),
        link("two"),
        link("tip"),
        joint("q1", "base", "one", 0.0, "continuous"),
        joint("q2", "one", "two", 0.5, "continuous"),
        joint("end", "two", "tip", 0.3, "fixed"),
    );
    let model = parse_urdf_with(&text, None, &LoadOptions::default()).unwrap().model;
    let tip = model.frame("tip").unwrap();
    let plane = TaskRows([true, true, false, false, false, false]);
    let mut kinematics = Kinematics::new(&model);
    for q in [[0.3, 0.7], [2.0, -1.9], [0.0, 3.0]] {
        kinematics.update(&model, &q);
        let mut slope = [f64::NAN; 2];
        let measure = kinematics.manipulability_gradient(&model, tip, plane, &mut slope);
        assert_relative_eq!(measure, 0.15 * q[1].sin().abs(), epsilon = 1e-14);
        assert_relative_eq!(slope[0], 0.0, epsilon = 1e-14);
        assert_relative_eq!(slope[1], 0.15 * q[1].cos() * q[1].sin().signum(), epsilon = 1e-13);
    }
    // Two joints never span six dimensions.
    assert_eq!(kinematics.manipulability(&model, tip, TaskRows::POSE), 0.0);
    kinematics.update(&model, &[0.4, 0.0]);
    let mut slope = [f64::NAN; 2];
    assert!(kinematics.manipulability_gradient(&model, tip, plane, &mut slope) < 1e-8);
}

#[test]
fn gradient_matches_finite_differences() {
    let panda = |base| {
        load_with("panda", Path::new("."), &LoadOptions { base, ..LoadOptions::default() }).unwrap().model
    };
    let branching = parse_urdf_with(include_str!("fixtures/branching.urdf"), None, &LoadOptions::default())
        .unwrap()
        .model;
    let position = TaskRows([true, false, true, false, false, false]);
    let cases = [
        (panda(BaseMode::AsFile), "panda_hand_tcp", TaskRows::POSE),
        (panda(BaseMode::AsFile), "panda_hand_tcp", TaskRows::POSITION),
        (panda(BaseMode::Floating), "panda_hand_tcp", TaskRows::ORIENTATION),
        // Mimic joints share a column.
        (branching, "slider", position),
    ];
    for (model, name, rows) in cases {
        let frame = model.frame(name).unwrap();
        let mut kinematics = Kinematics::new(&model);
        for seed in 0..5 {
            let q = configuration(&model, f64::from(seed));
            kinematics.update(&model, &q);
            let mut slope = vec![f64::NAN; model.nv()];
            let measure = kinematics.manipulability_gradient(&model, frame, rows, &mut slope);
            assert_relative_eq!(measure, kinematics.manipulability(&model, frame, rows), epsilon = 1e-15);
            assert!(measure > 1e-4, "{measure}");
            for column in 0..model.nv() {
                let h = 1e-6;
                let mut moved = [q.clone(), q.clone()];
                for (moved, sign) in moved.iter_mut().zip([1.0, -1.0]) {
                    let mut step = vec![0.0; model.nv()];
                    step[column] = sign * h;
                    model.integrate(&q, &step, moved);
                }
                let rise = manipulability_at(&model, &moved[0], frame, rows)
                    - manipulability_at(&model, &moved[1], frame, rows);
                assert_relative_eq!(slope[column], rise / (2.0 * h), epsilon = 1e-7);
            }
            // from the Jacobian itself, without the base columns
            let mut jacobian = Matrix6xX::zeros(model.nv());
            kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut jacobian);
            let picked: Vec<usize> = (0..6).filter(|&row| rows.0[row]).collect();
            let first = model.nv() - model.joint_count();
            let joints = jacobian.columns(first, model.joint_count()).into_owned().select_rows(&picked);
            assert_relative_eq!(
                measure,
                (&joints * joints.transpose()).determinant().sqrt(),
                epsilon = 1e-12
            );
        }
    }
}

#[test]
fn relative_jacobian_is_the_derivative_of_the_pose() {
    for base in [BaseMode::AsFile, BaseMode::Floating] {
        let options = LoadOptions { base, ..LoadOptions::default() };
        let model = load_with("panda", Path::new("."), &options).unwrap().model;
        let (from, to) = (model.frame("panda_link3").unwrap(), model.frame("panda_hand_tcp").unwrap());
        let q = configuration(&model, 3.0);
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let (mut scratch, mut jacobian) = (Matrix6xX::zeros(model.nv()), Matrix6xX::zeros(model.nv()));
        kinematics.relative_jacobian(&model, from, to, &mut scratch, &mut jacobian);
        for column in 0..model.nv() {
            let h = 1e-6;
            let seen = [1.0, -1.0].map(|sign| {
                let (mut step, mut moved) = (vec![0.0; model.nv()], q.clone());
                step[column] = sign * h;
                model.integrate(&q, &step, &mut moved);
                let mut kinematics = Kinematics::new(&model);
                kinematics.update(&model, &moved);
                kinematics.pose(&model, from).inverse() * kinematics.pose(&model, to)
            });
            let linear = (seen[0].translation.vector - seen[1].translation.vector) / (2.0 * h);
            let angular = (seen[0].rotation * seen[1].rotation.inverse()).scaled_axis() / (2.0 * h);
            assert_relative_eq!(jacobian.fixed_view::<3, 1>(0, column).into_owned(), linear, epsilon = 1e-8);
            assert_relative_eq!(jacobian.fixed_view::<3, 1>(3, column).into_owned(), angular, epsilon = 1e-8);
        }
    }
}

#[test]
fn centre_of_mass_jacobian_is_its_derivative() {
    for base in [BaseMode::AsFile, BaseMode::Floating] {
        let options = LoadOptions { base, ..LoadOptions::default() };
        let text = include_str!("fixtures/branching.urdf");
        let model = parse_urdf_with(text, None, &options).unwrap().model;
        let q = configuration(&model, 4.0);
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let mut jacobian = nalgebra::Matrix3xX::zeros(model.nv());
        kinematics.com_jacobian(&model, &mut jacobian);
        for column in 0..model.nv() {
            let h = 1e-6;
            let seen: [Vector3<f64>; 2] = [1.0, -1.0].map(|sign| {
                let (mut step, mut moved) = (vec![0.0; model.nv()], q.clone());
                step[column] = sign * h;
                model.integrate(&q, &step, &mut moved);
                kinematics.update(&model, &moved);
                kinematics.centre_of_mass(&model).position
            });
            let slope = (seen[0] - seen[1]) / (2.0 * h);
            assert_relative_eq!(jacobian.column(column).into_owned(), slope, epsilon = 1e-8);
        }
    }
}

#[test]
fn single_frame_jacobian_matches_a_full_update() {
    for base in [BaseMode::AsFile, BaseMode::Floating] {
        let options = LoadOptions { base, ..LoadOptions::default() };
        let model = load_with("humanoid", Path::new("."), &options).unwrap().model;
        let q = configuration(&model, 2.0);
        let (mut kinematics, mut alone) = (Kinematics::new(&model), Kinematics::new(&model));
        kinematics.update(&model, &q);
        let mut expected = Matrix6xX::zeros(model.nv());
        for link in model.frames() {
            let frame = model.frame(&link.name).unwrap();
            for reference in [Reference::Local, Reference::World, Reference::LocalWorldAligned] {
                kinematics.jacobian(&model, frame, reference, &mut expected);
                let mut found = Matrix6xX::from_element(model.nv(), f64::NAN);
                alone.jacobian_at(&model, &q, frame, reference, &mut found);
                assert_relative_eq!(found, expected, epsilon = 1e-13);
            }
            alone.place_carriers(&model, &q, frame);
            assert_relative_eq!(alone.pose(&model, frame), kinematics.pose(&model, frame), epsilon = 1e-13);
        }
    }
}
