//! Descriptions of elements in messages.

use roxmltree::Node;

/// Describes an element with the name of its link or joint: `inertia of link "arm"`.
pub(super) fn named(node: Node<'_, '_>) -> String {
    let element = node.tag_name().name();
    let owner = node.ancestors().find(|owner| owner.has_tag_name("link") || owner.has_tag_name("joint"));
    match owner.and_then(|owner| Some((owner, owner.attribute("name")?))) {
        Some((owner, name)) if owner == node => format!("{element} name=\"{name}\""),
        Some((owner, name)) => format!("{element}> of <{} name=\"{name}\"", owner.tag_name().name()),
        None => element.to_owned(),
    }
}
