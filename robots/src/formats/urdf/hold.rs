//! URDF text with held joints.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};

use super::write::{escaped, origin};
use crate::{Coordinate, LoadOptions, parse_urdf_with};

/// Returns the text of a URDF with some joints, and the joints that mimic them, fixed at positions \[rad or
/// m\]. `None` if it does not parse.
pub(crate) fn hold_joints(text: &str, file: Option<&Path>, held: &[(String, f64)]) -> Option<String> {
    let model = parse_urdf_with(text, file, &LoadOptions::default()).ok()?.model;
    let position = |joint: &str| held.iter().find(|(name, _)| name == joint).map(|(_, position)| *position);
    let document = Document::parse(text).ok()?;
    let (mut fixed, mut copied) = (String::with_capacity(text.len()), 0);
    for node in document.root_element().children().filter(|node| node.has_tag_name("joint")) {
        let name = node.attribute("name")?;
        let Some(body) = model.bodies().iter().find(|body| body.joint.name == name) else { continue };
        let joint = &body.joint;
        let led = match joint.coordinate {
            Coordinate::Independent(_) => None,
            Coordinate::Mimic { of, multiplier, offset } => {
                position(&model.joint_names()[of]).map(|leader| multiplier * leader + offset)
            }
        };
        let Some(position) = position(name).or(led) else { continue };
        let place = placement(node)? * joint.placement.inv_mul(&joint.pose(position));
        let link = |end| node.children().find(|child| child.has_tag_name(end))?.attribute("link");
        fixed += &text[copied..node.range().start];
        copied = node.range().end;
        write!(
            fixed,
            r#"<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/>{}</joint>"#,
            escaped(name),
            escaped(link("parent")?),
            escaped(link("child")?),
            origin(&place)
        )
        .ok()?;
    }
    Some(fixed + &text[copied..])
}

/// The `<origin>` of a joint.
fn placement(joint: Node<'_, '_>) -> Option<Isometry3<f64>> {
    let origin = joint.children().find(|child| child.has_tag_name("origin"));
    let numbers = |attribute| -> Option<[f64; 3]> {
        let text = origin.and_then(|origin| origin.attribute(attribute)).unwrap_or("0 0 0");
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        numbers.try_into().ok()
    };
    let ([roll, pitch, yaw], place) = (numbers("rpy")?, numbers("xyz")?);
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Some(Isometry3::from_parts(Translation3::from(Vector3::from(place)), rotation))
}
