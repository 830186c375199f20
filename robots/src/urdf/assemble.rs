//! Bodies and frames from links and joints: fixed joints disappear, links fixed together merge.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};
use urdf_rs::Robot;

use super::error::{UrdfError, UrdfProblem};
use super::mimic::{self, Follow};
use super::source::{self, Survey};
use super::structure::{self, Edge, Structure};
use super::warning::ModelWarning;
use super::{MimicMode, PackagePath, UrdfRobot, inertia, joints};
use crate::{Body, Coordinate, Frame, Geometry, Inertia, Joint, Model, Shape};

/// Parses, checks and builds.
pub(crate) fn assemble(
    text: &str,
    file: Option<&Path>,
    mimic: MimicMode,
    packages: &PackagePath,
) -> Result<UrdfRobot, UrdfError> {
    let survey = source::survey(text)?;
    let robot = urdf_rs::read_from_string(&survey.text)
        .map_err(|error| UrdfError::new(None, UrdfProblem::Reader(error.to_string())))?;
    let structure = structure::structure(&robot, &survey)?;
    let follows = match mimic {
        MimicMode::Follow => mimic::resolve(&robot, &survey)?,
        MimicMode::Independent => vec![None; robot.joints.len()],
    };
    let mut assembly = Assembly {
        robot: &robot,
        survey: &survey,
        file,
        packages,
        places: vec![None; robot.links.len()],
        bodies: Vec::new(),
        frames: Vec::new(),
        base_shapes: Vec::new(),
        warnings: Vec::new(),
    };
    assembly.add_link(structure.root, None, Isometry3::identity())?;
    let columns = columns(&robot, &structure, &follows);
    for edge in &structure.joints {
        assembly.add_joint(edge, &columns, &follows)?;
    }
    inertia::warn_of_massless_ends(&assembly.bodies, &mut assembly.warnings);
    let Assembly { bodies, frames, base_shapes, warnings, .. } = assembly;
    Ok(UrdfRobot { model: Model::new(robot.name.clone(), bodies, frames, base_shapes), warnings })
}

/// For every joint of the file its column in `q`, where it has one.
fn columns(robot: &Robot, structure: &Structure, follows: &[Option<Follow>]) -> Vec<Option<usize>> {
    let mut columns = vec![None; robot.joints.len()];
    let mut next = 0;
    for edge in &structure.joints {
        let fixed = robot.joints[edge.joint].joint_type == urdf_rs::JointType::Fixed;
        if !fixed && follows[edge.joint].is_none() {
            columns[edge.joint] = Some(next);
            next += 1;
        }
    }
    columns
}

struct Assembly<'a> {
    robot: &'a Robot,
    survey: &'a Survey,
    file: Option<&'a Path>,
    packages: &'a PackagePath,
    /// Body and placement in it, for every link added so far.
    places: Vec<Option<(Option<usize>, Isometry3<f64>)>>,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    base_shapes: Vec<Shape>,
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
        let Some(kind) = joints::kind(joint, source)? else {
            return self.add_link(edge.child, parent, placement);
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
            coordinate,
        };
        let name = self.robot.links[edge.child].name.clone();
        self.bodies.push(Body { name, joint, parent, inertia: Inertia::zero(), shapes: Vec::new() });
        self.add_link(edge.child, Some(self.bodies.len() - 1), Isometry3::identity())
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
        self.frames.push(Frame { name: link.name.clone(), body, placement });
        let inertia = inertia::of_link(link, self.survey.links[index], &mut self.warnings)?;
        for collision in &link.collision {
            let placement = placement * joints::pose(&collision.origin);
            let geometry = self.geometry(&link.name, &collision.geometry);
            let shapes = match body {
                Some(body) => &mut self.bodies[body].shapes,
                None => &mut self.base_shapes,
            };
            shapes.push(Shape { link: link.name.clone(), placement, geometry });
        }
        if let Some(body) = body {
            let body = &mut self.bodies[body];
            body.inertia = body.inertia.merged(&inertia.moved(&placement));
        }
        Ok(())
    }

    fn geometry(&mut self, link: &str, geometry: &urdf_rs::Geometry) -> Geometry {
        match geometry {
            urdf_rs::Geometry::Box { size } => Geometry::Box { size: Vector3::from(size.0) },
            &urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
            &urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius, length },
            &urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius },
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let path = match self.packages.resolve(filename, self.file) {
                    Ok(path) => Some(path),
                    Err(tried) => {
                        let (link, uri) = (link.to_owned(), filename.clone());
                        self.warnings.push(ModelWarning::MissingMesh { link, uri, tried });
                        None
                    }
                };
                let scale = scale.map_or(Vector3::repeat(1.0), |scale| Vector3::from(scale.0));
                Geometry::Mesh { uri: filename.clone(), path, scale }
            }
        }
    }
}
