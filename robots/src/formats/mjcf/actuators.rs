//! `<actuator>`: armature, damping, gains and limits of joint drives; and `<tendon>`, whose forces are not
//! supported.

use roxmltree::Node;

use super::attributes::{Attributes, Element, MAIN};
use super::drives::{Drives, PositionDrive};
use super::equality::joint_named;
use super::error::{MjcfError, MjcfProblem};
use super::gains::Gains;
use super::schema::{ACTUATOR, ACTUATORS, TENDON};
use crate::Body;

/// Adds the effects of a section's actuators to the driven joints, and the gains of position actuators.
pub(crate) fn read_actuators<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    bodies: &mut [Body],
    drives: &mut Drives,
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
            return Err(actuator.refused("damping", "only damping proportional to velocity is supported"));
        }
        if armature != 0.0 || damping != 0.0 {
            let attribute = if armature != 0.0 { "armature" } else { "damping" };
            let target = ["joint", "jointinparent"].into_iter().find(|name| node.attribute(*name).is_some());
            let Some(target) = target else {
                return Err(actuator.refused(attribute, "only actuators of a joint support it"));
            };
            if is_free(section, node.attribute(target)) {
                return Err(actuator.refused(attribute, "a free base cannot have it"));
            }
            let joint = &mut bodies[joint_named(bodies, attributes, node, target)?].joint;
            let [gear, ..] = actuator.first_numbers("gear", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])?;
            joint.drive.rotor_inertia += armature * gear * gear;
            joint.dynamics.damping += damping * gear * gear;
        }
        let driven = ["joint", "jointinparent"].into_iter().find(|name| node.attribute(*name).is_some());
        let Some(driven) = driven.filter(|name| !is_free(section, node.attribute(*name))) else {
            drives.others = true;
            attributes.ignored(node, format!("<{tag}> of <actuator>"), "it does not drive a single joint");
            continue;
        };
        let body = joint_named(bodies, attributes, node, driven)?;
        let [gear, ..] = actuator.first_numbers("gear", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])?;
        let drive = position_drive(&actuator, tag, gear)?;
        if drive.is_some() {
            limit(&actuator, gear, &mut bodies[body].joint.limits.effort)?;
        } else {
            let reason = "it is not a position servo: it provides no gains";
            attributes.ignored(node, format!("<{tag}> of <actuator>"), reason);
        }
        // next to a position drive, a motor only adds effort
        let known = drives.by_body.entry(body).or_default();
        *known = drive.or(*known);
    }
    Ok(())
}

/// Applies a drive's force range if it is narrower than the joint's limit.
fn limit(actuator: &Element<'_, '_, '_>, gear: f64, effort: &mut f64) -> Result<(), MjcfError> {
    let limited = match actuator.get("forcelimited") {
        Some("false") => false,
        _ => actuator.get("forcerange").is_some(),
    };
    let Some([low, high]) = actuator.numbers::<2>("forcerange")?.filter(|_| limited) else { return Ok(()) };
    let largest = high.min(-low) * gear.abs();
    if largest > 0.0 {
        *effort = effort.min(largest);
    }
    Ok(())
}

/// Returns the gains of an actuator whose force is proportional to the distance from its control; `None` for
/// others. At the joint they are multiplied by the square of the gear.
fn position_drive(
    actuator: &Element<'_, '_, '_>,
    tag: &str,
    gear: f64,
) -> Result<Option<PositionDrive>, MjcfError> {
    let Gains { gain, bias: [offset, slope, rate], is_fixed, is_affine, .. } = Gains::read(actuator)?;
    // gain (u - q) - rate v: anything else is not a position servo
    let is_servo = is_fixed && is_affine && (slope + gain).abs() <= 1e-9 * gain;
    if !(tag == "position" || tag == "general" && is_servo && offset == 0.0) {
        return Ok(None);
    }
    // MuJoCo interprets a positive number as a ratio to critical damping.
    let (kp, kd, damping_ratio) = (gain, (-rate).max(0.0), rate.max(0.0));
    let squared = gear * gear;
    Ok((kp > 0.0).then_some(PositionDrive { kp: kp * squared, kd: kd * squared, damping_ratio }))
}

/// Returns `true` if a joint is a free joint.
fn is_free(section: Node<'_, '_>, name: Option<&str>) -> bool {
    let named = |node: &Node<'_, '_>| node.attribute("name") == name;
    let mut nodes = section.document().descendants().filter(named);
    nodes.any(|node| {
        node.has_tag_name("freejoint") || node.has_tag_name("joint") && node.attribute("type") == Some("free")
    })
}

/// Checks the tendons of a section.
pub(crate) fn check_tendons<'a, 'i>(
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
