//! Bodies and frames from links and joints: fixed joints are removed, and links fixed together are merged.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use urdf_rs::{JointType, Robot};

use super::error::{UrdfError, UrdfProblem};
use super::mimic::{self, Follow};
use super::robot::UrdfRobot;
use super::source::{self, Survey};
use super::structure::{self, Edge, Structure};
use super::warning::ModelWarning;
use super::{MimicMode, PackagePath, inertia, joints, transmission, warn_of_model};
use crate::catalogue;
use crate::formats::lines::Lines;
use crate::formats::options::{BaseMode, LoadOptions, ShapeSource};
use crate::{
    Base, Body, Coordinate, Drive, Frame, Geometry, Inertia, Joint, JointKind, Limits, Model, Shape,
};

/// Parses, checks and builds a robot.
pub(crate) fn assemble(
    text: &str,
    file: Option<&Path>,
    options: &LoadOptions,
) -> Result<UrdfRobot, UrdfError> {
    let survey = source::survey(text, options.shapes)?;
    let robot = urdf_rs::read_from_string(&survey.text).map_err(|error| match text.find("<!ENTITY") {
        Some(at) => UrdfError::new(Lines::new(text).position(at), UrdfProblem::Entity),
        None => UrdfError::new(None, UrdfProblem::Reader(error.to_string())),
    })?;
    let structure = structure::structure(&robot, &survey)?;
    let follows = match options.mimic {
        MimicMode::Follow => mimic::resolve(&robot, &survey)?,
        MimicMode::Independent => vec![None; robot.joints.len()],
    };
    let mut assembly = Assembly {
        robot: &robot,
        survey: &survey,
        file,
        packages: &options.packages,
        shapes: options.shapes,
        places: vec![None; robot.links.len()],
        parents: vec![None; robot.links.len()],
        of_links: vec![None; robot.links.len()],
        bodies: Vec::new(),
        frames: Vec::new(),
        base: Base {
            floating: options.base == BaseMode::Floating,
            neutral: Isometry3::identity(),
            inertia: Inertia::zero(),
            shapes: Vec::new(),
            world_shapes: Vec::new(),
        },
        warnings: Vec::new(),
    };
    assembly.add_link(structure.root, None, Isometry3::identity())?;
    let columns = columns(&robot, &structure, &follows);
    for edge in &structure.joints {
        assembly.parents[edge.child] = Some(edge.parent);
        assembly.add_joint(edge, &columns, &follows)?;
    }
    assembly.warnings.extend(survey.warnings.iter().cloned());
    transmission::warn_of_unknown_joints(&robot, &survey.drives, &mut assembly.warnings);
    inertia::warn_of_massless_ends(&assembly.bodies, &mut assembly.warnings);
    let Assembly { bodies, frames, base, mut warnings, .. } = assembly;
    let model = Model::new(robot.name.clone(), base, bodies, frames);
    warn_of_model(&model, &mut warnings);
    Ok(UrdfRobot { model, warnings })
}

/// Returns, for every joint of the file, the index of its first coordinate among the independent joints, if
/// any.
fn columns(robot: &Robot, structure: &Structure, follows: &[Option<Follow>]) -> Vec<Option<usize>> {
    let mut columns = vec![None; robot.joints.len()];
    let mut next = 0;
    for edge in &structure.joints {
        if follows[edge.joint].is_some() {
            continue;
        }
        let count = match robot.joints[edge.joint].joint_type {
            JointType::Fixed | JointType::Floating => continue,
            JointType::Planar => 3,
            _ => 1,
        };
        columns[edge.joint] = Some(next);
        next += count;
    }
    columns
}

struct Assembly<'a> {
    robot: &'a Robot,
    survey: &'a Survey,
    file: Option<&'a Path>,
    packages: &'a PackagePath,
    shapes: ShapeSource,
    /// Body and pose in it of every link added so far.
    places: Vec<Option<(Option<usize>, Isometry3<f64>)>>,
    /// Carrying link of every link.
    parents: Vec<Option<usize>>,
    /// Frame of every link added so far.
    of_links: Vec<Option<usize>>,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    base: Base,
    warnings: Vec<ModelWarning>,
}

impl Assembly<'_> {
    fn add_joint(
        &mut self,
        edge: &Edge,
        columns: &[Option<usize>],
        follows: &[Option<Follow>],
    ) -> Result<(), UrdfError> {
        let joint = &self.robot.joints[edge.joint];
        let source = &self.survey.joints[edge.joint];
        let (parent, at) = self.places[edge.parent].expect("a parent link is added before its children");
        let placement = at * joints::pose(&joint.origin);
        let kind = match joint.joint_type {
            JointType::Floating if follows[edge.joint].is_some() => {
                return joints::unsupported(joint, source, "a floating mimic joint").map(drop);
            }
            JointType::Floating => return self.add_floating(edge, parent, placement),
            JointType::Planar => return self.add_planar(edge, columns[edge.joint], (parent, placement)),
            _ => match joints::kind(joint, source)? {
                Some(kind) => kind,
                None => return self.add_link(edge.child, parent, placement),
            },
        };
        let coordinate = match follows[edge.joint] {
            None => Coordinate::Independent(columns[edge.joint].expect("an independent joint has a column")),
            Some(Follow { master, multiplier, offset }) => Coordinate::Mimic {
                of: columns[master].expect("the master of a chain is an independent joint"),
                multiplier,
                offset,
            },
        };
        let joint = Joint {
            name: joint.name.clone(),
            kind,
            axis: joints::axis(joint, source, &mut self.warnings)?,
            placement,
            limits: joints::limits(joint, kind, source, &mut self.warnings)?,
            dynamics: joints::dynamics(joint, source)?,
            drive: self.survey.drives.get(&joint.name).map(|(_, drive)| *drive).unwrap_or_default(),
            safety: source.safety,
            coordinate,
        };
        let name = self.robot.links[edge.child].name.clone();
        self.bodies.push(Body { name, joint, parent, inertia: Inertia::zero(), shapes: Vec::new() });
        self.add_link(edge.child, Some(self.bodies.len() - 1), Isometry3::identity())
    }

    /// Adds a floating joint of the root: its child becomes the base, and links above it belong to the world.
    fn add_floating(
        &mut self,
        edge: &Edge,
        parent: Option<usize>,
        placement: Isometry3<f64>,
    ) -> Result<(), UrdfError> {
        let joint = &self.robot.joints[edge.joint];
        let moving = |joint: &&urdf_rs::Joint| joint.joint_type != JointType::Fixed;
        let above: Vec<&str> = self.frames.iter().map(|frame| &*frame.name).collect();
        let alone = self
            .robot
            .joints
            .iter()
            .filter(moving)
            .filter(|joint| above.contains(&&*joint.parent.link))
            .count();
        if parent.is_some() || self.base.floating || alone > 1 {
            return joints::unsupported(joint, &self.survey.joints[edge.joint], "floating").map(drop);
        }
        for frame in &mut self.frames {
            frame.in_world = true;
        }
        self.base.world_shapes = std::mem::take(&mut self.base.shapes);
        self.base.inertia = Inertia::zero();
        self.base.neutral = placement;
        self.base.floating = true;
        self.add_link(edge.child, None, Isometry3::identity())
    }

    /// Adds a planar joint as two prismatic joints and a revolute one, in this order: `NAME/x`, `NAME/y`,
    /// `NAME/yaw`.
    fn add_planar(
        &mut self,
        edge: &Edge,
        column: Option<usize>,
        (parent, placement): (Option<usize>, Isometry3<f64>),
    ) -> Result<(), UrdfError> {
        let joint = &self.robot.joints[edge.joint];
        let source = &self.survey.joints[edge.joint];
        let Some(column) = column else {
            return joints::unsupported(joint, source, "a planar mimic joint").map(drop);
        };
        let normal = joints::axis(joint, source, &mut self.warnings)?;
        let limits =
            Limits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..joints::planar_limits(joint, source) };
        let plane = joints::plane(&normal);
        let child = &self.robot.links[edge.child].name;
        let (mut parent, mut placement) = (parent, placement);
        let steps = [
            ("x", JointKind::Prismatic, plane[0]),
            ("y", JointKind::Prismatic, plane[1]),
            ("yaw", JointKind::Continuous, normal),
        ];
        for (place, (suffix, kind, axis)) in steps.into_iter().enumerate() {
            let name = format!("{}/{suffix}", joint.name);
            let coordinate = Coordinate::Independent(column + place);
            let dynamics = joints::dynamics(joint, source)?;
            let (drive, safety) = (Drive::DIRECT, None);
            let joint = Joint { name, kind, axis, placement, limits, dynamics, drive, safety, coordinate };
            let name = if place == 2 { child.clone() } else { format!("{child}/{suffix}") };
            self.bodies.push(Body { name, joint, parent, inertia: Inertia::zero(), shapes: Vec::new() });
            (parent, placement) = (Some(self.bodies.len() - 1), Isometry3::identity());
        }
        self.add_link(edge.child, parent, Isometry3::identity())
    }

    /// Merges a link into `body` (or the base), at `placement` in it.
    fn add_link(
        &mut self,
        index: usize,
        body: Option<usize>,
        placement: Isometry3<f64>,
    ) -> Result<(), UrdfError> {
        let link = &self.robot.links[index];
        self.places[index] = Some((body, placement));
        let inertia = inertia::of_link(link, self.survey.links[index], &mut self.warnings)?;
        let parent = self.parents[index].and_then(|parent| self.of_links[parent]);
        self.of_links[index] = Some(self.frames.len());
        let name = link.name.clone();
        self.frames.push(Frame { name, body, in_world: false, placement, parent, inertia });
        let collisions = link.collision.iter().map(|shape| (&shape.origin, &shape.geometry));
        let visuals = link.visual.iter().map(|shape| (&shape.origin, &shape.geometry));
        let shapes: Vec<_> = match self.shapes {
            ShapeSource::Collision => collisions.collect(),
            ShapeSource::Visual => visuals.collect(),
        };
        for (origin, geometry) in shapes {
            let placement = placement * joints::pose(origin);
            let geometry = self.geometry(&link.name, geometry);
            let shapes = match body {
                Some(body) => &mut self.bodies[body].shapes,
                None => &mut self.base.shapes,
            };
            shapes.push(Shape { link: link.name.clone(), placement, geometry });
        }
        let whole = match body {
            Some(body) => &mut self.bodies[body].inertia,
            None => &mut self.base.inertia,
        };
        *whole = whole.merged(&inertia.moved(&placement));
        Ok(())
    }

    fn geometry(&mut self, link: &str, geometry: &urdf_rs::Geometry) -> Geometry {
        match geometry {
            urdf_rs::Geometry::Box { size } => Geometry::Box { size: Vector3::from(size.0) },
            &urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
            &urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius, length },
            &urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius },
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let (path, inline) = match self.packages.resolve(filename, self.file) {
                    Ok(path) => (Some(path), None),
                    Err(tried) => {
                        let inline = catalogue::shell(filename);
                        if inline.is_none() {
                            let (link, uri) = (link.to_owned(), filename.clone());
                            self.warnings.push(ModelWarning::MissingMesh { link, uri, tried, at: None });
                        }
                        (None, inline)
                    }
                };
                let scale = scale.map_or(Vector3::repeat(1.0), |scale| Vector3::from(scale.0));
                Geometry::Mesh { uri: filename.clone(), path, inline, scale }
            }
        }
    }
}
