//! Support of the distance tests: a robot of one shape, poses, random numbers.

use motorium_robots::{Geometry, LoadOptions, Model, parse_urdf_with};
use nalgebra::{Isometry3, Vector3};

/// Numbers in -1 .. 1: Knuth's MMIX generator.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A robot of one slide without other links, so that obstacles meet one shape on its base.
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
