//! Attributes with their default classes, and errors with their place.

use std::collections::HashMap;

use roxmltree::{Document, Node};

use super::error::{MjcfError, MjcfProblem};
use crate::Position;
use crate::nearest::nearest;

/// Attributes by name, of each kind of element.
type Class<'a> = HashMap<&'a str, HashMap<&'a str, &'a str>>;

/// The document and its `<default>` classes.
pub(super) struct Attributes<'a, 'i> {
    document: &'a Document<'i>,
    classes: HashMap<String, Class<'a>>,
}

/// The class of those elements that name none.
pub(super) const MAIN: &str = "main";

/// Kinds of elements whose defaults matter here.
const KINDS: [&str; 3] = ["joint", "geom", "mesh"];

impl<'a, 'i> Attributes<'a, 'i> {
    pub(super) fn new(document: &'a Document<'i>) -> Result<Self, MjcfError> {
        let mut attributes = Self { document, classes: HashMap::from([(MAIN.to_owned(), Class::new())]) };
        for section in document.root_element().children().filter(|node| node.has_tag_name("default")) {
            attributes.read_class(section, None)?;
        }
        Ok(attributes)
    }

    /// A class is its parent's, changed.
    fn read_class(&mut self, node: Node<'a, 'i>, parent: Option<&str>) -> Result<(), MjcfError> {
        let name = match (node.attribute("class"), parent) {
            (Some(name), _) => name,
            (None, None) => MAIN,
            (None, Some(_)) => return Err(self.missing(node, "class")),
        };
        let mut class = self.classes.get(parent.unwrap_or(MAIN)).cloned().unwrap_or_default();
        for element in node.children().filter(Node::is_element) {
            let kind = element.tag_name().name();
            if KINDS.contains(&kind) {
                let values = class.entry(kind).or_default();
                values.extend(element.attributes().map(|attribute| (attribute.name(), attribute.value())));
            }
        }
        self.classes.insert(name.to_owned(), class);
        for child in node.children().filter(|child| child.has_tag_name("default")) {
            self.read_class(child, Some(name))?;
        }
        Ok(())
    }

    /// The class of an element: the one it names, or that of the bodies around it.
    pub(super) fn class_of(&self, node: Node<'a, 'i>, around: &'a str) -> Result<&'a str, MjcfError> {
        let class = node.attribute("class").unwrap_or(around);
        self.known_class(node, class).map(|()| class)
    }

    pub(super) fn known_class(&self, node: Node<'_, '_>, class: &str) -> Result<(), MjcfError> {
        if self.classes.contains_key(class) {
            return Ok(());
        }
        let nearest = nearest(class, self.classes.keys().map(String::as_str)).map(str::to_owned);
        let element = node.tag_name().name().to_owned();
        Err(self
            .error(node, MjcfProblem::Unknown { element, what: "class", name: class.to_owned(), nearest }))
    }

    /// The value that the element or its class gives.
    pub(super) fn get(&self, node: Node<'a, 'i>, class: &str, name: &str) -> Option<&'a str> {
        let default = || self.classes.get(class)?.get(node.tag_name().name())?.get(name).copied();
        node.attribute(name).or_else(default)
    }

    /// The value of one of several attributes that exclude each other: the element's own before its class's.
    pub(super) fn one_of<const N: usize>(
        &self,
        node: Node<'a, 'i>,
        class: &str,
        names: [&'static str; N],
    ) -> Option<(&'static str, &'a str)> {
        let own = names.into_iter().find_map(|name| Some((name, node.attribute(name)?)));
        own.or_else(|| names.into_iter().find_map(|name| Some((name, self.get(node, class, name)?))))
    }

    /// Refuses attributes that are not in `known`, of the element itself: those of classes are for others too.
    pub(super) fn only(&self, node: Node<'_, '_>, known: &[&str]) -> Result<(), MjcfError> {
        match node.attributes().find(|attribute| !known.contains(&attribute.name())) {
            None => Ok(()),
            Some(attribute) => Err(self.refused(node, attribute.name(), attribute.value(), "")),
        }
    }

    pub(super) fn refused(
        &self,
        node: Node<'_, '_>,
        name: &str,
        value: &str,
        reason: &'static str,
    ) -> MjcfError {
        let (attribute, value) = (name.to_owned(), value.to_owned());
        self.error(node, MjcfProblem::Attribute { element: named(node), attribute, value, reason })
    }

    pub(super) fn missing(&self, node: Node<'_, '_>, attribute: &'static str) -> MjcfError {
        self.error(node, MjcfProblem::Missing { element: named(node), attribute })
    }

    pub(super) fn error(&self, node: Node<'_, '_>, problem: MjcfProblem) -> MjcfError {
        let at = self.document.text_pos_at(node.range().start);
        MjcfError { file: None, at: Position { line: at.row, column: at.col }, problem }
    }

    /// Exactly `N` numbers.
    pub(super) fn numbers<const N: usize>(
        &self,
        node: Node<'a, 'i>,
        class: &str,
        name: &str,
    ) -> Result<Option<[f64; N]>, MjcfError> {
        let Some(value) = self.get(node, class, name) else { return Ok(None) };
        self.parse(node, name, value, N).map(|numbers| Some(std::array::from_fn(|index| numbers[index])))
    }

    pub(super) fn number(
        &self,
        node: Node<'a, 'i>,
        class: &str,
        name: &str,
        default: f64,
    ) -> Result<f64, MjcfError> {
        Ok(self.numbers::<1>(node, class, name)?.map_or(default, |[x]| x))
    }

    /// `count` numbers, or at least one when `count` is zero.
    pub(super) fn parse(
        &self,
        node: Node<'_, '_>,
        name: &str,
        value: &str,
        count: usize,
    ) -> Result<Vec<f64>, MjcfError> {
        let numbers: Result<Vec<f64>, _> = value.split_whitespace().map(str::parse).collect();
        match numbers {
            Ok(numbers)
                if numbers.iter().all(|x| x.is_finite())
                    && (numbers.len() == count || count == 0 && !numbers.is_empty()) =>
            {
                Ok(numbers)
            }
            _ => {
                let expected = match count {
                    0 => "numbers separated by spaces".to_owned(),
                    1 => "a number".to_owned(),
                    _ => format!("{count} numbers separated by spaces"),
                };
                let (attribute, value) = (name.to_owned(), value.to_owned());
                Err(self
                    .error(node, MjcfProblem::Number { element: named(node), attribute, value, expected }))
            }
        }
    }
}

/// The element with its name, if it has one: `joint name="knee"`.
pub(super) fn named(node: Node<'_, '_>) -> String {
    let element = node.tag_name().name();
    node.attribute("name").map_or_else(|| element.to_owned(), |name| format!("{element} name=\"{name}\""))
}
