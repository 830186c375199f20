//! The shapes of robots in the world, coloured.

use std::collections::BTreeMap;
use std::sync::Arc;

use motorium_robots::{Geometry, Kinematics, LinkColours, Loaded, Shape};
use nalgebra::{Isometry3, Point3, Translation3, Unit, Vector3};

use super::solid::{Detail, Face, Form, Solid};

/// Colour of sticks for links without a shape.
const STICK: [f64; 3] = [0.45, 0.58, 0.75];

/// The bodies of the scene.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub(super) solids: Vec<Solid>,
}

impl Scene {
    /// Creates the scene of a robot at the poses in `kinematics`, in the colours of its links.
    pub(super) fn from_robot(
        robot: &Loaded,
        kinematics: &Kinematics,
        colours: &LinkColours,
        forms: &mut Forms,
    ) -> Self {
        let model = &robot.model;
        let mut painter = Painter { colours, used: BTreeMap::new(), forms };
        let mut solids = Vec::new();
        let root = model.frames().iter().find(|frame| frame.body.is_none() && !frame.in_world);
        let base = root.and_then(|frame| {
            let pose = kinematics.pose(model, model.frame(&frame.name).ok()?);
            Some(pose * frame.placement.inverse())
        });
        let base = base.unwrap_or_else(Isometry3::identity);
        solids.extend(painter.paint(&model.base().world_shapes, Isometry3::identity(), None));
        let shapes = painter.paint(&model.base().shapes, base, None);
        let bare_base =
            shapes.is_empty() && (model.base().inertia.mass > 0.0 || !model.base().shapes.is_empty());
        solids.extend(shapes);
        let mut bare = Vec::new();
        for (index, body) in model.bodies().iter().enumerate() {
            let shapes = painter.paint(&body.shapes, kinematics.body_pose(index), Some(index));
            // A link without shape and mass, such as between the slides of a base, is not drawn.
            bare.push(shapes.is_empty() && (body.inertia.mass > 0.0 || !body.shapes.is_empty()));
            solids.extend(shapes);
        }
        let origin = |index: usize| Point3::from(kinematics.body_pose(index).translation.vector);
        let mut sticks = Vec::new();
        for (index, body) in model.bodies().iter().enumerate() {
            // The stick represents the link above the joint.
            let (above, from) = match body.parent {
                Some(parent) => (bare[parent], origin(parent)),
                None => (bare_base, Point3::from(base.translation.vector)),
            };
            if above {
                sticks.push((from, origin(index)));
            }
            let last = model.frames().iter().rev().find(|frame| frame.body == Some(index));
            if let Some(last) =
                last.filter(|_| bare[index] && !model.bodies().iter().any(|b| b.parent == Some(index)))
            {
                sticks.push((
                    origin(index),
                    kinematics.body_pose(index) * Point3::from(last.placement.translation.vector),
                ));
            }
        }
        let reach = sticks.iter().map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
        let thick = 0.08 * reach;
        solids.extend(sticks.iter().filter_map(|(a, b)| stick(a, b, thick)));
        Self { solids }
    }

    /// Returns points that enclose the scene.
    pub(super) fn points(&self) -> impl Iterator<Item = Point3<f64>> {
        self.solids.iter().flat_map(|solid| solid.faces().into_iter().flat_map(|face| face.points))
    }

    /// Returns the faces that point towards the camera and are not inside another body.
    pub(super) fn visible(&self, eye: &Vector3<f64>) -> Vec<Face> {
        let mut faces = Vec::new();
        for (index, solid) in self.solids.iter().enumerate() {
            let hidden = |face: &Face| {
                let mut others = self.solids.iter().enumerate().filter(|(other, _)| *other != index);
                others.any(|(_, other)| face.points.iter().all(|point| other.contains(point)))
            };
            faces.extend(
                solid.faces().into_iter().filter(|face| face.normal.dot(eye) > 1e-9 && !hidden(face)),
            );
        }
        faces
    }
}

/// The forms of shapes, each mesh prepared once.
#[derive(Debug)]
pub(super) struct Forms {
    detail: Detail,
    meshes: BTreeMap<String, Option<Form>>,
}

impl Forms {
    pub(super) fn new(detail: Detail) -> Self {
        Self { detail, meshes: BTreeMap::new() }
    }

    /// Returns the form of a shape; `None` if its mesh cannot be read.
    fn form(&mut self, geometry: &Geometry) -> Option<Form> {
        let Geometry::Mesh { uri, path, inline, scale } = geometry else {
            return Form::from_geometry(geometry, self.detail);
        };
        let key = format!("{uri} {path:?} {:?} {scale:?}", inline.as_ref().map(Arc::as_ptr));
        let detail = self.detail;
        self.meshes.entry(key).or_insert_with(|| Form::from_geometry(geometry, detail)).clone()
    }
}

struct Painter<'a> {
    colours: &'a LinkColours,
    /// Number of painted shapes per link.
    used: BTreeMap<String, usize>,
    forms: &'a mut Forms,
}

impl Painter<'_> {
    /// Paints shapes in the colour of the visual at the same place in the link, and skips unreadable meshes.
    fn paint(&mut self, shapes: &[Shape], pose: Isometry3<f64>, body: Option<usize>) -> Vec<Solid> {
        let mut solids = Vec::new();
        for shape in shapes {
            let place = self.used.entry(shape.link.clone()).or_default();
            let colour = self.colours.of_shape(&shape.link, *place, body);
            *place += 1;
            if let Some(form) = self.forms.form(&shape.geometry) {
                solids.push(Solid { pose: pose * shape.placement, form, colour });
            }
        }
        solids
    }
}

/// Returns a capsule between two points, if they are apart.
fn stick(from: &Point3<f64>, to: &Point3<f64>, thick: f64) -> Option<Solid> {
    let way = to - from;
    let length = way.norm();
    if length < 0.25 * thick {
        return None;
    }
    let rotation = motorium_robots::lie::so3::least_rotation(&Vector3::z_axis(), &Unit::new_normalize(way));
    let pose = Isometry3::from_parts(Translation3::from(nalgebra::center(from, to).coords), rotation);
    let form = Form::Primitive(Geometry::Capsule { radius: thick / 2.0, length });
    Some(Solid { pose, form, colour: STICK })
}
