//! SRDF, MoveIt's semantic description of a robot: collision rules and named states of its groups.

use std::collections::HashSet;

use roxmltree::{Document, Node, ParsingOptions};

/// The collision rules of an SRDF file. Groups, states and end effectors are skipped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Srdf {
    /// Pairs of links in `<disable_collisions link1 link2>`: these links are not checked against each other.
    pub disabled: Vec<(String, String)>,
    /// Pairs of links in `<enable_collisions link1 link2>`: these links are checked against each other, even
    /// if a rule disables the check.
    pub enabled: Vec<(String, String)>,
    /// Links in `<disable_default_collisions link>`: each of these links is only checked against links that
    /// are paired with it in `enabled`.
    pub disabled_links: Vec<String>,
}

/// An error in an SRDF file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("SRDF:{line}:{column}: {problem}")]
pub struct SrdfError {
    /// Line, counted from 1.
    pub line: u32,
    /// Column in characters, counted from 1.
    pub column: u32,
    /// The problem.
    pub problem: String,
}

/// A `<group_state>`: values of some joints, as written in the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GroupState {
    pub(crate) name: String,
    pub(crate) group: String,
    /// Name and values of each joint; no values if one of them does not parse.
    pub(crate) joints: Vec<(String, Vec<f64>)>,
}

/// An `<end_effector>`: a link with which a group of joints acts on the environment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GroupEnd {
    pub(crate) name: String,
    pub(crate) link: String,
    pub(crate) group: String,
}

impl Srdf {
    /// Parses the collision rules of an SRDF text.
    ///
    /// # Errors
    ///
    /// [`SrdfError`] if the XML is not well-formed, the root is not `<robot>`, or a rule lacks its links.
    pub fn parse(text: &str) -> Result<Self, SrdfError> {
        let document = read(text)?;
        let mut rules = Self::default();
        for rule in document.root_element().children().filter(Node::is_element) {
            let element = rule.tag_name().name();
            let link = |attribute: &str| {
                rule.attribute(attribute).map(str::to_owned).ok_or_else(|| {
                    error(&document, rule, format!("<{element}> has no attribute \"{attribute}\""))
                })
            };
            match element {
                "disable_collisions" => rules.disabled.push((link("link1")?, link("link2")?)),
                "enable_collisions" => rules.enabled.push((link("link1")?, link("link2")?)),
                "disable_default_collisions" => rules.disabled_links.push(link("link")?),
                _ => {}
            }
        }
        Ok(rules)
    }

    /// Returns the rules with `prefix` before all link names, for a [prefixed](crate::Model::prefixed) robot.
    pub fn prefixed(&self, prefix: &str) -> Self {
        let named = |link: &String| format!("{prefix}{link}");
        let pairs = |pairs: &[(String, String)]| pairs.iter().map(|(a, b)| (named(a), named(b))).collect();
        Self {
            disabled: pairs(&self.disabled),
            enabled: pairs(&self.enabled),
            disabled_links: self.disabled_links.iter().map(named).collect(),
        }
    }

    /// Adds `other`, the rules of a further robot in the same world.
    pub fn extend(&mut self, other: Self) {
        self.disabled.extend(other.disabled);
        self.enabled.extend(other.enabled);
        self.disabled_links.extend(other.disabled_links);
    }

    /// Returns the links named in the rules.
    pub fn links(&self) -> HashSet<&str> {
        let pairs = self.disabled.iter().chain(&self.enabled);
        let links = pairs.flat_map(|(first, second)| [first.as_str(), second.as_str()]);
        links.chain(self.disabled_links.iter().map(String::as_str)).collect()
    }
}

/// Parses the group states in the text of an SRDF file, in order.
pub(crate) fn group_states(text: &str) -> Result<Vec<GroupState>, SrdfError> {
    let document = read(text)?;
    let states = document.root_element().children().filter(|node| node.has_tag_name("group_state"));
    let attribute = |node: Node<'_, '_>, name: &str| node.attribute(name).unwrap_or_default().to_owned();
    let numbers = |value: &str| -> Option<Vec<f64>> {
        value.split_whitespace().map(|number| number.parse().ok()).collect()
    };
    Ok(states
        .map(|state| GroupState {
            name: state.attribute("name").unwrap_or("unnamed").to_owned(),
            group: state.attribute("group").unwrap_or("group").to_owned(),
            joints: state
                .children()
                .filter(|node| node.has_tag_name("joint"))
                .map(|joint| {
                    let value = joint.attribute("value").unwrap_or_default();
                    (attribute(joint, "name"), numbers(value).unwrap_or_default())
                })
                .collect(),
        })
        .collect())
}

/// Parses the end effectors in the text of an SRDF file, in order, skipping end effectors without a link.
pub(crate) fn group_ends(text: &str) -> Result<Vec<GroupEnd>, SrdfError> {
    let document = read(text)?;
    let ends = document.root_element().children().filter(|node| node.has_tag_name("end_effector"));
    let text = |node: Node<'_, '_>, name: &str| node.attribute(name).unwrap_or_default().to_owned();
    Ok(ends
        .filter(|end| end.has_attribute("parent_link"))
        .map(|end| GroupEnd {
            name: text(end, "name"),
            link: text(end, "parent_link"),
            group: text(end, "group"),
        })
        .collect())
}

fn read(text: &str) -> Result<Document<'_>, SrdfError> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        let problem = format!("not well-formed XML: {}", error.to_string().replace(&format!(" at {at}"), ""));
        SrdfError { line: at.row, column: at.col, problem }
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let problem = format!("the root element is <{}>, expected <robot>", root.tag_name().name());
        return Err(error(&document, root, problem));
    }
    Ok(document)
}

fn error(document: &Document<'_>, node: Node<'_, '_>, problem: String) -> SrdfError {
    let at = document.text_pos_at(node.range().start);
    SrdfError { line: at.row, column: at.col, problem }
}
