//! Suspicious parts of a well-formed file: misspelt and misplaced names, which would be ignored, angles in
//! degrees, and shapes without a size.

use roxmltree::Node;

use super::named::named;
use super::warning::ModelWarning;
use crate::Position;
use crate::formats::lines::Lines;
use crate::nearest::nearest;

/// The unit of angles in URDF.
pub(super) const RADIANS: &str = "URDF has radians";

/// Optional attributes of each element. A misspelt one would silently keep its default.
const OPTIONAL: &[(&str, &[&str])] = &[
    ("origin", &["xyz", "rpy"]),
    ("limit", &["lower", "upper", "effort"]),
    ("dynamics", &["damping", "friction"]),
    ("mimic", &["multiplier", "offset"]),
    ("mesh", &["scale"]),
    ("safety_controller", &["soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"]),
];

/// Children of each element that has optional ones.
const CHILDREN: &[(&str, &[&str])] = &[
    ("link", &["inertial", "visual", "collision"]),
    (
        "joint",
        &[
            "origin",
            "parent",
            "child",
            "axis",
            "calibration",
            "dynamics",
            "limit",
            "mimic",
            "safety_controller",
        ],
    ),
    ("inertial", &["origin", "mass", "inertia"]),
    ("collision", &["origin", "geometry", "material"]),
];

/// Sizes of each shape.
const SIZES: &[(&str, &[&str])] = &[
    ("box", &["size"]),
    ("cylinder", &["radius", "length"]),
    ("sphere", &["radius"]),
    ("capsule", &["radius"]),
    ("mesh", &["scale"]),
];

fn entry<'t>(table: &'t [(&str, &'t [&'t str])], node: Node<'_, '_>) -> &'t [&'t str] {
    let name = node.tag_name().name();
    table.iter().find(|(element, _)| *element == name).map_or(&[], |(_, names)| names)
}

/// Reports suspicious parts of a robot's links and joints. Visual shapes are not checked.
pub(super) fn warn_of_doubts(robot: Node<'_, '_>, lines: &Lines<'_>, warnings: &mut Vec<ModelWarning>) {
    let parts = robot.children().filter(|part| part.has_tag_name("link") || part.has_tag_name("joint"));
    misplaced(robot, lines, warnings);
    for node in parts.flat_map(|part| part.descendants()).filter(Node::is_element) {
        if node.ancestors().any(|ancestor| ancestor.has_tag_name("visual")) {
            continue;
        }
        let at = lines.position(node.range().start);
        misspelt(node, at, warnings);
        misplaced(node, lines, warnings);
        degrees(node, at, warnings);
        sizes(node, at, warnings);
    }
}

fn misspelt(node: Node<'_, '_>, at: Position, warnings: &mut Vec<ModelWarning>) {
    let mut warn = |found: &str, expected: &str| {
        let (element, found, expected) = (named(node), found.to_owned(), expected.to_owned());
        warnings.push(ModelWarning::Misspelt { element, found, expected, at });
    };
    let missing = || entry(OPTIONAL, node).iter().copied().filter(|name| !node.has_attribute(*name));
    let plain = node.attributes().filter(|attribute| attribute.namespace().is_none());
    for attribute in plain.filter(|attribute| !entry(OPTIONAL, node).contains(&attribute.name())) {
        if let Some(expected) = nearest(attribute.name(), missing()) {
            warn(attribute.name(), expected);
        }
    }
    let known = entry(CHILDREN, node);
    for child in node.children().filter(|child| child.is_element() && child.tag_name().namespace().is_none())
    {
        let name = child.tag_name().name();
        if known.contains(&name) {
            continue;
        }
        if let Some(expected) = nearest(name, known.iter().copied()) {
            warn(name, expected);
        }
    }
}

/// Parents of each element with a meaning in one place only.
const PARENTS: &[(&str, &[&str])] = &[
    ("link", &["robot"]),
    ("joint", &["robot", "transmission"]),
    ("inertial", &["link"]),
    ("visual", &["link"]),
    ("collision", &["link"]),
    ("mass", &["inertial"]),
    ("inertia", &["inertial"]),
    ("geometry", &["visual", "collision"]),
    ("origin", &["joint", "inertial", "visual", "collision"]),
    ("parent", &["joint"]),
    ("child", &["joint"]),
    ("axis", &["joint"]),
    ("limit", &["joint"]),
    ("mimic", &["joint"]),
    ("dynamics", &["joint"]),
    ("safety_controller", &["joint"]),
];

/// Reports children with a meaning elsewhere only, such as the `<origin>` of a link.
fn misplaced(node: Node<'_, '_>, lines: &Lines<'_>, warnings: &mut Vec<ModelWarning>) {
    // elements of other programs have their own rules
    let is_own = |part: Node<'_, '_>| part.has_tag_name("robot") || !entry(PARENTS, part).is_empty();
    if !node.ancestors().filter(Node::is_element).all(is_own) {
        return;
    }
    for child in node.children().filter(|child| child.is_element() && child.tag_name().namespace().is_none())
    {
        let parents = entry(PARENTS, child);
        if let [expected, ..] = parents
            && !parents.contains(&node.tag_name().name())
        {
            let (element, found) = (named(node), child.tag_name().name().to_owned());
            let at = lines.position(child.range().start);
            warnings.push(ModelWarning::Misplaced { element, found, expected, at });
        }
    }
}

/// Returns the numbers of an attribute; empty if it is missing.
fn numbers<'n>(node: Node<'n, '_>, attribute: &str) -> impl Iterator<Item = f64> + use<'n> {
    node.attribute(attribute).unwrap_or("").split_whitespace().filter_map(|word| word.parse().ok())
}

fn degrees(node: Node<'_, '_>, at: Position, warnings: &mut Vec<ModelWarning>) {
    if node.has_tag_name("origin") {
        let (what, angles) = (format!("rpy of <{}>", named(node)), numbers(node, "rpy").collect::<Vec<_>>());
        warnings.extend(ModelWarning::of_angles(&what, &angles, RADIANS, Some(at)));
    }
}

fn sizes(node: Node<'_, '_>, at: Position, warnings: &mut Vec<ModelWarning>) {
    for what in entry(SIZES, node) {
        // a negative scale mirrors
        let is_wrong = |size: &f64| if *what == "scale" { *size == 0.0 } else { *size <= 0.0 };
        if let Some(value) = numbers(node, what).find(is_wrong) {
            let (element, what) = (named(node), (*what).to_owned());
            warnings.push(ModelWarning::NoSize { element, what, value, at });
        }
    }
}
