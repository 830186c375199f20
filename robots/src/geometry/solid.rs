//! Solids: collision shapes prepared for distance queries.

use std::path::PathBuf;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::shape::{SharedShape, TriMesh};
use parry3d_f64::transformation::try_convex_hull;

use super::capsule::fit_capsule;
use super::shape::{ConvexShape, outermost};
use super::support::{Cloud, Core};
use crate::math::{M3, V3, v3, vector};
use crate::{Geometry, MeshError, Shape, TriangleMesh};

/// Kind of collision shape that replaces a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshMode {
    /// Convex hull. If the hull has more than `most_corners` corners, a capsule around the mesh replaces the
    /// hull.
    Hull {
        /// Maximum number of corners of a hull.
        most_corners: usize,
    },
    /// A capsule around the mesh. This is the fastest option, and its distances are smooth.
    Capsule,
    /// Convex hull of the 26 points that are outermost towards the faces, edges and corners of a cube. This
    /// hull is coarse and slightly smaller than the mesh, but sufficient for simulating contacts.
    Outermost,
    /// The triangles of the mesh: exact and slow. A surface has no interior. If a surface intersects a solid,
    /// their distance is the negative depth of the deepest triangle.
    Surface,
}

impl Default for MeshMode {
    fn default() -> Self {
        Self::Hull { most_corners: 500 }
    }
}

/// Kind of shape of a solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolidKind {
    /// A primitive shape of the robot's file, such as a box.
    Primitive,
    /// The convex hull of a mesh.
    Hull {
        /// Number of corners.
        corners: usize,
    },
    /// A capsule around a mesh.
    Fitted,
    /// A half-space.
    HalfSpace,
    /// The triangles of a mesh.
    Surface {
        /// Number of triangles.
        triangles: usize,
    },
}

/// Reason why a shape cannot be used for distances.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolidProblem {
    /// The mesh file was not found when the robot was loaded.
    #[error(
        "its mesh \"{uri}\" was not found; pass the folder of its package with --package-path or ROS_PACKAGE_PATH, or leave the \
         link out of the collision model"
    )]
    MissingMesh {
        /// Name of the mesh in the URDF.
        uri: String,
    },
    /// The mesh file has an error.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh has no volume, so it has no convex hull.
    #[error("its mesh {} has no convex hull ({why}); use a capsule for it", .path.display())]
    NoHull {
        /// Path of the mesh file.
        path: PathBuf,
        /// Reason reported by the geometry library.
        why: String,
    },
    /// A size of the shape is not positive.
    #[error("its {what} is {value}, expected a number above 0")]
    Size {
        /// Name of the size.
        what: &'static str,
        /// Value of the size.
        value: f64,
    },
}

/// A solid in the frame to which it is fixed.
#[derive(Clone)]
pub(super) struct Solid {
    pub(super) link: String,
    pub(super) kind: SolidKind,
    pub(super) core: Core,
    pub(super) radius: f64,
    /// Pose in the frame of the link's body, the base or the world.
    pub(super) placement: Isometry3<f64>,
    /// Rotation of that pose in the frame of the body's node, which the algorithms use.
    pub(super) rotation: M3,
    pub(super) position: V3,
    /// Radius of the bounding sphere about `position`.
    pub(super) reach: f64,
    /// Shape for parry in the same frame, for pairs with surfaces.
    pub(super) shape: Option<SharedShape>,
}

impl Solid {
    /// Reads and prepares a shape; `within` is the pose of the body frame in its node's frame.
    pub(super) fn new(shape: &Shape, within: &Isometry3<f64>, mode: MeshMode) -> Result<Self, SolidProblem> {
        let placement = (within, shape.placement);
        let link = &shape.link;
        match &shape.geometry {
            Geometry::Mesh { inline: Some(mesh), uri, scale, .. } => {
                let mesh = TriangleMesh::clone(mesh).scaled(scale);
                Self::of_mesh(link, placement, mesh, mode, std::path::Path::new(uri))
            }
            Geometry::Mesh { uri, path, scale, .. } => {
                let path = path.as_ref().ok_or_else(|| SolidProblem::MissingMesh { uri: uri.clone() })?;
                let mesh = TriangleMesh::read(path)?.scaled(scale);
                Self::of_mesh(link, placement, mesh, mode, path)
            }
            geometry => Self::primitive(link, SolidKind::Primitive, placement, geometry),
        }
    }

    fn primitive(
        link: &str,
        kind: SolidKind,
        placement: (&Isometry3<f64>, Isometry3<f64>),
        geometry: &Geometry,
    ) -> Result<Self, SolidProblem> {
        let positive = |what, value: f64| {
            if value > 0.0 && value.is_finite() { Ok(value) } else { Err(SolidProblem::Size { what, value }) }
        };
        let not_negative = |what, value: f64| {
            if value >= 0.0 && value.is_finite() {
                Ok(value)
            } else {
                Err(SolidProblem::Size { what, value })
            }
        };
        let (core, radius) = match *geometry {
            Geometry::Box { size } => {
                let smallest = if size.iter().all(|x| x.is_finite()) { size.min() } else { f64::NAN };
                positive("shortest side", smallest)?;
                (Core::Box((size * 0.5).into()), 0.0)
            }
            Geometry::Cylinder { radius, length } => {
                (Core::Cylinder(positive("radius", radius)?, 0.5 * positive("length", length)?), 0.0)
            }
            Geometry::Sphere { radius } => (Core::Point, positive("radius", radius)?),
            Geometry::Capsule { radius, length } => {
                let half = 0.5 * not_negative("length", length)?;
                (if half > 0.0 { Core::Segment(half) } else { Core::Point }, not_negative("radius", radius)?)
            }
            Geometry::Mesh { .. } => return Err(SolidProblem::MissingMesh { uri: link.to_owned() }),
        };
        Ok(Self::placed(link, kind, placement, core, radius))
    }

    fn of_mesh(
        link: &str,
        placement: (&Isometry3<f64>, Isometry3<f64>),
        mesh: TriangleMesh,
        mode: MeshMode,
        path: &std::path::Path,
    ) -> Result<Self, SolidProblem> {
        let corners: Vec<_> = mesh.used().collect();
        let no_hull = |why: String| SolidProblem::NoHull { path: path.to_owned(), why };
        match mode {
            MeshMode::Capsule => Self::fitted(link, placement, &corners),
            MeshMode::Outermost => {
                let points: Vec<V3> = outermost(&corners).into_iter().map(V3::from).collect();
                if points.is_empty() {
                    return Err(no_hull("it has no triangles".to_owned()));
                }
                let kind = SolidKind::Hull { corners: points.len() };
                Ok(Self::placed(link, kind, placement, Core::Hull(Cloud::new(&points)), 0.0))
            }
            MeshMode::Hull { most_corners } => {
                let points: Vec<_> = corners.iter().map(|&point| vector(point.into())).collect();
                let (hull, _) = try_convex_hull(&points).map_err(|error| no_hull(error.to_string()))?;
                if hull.len() > most_corners {
                    return Self::fitted(link, placement, &corners);
                }
                let kind = SolidKind::Hull { corners: hull.len() };
                // Centred, so that the bounding sphere is small.
                let (low, high) = bounds(hull.iter().map(|&point| v3(point)));
                let middle = (low + high) * 0.5;
                let hull: Vec<_> = hull.into_iter().map(|point| v3(point) - middle).collect();
                let placement = (placement.0, placement.1 * Translation3::from(Vector3::from(middle)));
                Ok(Self::placed(link, kind, placement, Core::Hull(Cloud::new(&hull)), 0.0))
            }
            MeshMode::Surface => {
                let kind = SolidKind::Surface { triangles: mesh.triangles.len() };
                let points: Vec<_> = mesh.points.iter().map(|&point| vector(point.into())).collect();
                let surface =
                    TriMesh::new(points, mesh.triangles).map_err(|error| no_hull(format!("{error:?}")))?;
                let corners: Vec<V3> = corners.into_iter().map(V3::from).collect();
                let mut solid = Self::placed(link, kind, placement, Core::Hull(Cloud::new(&corners)), 0.0);
                solid.shape = Some(SharedShape::new(surface));
                Ok(solid)
            }
        }
    }

    fn fitted(
        link: &str,
        (within, placement): (&Isometry3<f64>, Isometry3<f64>),
        corners: &[Vector3<f64>],
    ) -> Result<Self, SolidProblem> {
        match fit_capsule(corners) {
            Some((fit, capsule)) => {
                Self::primitive(link, SolidKind::Fitted, (within, placement * fit), &capsule)
            }
            None => Err(SolidProblem::Size { what: "number of corners", value: 0.0 }),
        }
    }

    /// Returns the half-space below the plane z = 0 of `placement`, in the world.
    pub(super) fn half_space(name: &str, placement: Isometry3<f64>) -> Self {
        Self::placed(name, SolidKind::HalfSpace, (&Isometry3::identity(), placement), Core::HalfSpace, 0.0)
    }

    fn placed(
        link: &str,
        kind: SolidKind,
        (within, placement): (&Isometry3<f64>, Isometry3<f64>),
        core: Core,
        radius: f64,
    ) -> Self {
        let in_node = within * placement;
        Self {
            link: link.to_owned(),
            kind,
            placement,
            rotation: in_node.rotation.to_rotation_matrix().into_inner().into(),
            position: in_node.translation.vector.into(),
            reach: core.reach() + radius,
            core,
            radius,
            shape: None,
        }
    }

    /// Returns the shape as a convex shape; for a surface, its convex hull.
    pub(super) fn convex_shape(&self) -> ConvexShape {
        let radius = self.radius;
        match &self.core {
            Core::Point => ConvexShape::Sphere { radius },
            Core::Segment(half) => ConvexShape::Capsule { radius, half_length: *half },
            Core::Box(half) => ConvexShape::Box { half: (*half).into() },
            Core::Cylinder(radius, half) => ConvexShape::Cylinder { radius: *radius, half_length: *half },
            Core::Hull(cloud) => ConvexShape::Hull { points: cloud.corners().map(Vector3::from).collect() },
            Core::HalfSpace => ConvexShape::HalfSpace,
        }
    }

    pub(super) fn is_half_space(&self) -> bool {
        self.core == Core::HalfSpace
    }

    pub(super) fn is_surface(&self) -> bool {
        matches!(self.kind, SolidKind::Surface { .. })
    }

    /// Creates the parry shape for pairs with a surface.
    pub(super) fn share(&mut self) {
        if self.shape.is_some() {
            return;
        }
        let (x, z) = (V3::new(1.0, 0.0, 0.0), V3::new(0.0, 0.0, 1.0));
        self.shape = Some(match &self.core {
            Core::Point => SharedShape::ball(self.radius),
            Core::Segment(half) => SharedShape::capsule(vector(z * -*half), vector(z * *half), self.radius),
            Core::Box(half) => SharedShape::cuboid(half.x, half.y, half.z),
            Core::Cylinder(radius, half) => {
                // Parry's cylinder is along y: rotate about x to align it with z.
                let turn = UnitQuaternion::from_axis_angle(
                    &nalgebra::Unit::new_unchecked(Vector3::from(x)),
                    std::f64::consts::FRAC_PI_2,
                );
                let pose = pose(&turn.to_rotation_matrix().into_inner().into(), V3::ZERO);
                SharedShape::compound(vec![(pose, SharedShape::cylinder(*half, *radius))])
            }
            Core::Hull(cloud) => {
                let points: Vec<_> = cloud.points().map(vector).collect();
                SharedShape::convex_hull(&points).unwrap_or_else(|| SharedShape::ball(self.reach))
            }
            // Distances of a half-space are computed in closed form, not by parry.
            Core::HalfSpace => SharedShape::halfspace(vector(z)),
        });
    }
}

fn bounds(points: impl Iterator<Item = V3>) -> (V3, V3) {
    let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
    points.fold((V3::new(low, low, low), V3::new(high, high, high)), |(low, high), point| {
        (
            V3::new(low.x.min(point.x), low.y.min(point.y), low.z.min(point.z)),
            V3::new(high.x.max(point.x), high.y.max(point.y), high.z.max(point.z)),
        )
    })
}

/// Converts a pose to parry's type.
pub(super) fn pose(rotation: &M3, position: V3) -> parry3d_f64::math::Pose {
    let matrix = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from(*rotation));
    let turn = UnitQuaternion::from_rotation_matrix(&matrix).coords;
    parry3d_f64::math::Pose {
        rotation: parry3d_f64::math::Rotation::from_xyzw(turn.x, turn.y, turn.z, turn.w),
        translation: vector(position),
    }
}
