//! Geoms: shapes, and the inertia they give their body.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::PathBuf;

use nalgebra::{Isometry3, Matrix3, Translation3, Unit, Vector3};
use roxmltree::Node;

use super::attributes::{Attributes, named};
use super::compiler::Compiler;
use super::error::{MjcfError, MjcfProblem};
use super::pose::{along, pose};
use crate::nearest::nearest;
use crate::{Geometry, Inertia};

/// Attributes read, and those that no quantity here contains.
const KNOWN: &[&str] = &[
    "name",
    "class",
    "type",
    "pos",
    "quat",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
    "size",
    "fromto",
    "mass",
    "density",
    "contype",
    "conaffinity",
    "mesh",
    "group",
    "condim",
    "priority",
    "friction",
    "solmix",
    "solref",
    "solimp",
    "margin",
    "gap",
    "rgba",
    "material",
    "user",
    "fluidshape",
    "fluidcoef",
];

/// Sides and thickness of the box that stands for an infinite plane of the world \[m\].
const PLANE: [f64; 2] = [100.0, 1.0];

/// Density where the file gives none \[kg/m3\].
const WATER: f64 = 1000.0;

/// A mesh of `<asset>`.
pub(super) struct MeshAsset {
    pub(super) uri: String,
    pub(super) path: Option<PathBuf>,
    pub(super) scale: Vector3<f64>,
}

/// What one `<geom>` says.
pub(super) struct Geom {
    pub(super) placement: Isometry3<f64>,
    pub(super) geometry: Geometry,
    /// It can collide with something.
    pub(super) collides: bool,
    /// In the frame that the geom is placed in; an error where it cannot be said, for when it is needed.
    pub(super) inertia: Result<Inertia, MjcfError>,
}

pub(super) struct Geoms<'b, 'a, 'i> {
    pub(super) attributes: &'b Attributes<'a, 'i>,
    pub(super) compiler: &'b Compiler,
    pub(super) meshes: HashMap<&'a str, MeshAsset>,
}

impl<'a, 'i> Geoms<'_, 'a, 'i> {
    /// Reads a geom; `in_world` when what carries it does not move.
    pub(super) fn read(
        &self,
        node: Node<'a, 'i>,
        around: &'a str,
        in_world: bool,
    ) -> Result<Geom, MjcfError> {
        let attributes = self.attributes;
        attributes.only(node, KNOWN)?;
        let class = attributes.class_of(node, around)?;
        let kind = attributes.get(node, class, "type").unwrap_or("sphere");
        let mut placement = pose(attributes, self.compiler, node, class)?;
        let mut size = match attributes.get(node, class, "size") {
            Some(value) => attributes.parse(node, "size", value, 0)?,
            None => Vec::new(),
        };
        if let Some([ax, ay, az, bx, by, bz]) = attributes.numbers::<6>(node, class, "fromto")? {
            if !["capsule", "cylinder"].contains(&kind) {
                let value = attributes.get(node, class, "fromto").unwrap_or("");
                return Err(attributes.refused(
                    node,
                    "fromto",
                    value,
                    "only capsules and cylinders are read with it",
                ));
            }
            let (from, to) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
            let axis = Unit::try_new(from - to, 1e-14).ok_or_else(|| {
                attributes.error(node, MjcfProblem::Other("fromto has two equal ends".to_owned()))
            })?;
            placement = Isometry3::from_parts(((from + to) * 0.5).into(), along(&axis));
            size.truncate(1);
            size.push(0.5 * (from - to).norm());
        }
        let mesh = attributes.get(node, class, "mesh");
        if mesh.is_some() && kind != "mesh" {
            return Err(attributes.refused(
                node,
                "mesh",
                mesh.unwrap_or(""),
                "primitives fitted to meshes are not read",
            ));
        }
        let wanted = match kind {
            "sphere" => 1,
            "capsule" | "cylinder" => 2,
            "box" => 3,
            _ => 0,
        };
        if size.len() < wanted || size[..wanted].iter().any(|x| *x <= 0.0) {
            let (attribute, value) =
                ("size".to_owned(), attributes.get(node, class, "size").unwrap_or("").to_owned());
            let expected = format!("{wanted} numbers above 0 for a {kind}");
            let problem = MjcfProblem::Number { element: named(node), attribute, value, expected };
            return Err(attributes.error(node, problem));
        }
        let geometry = match kind {
            "sphere" => Geometry::Sphere { radius: size[0] },
            "capsule" => Geometry::Capsule { radius: size[0], length: 2.0 * size[1] },
            "cylinder" => Geometry::Cylinder { radius: size[0], length: 2.0 * size[1] },
            "box" => Geometry::Box { size: Vector3::new(size[0], size[1], size[2]) * 2.0 },
            "mesh" => self.mesh(node, mesh)?,
            "plane" if in_world => {
                let side = |index: usize| size.get(index).map_or(0.0, |half| 2.0 * half);
                let [x, y] = [side(0), side(1)].map(|side| if side > 0.0 { side } else { PLANE[0] });
                placement *= Translation3::new(0.0, 0.0, -0.5 * PLANE[1]);
                Geometry::Box { size: Vector3::new(x, y, PLANE[1]) }
            }
            "plane" => {
                return Err(attributes.refused(node, "type", kind, "planes are read in the world alone"));
            }
            _ => {
                return Err(attributes.refused(
                    node,
                    "type",
                    kind,
                    "write a sphere, capsule, cylinder, box or mesh",
                ));
            }
        };
        let number = |name, default| attributes.number(node, class, name, default);
        let collides = number("contype", 1.0)? != 0.0 || number("conaffinity", 1.0)? != 0.0;
        let density = number("density", WATER)?;
        let mass = attributes.numbers::<1>(node, class, "mass")?.map(|[mass]| mass);
        let inertia = match solid(&geometry) {
            _ if kind == "plane" || mass == Some(0.0) || mass.is_none() && density == 0.0 => {
                Ok(Inertia::zero())
            }
            Some((volume, per_mass)) => {
                let mass = mass.unwrap_or(density * volume);
                let rotational = Matrix3::from_diagonal(&(per_mass * mass));
                Ok(Inertia { mass, com: Vector3::zeros(), rotational }.moved(&placement))
            }
            None => {
                let reason = "the inertia of a mesh is not computed here; give the body an <inertial>, or the geom mass=\"0\"";
                Err(attributes.refused(node, "type", kind, reason))
            }
        };
        Ok(Geom { placement, geometry, collides, inertia })
    }

    fn mesh(&self, node: Node<'a, 'i>, name: Option<&str>) -> Result<Geometry, MjcfError> {
        let name = name.ok_or_else(|| self.attributes.missing(node, "mesh"))?;
        match self.meshes.get(name) {
            Some(MeshAsset { uri, path, scale }) => {
                Ok(Geometry::Mesh { uri: uri.clone(), path: path.clone(), scale: *scale })
            }
            None => {
                let nearest = nearest(name, self.meshes.keys().copied()).map(str::to_owned);
                let (element, name) = (named(node), name.to_owned());
                Err(self
                    .attributes
                    .error(node, MjcfProblem::Unknown { element, what: "mesh", name, nearest }))
            }
        }
    }
}

/// Volume \[m3\] and principal moments per mass \[m2\] of a solid primitive.
fn solid(geometry: &Geometry) -> Option<(f64, Vector3<f64>)> {
    Some(match *geometry {
        Geometry::Sphere { radius: r } => (4.0 / 3.0 * PI * r.powi(3), Vector3::repeat(0.4 * r * r)),
        Geometry::Box { size: s } => {
            let squares = s.component_mul(&s);
            (s.product(), (Vector3::repeat(squares.sum()) - squares) / 12.0)
        }
        Geometry::Cylinder { radius: r, length: h } => {
            let across = (3.0 * r * r + h * h) / 12.0;
            (PI * r * r * h, Vector3::new(across, across, 0.5 * r * r))
        }
        Geometry::Capsule { radius: r, length: h } => {
            let (tube, caps) = (PI * r * r * h, 4.0 / 3.0 * PI * r.powi(3));
            let volume = tube + caps;
            let (tube, caps) = (tube / volume, caps / volume);
            // Two half spheres, each with its centre 3/8 r beyond the end of the tube.
            let across =
                tube * (3.0 * r * r + h * h) / 12.0 + caps * (0.4 * r * r + 0.25 * h * h + 0.375 * r * h);
            (volume, Vector3::new(across, across, tube * 0.5 * r * r + caps * 0.4 * r * r))
        }
        Geometry::Mesh { .. } => return None,
    })
}
