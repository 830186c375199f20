//! `<equality><joint>`: one joint that follows another.

use roxmltree::Node;

use super::attributes::{Attributes, named};
use super::error::{MjcfError, MjcfProblem};
use crate::nearest::nearest;
use crate::{Body, Coordinate, MimicMode};

/// Makes mimic joints of first-order couplings. Until joints are numbered they name their master by its body.
pub(super) fn couple<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    bodies: &mut [Body],
    references: &[f64],
    mimic: MimicMode,
) -> Result<(), MjcfError> {
    for rule in section.children().filter(Node::is_element) {
        if rule.attribute("active") == Some("false") {
            continue;
        }
        let name = rule.tag_name().name();
        if name != "joint" {
            return Err(attributes.error(rule, MjcfProblem::Element(format!("{name}> of <equality"))));
        }
        let find = |attribute: &'static str| {
            let wanted = rule.attribute(attribute).ok_or_else(|| attributes.missing(rule, attribute))?;
            bodies.iter().position(|body| body.joint.name == wanted).ok_or_else(|| {
                let nearest = nearest(wanted, bodies.iter().map(|body| &*body.joint.name)).map(str::to_owned);
                let (element, name) = (named(rule), wanted.to_owned());
                attributes.error(rule, MjcfProblem::Unknown { element, what: "joint", name, nearest })
            })
        };
        let (follower, master) = (find("joint1")?, find("joint2")?);
        let value = rule.attribute("polycoef").unwrap_or("0 1 0 0 0");
        let polynomial = attributes.parse(rule, "polycoef", value, 0)?;
        if polynomial.iter().skip(2).any(|factor| *factor != 0.0) {
            return Err(attributes.refused(
                rule,
                "polycoef",
                value,
                "couplings of first order alone are read",
            ));
        }
        if mimic == MimicMode::Independent {
            continue;
        }
        let straight = |body: usize| matches!(bodies[body].joint.coordinate, Coordinate::Independent(_));
        let followed = bodies
            .iter()
            .any(|body| matches!(body.joint.coordinate, Coordinate::Mimic { of, .. } if of == follower));
        if follower == master || !straight(follower) || !straight(master) || followed {
            let problem = "chains of couplings are not read; couple every joint with the same one".to_owned();
            return Err(attributes.error(rule, MjcfProblem::Other(problem)));
        }
        // Both count from the pose of the file.
        let multiplier = polynomial.get(1).copied().unwrap_or(0.0);
        let offset = references[follower] + polynomial[0] - multiplier * references[master];
        bodies[follower].joint.coordinate = Coordinate::Mimic { of: master, multiplier, offset };
    }
    Ok(())
}
