//! Moving links as objects of one or more shapes, with masses from the `<inertial>` elements.

use motorium_robots::BasePose;
use nalgebra::{Isometry3, Matrix3, UnitQuaternion};
use roxmltree::Node;

use super::super::reading::{fixed, problem, unique};
use super::super::{ObjectMass, WorldFileError};
use super::reader::Reader;
use super::values::{child, elements, is_true, named};
use crate::{CompoundPart, Object, ObjectShape};

/// Centres of mass closer than this \[m\] count as equal.
const SAME_CENTRE: f64 = 1e-6;
/// Relative difference below which inertias count as equal, because files contain rounded values.
const SAME_INERTIA: f64 = 1e-3;

/// Default density in SDF \[kg/m3\].
const WATER: f64 = 1000.0;

/// Reason for the warning about an inertia.
const UNIFORM: &str = "an object has the inertia of its shapes with uniform density";

/// A collision of a moving link.
struct Part<'a, 'i> {
    collision: Node<'a, 'i>,
    /// Pose in the model.
    frame: Isometry3<f64>,
    shape: ObjectShape,
}

impl Reader<'_> {
    /// Adds the object of a link whose pose in its model is `within`. The object has the pose of the model.
    pub(super) fn free_link(
        &mut self,
        link: Node<'_, '_>,
        model: &str,
        (model_pose, within): (&Isometry3<f64>, &Isometry3<f64>),
    ) -> Result<(), WorldFileError> {
        let mut parts: Vec<Part<'_, '_>> = Vec::new();
        let mut surface = None;
        for collision in named(link, "collision") {
            let frame = within * self.pose(collision, link.attribute("name"))?;
            let geometry = self.geometry(collision)?;
            if geometry.tag_name().name() == "plane" {
                return Err(problem(self.path, geometry, "a plane cannot move; make its model <static>"));
            }
            let own = self.surface(collision)?;
            if *surface.get_or_insert(own) != own {
                let text = "its friction or restitution differs from the first collision of its link: an object has \
                            one surface";
                return Err(problem(self.path, collision, text));
            }
            parts.push(Part { collision, frame, shape: self.shape(geometry, true)? });
        }
        let (Some((friction, restitution)), Some(first)) = (surface, parts.first()) else {
            let text =
                format!("model \"{model}\" moves and has no <collision>, which defines its shape; add one");
            return Err(problem(self.path, link, text));
        };
        let name = unique(&self.world, model);
        self.paint(first.collision, &name);
        let inertial = child(link, "inertial");
        for node in inertial.into_iter().flat_map(elements) {
            self.leave_out("inertial", node)?;
        }
        let automatic = inertial.filter(|node| node.attribute("auto").is_some_and(is_true));
        let masses: Option<Vec<f64>> = match automatic {
            Some(inertial) => {
                Some(parts.iter().map(|part| self.automatic_mass(inertial, part)).collect::<Result<_, _>>()?)
            }
            None => None,
        };
        let mass = match &masses {
            Some(masses) => masses.iter().sum(),
            None => self.number_or(inertial, "mass", 1.0)?,
        };
        let shape = match <[_; 1]>::try_from(parts) {
            Ok([Part { frame, shape, .. }]) => shape.displaced(&frame),
            Err(parts) => {
                let part = |(index, Part { frame, shape, .. }): (usize, Part<'_, '_>)| {
                    let BasePose { position, rpy } = BasePose::from_isometry(&frame);
                    let mass = masses.as_ref().and_then(|masses| masses.get(index).copied());
                    CompoundPart { shape, position, rpy, mass }
                };
                ObjectShape::Compound(parts.into_iter().enumerate().map(part).collect())
            }
        };
        let object = Object { mass: Some(mass), friction, restitution, ..fixed(name, shape, model_pose) };
        match (automatic, object.mass_properties()) {
            (Some(inertial), _) => {
                for name in ["mass", "pose", "inertia"] {
                    if let Some(node) = child(inertial, name) {
                        let what = format!("<{name}> of <inertial auto>");
                        self.ignore(node, &what, "it follows from the shapes and their density");
                    }
                }
            }
            (None, Some(own)) => self.compare_inertia(link, inertial, within, &own)?,
            // reported by the check of the object
            (None, None) => {}
        }
        self.world.objects.push(object);
        Ok(())
    }

    /// Returns the mass of a shape, computed with the density of its collision or, by default, of its link.
    fn automatic_mass(&self, inertial: Node<'_, '_>, part: &Part<'_, '_>) -> Result<f64, WorldFileError> {
        let of_link = self.number_or(Some(inertial), "density", WATER)?;
        let density = self.number_or(Some(part.collision), "density", of_link)?;
        let volume = part.shape.volume().ok_or_else(|| {
            problem(
                self.path,
                inertial,
                "the mass cannot be computed, because a shape has no volume; write <mass>",
            )
        })?;
        Ok(density * volume)
    }

    /// Warns if the centre of mass or inertia of a link differs from the object's.
    fn compare_inertia(
        &mut self,
        link: Node<'_, '_>,
        inertial: Option<Node<'_, '_>>,
        within: &Isometry3<f64>,
        own: &ObjectMass,
    ) -> Result<(), WorldFileError> {
        let stated = match inertial {
            Some(inertial) => within * self.pose(inertial, None)?,
            None => *within,
        };
        let frame = own.frame.unwrap_or_default();
        let around = inertial.unwrap_or(link);
        if (stated.translation.vector - frame.translation.vector).norm() > SAME_CENTRE {
            let at = inertial.and_then(|node| child(node, "pose")).unwrap_or(around);
            let reason = "an object has the centre of mass of its shapes with uniform density";
            self.ignore(at, "<pose> of <inertial>", reason);
        }
        let inertia = inertial.and_then(|node| child(node, "inertia"));
        let part = |name: &str, default: f64| self.number_or(inertia, name, default);
        let [xx, yy, zz] = [part("ixx", 1.0)?, part("iyy", 1.0)?, part("izz", 1.0)?];
        let [xy, xz, yz] = [part("ixy", 0.0)?, part("ixz", 0.0)?, part("iyz", 0.0)?];
        let turned = |rotation: &UnitQuaternion<f64>, tensor: Matrix3<f64>| {
            let rotation = rotation.to_rotation_matrix();
            rotation.matrix() * tensor * rotation.matrix().transpose()
        };
        let tensor = turned(&stated.rotation, Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
        let own = turned(&frame.rotation, Matrix3::from_diagonal(&own.moments));
        if (tensor - own).norm() > SAME_INERTIA * tensor.norm() {
            match inertia {
                Some(inertia) => self.ignore(inertia, "<inertia> of <inertial>", UNIFORM),
                None => self.ignore(around, "the default <inertia> of 1 kg m2", UNIFORM),
            }
        }
        Ok(())
    }
}
