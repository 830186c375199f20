//! The mass matrix in frames on the joint axes, compared with the independent inverse dynamics; its factor,
//! compared with a dense factor.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, Dynamics, LoadOptions, MassFactor, MimicMode, Model, catalogue, load_with, parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Vector3};

/// Links `l1`, `l2` ... on joints: parent link, type, rpy and xyz of the origin, axis.
fn robot(joints: &[(usize, &str, &str, &str, &str)], base: BaseMode) -> Model {
    let link = |index: usize| {
        format!(
            "<link name=\"l{index}\"><inertial><origin xyz=\"0.0{index} -0.02 0.1\" rpy=\"0.{index} 0.2 0\"/>\
             <mass value=\"1.{index}\"/><inertia ixx=\"0.02\" ixy=\"0.001\" ixz=\"-0.002\" iyy=\"0.03\" iyz=\"0.003\" \
             izz=\"0.025\"/></inertial></link>"
        )
    };
    let mut text = format!("<robot name=\"r\">{}", link(0));
    for (index, (parent, kind, rpy, xyz, axis)) in joints.iter().enumerate() {
        let child = index + 1;
        text += &link(child);
        text += &format!(
            "<joint name=\"j{child}\" type=\"{kind}\"><parent link=\"l{parent}\"/><child link=\"l{child}\"/>\
             <origin rpy=\"{rpy}\" xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" velocity=\"1\" effort=\"1\"/></joint>"
        );
    }
    text += "</robot>";
    let options = LoadOptions { base, ..LoadOptions::default() };
    parse_urdf_with(&text, None, &options).unwrap().model
}

/// Returns a generic configuration.
fn configuration(model: &Model, shift: f64) -> Vec<f64> {
    let wave: Vec<f64> = (0..model.nv()).map(|i| 1.3 * (1.7 * i as f64 + shift).sin()).collect();
    let mut q = model.neutral();
    model.integrate(&model.neutral(), &wave, &mut q);
    q
}

/// Returns the mass matrix column by column, from the efforts of unit accelerations at rest without gravity.
fn by_inverse_dynamics(model: &Model, q: &[f64]) -> DMatrix<f64> {
    let n = model.nv();
    let mut dynamics = Dynamics::new(model);
    let mut mass = DMatrix::zeros(n, n);
    for column in 0..n {
        let mut a = vec![0.0; n];
        a[column] = 1.0;
        let tau = &mut mass.as_mut_slice()[column * n..][..n];
        dynamics.rnea(model, q, &vec![0.0; n], &a, Vector3::zeros(), tau);
    }
    mass
}

fn assert_mass(model: &Model, what: &str) {
    let n = model.nv();
    let mut dynamics = Dynamics::new(model);
    // in the upper triangle, only entries that may be nonzero are written; in the whole matrix, all entries
    let (mut upper, mut whole) = (DMatrix::zeros(n, n), DMatrix::from_element(n, n, f64::NAN));
    for shift in [0.2, 1.9, -3.0] {
        let q = configuration(model, shift);
        let expected = by_inverse_dynamics(model, &q);
        dynamics.crba(model, &q, &mut whole);
        let error = (&whole - &expected).amax() / expected.amax();
        assert!(error < 1e-13, "{what}: {error:e}\n{whole}{expected}");
        dynamics.crba_upper(model, &q, &mut upper);
        assert_eq!(upper.upper_triangle(), whole.upper_triangle(), "{what}");
        assert_eq!(whole, whole.transpose(), "{what}");
    }
}

#[test]
fn axes_at_any_angle_match_inverse_dynamics() {
    // Angle between the axes: zero, nearly zero, within rounding of parallel, a few degrees, skew,
    // perpendicular, opposite.
    let turns = [
        "0 0 0",
        "1e-9 0 0",
        "1e-15 2e-15 0",
        "0.04 0.02 1",
        "0.06 0 -1",
        "0.7 -0.4 0.2",
        "1.57079632679 0 0",
        "3.14159265359 0 0",
        "-1.5707963267948966 0 0.3",
    ];
    for base in [BaseMode::Fixed, BaseMode::Floating] {
        for first in turns {
            for second in turns {
                for offset in ["0 0 0", "0 0 0.3", "0.2 -0.1 0.3"] {
                    let joints = [
                        (0, "revolute", "0.3 0.1 -0.7", "0.1 0.2 0.3", "0 0 1"),
                        (1, "revolute", first, offset, "0 0 1"),
                        (2, "continuous", second, "0.05 0.2 0", "0 0.6 0.8"),
                        (3, "prismatic", first, offset, "0 0 1"),
                        (4, "revolute", second, "0 0.1 0.2", "-1 0 0"),
                        (5, "revolute", first, offset, "0 0 -1"),
                    ];
                    assert_mass(&robot(&joints, base), &format!("{first} | {second} | {offset}"));
                }
            }
        }
    }
}

#[test]
fn branches_of_any_length_match_inverse_dynamics() {
    // Parents of the links 1, 2 ...: depth first, and across.
    let trees: [&[usize]; 6] = [
        &[0, 0, 0, 0, 0, 0],
        &[0, 1, 2, 3, 4, 5, 6, 7, 8],
        &[0, 1, 2, 2, 4, 1, 0, 7, 8],
        &[0, 1, 1, 1, 1, 5, 6, 7, 8],
        &[0, 1, 2, 3, 4, 2, 6, 7, 8],
        &[0, 0, 1, 2, 3, 4, 1, 2],
    ];
    for base in [BaseMode::Fixed, BaseMode::Floating] {
        for parents in trees {
            let joints: Vec<_> = parents
                .iter()
                .enumerate()
                .map(|(index, &parent)| {
                    let kind = ["revolute", "prismatic", "continuous"][index % 3];
                    (
                        parent,
                        kind,
                        ["0.5 0 0.2", "0 1.1 0"][index % 2],
                        "0.1 0 0.2",
                        ["0 0 1", "0 1 0", "1 0 0"][index % 3],
                    )
                })
                .collect();
            assert_mass(&robot(&joints, base), &format!("{parents:?}"));
        }
    }
}

#[test]
fn every_catalogue_robot_matches_inverse_dynamics() {
    for entry in catalogue() {
        for mimic in [MimicMode::Follow, MimicMode::Independent] {
            for base in [BaseMode::AsFile, BaseMode::Floating] {
                let options = LoadOptions { mimic, base, ..LoadOptions::default() };
                let model = load_with(entry.name, Path::new("."), &options).unwrap().model;
                assert_mass(&model, entry.name);
            }
        }
    }
}

#[test]
fn nan_state_does_not_persist() {
    let model = load_with("panda", Path::new("."), &LoadOptions::default())
        .unwrap()
        .model
        .locked(&[("panda_finger_joint1", 0.0)])
        .unwrap();
    let n = model.nv();
    let (mut dynamics, mut mass) = (Dynamics::new(&model), DMatrix::zeros(n, n));
    dynamics.crba(&model, &vec![f64::NAN; n], &mut mass);
    assert!(mass.iter().any(|entry| entry.is_nan()));
    let q = configuration(&model, 0.4);
    dynamics.crba(&model, &q, &mut mass);
    assert_relative_eq!(mass, by_inverse_dynamics(&model, &q), epsilon = 1e-12);
}

#[test]
fn sparse_factor_solves_like_a_dense_one() {
    for name in ["panda", "quadruped", "humanoid"] {
        let model = load_with(name, Path::new("."), &LoadOptions::default()).unwrap().model;
        let n = model.nv();
        let q = configuration(&model, 0.8);
        let mut dynamics = Dynamics::new(&model);
        let mut mass = DMatrix::zeros(n, n);
        dynamics.crba(&model, &q, &mut mass);
        let dense = mass.clone().cholesky().unwrap();
        let b = DVector::from_fn(n, |i, _| (0.9 * i as f64).cos());
        let scale = dense.inverse().amax();

        let mut x = b.clone();
        dynamics.factor_mass(&model, &q).unwrap().solve(x.as_mut_slice());
        assert_relative_eq!(x, dense.solve(&b), epsilon = 1e-11 * scale);
        let mut factor = MassFactor::new(&model);
        factor.factor(&mass).unwrap();
        let mut inverse = DMatrix::zeros(n, n);
        factor.inverse(&mut inverse);
        assert_relative_eq!(inverse, dense.inverse(), epsilon = 1e-11 * scale);
        // X M = B, with more than one row
        let rows = DMatrix::from_fn(3, n, |i, j| (0.7 * i as f64 + 1.3 * j as f64).sin());
        let mut found = rows.clone();
        factor.solve_right(&mut found);
        assert_relative_eq!(found * mass, rows, epsilon = 1e-10);
    }
}
