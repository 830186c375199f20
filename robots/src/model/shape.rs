//! Collision geometry.

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use crate::TriangleMesh;

/// A collision shape, fixed to a body or to the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// URDF link of the shape.
    pub link: String,
    /// Frame of the geometry in the body frame (in the world for shapes of the base).
    pub placement: Isometry3<f64>,
    /// The geometry.
    pub geometry: Geometry,
}

impl Shape {
    /// Returns the shape relative to the frame in which its own frame has this `pose`.
    pub fn moved(&self, pose: &Isometry3<f64>) -> Self {
        Self { placement: pose * self.placement, ..self.clone() }
    }
}

/// Geometry centred on the origin of its frame. Metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Box with these full side lengths.
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
    /// Cylinder along z with half spheres added at both ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length of the cylinder, without the caps.
        length: f64,
    },
    /// A mesh: in a separate file that has not been read, or contained in the robot's file.
    Mesh {
        /// File name as in the robot's file; for a mesh without a file, its name.
        uri: String,
        /// The file, if it was found.
        path: Option<PathBuf>,
        /// Mesh data, if the mesh has no file.
        inline: Option<Arc<TriangleMesh>>,
        /// Scale along x, y and z.
        scale: Vector3<f64>,
    },
}
