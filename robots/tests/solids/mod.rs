//! Helpers of the distance tests: a robot with one shape, poses, random numbers.

mod random;

use motorium_robots::{Geometry, LoadOptions, Model, parse_urdf_with};
use nalgebra::{Isometry3, Vector3};

pub(crate) use random::Random;

/// Creates a robot with one slide and no other links; obstacles are checked against its only shape, on the
/// base.
pub(crate) fn with_shape(geometry: &str) -> Model {
    let text = format!(
        "<robot name=\"r\"><link name=\"base\"/><link name=\"body\">\
         <collision><geometry>{geometry}</geometry></collision></link>\
         <joint name=\"j\" type=\"prismatic\"><parent link=\"base\"/><child link=\"body\"/><axis xyz=\"0 0 1\"/>\
         <limit lower=\"-9\" upper=\"9\" velocity=\"1\" effort=\"1\"/></joint></robot>"
    );
    parse_urdf_with(&text, None, &LoadOptions::default()).unwrap().model
}

pub(crate) fn translation(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

pub(crate) fn cube(side: f64) -> Geometry {
    Geometry::Box { size: Vector3::repeat(side) }
}
