//! `<keyframe>`: named poses.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use roxmltree::Node;

use super::attributes::{Attributes, named};
use super::error::{MjcfError, MjcfProblem};
use crate::{Base, Body};

/// A pose of a file: one position for each body's joint \[rad or m\].
pub(crate) struct Keyframe {
    pub(crate) name: String,
    pub(crate) base: Option<Isometry3<f64>>,
    pub(crate) positions: Vec<f64>,
}

/// Reads the poses of a section; velocities, times, controls and activations are not part of a pose.
pub(crate) fn read_keyframes<'a, 'i>(
    section: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    (base, bodies): (&Base, &[Body]),
    keyframes: &mut Vec<Keyframe>,
) -> Result<(), MjcfError> {
    for node in section.children().filter(Node::is_element) {
        if !node.has_tag_name("key") {
            let problem = MjcfProblem::Element(format!("{}> of <keyframe", node.tag_name().name()));
            return Err(attributes.error(node, problem));
        }
        let known = ["name", "time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat"];
        attributes.refuse_unknown(node, |name| known.contains(&name))?;
        let name = node.attribute("name").map_or_else(|| format!("key{}", keyframes.len()), str::to_owned);
        if keyframes.iter().any(|other| other.name == name) {
            return Err(attributes.error(node, MjcfProblem::Duplicate { what: "key", name }));
        }
        // Without positions it equals the pose of the file.
        let Some(value) = node.attribute("qpos") else { continue };
        let own = if base.floating { 7 } else { 0 };
        let count = own + bodies.len();
        let numbers = attributes.parse(node, "qpos", value, count..=count)?;
        let pose = match numbers[..own] {
            [x, y, z, qw, qx, qy, qz] => {
                let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-9);
                let rotation = rotation.ok_or_else(|| {
                    attributes.error(
                        node,
                        MjcfProblem::Number {
                            element: named(node),
                            attribute: "qpos".to_owned(),
                            value: value.to_owned(),
                            expected: "a nonzero quaternion after the position of the base".to_owned(),
                        },
                    )
                })?;
                Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
            }
            _ => None,
        };
        keyframes.push(Keyframe { name, base: pose, positions: numbers[own..].to_vec() });
    }
    Ok(())
}
