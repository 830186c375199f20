//! The Lie groups compared with values computed with 60 digits by `lie/generate.py`, and rotations between
//! directions.

use std::f64::consts::PI;

use motorium_robots::lie::{RotationRates, angular_motion, rotation_rates, se3, so3};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Quaternion, Translation3, Unit, UnitQuaternion, Vector3, Vector6,
};
use serde_json::Value;

fn cases() -> Vec<Value> {
    let cases: Value = serde_json::from_str(include_str!("lie/vectors.json")).unwrap();
    cases.as_array().unwrap().clone()
}

fn numbers(case: &Value, key: &str) -> Vec<f64> {
    case[key].as_array().unwrap().iter().map(|entry| entry.as_f64().unwrap()).collect()
}

fn xi(case: &Value) -> Vector6<f64> {
    Vector6::from_column_slice(&numbers(case, "xi"))
}

fn vector(case: &Value, key: &str) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(case, key))
}

fn motion(case: &Value) -> Isometry3<f64> {
    let q = numbers(case, "quaternion");
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]));
    Isometry3::from_parts(Translation3::from(vector(case, "translation")), rotation)
}

/// Asserts that the largest difference, relative to the largest entry if that exceeds one, is within `units`
/// units in the last place of one.
fn assert_close<'a>(
    what: &str,
    case: &Value,
    found: impl IntoIterator<Item = &'a f64>,
    expected: &[f64],
    units: f64,
) {
    let scale = expected.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let found: Vec<f64> = found.into_iter().copied().collect();
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs() / (scale * f64::EPSILON);
        assert!(off <= units, "{what} at {:?}: {found} instead of {expected}, {off:.1} units", xi(case));
    }
}

#[test]
fn exponential_is_exact_up_to_almost_a_whole_turn() {
    for case in cases() {
        let found = se3::exp(&xi(&case));
        assert_close("rotation", &case, found.rotation.coords.iter(), &numbers(&case, "quaternion"), 2.0);
        let expected = numbers(&case, "translation");
        assert_close("translation", &case, found.translation.vector.iter(), &expected, 8.0);
    }
}

#[test]
fn logarithm_is_exact_up_to_almost_half_a_turn() {
    let short: Vec<_> = cases().into_iter().filter(|case| case["short"] == true).collect();
    assert!(short.len() > 80);
    for case in short {
        assert_close("log", &case, se3::log(&motion(&case)).iter(), xi(&case).as_slice(), 8.0);
        // the other quaternion of the same rotation
        let mut negated = motion(&case);
        negated.rotation = UnitQuaternion::new_unchecked(-negated.rotation.into_inner());
        assert_close("log", &case, se3::log(&negated).iter(), xi(&case).as_slice(), 8.0);
    }
}

#[test]
fn small_rotations_keep_their_relative_accuracy() {
    for exponent in 1..300 {
        let phi = Vector3::new(0.6, -0.8, 0.0) * 10_f64.powi(-exponent);
        let back = so3::log(&so3::exp(&phi));
        assert!((back - phi).norm() <= 8.0 * f64::EPSILON * phi.norm(), "1e-{exponent}");
    }
}

#[test]
fn jacobians_are_exact_on_both_sides_of_every_seam() {
    for case in cases() {
        let (xi, phi) = (xi(&case), xi(&case).fixed_rows::<3>(3).into_owned());
        let rows = |matrix: Matrix3<f64>| matrix.transpose().as_slice().to_vec();
        let six = |matrix: Matrix6<f64>| matrix.transpose().as_slice().to_vec();
        for (key, found) in [
            ("so3_left", rows(so3::left_jacobian(&phi))),
            ("so3_left_inverse", rows(so3::left_jacobian_inverse(&phi))),
            ("so3_left", rows(so3::right_jacobian(&-phi))),
            ("so3_left_inverse", rows(so3::right_jacobian_inverse(&-phi))),
            ("se3_left", six(se3::left_jacobian(&xi))),
            ("se3_left_inverse", six(se3::left_jacobian_inverse(&xi))),
            ("se3_left", six(se3::right_jacobian(&-xi))),
            ("se3_left_inverse", six(se3::right_jacobian_inverse(&-xi))),
        ] {
            assert_close(key, &case, &found, &numbers(&case, key), 64.0);
        }
    }
}

#[test]
fn logarithm_jacobian_is_the_inverse_right_jacobian() {
    for case in cases().iter().filter(|case| case["short"] == true) {
        // the right Jacobian of the inverse motion is the left Jacobian of the motion
        let found = se3::log_jacobian(&motion(case).inverse()).transpose();
        assert_close("log_jacobian", case, found.iter(), &numbers(case, "se3_left_inverse"), 64.0);
    }
}

#[test]
fn rotation_vector_rates_convert_to_angular_velocity_and_back() {
    for case in cases() {
        let phi = RotationRates {
            vector: xi(&case).fixed_rows::<3>(3).into_owned(),
            rate: vector(&case, "rate"),
            acceleration: vector(&case, "acceleration"),
        };
        let (velocity, acceleration) = angular_motion(&phi);
        assert_close("velocity", &case, velocity.iter(), &numbers(&case, "angular_velocity"), 16.0);
        assert_close(
            "acceleration",
            &case,
            acceleration.iter(),
            &numbers(&case, "angular_acceleration"),
            64.0,
        );
        let back = rotation_rates(phi.vector, velocity, acceleration).unwrap();
        assert!(
            (back.rate - phi.rate).norm() < 1e-12 && (back.acceleration - phi.acceleration).norm() < 1e-10
        );
    }
}

#[test]
fn logarithm_of_half_a_turn_has_length_pi() {
    for axis in [Vector3::x(), -Vector3::y(), Vector3::new(1.0, -1.0, 0.5).normalize()] {
        for real in [0.0, -0.0, 1e-17, -1e-17] {
            let rotation = UnitQuaternion::new_unchecked(Quaternion::from_parts(real, axis));
            let motion = Isometry3::from_parts(Translation3::new(1.0, 2.0, 3.0), rotation);
            let xi = se3::log(&motion);
            assert!((xi.fixed_rows::<3>(3).norm() - PI).abs() < 1e-15);
            assert!((se3::exp(&xi).to_homogeneous() - motion.to_homogeneous()).amax() < 4e-15);
            assert!(se3::log_jacobian(&motion).iter().all(|entry| entry.is_finite()));
        }
    }
}

#[test]
fn adjoint_moves_a_body_velocity_to_the_outer_frame() {
    for case in cases() {
        let (motion, body) = (motion(&case), Vector6::new(0.3, -0.2, 0.5, 1.0, 0.1, -0.7));
        // exp(Ad xi) M = M exp(xi)
        let found = se3::exp(&(se3::adjoint(&motion) * body)) * motion;
        let expected = motion * se3::exp(&body);
        let error = (found.to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(error < 1e-14 * (1.0 + motion.translation.vector.norm()), "{error:e}");
    }
}

#[test]
fn least_rotation_maps_directions_without_extra_turn() {
    let directions = [
        Vector3::x(),
        -Vector3::y(),
        Vector3::z(),
        Vector3::new(0.3, -0.9, 0.2).normalize(),
        Vector3::new(-1.0, 1e-9, 1e-17).normalize(),
    ];
    let angles = [0.0, 1e-18, 1e-16, 1e-12, 1e-8, 3e-8, 1e-5, 0.1, 1.0, 1.57, 2.0, 3.0, 3.12];
    let angles = angles.into_iter().flat_map(|angle| [angle, PI - angle]);
    for (from, angle) in directions.iter().flat_map(|from| angles.clone().map(move |angle| (from, angle))) {
        let across = from.cross(&Vector3::ith(from.iamin(), 1.0)).normalize();
        // approaches pi from above, because pi itself is not representable
        let (sin, cos) =
            if angle > 3.0 { ((PI - angle).sin(), -(PI - angle).cos()) } else { angle.sin_cos() };
        let to = Unit::new_normalize(from * cos + from.cross(&across) * sin);
        let from = Unit::new_unchecked(*from);
        let rotation = so3::least_rotation(&from, &to);
        assert!((rotation * from.into_inner() - to.into_inner()).norm() < 1e-15, "{from:?} {angle:e}");
        assert!((rotation.angle() - angle).abs() < 1e-15, "{from:?} {angle:e}");
        assert!(rotation.imag().dot(&from).abs() < 1e-15, "{from:?} {angle:e}");
    }
}
