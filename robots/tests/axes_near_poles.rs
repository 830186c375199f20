//! Robots whose joint axes are at or nearly at a coordinate axis: CAD programs write `0 1.22465e-16 -1` for
//! -z.
//!
//! Random trees are compared with closed forms of the file's own numbers: Rodrigues' rotation about the axis
//! as written, one joint after the other from the root. Trees and a real robot are compared with Pinocchio,
//! by vectors written by `golden/axes.py`.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

use crate::golden::Golden;
use motorium_robots::{
    BaseMode, Dynamics, Kinematics, LoadOptions, MimicMode, Model, PackagePath, Reference, parse_urdf,
    parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use proptest::prelude::*;
use serde_json::Value;

const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

/// Tilts of an axis away from its pole \[rad\].
const TILTS: [f64; 20] = [
    0.0,
    1e-18,
    1e-17,
    1e-16,
    1.22465e-16,
    1e-15,
    1e-14,
    1e-13,
    1e-12,
    1e-11,
    1e-10,
    1e-9,
    1e-8,
    3e-8,
    1e-7,
    1e-6,
    1e-5,
    1e-3,
    1e-1,
    0.7,
];

/// One joint and the link it carries, with the numbers of the file.
#[derive(Clone, Debug)]
struct Part {
    /// Parent link: 0 is the root, part `i` carries link `i + 1`.
    parent: usize,
    prismatic: bool,
    xyz: Vector3<f64>,
    rpy: Vector3<f64>,
    axis: Vector3<f64>,
    mass: f64,
    com: Vector3<f64>,
    /// Diagonal of the inertia about the centre of mass, in the link's axes.
    inertia: Vector3<f64>,
    q: f64,
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(|[x, y, z]| Vector3::new(x, y, z))
}

/// A pole, tilted in a random direction and scaled: axes need not be unit vectors.
fn axis() -> impl Strategy<Value = Vector3<f64>> {
    (0..6_usize, 0..TILTS.len(), -3.2..3.2_f64, prop_oneof![3 => Just(1.0), 1 => 0.1..10.0_f64]).prop_map(
        |(pole, tilt, direction, length)| {
            let sign = if pole < 3 { -1.0 } else { 1.0 };
            let (first, second) = (Vector3::ith((pole + 1) % 3, 1.0), Vector3::ith((pole + 2) % 3, 1.0));
            let across = first * direction.cos() + second * direction.sin();
            (Vector3::ith(pole % 3, sign) + across * TILTS[tilt]) * length
        },
    )
}

fn part() -> impl Strategy<Value = Part> {
    let right = prop_oneof![Just(0.0), Just(FRAC_PI_2), Just(PI)];
    let rpy = prop_oneof![
        vector(3.0),
        [right.clone(), right.clone(), right].prop_map(|[x, y, z]| Vector3::new(x, y, z)),
    ];
    let body = (0.1..3.0_f64, vector(0.2), [0.01..0.03_f64, 0.01..0.03, 0.01..0.03]);
    (0..100_usize, prop::bool::weighted(0.25), vector(0.5), rpy, axis(), body, -3.0..3.0_f64).prop_map(
        |(parent, prismatic, xyz, rpy, axis, (mass, com, [x, y, z]), q)| {
            let inertia = Vector3::new(x, y, z);
            Part { parent, prismatic, xyz, rpy, axis, mass, com, inertia, q }
        },
    )
}

/// Trees of one to ten joints, most of them chains.
fn tree() -> impl Strategy<Value = Vec<Part>> {
    prop::collection::vec(part(), 1..=10).prop_map(|mut parts| {
        for (index, part) in parts.iter_mut().enumerate() {
            part.parent = if part.parent < 65 { index } else { part.parent % (index + 1) };
        }
        parts
    })
}

fn urdf(parts: &[Part]) -> String {
    // the shortest text that parses to the same number
    let text = |v: &Vector3<f64>| format!("{:e} {:e} {:e}", v.x, v.y, v.z);
    let mut urdf = String::from("<robot name=\"tree\"><link name=\"0\"/>");
    for (index, part) in parts.iter().enumerate() {
        let kind = if part.prismatic { "prismatic" } else { "revolute" };
        let i = part.inertia;
        write!(
            urdf,
            "<link name=\"{link}\"><inertial><origin xyz=\"{com}\"/><mass value=\"{mass:e}\"/>\
             <inertia ixx=\"{:e}\" iyy=\"{:e}\" izz=\"{:e}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
             <joint name=\"j{link}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{link}\"/>\
             <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" velocity=\"1\" effort=\"1\"/></joint>",
            i.x,
            i.y,
            i.z,
            link = index + 1,
            com = text(&part.com),
            mass = part.mass,
            parent = part.parent,
            xyz = text(&part.xyz),
            rpy = text(&part.rpy),
            axis = text(&part.axis),
        )
        .unwrap();
    }
    urdf + "</robot>"
}

/// `cos t 1 + sin t [k] + (1 - cos t) k k'`
fn rodrigues(k: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (sin, cos) = angle.sin_cos();
    Matrix3::identity() * cos + k.cross_matrix() * sin + k * k.transpose() * (1.0 - cos)
}

/// A link in the world, and the line about which its joint rotates or along which it slides.
struct Placed {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    axis: Vector3<f64>,
    /// Links from the root to this link, including itself; their joints move it.
    ancestors: Vec<usize>,
}

fn place_parts(parts: &[Part]) -> Vec<Placed> {
    let mut links: Vec<Placed> = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let (rotation, position, mut ancestors) = match part.parent.checked_sub(1) {
            Some(parent) => (links[parent].rotation, links[parent].position, links[parent].ancestors.clone()),
            None => (Matrix3::identity(), Vector3::zeros(), Vec::new()),
        };
        ancestors.push(index);
        let k = part.axis / part.axis.norm();
        let fixed = rotation
            * rodrigues(&Vector3::z(), part.rpy.z)
            * rodrigues(&Vector3::y(), part.rpy.y)
            * rodrigues(&Vector3::x(), part.rpy.x);
        let axis = fixed * k;
        let origin = position + rotation * part.xyz;
        links.push(if part.prismatic {
            Placed { rotation: fixed, position: origin + axis * part.q, axis, ancestors }
        } else {
            Placed { rotation: fixed * rodrigues(&k, part.q), position: origin, axis, ancestors }
        });
    }
    links
}

/// Returns the Jacobian of a point of link `link`, linear rows first, from each joint's line.
fn jacobian(parts: &[Part], links: &[Placed], link: usize, point: &Vector3<f64>) -> DMatrix<f64> {
    let mut jacobian = DMatrix::zeros(6, parts.len());
    for &joint in &links[link].ancestors {
        let axis = links[joint].axis;
        let mut column = jacobian.column_mut(joint);
        if parts[joint].prismatic {
            column.rows_mut(0, 3).copy_from(&axis);
        } else {
            column.rows_mut(0, 3).copy_from(&axis.cross(&(point - links[joint].position)));
            column.rows_mut(3, 3).copy_from(&axis);
        }
    }
    jacobian
}

/// Returns the largest difference, relative to the largest entry if that exceeds one.
fn error(ours: &DMatrix<f64>, theirs: &DMatrix<f64>) -> f64 {
    assert!(ours.iter().all(|entry| entry.is_finite()));
    (ours - theirs).amax() / theirs.amax().max(1.0)
}

fn matrix(rotation: &nalgebra::UnitQuaternion<f64>) -> Matrix3<f64> {
    rotation.to_rotation_matrix().into_inner()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn joints_rotate_about_axes_near_a_pole(parts in tree()) {
        const BOUND: f64 = 1e-13;
        let model = parse_urdf(&urdf(&parts), None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
        let n = parts.len();
        let links = place_parts(&parts);
        // our columns follow the tree, theirs the file
        let column = |part: usize| model.joint_index(&format!("j{}", part + 1)).unwrap();
        let arrange = |theirs: DMatrix<f64>| {
            let mut ours = theirs.clone();
            (0..n).for_each(|part| ours.set_column(column(part), &theirs.column(part)));
            ours
        };
        let mut q = vec![0.0; n];
        parts.iter().enumerate().for_each(|(index, part)| q[column(index)] = part.q);
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);

        let (mut mass, mut gravity) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut com, mut whole) = (DMatrix::zeros(3, n), 0.0);
        for (link, (part, placed)) in parts.iter().zip(&links).enumerate() {
            let frame = model.frame(&(link + 1).to_string()).unwrap();
            let pose = kinematics.pose(&model, frame);
            prop_assert!((matrix(&pose.rotation) - placed.rotation).amax() < BOUND, "rotation of {}", link + 1);
            prop_assert!((pose.translation.vector - placed.position).amax() < 10.0 * BOUND);
            let mut ours = DMatrix::zeros(6, n);
            kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut ours);
            let theirs = arrange(jacobian(&parts, &links, link, &placed.position));
            prop_assert!(error(&ours, &theirs) < BOUND, "Jacobian of {}", link + 1);

            let centre = placed.position + placed.rotation * part.com;
            let moved = jacobian(&parts, &links, link, &centre);
            let (linear, angular) = (moved.rows(0, 3).into_owned(), moved.rows(3, 3).into_owned());
            let inertia = placed.rotation * Matrix3::from_diagonal(&part.inertia) * placed.rotation.transpose();
            mass += linear.transpose() * &linear * part.mass + angular.transpose() * inertia * &angular;
            gravity -= linear.transpose() * GRAVITY * part.mass;
            com += linear * part.mass;
            whole += part.mass;
        }
        let mut dynamics = Dynamics::new(&model);
        let mut ours = DMatrix::zeros(n, n);
        dynamics.crba(&model, &q, &mut ours);
        let theirs = arrange(arrange(mass).transpose());
        prop_assert!(error(&ours, &theirs) < BOUND, "mass matrix");
        let mut ours = DMatrix::zeros(1, n);
        dynamics.gravity(&model, &q, GRAVITY, ours.as_mut_slice());
        prop_assert!(error(&ours, &arrange(DMatrix::from_row_slice(1, n, gravity.as_slice()))) < BOUND, "gravity");
        let mut ours = DMatrix::zeros(3, n);
        kinematics.com_jacobian(&model, &mut ours);
        prop_assert!(error(&ours, &arrange(com / whole)) < BOUND, "centre of mass");
    }
}

#[test]
fn trees_with_axes_near_every_pole_match_pinocchio() {
    let trees: Value = serde_json::from_str(include_str!("golden/axes.json")).unwrap();
    let trees = trees.as_array().unwrap();
    assert!(trees.len() >= 16);
    for tree in trees {
        let base = if tree["floating_base"] == true { BaseMode::Floating } else { BaseMode::Fixed };
        let options = LoadOptions { base, ..LoadOptions::default() };
        let model: Model = parse_urdf_with(tree["urdf"].as_str().unwrap(), None, &options).unwrap().model;
        let errors = Golden::from_document(tree.clone()).compare(&model);
        println!("{}: {}", model.name(), errors.summary());
        assert!(errors.0.len() >= 30, "{}", errors.summary());
        // Pinocchio treats an axis within 1e-12 of a pole as the pole itself, so closer axes cannot be
        // compared
        errors.stay_below(1e-10, 1e-10);
    }
}
