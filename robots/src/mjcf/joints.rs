//! Joints and stated inertias of bodies.

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Unit, Vector3};
use roxmltree::Node;

use super::attributes::MAIN;
use super::bodies::{POSES, Tree};
use super::error::{MjcfError, MjcfProblem};
use super::pose::pose;
use crate::{Coordinate, Drive, Inertia, Joint, JointDynamics, JointKind, Limits};

const JOINT: &[&str] = &[
    "name",
    "class",
    "type",
    "pos",
    "axis",
    "range",
    "limited",
    "damping",
    "frictionloss",
    "armature",
    "ref",
    "springref",
    "stiffness",
    "springdamper",
    "group",
    "solreflimit",
    "solimplimit",
    "solreffriction",
    "solimpfriction",
    "margin",
    "user",
    "actuatorfrcrange",
    "actuatorfrclimited",
    "actuatorgravcomp",
    "align",
];

impl<'a, 'i> Tree<'_, 'a, 'i> {
    pub(super) fn joint(
        &mut self,
        node: Node<'a, 'i>,
        kind: &str,
        class: &str,
        placement: Isometry3<f64>,
    ) -> Result<Joint, MjcfError> {
        let attributes = self.attributes();
        attributes.only(node, JOINT)?;
        let slide = match kind {
            "slide" => true,
            "hinge" => false,
            _ => return Err(attributes.refused(node, "type", kind, "write hinges and slides")),
        };
        let unit = if slide { 1.0 } else { self.geoms.compiler.angle };
        let axis = Vector3::from(attributes.numbers::<3>(node, class, "axis")?.unwrap_or([0.0, 0.0, 1.0]));
        let axis = Unit::try_new(axis, 1e-14)
            .ok_or_else(|| attributes.error(node, MjcfProblem::Other("the axis is zero".to_owned())))?;
        let range = attributes.numbers::<2>(node, class, "range")?;
        let limited = self.limited(node, class, "limited", range.is_some())?;
        let mut limits = Limits::NONE;
        if limited {
            let [lower, upper] = range.ok_or_else(|| attributes.missing(node, "range"))?;
            (limits.lower, limits.upper) = (lower * unit, upper * unit);
        }
        let force = attributes.numbers::<2>(node, class, "actuatorfrcrange")?;
        if self.limited(node, class, "actuatorfrclimited", force.is_some())?
            && let Some([low, high]) = force
        {
            limits.effort = low.abs().max(high.abs());
        }
        let number = |name| attributes.number(node, class, name, 0.0);
        let reference = number("ref")? * unit;
        let name = match node.attribute("name") {
            Some(name) => name.to_owned(),
            None => format!("joint{}", self.bodies.len()),
        };
        let kind = match (slide, limited) {
            (true, _) => JointKind::Prismatic,
            (false, true) => JointKind::Revolute,
            (false, false) => JointKind::Continuous,
        };
        let mut joint = Joint {
            name,
            kind,
            axis,
            placement,
            limits,
            dynamics: JointDynamics { damping: number("damping")?, friction: number("frictionloss")? },
            drive: Drive { reduction: 1.0, rotor_inertia: number("armature")? },
            safety: None,
            coordinate: Coordinate::Independent(0),
        };
        // The file shows the body where its joint stands at `ref`.
        joint.placement = joint.pose(-reference);
        self.references.push(reference);
        Ok(joint)
    }

    fn limited(&self, node: Node<'a, 'i>, class: &str, name: &str, given: bool) -> Result<bool, MjcfError> {
        let attributes = self.attributes();
        match attributes.get(node, class, name).unwrap_or("auto") {
            "true" => Ok(true),
            "false" => Ok(false),
            "auto" => Ok(given && self.geoms.compiler.auto_limits),
            value => Err(attributes.refused(node, name, value, "expected true, false or auto")),
        }
    }

    pub(super) fn inertial(&self, node: Node<'a, 'i>) -> Result<Inertia, MjcfError> {
        let attributes = self.attributes();
        attributes.only(node, &[&["mass", "diaginertia", "fullinertia"], &POSES[..]].concat())?;
        let pose = pose(attributes, self.geoms.compiler, node, MAIN)?;
        let [mass] =
            attributes.numbers::<1>(node, MAIN, "mass")?.ok_or_else(|| attributes.missing(node, "mass"))?;
        let rotational = match attributes.numbers::<6>(node, MAIN, "fullinertia")? {
            Some([xx, yy, zz, xy, xz, yz]) => Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            None => {
                let diagonal = attributes.numbers::<3>(node, MAIN, "diaginertia")?;
                let diagonal = diagonal.ok_or_else(|| attributes.missing(node, "diaginertia"))?;
                Matrix3::from_diagonal(&Vector3::from(diagonal))
            }
        };
        let least = SymmetricEigen::new(rotational).eigenvalues.min();
        if mass < 0.0 || least < 0.0 {
            let problem =
                format!("mass {mass} kg and a least moment of {least} kg m2: neither can be negative");
            return Err(attributes.error(node, MjcfProblem::Other(problem)));
        }
        Ok(Inertia { mass, com: Vector3::zeros(), rotational }.moved(&pose))
    }
}
