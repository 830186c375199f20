//! A model as URDF text, for viewers that support only URDF.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Isometry3;

use crate::{Coordinate, Frame, Geometry, Inertia, JointKind, LinkColours, Model, Shape, TriangleMesh};

/// A robot as URDF text for viewers, with the meshes to which the text refers.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnRobot {
    /// URDF text.
    pub text: String,
    /// Meshes without a file. Each entry is the name used in the text, and the scaled mesh.
    pub meshes: Vec<(String, Arc<TriangleMesh>)>,
}

/// Maximum distance of a frame from its body's frame at which they count as equal \[m, rad\].
const SAME: f64 = 1e-9;

/// Writes a model as URDF text for viewers: links with their names, joints with their axes and limits, and
/// shapes as visuals. The text refers to meshes from files by `file://` and their path, and to meshes without
/// a file by `package://ROBOT/NUMBER.obj`. Shapes that are fixed to the world next to a floating base are
/// omitted.
///
/// ```
/// use motorium_robots::{MimicMode, PackagePath, draw_as_urdf, load, parse_urdf};
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// let drawn = draw_as_urdf(&panda);
/// let again = parse_urdf(&drawn.text, None, MimicMode::Follow, &PackagePath::default())?.model;
/// assert_eq!(again.joint_names(), panda.joint_names());
/// assert_eq!(again.frames()[0].name, panda.frames()[0].name);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn draw_as_urdf(model: &Model) -> DrawnRobot {
    write(model, LinkColours::default())
}

/// Writes a model as URDF, with colours of its shapes.
pub(crate) fn write(model: &Model, colours: LinkColours) -> DrawnRobot {
    let mut writer = Writer { model, text: String::new(), meshes: Vec::new(), names: names(model), colours };
    // writing to a string cannot fail
    let _ = writer.robot();
    DrawnRobot { text: writer.text, meshes: writer.meshes }
}

struct Writer<'a> {
    model: &'a Model,
    text: String,
    meshes: Vec<(String, Arc<TriangleMesh>)>,
    /// Name of the link at the origin of each body.
    names: Vec<String>,
    colours: LinkColours,
}

/// Returns `true` for a frame at the origin of its body.
fn is_origin(frame: &Frame) -> bool {
    frame.placement.translation.vector.norm() < SAME && frame.placement.rotation.angle() < SAME
}

/// Returns the names of the links at the origin of each body: an existing frame there, otherwise a new link.
fn names(model: &Model) -> Vec<String> {
    let of = |(index, body): (usize, &crate::Body)| {
        let mut frames = model.frames().iter().filter(|frame| frame.body == Some(index));
        let own = frames.find(|frame| is_origin(frame)).map(|frame| frame.name.clone());
        own.unwrap_or_else(|| format!("{}/origin", body.joint.name))
    };
    model.bodies().iter().enumerate().map(of).collect()
}

impl Writer<'_> {
    fn robot(&mut self) -> std::fmt::Result {
        let model = self.model;
        let Some(root) = model.frames().iter().find(|frame| frame.body.is_none() && !frame.in_world) else {
            return Ok(());
        };
        writeln!(self.text, r#"<?xml version="1.0"?>"#)?;
        writeln!(self.text, r#"<robot name="{}">"#, escaped(model.name()))?;
        let base = model.base();
        let to_root = root.placement.inverse();
        self.link(&root.name, &base.inertia, &base.shapes, (&to_root, None))?;
        for frame in model.frames().iter().filter(|frame| frame.body.is_none() && !frame.in_world) {
            if frame.name != root.name {
                self.fixed(&root.name, frame, &(to_root * frame.placement))?;
            }
        }
        for (index, body) in model.bodies().iter().enumerate() {
            let name = self.names[index].clone();
            self.link(&name, &body.inertia, &body.shapes, (&Isometry3::identity(), Some(index)))?;
            let (parent, placement) = match body.parent {
                Some(parent) => (self.names[parent].clone(), body.joint.placement),
                None => (root.name.clone(), to_root * body.joint.placement),
            };
            self.joint(index, &parent, &placement)?;
            for frame in model.frames().iter().filter(|frame| frame.body == Some(index)) {
                if frame.name != name {
                    self.fixed(&name, frame, &frame.placement)?;
                }
            }
        }
        writeln!(self.text, "</robot>")
    }

    fn link(
        &mut self,
        name: &str,
        inertia: &Inertia,
        shapes: &[Shape],
        (within, body): (&Isometry3<f64>, Option<usize>),
    ) -> std::fmt::Result {
        writeln!(self.text, r#"  <link name="{}">"#, escaped(name))?;
        if inertia.mass > 0.0 {
            let moved = inertia.moved(within);
            let (com, i) = (moved.com, moved.rotational);
            writeln!(
                self.text,
                r#"    <inertial><origin xyz="{} {} {}"/><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="{}" iyz="{}"/></inertial>"#,
                com.x,
                com.y,
                com.z,
                moved.mass,
                i[(0, 0)],
                i[(1, 1)],
                i[(2, 2)],
                i[(0, 1)],
                i[(0, 2)],
                i[(1, 2)]
            )?;
        }
        for (place, shape) in shapes.iter().enumerate() {
            let Some(geometry) = self.geometry(&shape.geometry) else { continue };
            let of_link = shapes[..place].iter().filter(|other| other.link == shape.link).count();
            let [r, g, b] = self.colours.of_shape(&shape.link, of_link, body);
            let origin = origin(&(within * shape.placement));
            writeln!(
                self.text,
                r#"    <visual>{origin}<geometry>{geometry}</geometry><material name="{}_{place}"><color rgba="{r} {g} {b} 1"/></material></visual>"#,
                escaped(name)
            )?;
        }
        writeln!(self.text, "  </link>")
    }

    /// `None` for a missing mesh.
    fn geometry(&mut self, geometry: &Geometry) -> Option<String> {
        Some(match geometry {
            Geometry::Box { size } => format!(r#"<box size="{} {} {}"/>"#, size.x, size.y, size.z),
            Geometry::Cylinder { radius, length } => {
                format!(r#"<cylinder radius="{radius}" length="{length}"/>"#)
            }
            Geometry::Sphere { radius } => format!(r#"<sphere radius="{radius}"/>"#),
            // URDF has no capsule: its hull is used.
            Geometry::Capsule { radius, length } => {
                let mesh = Arc::new(capsule(*radius, *length));
                let name = self.mesh(mesh);
                format!(r#"<mesh filename="{name}"/>"#)
            }
            Geometry::Mesh { inline: Some(mesh), scale, .. } => {
                let name = self.mesh(Arc::new(TriangleMesh::clone(mesh).scaled(scale)));
                format!(r#"<mesh filename="{name}"/>"#)
            }
            Geometry::Mesh { path: Some(path), scale, .. } => {
                let path = std::path::absolute(path).unwrap_or_else(|_| Path::to_owned(path));
                let name = escaped(&path.to_string_lossy());
                format!(r#"<mesh filename="file://{name}" scale="{} {} {}"/>"#, scale.x, scale.y, scale.z)
            }
            Geometry::Mesh { .. } => return None,
        })
    }

    fn mesh(&mut self, mesh: Arc<TriangleMesh>) -> String {
        let known = self.meshes.iter().find(|(_, other)| *other == mesh);
        if let Some((name, _)) = known {
            return name.clone();
        }
        let robot = self.model.name().replace(|letter: char| !letter.is_ascii_alphanumeric(), "_");
        let name = format!("package://{robot}/{}.obj", self.meshes.len());
        self.meshes.push((name.clone(), mesh));
        name
    }

    fn fixed(&mut self, parent: &str, frame: &Frame, pose: &Isometry3<f64>) -> std::fmt::Result {
        let name = escaped(&frame.name);
        writeln!(self.text, r#"  <link name="{name}"/>"#)?;
        writeln!(
            self.text,
            r#"  <joint name="{name}/fixed" type="fixed"><parent link="{}"/><child link="{name}"/>{}</joint>"#,
            escaped(parent),
            origin(pose)
        )
    }

    fn joint(&mut self, index: usize, parent: &str, placement: &Isometry3<f64>) -> std::fmt::Result {
        let joint = &self.model.bodies()[index].joint;
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Continuous => "continuous",
            JointKind::Prismatic => "prismatic",
        };
        let axis = &joint.axis;
        write!(
            self.text,
            r#"  <joint name="{}" type="{kind}"><parent link="{}"/><child link="{}"/>{}<axis xyz="{} {} {}"/>"#,
            escaped(&joint.name),
            escaped(parent),
            escaped(&self.names[index]),
            origin(placement),
            axis.x,
            axis.y,
            axis.z
        )?;
        let bound = |value: f64| if value.is_finite() { value } else { 1e6_f64.copysign(value) };
        let limits = &joint.limits;
        let (lower, upper) = (bound(limits.lower), bound(limits.upper));
        let (effort, velocity) = (bound(limits.effort), bound(limits.velocity));
        write!(
            self.text,
            r#"<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>"#
        )?;
        if let Coordinate::Mimic { of, multiplier, offset } = joint.coordinate {
            let leader = escaped(&self.model.joint_names()[of]);
            write!(self.text, r#"<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>"#)?;
        }
        writeln!(self.text, "</joint>")
    }
}

pub(super) fn origin(pose: &Isometry3<f64>) -> String {
    let (p, (roll, pitch, yaw)) = (pose.translation.vector, pose.rotation.euler_angles());
    format!(r#"<origin xyz="{} {} {}" rpy="{roll} {pitch} {yaw}"/>"#, p.x, p.y, p.z)
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Returns the hull of rings of points on a capsule along z.
fn capsule(radius: f64, length: f64) -> TriangleMesh {
    const RINGS: usize = 6;
    const AROUND: usize = 24;
    let mut points = Vec::new();
    for end in [-1.0, 1.0] {
        for ring in 0..=RINGS {
            let latitude = core::f64::consts::FRAC_PI_2 * ring as f64 / RINGS as f64;
            let (sin, cos) = latitude.sin_cos();
            for step in 0..if ring == RINGS { 1 } else { AROUND } {
                let (y, x) = (core::f64::consts::TAU * step as f64 / AROUND as f64).sin_cos();
                let z = end * (0.5 * length + radius * sin);
                points.push(nalgebra::Vector3::new(radius * cos * x, radius * cos * y, z));
            }
        }
    }
    let triangles = (2..points.len() as u32).map(|last| [last - 2, last - 1, last]).collect();
    let soup = TriangleMesh { points, triangles };
    soup.hull(usize::MAX).unwrap_or(soup)
}
