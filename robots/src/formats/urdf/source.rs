//! Validation of the XML: well-formed, complete and numeric, with positions. `urdf-rs` reads the values, but
//! its errors have no position and it cannot distinguish an absent element from a default one.

use std::collections::HashMap;
use std::ops::Range;

use roxmltree::{Document, Node, ParsingOptions};

use super::doubts::warn_of_doubts;
use super::error::{UrdfError, UrdfProblem};
use super::named::named;
use super::transmission;
use super::warning::ModelWarning;
use crate::formats::lines::Lines;
use crate::formats::options::ShapeSource;
use crate::nearest::nearest;
use crate::{Drive, Position, SafetyController};

/// Information of the file that the parsed values lack, in file order.
pub(crate) struct Survey {
    pub(crate) links: Vec<Position>,
    pub(crate) joints: Vec<JointSource>,
    /// Name and content of each transmission, by joint.
    pub(crate) drives: HashMap<String, (String, Drive)>,
    pub(crate) warnings: Vec<ModelWarning>,
    /// The text, with all parts blanked that the model does not use.
    pub(crate) text: String,
}

pub(crate) struct JointSource {
    pub(crate) at: Position,
    /// Attributes of `<limit>`, if there is one.
    pub(crate) limit: Option<LimitSource>,
    pub(crate) safety: Option<SafetyController>,
}

pub(crate) struct LimitSource {
    pub(crate) at: Position,
    pub(crate) has_effort: bool,
}

/// Numeric attributes: element, attribute, count, required.
const NUMBERS: &[(&str, &str, usize, bool)] = &[
    ("origin", "xyz", 3, false),
    ("origin", "rpy", 3, false),
    ("axis", "xyz", 3, true),
    ("mass", "value", 1, true),
    ("inertia", "ixx", 1, true),
    ("inertia", "ixy", 1, true),
    ("inertia", "ixz", 1, true),
    ("inertia", "iyy", 1, true),
    ("inertia", "iyz", 1, true),
    ("inertia", "izz", 1, true),
    ("limit", "lower", 1, false),
    ("limit", "upper", 1, false),
    ("limit", "effort", 1, false),
    ("limit", "velocity", 1, false),
    ("dynamics", "damping", 1, false),
    ("dynamics", "friction", 1, false),
    ("mimic", "multiplier", 1, false),
    ("mimic", "offset", 1, false),
    ("box", "size", 3, true),
    ("cylinder", "radius", 1, true),
    ("cylinder", "length", 1, true),
    ("capsule", "radius", 1, true),
    ("capsule", "length", 1, true),
    ("sphere", "radius", 1, true),
    ("mesh", "scale", 3, false),
    ("safety_controller", "soft_lower_limit", 1, false),
    ("safety_controller", "soft_upper_limit", 1, false),
    ("safety_controller", "k_position", 1, false),
    ("safety_controller", "k_velocity", 1, false),
];

const JOINT_TYPES: [&str; 7] =
    ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

/// Checks the text and records positions.
pub(crate) fn survey(text: &str, shapes: ShapeSource) -> Result<Survey, UrdfError> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        // The message already starts with the position.
        let message = error.to_string().replace(&format!(" at {at}"), "");
        // Without its namespace declaration, xacro is not even valid XML.
        let problem = match text.contains("<xacro:") {
            true => UrdfProblem::Xacro,
            false => UrdfProblem::Xml(message),
        };
        UrdfError::new(Position { line: at.row, column: at.col }, problem)
    })?;
    let root = document.root_element();
    let source = Source { lines: Lines::new(document.input_text()), shapes };
    if let Some(node) = document.descendants().find(|node| is_xacro(node)) {
        return Err(UrdfError::new(source.position(node), UrdfProblem::Xacro));
    }
    if root.tag_name().name() != "robot" {
        return Err(source.error(root, UrdfProblem::Root(root.tag_name().name().to_owned())));
    }
    let (mut links, mut joints, mut unused) = (Vec::new(), Vec::new(), Vec::new());
    let (mut drives, mut warnings) = (HashMap::new(), Vec::new());
    for child in root.children().filter(Node::is_element) {
        match child.tag_name().name() {
            "link" => {
                source.check_link(child, &mut unused)?;
                links.push(source.position(child));
            }
            "joint" => joints.push(source.check_joint(child, &mut unused)?),
            "transmission" => {
                transmission::read(child, &mut drives, &mut warnings)
                    .map_err(|(node, problem)| source.error(node, problem))?;
                unused.push(child.range());
            }
            _ => unused.push(child.range()),
        }
    }
    if links.is_empty() {
        return Err(source.error(root, UrdfProblem::Empty));
    }
    warn_of_doubts(root, &source.lines, &mut warnings);
    Ok(Survey { links, joints, drives, warnings, text: blank(text, &unused) })
}

fn is_xacro(node: &Node<'_, '_>) -> bool {
    let unexpanded = |value: &str| value.contains("${") || value.contains("$(");
    node.is_element()
        && (node.tag_name().namespace().is_some_and(|name| name.contains("xacro"))
            || node.attributes().any(|attribute| unexpanded(attribute.value())))
}

struct Source<'a> {
    lines: Lines<'a>,
    shapes: ShapeSource,
}

impl<'a> Source<'a> {
    fn position(&self, node: Node<'_, '_>) -> Position {
        self.lines.position(node.range().start)
    }

    fn error(&self, node: Node<'_, '_>, problem: UrdfProblem) -> UrdfError {
        UrdfError::new(self.position(node), problem)
    }

    fn check_link(&self, link: Node<'a, '_>, unused: &mut Vec<Range<usize>>) -> Result<(), UrdfError> {
        self.require_attribute(link, "name")?;
        self.at_most_one(link, &["inertial"])?;
        for child in link.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "inertial" => {
                    self.at_most_one(child, &["origin", "mass", "inertia"])?;
                    self.require_element(child, "mass")?;
                    self.require_element(child, "inertia")?;
                    self.check_numbers(child)?;
                }
                "collision" => {
                    self.at_most_one(child, &["origin", "geometry"])?;
                    let geometry = self.require_element(child, "geometry")?;
                    self.check_geometry(geometry)?;
                    self.check_numbers(child)?;
                }
                "visual" if self.shapes == ShapeSource::Visual => {
                    self.at_most_one(child, &["origin", "geometry"])?;
                    let geometry = self.require_element(child, "geometry")?;
                    self.check_geometry(geometry)?;
                    // Colours are read elsewhere.
                    let materials = child.children().filter(|inside| inside.has_tag_name("material"));
                    unused.extend(materials.map(|material| material.range()));
                }
                _ => unused.push(child.range()),
            }
        }
        Ok(())
    }

    fn check_geometry(&self, geometry: Node<'a, '_>) -> Result<(), UrdfError> {
        let mut shapes = geometry.children().filter(|shape| {
            ["box", "cylinder", "sphere", "capsule", "mesh"].contains(&shape.tag_name().name())
        });
        let shape = shapes.next();
        if let Some(second) = shapes.next() {
            let problem = UrdfProblem::RepeatedElement { element: named(geometry), child: "shape" };
            return Err(self.error(second, problem));
        }
        match shape {
            Some(mesh) if mesh.has_tag_name("mesh") => self.require_attribute(mesh, "filename").map(drop),
            Some(_) => Ok(()),
            None => Err(self.error(
                geometry,
                UrdfProblem::MissingElement {
                    element: named(geometry),
                    child: "box>, <cylinder>, <sphere>, <capsule> or <mesh",
                },
            )),
        }
    }

    fn check_joint(
        &self,
        joint: Node<'a, '_>,
        unused: &mut Vec<Range<usize>>,
    ) -> Result<JointSource, UrdfError> {
        const KNOWN: [&str; 9] = [
            "origin",
            "parent",
            "child",
            "axis",
            "limit",
            "dynamics",
            "mimic",
            "joint_properties",
            "safety_controller",
        ];
        let name = self.require_attribute(joint, "name")?;
        let kind = self.require_attribute(joint, "type")?;
        if !JOINT_TYPES.contains(&kind) {
            let nearest = nearest(kind, JOINT_TYPES).map(str::to_owned);
            let (joint_name, kind) = (name.to_owned(), kind.to_owned());
            return Err(self.error(joint, UrdfProblem::UnknownJointType { joint: joint_name, kind, nearest }));
        }
        self.at_most_one(joint, &KNOWN)?;
        for end in ["parent", "child"] {
            self.require_attribute(self.require_element(joint, end)?, "link")?;
        }
        for child in joint.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "mimic" => drop(self.require_attribute(child, "joint")?),
                // Parsed here, because `urdf-rs` would require all of its attributes.
                "safety_controller" => unused.push(child.range()),
                known if KNOWN.contains(&known) => {}
                _ => unused.push(child.range()),
            }
        }
        self.check_numbers(joint)?;
        let limit = joint.children().find(|child| child.has_tag_name("limit"));
        if let Some(limit) = limit.filter(|_| kind != "fixed") {
            self.require_attribute(limit, "velocity")?;
        }
        let limit = limit
            .map(|limit| LimitSource { at: self.position(limit), has_effort: limit.has_attribute("effort") });
        let safety = joint.children().find(|child| child.has_tag_name("safety_controller")).map(|safety| {
            // The numbers have been checked.
            let number =
                |name, default| safety.attribute(name).and_then(|x| x.trim().parse().ok()).unwrap_or(default);
            SafetyController {
                soft_lower: number("soft_lower_limit", 0.0),
                soft_upper: number("soft_upper_limit", 0.0),
                k_position: number("k_position", 0.0),
                k_velocity: number("k_velocity", 0.0),
            }
        });
        Ok(JointSource { at: self.position(joint), limit, safety })
    }

    /// Checks that every attribute of [`NUMBERS`] below `parent` contains valid numbers.
    fn check_numbers(&self, parent: Node<'a, '_>) -> Result<(), UrdfError> {
        for node in parent.descendants().filter(Node::is_element) {
            for &(element, attribute, expected, required) in NUMBERS {
                if !node.has_tag_name(element) {
                    continue;
                }
                if element == "origin" && node.has_attribute("quat_xyzw") {
                    return Err(self.error(node, UrdfProblem::Quaternion));
                }
                let Some(value) = node.attribute(attribute) else {
                    if required {
                        self.require_attribute(node, attribute)?;
                    }
                    continue;
                };
                let unlimited = element == "limit";
                let good =
                    |word: &str| word.parse().is_ok_and(|x: f64| x.is_finite() || unlimited && !x.is_nan());
                if value.split_whitespace().count() != expected || !value.split_whitespace().all(good) {
                    let value = value.to_owned();
                    let problem = UrdfProblem::Number { element: named(node), attribute, value, expected };
                    return Err(self.error(node, problem));
                }
            }
        }
        Ok(())
    }

    fn require_attribute<'n>(
        &self,
        node: Node<'n, '_>,
        attribute: &'static str,
    ) -> Result<&'n str, UrdfError> {
        node.attribute(attribute).ok_or_else(|| {
            self.error(node, UrdfProblem::MissingAttribute { element: named(node), attribute })
        })
    }

    fn require_element<'n, 'i>(
        &self,
        node: Node<'n, 'i>,
        child: &'static str,
    ) -> Result<Node<'n, 'i>, UrdfError> {
        node.children()
            .find(|candidate| candidate.has_tag_name(child))
            .ok_or_else(|| self.error(node, UrdfProblem::MissingElement { element: named(node), child }))
    }

    fn at_most_one(&self, node: Node<'a, '_>, children: &[&'static str]) -> Result<(), UrdfError> {
        for &child in children {
            if let Some(second) = node.children().filter(|candidate| candidate.has_tag_name(child)).nth(1) {
                return Err(self.error(second, UrdfProblem::RepeatedElement { element: named(node), child }));
            }
        }
        Ok(())
    }
}

/// Replaces ranges of the text by spaces. Visuals, materials and extensions are not used here, and `urdf-rs`
/// would reject a whole robot for a defect in one of them, such as a texture without a file.
fn blank(text: &str, ranges: &[Range<usize>]) -> String {
    let mut blanked = String::with_capacity(text.len());
    let mut from = 0;
    for range in ranges {
        blanked.push_str(&text[from..range.start]);
        blanked.extend(text[range.clone()].chars().map(|c| if c == '\n' { '\n' } else { ' ' }));
        from = range.end;
    }
    blanked.push_str(&text[from..]);
    blanked
}
