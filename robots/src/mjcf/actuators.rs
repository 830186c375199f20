//! `<actuator>`: armature and damping of joints; and `<tendon>`, whose forces are not read.

use roxmltree::Node;

use super::attributes::{Attributes, MAIN};
use super::equality::joint_named;
use super::error::{MjcfError, MjcfProblem};
use super::schema::{ACTUATOR, ACTUATORS, TENDON};
use crate::Body;

/// Adds what the actuators of a section add to the joints that they drive.
pub(super) fn read_actuators<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    bodies: &mut [Body],
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        let tag = node.tag_name().name();
        if !ACTUATORS.contains(&tag) {
            return Err(attributes.error(node, MjcfProblem::Element(format!("{tag}> of <actuator"))));
        }
        let actuator = attributes.element(node, MAIN, &ACTUATOR)?;
        let armature = actuator.number("armature", 0.0)?;
        let [damping, quadratic, cubic] = actuator.first_numbers("damping", [0.0; 3])?;
        if quadratic != 0.0 || cubic != 0.0 {
            return Err(actuator.refused("damping", "damping is proportional to velocity here"));
        }
        if armature != 0.0 || damping != 0.0 {
            let attribute = if armature != 0.0 { "armature" } else { "damping" };
            let target = ["joint", "jointinparent"].into_iter().find(|name| node.attribute(*name).is_some());
            let Some(target) = target else {
                return Err(actuator.refused(attribute, "it is read of actuators of a joint alone"));
            };
            if is_free(section, node.attribute(target)) {
                return Err(actuator.refused(attribute, "a free base has none"));
            }
            let joint = &mut bodies[joint_named(bodies, attributes, node, target)?].joint;
            let [gear, ..] = actuator.first_numbers("gear", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])?;
            joint.drive.rotor_inertia += armature * gear * gear;
            joint.dynamics.damping += damping * gear * gear;
        }
        let reason = "joints are commanded directly; its gains, ranges and forces are not read";
        attributes.ignored(node, format!("<{tag}> of <actuator>"), reason);
    }
    Ok(())
}

/// True if a joint is a free joint.
fn is_free(section: Node<'_, '_>, name: Option<&str>) -> bool {
    let named = |node: &Node<'_, '_>| node.attribute("name") == name;
    let mut nodes = section.document().descendants().filter(named);
    nodes.any(|node| {
        node.has_tag_name("freejoint") || node.has_tag_name("joint") && node.attribute("type") == Some("free")
    })
}

/// Checks the tendons of a section.
pub(super) fn check_tendons<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        let tag = node.tag_name().name();
        if !["fixed", "spatial"].contains(&tag) {
            return Err(attributes.error(node, MjcfProblem::Element(format!("{tag}> of <tendon"))));
        }
        attributes.element(node, MAIN, &TENDON)?;
    }
    Ok(())
}
