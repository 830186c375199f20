//! `<equality><joint>`: couplings with which one joint follows another joint.

use roxmltree::Node;

use super::attributes::{Attributes, MAIN, named};
use super::error::{MjcfError, MjcfProblem};
use super::schema::EQUALITY;
use crate::nearest::nearest;
use crate::{Body, Coordinate, MimicMode};

/// Converts first-order couplings to mimic joints. `of` is a body index until joints are numbered.
pub(crate) fn couple<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    bodies: &mut [Body],
    references: &[f64],
    mimic: MimicMode,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        let rule = attributes.unchecked(node, MAIN, &EQUALITY)?;
        if !rule.flag("active", true)? {
            continue;
        }
        let name = node.tag_name().name();
        if name != "joint" {
            return Err(rule.error(MjcfProblem::Element(format!("{name}> of <equality"))));
        }
        let rule = rule.checked()?;
        let follower = joint_named(bodies, attributes, node, "joint1")?;
        let master = joint_named(bodies, attributes, node, "joint2")?;
        let polynomial = rule.first_numbers("polycoef", [0.0, 1.0, 0.0, 0.0, 0.0])?;
        if polynomial[2..] != [0.0; 3] {
            return Err(rule.refused("polycoef", "only first-order couplings are supported"));
        }
        if mimic == MimicMode::Independent {
            continue;
        }
        let straight = |body: usize| matches!(bodies[body].joint.coordinate, Coordinate::Independent(_));
        let followed = bodies
            .iter()
            .any(|body| matches!(body.joint.coordinate, Coordinate::Mimic { of, .. } if of == follower));
        if follower == master || !straight(follower) || !straight(master) || followed {
            return Err(
                rule.fault("chains of couplings are not supported; couple every joint to the same joint")
            );
        }
        // Both positions are relative to the pose of the file.
        let multiplier = polynomial[1];
        let offset = references[follower] + polynomial[0] - multiplier * references[master];
        bodies[follower].joint.coordinate = Coordinate::Mimic { of: master, multiplier, offset };
    }
    Ok(())
}

/// Returns the body whose joint is named by an attribute.
pub(crate) fn joint_named(
    bodies: &[Body],
    attributes: &Attributes<'_, '_>,
    node: Node<'_, '_>,
    attribute: &'static str,
) -> Result<usize, MjcfError> {
    let wanted = node.attribute(attribute).ok_or_else(|| attributes.missing(node, attribute))?;
    bodies.iter().position(|body| body.joint.name == wanted).ok_or_else(|| {
        let nearest = nearest(wanted, bodies.iter().map(|body| &*body.joint.name)).map(str::to_owned);
        let (element, name) = (named(node), wanted.to_owned());
        attributes.error(node, MjcfProblem::Unknown { element, what: "joint", name, nearest })
    })
}
