//! `<joint>`, `<freejoint>` and `<inertial>`.

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Unit, Vector3};
use roxmltree::Node;

use super::attributes::{Element, MAIN};
use super::bodies::{SpringDamper, Tree};
use super::compiler::RADIANS;
use super::error::MjcfError;
use super::pose::pose;
use super::schema::{INERTIAL, is_off};
use crate::formats::urdf::has_many_turns;
use crate::{Coordinate, Drive, Inertia, Joint, JointDynamics, JointKind, Limits, ModelWarning};

const SPRINGS: &str = "springs of a free base are not supported";

impl<'a, 'i> Tree<'_, 'a, 'i> {
    /// Reads a hinge or slide joint whose anchor is at `placement` in the frame of the parent body.
    pub(crate) fn joint(
        &mut self,
        joint: &Element<'_, 'a, 'i>,
        placement: Isometry3<f64>,
    ) -> Result<Joint, MjcfError> {
        let slide = match joint.get("type").unwrap_or("hinge") {
            "slide" => true,
            "hinge" => false,
            _ => return Err(joint.refused("type", "use a hinge or slide joint")),
        };
        let unit = if slide { 1.0 } else { self.geoms.compiler.angle };
        let axis = Vector3::from(joint.numbers::<3>("axis")?.unwrap_or([0.0, 0.0, 1.0]));
        let axis = Unit::try_new(axis, 1e-14).ok_or_else(|| joint.fault("the axis is zero"))?;
        let range = self.range(joint, "limited", "range")?;
        let mut limits = Limits::NONE;
        if let Some([lower, upper]) = range {
            (limits.lower, limits.upper) = (lower * unit, upper * unit);
        }
        if let Some([low, high]) = self.range(joint, "actuatorfrclimited", "actuatorfrcrange")? {
            limits.effort = high.min(-low);
            if limits.effort <= 0.0 {
                return Err(joint.refused("actuatorfrcrange", "effort limits must be symmetric"));
            }
            if high != -low {
                let reason = "effort limits must be symmetric: the smaller limit is used";
                joint.ignore("actuatorfrcrange", reason);
            }
        }
        let reference = joint.number("ref", 0.0)? * unit;
        let [damping, quadratic, cubic] = joint.first_numbers("damping", [0.0; 3])?;
        if quadratic != 0.0 || cubic != 0.0 {
            return Err(joint.refused("damping", "only damping proportional to velocity is supported"));
        }
        let [mut stiffness, quadratic, cubic] = joint.first_numbers("stiffness", [0.0; 3])?;
        if quadratic != 0.0 || cubic != 0.0 {
            joint.ignore("stiffness", "only linear springs are supported: it is ignored");
            stiffness = 0.0;
        }
        if stiffness < 0.0 {
            return Err(joint.refused("stiffness", "expected a number from 0 up"));
        }
        let rest = joint.number("springref", 0.0)? * unit;
        let [time_constant, ratio] = joint.numbers::<2>("springdamper")?.unwrap_or_default();
        if [time_constant, ratio] != [0.0; 2] {
            if time_constant <= 0.0 || ratio <= 0.0 {
                return Err(joint.refused("springdamper", "expected two numbers above 0"));
            }
            let (body, node) = (self.bodies.len(), joint.node);
            self.spring_dampers.push(SpringDamper { body, time_constant, ratio, node });
        }
        if joint.get("springyield").is_some_and(|value| !is_off(value)) {
            joint.ignore("springyield", "yielding springs are not supported");
        }
        let name = match joint.node.attribute("name") {
            Some(name) => name.to_owned(),
            None => format!("joint{}", self.bodies.len()),
        };
        let kind = match (slide, range) {
            (true, _) => JointKind::Prismatic,
            (false, Some(_)) => JointKind::Revolute,
            (false, None) => JointKind::Continuous,
        };
        if kind == JointKind::Revolute
            && self.geoms.compiler.angle == 1.0
            && has_many_turns([limits.lower, limits.upper])
        {
            let Limits { lower, upper, .. } = limits;
            let warning = ModelWarning::ManyTurns { joint: name.clone(), format: RADIANS, lower, upper };
            self.attributes().warn(Some(warning));
        }
        let friction = joint.number("frictionloss", 0.0)?;
        let mut built = Joint {
            name,
            kind,
            axis,
            placement,
            limits,
            dynamics: JointDynamics { damping, friction, stiffness, rest },
            drive: Drive { reduction: 1.0, rotor_inertia: joint.number("armature", 0.0)? },
            safety: None,
            coordinate: Coordinate::Independent(0),
        };
        // the file shows the body with its joint at `ref`
        built.placement = built.pose(-reference);
        self.references.push(reference);
        Ok(built)
    }

    /// Returns the active range of a joint by MuJoCo's rule for `limited`, `range` and the compiler's
    /// `autolimits`.
    fn range(
        &self,
        joint: &Element<'_, 'a, 'i>,
        limited: &'static str,
        range: &'static str,
    ) -> Result<Option<[f64; 2]>, MjcfError> {
        let given = joint.numbers::<2>(range)?;
        let [low, high] = given.unwrap_or_default();
        match joint.get(limited).unwrap_or("auto") {
            "false" => Ok(None),
            "true" if given.is_none() => Err(joint.missing(range)),
            "true" if low >= high => {
                Err(joint.refused(range, "expected the lower limit before the upper limit"))
            }
            "true" => Ok(given),
            "auto" if [low, high] != [0.0; 2] && !self.geoms.compiler.auto_limits => {
                Err(joint.refused(range, "without autolimits it requires an explicit limited attribute"))
            }
            "auto" => Ok(given.filter(|_| low < high)),
            _ => Err(joint.refused(limited, "expected true, false or auto")),
        }
    }

    /// Rejects attributes that a floating base cannot have. Limits, axis and anchor of a free joint have no
    /// effect in MuJoCo.
    pub(crate) fn check_free(
        &self,
        body: Node<'a, 'i>,
        joint: &Element<'_, 'a, 'i>,
    ) -> Result<(), MjcfError> {
        for name in ["armature", "damping", "frictionloss", "springdamper"] {
            if joint.get(name).is_some_and(|value| !is_off(value)) {
                return Err(joint.refused(name, "a free base cannot have it; write a <freejoint/>"));
            }
        }
        if joint.get("stiffness").is_some_and(|value| !is_off(value)) {
            joint.ignore("stiffness", SPRINGS);
        }
        let reason = "the base frame would move to the centre of mass; place it there in the file";
        let alone = !body.descendants().skip(1).any(|inside| inside.has_tag_name("body"));
        match joint.get("align").unwrap_or("auto") {
            "true" if alone => Err(joint.refused("align", reason)),
            "auto" if alone && self.geoms.compiler.align_free => {
                let compilers = body.document().root_element().children();
                let compiler = compilers.rev().find(|node| node.attribute("alignfree") == Some("true"));
                Err(self.attributes().refused(compiler.unwrap_or(body), "alignfree", "true", reason))
            }
            "true" | "false" | "auto" => Ok(()),
            _ => Err(joint.refused("align", "expected true, false or auto")),
        }
    }

    pub(crate) fn inertial(&self, node: Node<'a, 'i>) -> Result<Inertia, MjcfError> {
        let inertial = self.attributes().element(node, MAIN, &INERTIAL)?;
        let pose = pose(&inertial, self.geoms.compiler)?;
        for name in ["pos", "mass"] {
            inertial.get(name).ok_or_else(|| inertial.missing(name))?;
        }
        let mass = inertial.number("mass", 0.0)?;
        let diagonal = inertial.numbers::<3>("diaginertia")?;
        let rotational = match (inertial.numbers::<6>("fullinertia")?, diagonal) {
            (Some(_), Some(_)) => {
                return Err(inertial.refused("diaginertia", "it conflicts with fullinertia"));
            }
            (Some([xx, yy, zz, xy, xz, yz]), None) => {
                if let Some((way, ..)) = inertial.orientation()? {
                    return Err(inertial.refused(way, "fullinertia is in the axes of the body"));
                }
                Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            }
            (None, Some(diagonal)) => Matrix3::from_diagonal(&Vector3::from(diagonal)),
            (None, None) => return Err(inertial.missing("diaginertia")),
        };
        let least = SymmetricEigen::new(rotational).eigenvalues.min();
        if mass < 0.0 || least < 0.0 {
            let problem = format!(
                "mass {mass} kg and smallest principal moment {least} kg m2: neither can be negative"
            );
            return Err(inertial.fault(problem));
        }
        Ok(Inertia { mass, com: Vector3::zeros(), rotational }.moved(&pose))
    }
}
