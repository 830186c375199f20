//! Conversion of `<equality><connect>` and `<weld>` between bodies to connections between objects.

use std::collections::HashMap;

use motorium_robots::mjcf::{Attributes, HELD, MAIN, MjcfError, MjcfProblem, named};
use motorium_robots::nearest;
use nalgebra::{Isometry3, Point3};
use roxmltree::Node;

use crate::{Connection, ConnectionKind};

/// Placement of a body of the file in the resulting world.
#[derive(Clone, Debug)]
pub(super) struct Held {
    /// Its object, or `world` if it does not move.
    pub(super) object: String,
    /// Frame of the body relative to the object.
    pub(super) frame: Isometry3<f64>,
}

impl Held {
    /// Returns the placement of an immovable body.
    pub(super) fn world(frame: Isometry3<f64>) -> Self {
        Self { object: "world".to_owned(), frame }
    }
}

/// Returns the connections of a section `<equality>`.
pub(super) fn connections<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    bodies: &HashMap<String, Held>,
) -> Result<Vec<Connection>, MjcfError> {
    let mut connections = Vec::new();
    for node in section.children().filter(Node::is_element) {
        let kind = match node.tag_name().name() {
            "connect" => ConnectionKind::Ball,
            "weld" => ConnectionKind::Fixed,
            "joint" | "tendon" => {
                let problem = "it couples joints, which belong to robots: a world has no joints";
                return Err(attributes.error(node, MjcfProblem::Other(problem.to_owned())));
            }
            name => {
                return Err(attributes.error(node, MjcfProblem::Element(format!("{name}> of <equality"))));
            }
        };
        let rule = attributes.element(node, MAIN, &HELD)?;
        if !rule.flag("active", true)? {
            continue;
        }
        let body = |attribute: &'static str| match rule.get(attribute) {
            None => Ok(None),
            Some("world") => Ok(Some(Held::world(Isometry3::identity()))),
            Some(wanted) => bodies.get(wanted).cloned().map(Some).ok_or_else(|| {
                let mut names: Vec<&str> = bodies.keys().map(String::as_str).collect();
                names.sort_unstable();
                let nearest = nearest(wanted, names).map(str::to_owned);
                let (element, name) = (named(node), wanted.to_owned());
                rule.error(MjcfProblem::Unknown { element, what: "body", name, nearest })
            }),
        };
        let first = body("body1")?.ok_or_else(|| rule.missing("body1"))?;
        let second = body("body2")?.unwrap_or_else(|| Held::world(Isometry3::identity()));
        if first.object == second.object {
            return Err(rule
                .fault("the two bodies do not move relative to each other, so there is nothing to connect"));
        }
        let anchor = rule.numbers::<3>("anchor")?;
        if kind == ConnectionKind::Ball && anchor.is_none() {
            return Err(rule.missing("anchor"));
        }
        if rule.numbers::<7>("relpose")?.is_some_and(|pose| pose[3..] != [0.0; 4]) {
            return Err(
                rule.refused("relpose", "bodies are fixed in their poses in the file; change these poses")
            );
        }
        for (name, default) in [("solref", None), ("solimp", None), ("torquescale", Some(1.0))] {
            let stated =
                rule.get(name).filter(|value| default.is_none() || value.trim().parse().ok() != default);
            if stated.is_some() {
                rule.ignore(name, "a connection is rigid in all directions");
            }
        }
        let point = first.frame * Point3::from(anchor.unwrap_or_default());
        let parts = [first.object, second.object];
        connections.push(Connection { parts, kind, point: point.coords.into() });
    }
    Ok(connections)
}
