//! Pinocchio's order of the joints of a URDF file.

use std::collections::{BTreeMap, HashSet};

use roxmltree::{Document, Node};

/// Returns the names of the movable joints of a URDF text in Pinocchio's order: depth first, with all joints
/// below one link (including fixed joints) in alphabetical order. The list is empty if the text is not URDF.
///
/// A [`Model`](crate::Model) has a different order: parents before children, and siblings as in the file.
/// [`Model::to_pinocchio`](crate::Model::to_pinocchio) converts the entries of each joint to Pinocchio's
/// conventions, but keeps the model's order.
///
/// ```
/// let urdf = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
///     <joint name="left" type="revolute"><parent link="a"/><child link="b"/></joint>
///     <joint name="arm" type="revolute"><parent link="a"/><child link="c"/></joint></robot>"#;
/// assert_eq!(motorium_robots::pinocchio_joint_order(urdf), ["arm", "left"]);
/// ```
pub fn pinocchio_joint_order(urdf: &str) -> Vec<String> {
    let Ok(document) = Document::parse(urdf) else { return Vec::new() };
    let elements = |name| document.root_element().children().filter(move |node| node.has_tag_name(name));
    let link = |joint: Node<'_, '_>, role| {
        let end = joint.children().find(|node| node.has_tag_name(role))?;
        end.attribute("link").map(str::to_owned)
    };
    // For each link, the joints below it by name: the child link, and whether the joint moves.
    let mut below: BTreeMap<String, BTreeMap<&str, (String, bool)>> = BTreeMap::new();
    let mut children = HashSet::new();
    for joint in elements("joint") {
        let (Some(name), Some(parent), Some(child)) =
            (joint.attribute("name"), link(joint, "parent"), link(joint, "child"))
        else {
            continue;
        };
        children.insert(child.clone());
        let moves = joint.attribute("type") != Some("fixed");
        below.entry(parent).or_default().insert(name, (child, moves));
    }
    let roots = elements("link").filter_map(|link| link.attribute("name"));
    let mut order = Vec::new();
    for root in roots.filter(|link| !children.contains(*link)) {
        // Pending joints, the next one last. Links are removed from `below`, so that loops end.
        let mut open: Vec<(&str, (String, bool))> =
            below.remove(root).into_iter().flat_map(|joints| joints.into_iter().rev()).collect();
        while let Some((name, (child, moves))) = open.pop() {
            if moves {
                order.push(name.to_owned());
            }
            open.extend(below.remove(&child).into_iter().flat_map(|joints| joints.into_iter().rev()));
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_are_depth_first_and_alphabetical() {
        let tree = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
            <link name="e"/>
            <joint name="z" type="fixed"><parent link="a"/><child link="b"/></joint>
            <joint name="k" type="revolute"><parent link="b"/><child link="c"/></joint>
            <joint name="m" type="revolute"><parent link="a"/><child link="d"/></joint>
            <joint name="y" type="prismatic"><parent link="d"/><child link="e"/></joint></robot>"#;
        assert_eq!(pinocchio_joint_order(tree), ["m", "y", "k"]);
        assert!(pinocchio_joint_order("<mujoco/>").is_empty() && pinocchio_joint_order("<robot").is_empty());
    }
}
