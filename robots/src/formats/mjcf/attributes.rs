//! Attributes with their default classes, and errors with their position.

use std::cell::RefCell;
use std::collections::HashMap;

use roxmltree::{Document, Node};

use super::error::{MjcfError, MjcfProblem};
use super::schema::{POSE, Schema, Use, is_off};
use crate::formats::lines::Lines;
use crate::nearest::nearest;
use crate::{ModelWarning, Position};

/// Name of the class of elements that name no class.
pub const MAIN: &str = "main";

/// Key of a class's elements themselves, in place of an attribute: elements without attributes count as well.
const ELEMENT: &str = "";

/// A value and the element that provides it.
#[derive(Clone, Copy)]
struct Given<'a, 'i> {
    value: &'a str,
    node: Node<'a, 'i>,
}

/// Values of each attribute, the parent's before the child's. A short list of numbers keeps the remaining
/// numbers of the previous one.
type Values<'a, 'i> = HashMap<&'a str, Vec<Given<'a, 'i>>>;

/// Reader of an MJCF file's attributes: knows the `<default>` classes and the line numbers, and collects
/// warnings.
pub struct Attributes<'a, 'i> {
    lines: Lines<'a>,
    classes: HashMap<&'a str, HashMap<&'static str, Values<'a, 'i>>>,
    warnings: RefCell<Vec<ModelWarning>>,
}

impl<'a, 'i> Attributes<'a, 'i> {
    /// Reads the `<default>` classes of a document.
    ///
    /// # Errors
    /// A class has no name or a duplicate name, or an attribute is not supported.
    pub fn new(document: &'a Document<'i>) -> Result<Self, MjcfError> {
        let classes = HashMap::from([(MAIN, HashMap::new())]);
        let lines = Lines::new(document.input_text());
        let mut attributes = Self { lines, classes, warnings: RefCell::default() };
        for section in document.root_element().children().filter(|node| node.has_tag_name("default")) {
            attributes.read_class(section, None)?;
        }
        Ok(attributes)
    }

    /// Reads a class, which inherits from its parent, and its nested classes.
    fn read_class(&mut self, node: Node<'a, 'i>, parent: Option<&str>) -> Result<(), MjcfError> {
        let name = match (node.attribute("class"), parent) {
            (None, None) => MAIN,
            (Some(MAIN), None) => MAIN,
            (Some(name), None) => {
                return Err(self.refused(node, "class", name, "the outermost class must be main"));
            }
            (None, Some(_)) => return Err(self.missing(node, "class")),
            (Some(name), Some(_)) if self.classes.contains_key(name) => {
                return Err(self.error(node, MjcfProblem::Duplicate { what: "class", name: name.to_owned() }));
            }
            (Some(name), Some(_)) => name,
        };
        let mut class = self.classes.get(parent.unwrap_or(MAIN)).cloned().unwrap_or_default();
        for element in node.children().filter(Node::is_element).filter(|child| !child.has_tag_name("default"))
        {
            let tag = element.tag_name().name();
            let Ok(schema) = Schema::of_default(tag) else {
                return Err(self.error(element, MjcfProblem::Element(format!("{tag}> of <default"))));
            };
            let Some(schema) = schema else { continue };
            self.refuse_unknown(element, |name| schema.contains(name) && !["name", "class"].contains(&name))?;
            let values = class.entry(schema.kind).or_default();
            if self.orientation(element)?.is_some() {
                values.retain(|name, _| !POSE[1..].contains(name));
            }
            values.entry(ELEMENT).or_default().push(Given { value: tag, node: element });
            for attribute in element.attributes() {
                let given = Given { value: attribute.value(), node: element };
                values.entry(attribute.name()).or_default().push(given);
            }
        }
        self.classes.insert(name, class);
        for child in node.children().filter(|child| child.has_tag_name("default")) {
            self.read_class(child, Some(name))?;
        }
        Ok(())
    }

    /// Returns the orientation attribute of the element itself, ignoring its class.
    fn orientation(&self, node: Node<'a, 'i>) -> Result<Option<(&'static str, Given<'a, 'i>)>, MjcfError> {
        let mut ways = POSE[1..].iter().filter_map(|way| Some((*way, node.attribute(*way)?)));
        let first = ways.next();
        match ways.next() {
            Some((way, value)) => Err(self.refused(node, way, value, "only one orientation is allowed")),
            None => Ok(first.map(|(way, value)| (way, Given { value, node }))),
        }
    }

    pub(crate) fn refuse_unknown(
        &self,
        node: Node<'_, '_>,
        known: impl Fn(&str) -> bool,
    ) -> Result<(), MjcfError> {
        match node.attributes().find(|attribute| !known(attribute.name())) {
            None => Ok(()),
            Some(attribute) => Err(self.refused(node, attribute.name(), attribute.value(), "")),
        }
    }

    /// Returns the class of an element: its own, or the class of the surrounding bodies.
    fn class_of(&self, node: Node<'a, 'i>, around: &'a str) -> Result<&'a str, MjcfError> {
        let class = node.attribute("class").unwrap_or(around);
        self.known_class(node, class).map(|()| class)
    }

    /// Checks that a class exists.
    ///
    /// # Errors
    /// The class does not exist.
    pub fn known_class(&self, node: Node<'_, '_>, class: &str) -> Result<(), MjcfError> {
        if self.classes.contains_key(class) {
            return Ok(());
        }
        let nearest = nearest(class, self.classes.keys().copied()).map(str::to_owned);
        let element = node.tag_name().name().to_owned();
        Err(self
            .error(node, MjcfProblem::Unknown { element, what: "class", name: class.to_owned(), nearest }))
    }

    /// Returns an element with its defaults without checking its attributes.
    pub(crate) fn unchecked<'b>(
        &'b self,
        node: Node<'a, 'i>,
        around: &'a str,
        schema: &'static Schema,
    ) -> Result<Element<'b, 'a, 'i>, MjcfError> {
        let class = if schema.kind.is_empty() { MAIN } else { self.class_of(node, around)? };
        let defaults = self.classes.get(class).and_then(|class| class.get(schema.kind));
        Ok(Element { attributes: self, node, defaults, schema })
    }

    /// Returns an element with its default values, after checking all attributes against `schema`. `around`
    /// is the default class that the surrounding bodies set.
    ///
    /// # Errors
    /// The class is unknown, or `schema` rejects an attribute.
    pub fn element<'b>(
        &'b self,
        node: Node<'a, 'i>,
        around: &'a str,
        schema: &'static Schema,
    ) -> Result<Element<'b, 'a, 'i>, MjcfError> {
        self.unchecked(node, around, schema)?.checked()
    }

    /// Adds a warning that the attribute or element described by `what` is ignored. Repeated warnings are
    /// counted.
    pub fn ignored(&self, node: Node<'_, '_>, what: String, reason: &'static str) {
        let mut warnings = self.warnings.borrow_mut();
        for warning in warnings.iter_mut() {
            if let ModelWarning::Ignored { what: known, count, .. } = warning
                && *known == what
            {
                *count += 1;
                return;
            }
        }
        warnings.push(ModelWarning::Ignored { what, at: self.position(node), count: 1, reason });
    }

    /// Adds a warning, once.
    pub(crate) fn warn(&self, warning: Option<ModelWarning>) {
        let mut warnings = self.warnings.borrow_mut();
        let new = warning.filter(|warning| !warnings.contains(warning));
        warnings.extend(new);
    }

    /// Removes and returns all warnings collected so far.
    pub fn warnings(&self) -> Vec<ModelWarning> {
        self.warnings.take()
    }

    /// Creates an error that rejects the value of an attribute. `reason` may be empty.
    pub fn refused(&self, node: Node<'_, '_>, name: &str, value: &str, reason: &'static str) -> MjcfError {
        let (attribute, value) = (name.to_owned(), value.to_owned());
        self.error(node, MjcfProblem::Attribute { element: named(node), attribute, value, reason })
    }

    pub(crate) fn missing(&self, node: Node<'_, '_>, attribute: &'static str) -> MjcfError {
        self.error(node, MjcfProblem::Missing { element: named(node), attribute })
    }

    /// Creates an error at the position of an element.
    pub fn error(&self, node: Node<'_, '_>, problem: MjcfProblem) -> MjcfError {
        MjcfError { file: None, at: self.position(node), problem: Box::new(problem) }
    }

    pub(crate) fn position(&self, node: Node<'_, '_>) -> Position {
        self.lines.position(node.range().start)
    }

    /// Parses numbers separated by spaces, with the given count.
    ///
    /// # Errors
    /// The count differs, or a number does not parse or is not finite.
    pub fn parse(
        &self,
        node: Node<'_, '_>,
        name: &str,
        value: &str,
        count: std::ops::RangeInclusive<usize>,
    ) -> Result<Vec<f64>, MjcfError> {
        let numbers: Result<Vec<f64>, _> = value.split_whitespace().map(str::parse).collect();
        match numbers {
            Ok(numbers) if numbers.iter().all(|x| x.is_finite()) && count.contains(&numbers.len()) => {
                Ok(numbers)
            }
            _ => {
                let expected = match (*count.start(), *count.end()) {
                    (1, 1) => "a number".to_owned(),
                    (least, most) if least == most => format!("{least} numbers separated by spaces"),
                    (least, most) => format!("{least} to {most} numbers separated by spaces"),
                };
                let (attribute, value) = (name.to_owned(), value.to_owned());
                Err(self
                    .error(node, MjcfProblem::Number { element: named(node), attribute, value, expected }))
            }
        }
    }
}

/// An element of the file with the default values of its class.
#[derive(Clone, Copy)]
pub struct Element<'b, 'a, 'i> {
    /// Attributes of the file.
    pub attributes: &'b Attributes<'a, 'i>,
    /// XML node of the element.
    pub node: Node<'a, 'i>,
    defaults: Option<&'b Values<'a, 'i>>,
    schema: &'static Schema,
}

impl<'a, 'i> Element<'_, 'a, 'i> {
    pub(crate) fn checked(self) -> Result<Self, MjcfError> {
        self.attributes.refuse_unknown(self.node, |name| self.schema.contains(name))?;
        for (treatment, name) in self.schema.exceptions() {
            match (self.explicit(name).filter(|given| !is_off(given.value)), treatment) {
                (Some(given), Use::Refused(reason)) => {
                    return Err(self.attributes.refused(given.node, name, given.value, reason));
                }
                (Some(given), Use::Ignored(reason)) => self.ignored(given.node, name, reason),
                _ => {}
            }
        }
        Ok(self)
    }

    /// Warns that an attribute of `node` is ignored.
    fn ignored(&self, node: Node<'_, '_>, name: &str, reason: &'static str) {
        let element = self.node.tag_name().name();
        self.attributes.ignored(node, format!("{name} of <{element}>"), reason);
    }

    /// Adds a warning that an attribute is ignored.
    pub fn ignore(&self, name: &str, reason: &'static str) {
        let node = self.explicit(name).map_or(self.node, |given| given.node);
        self.ignored(node, name, reason);
    }

    fn explicit(&self, name: &str) -> Option<Given<'a, 'i>> {
        let own = self.node.attribute(name).map(|value| Given { value, node: self.node });
        own.or_else(|| self.defaults?.get(name)?.last().copied())
    }

    /// Returns the value of an attribute from the element or its class.
    pub fn get(&self, name: &str) -> Option<&'a str> {
        self.explicit(name).map(|given| given.value)
    }

    /// Returns the one orientation attribute, its value and its element; the element's own takes precedence
    /// over its class.
    pub(crate) fn orientation(&self) -> Result<Option<(&'static str, &'a str, Node<'a, 'i>)>, MjcfError> {
        let found = match self.attributes.orientation(self.node)? {
            Some(own) => Some(own),
            None => POSE[1..].iter().find_map(|way| Some((*way, self.explicit(way)?))),
        };
        Ok(found.map(|(way, given)| (way, given.value, given.node)))
    }

    /// Returns a boolean attribute, or `default` if it is missing.
    ///
    /// # Errors
    /// The value is neither `true` nor `false`.
    pub fn flag(&self, name: &str, default: bool) -> Result<bool, MjcfError> {
        match self.get(name) {
            None => Ok(default),
            Some("true") => Ok(true),
            Some("false") => Ok(false),
            Some(_) => Err(self.refused(name, "expected true or false")),
        }
    }

    /// Returns the `N` numbers of an attribute; `None` if the attribute is missing.
    ///
    /// # Errors
    /// See [`Attributes::parse`].
    pub fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, MjcfError> {
        let Some(given) = self.explicit(name) else { return Ok(None) };
        let numbers = self.attributes.parse(given.node, name, given.value, N..=N)?;
        Ok(Some(std::array::from_fn(|index| numbers[index])))
    }

    /// Returns one number, or `default` if the attribute is missing.
    ///
    /// # Errors
    /// See [`Attributes::parse`].
    pub fn number(&self, name: &str, default: f64) -> Result<f64, MjcfError> {
        Ok(self.numbers::<1>(name)?.map_or(default, |[x]| x))
    }

    /// Returns `N` numbers of an attribute. Missing trailing numbers are taken from the element's class, then
    /// from its parent classes, then from `default`.
    ///
    /// # Errors
    /// See [`Attributes::parse`].
    pub fn first_numbers<const N: usize>(
        &self,
        name: &str,
        default: [f64; N],
    ) -> Result<[f64; N], MjcfError> {
        let mut numbers = default;
        let class = self.defaults.and_then(|defaults| defaults.get(name)).map_or(&[][..], Vec::as_slice);
        let own = self.node.attribute(name).map(|value| Given { value, node: self.node });
        for given in class.iter().copied().chain(own) {
            let first = self.attributes.parse(given.node, name, given.value, 1..=N)?;
            numbers[..first.len()].copy_from_slice(&first);
        }
        Ok(numbers)
    }

    /// Elements that set the attributes: the defaults of the class and of its parents, in order, then the
    /// element itself.
    pub(crate) fn elements(&self) -> impl Iterator<Item = Node<'a, 'i>> {
        let class = self.defaults.and_then(|defaults| defaults.get(ELEMENT)).map_or(&[][..], Vec::as_slice);
        class.iter().map(|given| given.node).chain([self.node])
    }

    /// Returns the numbers set by one of the [`elements`](Self::elements), at most `most`; empty without the
    /// attribute.
    pub(crate) fn own_numbers(
        &self,
        node: Node<'_, '_>,
        name: &str,
        most: usize,
    ) -> Result<Vec<f64>, MjcfError> {
        let value = node.attribute(name);
        value.map_or(Ok(Vec::new()), |value| self.attributes.parse(node, name, value, 1..=most))
    }

    /// Creates an error that rejects an attribute of the element or its class.
    pub fn refused(&self, name: &str, reason: &'static str) -> MjcfError {
        let given = self.explicit(name).unwrap_or(Given { value: "", node: self.node });
        self.attributes.refused(given.node, name, given.value, reason)
    }

    /// Creates an error for a missing attribute.
    pub fn missing(&self, name: &'static str) -> MjcfError {
        self.attributes.missing(self.node, name)
    }

    /// Creates an error at the element.
    pub fn error(&self, problem: MjcfProblem) -> MjcfError {
        self.attributes.error(self.node, problem)
    }

    /// Creates an error with a custom message.
    pub fn fault(&self, problem: impl Into<String>) -> MjcfError {
        self.error(MjcfProblem::Other(problem.into()))
    }
}

/// Describes an element, including its name if it has one, such as `joint name="knee"`.
pub fn named(node: Node<'_, '_>) -> String {
    let element = node.tag_name().name();
    node.attribute("name").map_or_else(|| element.to_owned(), |name| format!("{element} name=\"{name}\""))
}
