//! Collision shapes of a robot's links.

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use crate::TriangleMesh;

/// A collision shape, fixed to a body or to the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Name of the link to which the shape belongs.
    pub link: String,
    /// Pose of the geometry in the body frame, or in the world for shapes of a fixed base.
    pub placement: Isometry3<f64>,
    /// Geometry of the shape.
    pub geometry: Geometry,
}

impl Shape {
    /// Returns the shape in a new frame. `pose` is the pose of the current frame in the new frame.
    pub fn moved(&self, pose: &Isometry3<f64>) -> Self {
        Self { placement: pose * self.placement, ..self.clone() }
    }
}

/// Geometry of a shape, centred on the origin of its frame. Lengths are in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Box with the full side lengths `size`.
    Box {
        /// Sides along x, y and z.
        size: Vector3<f64>,
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// Capsule: a cylinder along z with a half sphere at each end.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length of the cylinder without the half spheres.
        length: f64,
    },
    /// A mesh, either in a separate file, which has not been read, or contained in the robot's file.
    Mesh {
        /// File name as written in the robot's file, or the name of a mesh without a file.
        uri: String,
        /// Path of the file; `None` if it was not found.
        path: Option<PathBuf>,
        /// Mesh data of a mesh without a file.
        inline: Option<Arc<TriangleMesh>>,
        /// Scale along x, y and z.
        scale: Vector3<f64>,
    },
}
