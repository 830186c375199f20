//! Message types defined by a schema, with resolved names.

use std::collections::BTreeMap;
use std::sync::Arc;

/// Separator between the namespaces of a full name.
pub(crate) const SEPARATOR: &str = "::";

/// A fixed-size number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    Bool,
    Byte,
    Int8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Int64,
    Uint64,
    Float32,
    Float64,
}

/// A type as it is named in a schema.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Named {
    Scalar(Scalar),
    Text,
    /// A named type, and the scope in which the name is resolved.
    Name(String, Vec<String>),
    Array(Box<Named>, usize),
    Sequence(Box<Named>),
}

/// A definition of a schema.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    Struct(Vec<(String, Named)>),
    Alias(Named),
}

/// The definitions of a schema, by their full names.
pub(crate) type Items = BTreeMap<String, Item>;

/// A type whose components are resolved.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Type {
    Scalar(Scalar),
    Text,
    Struct(Arc<[(Arc<str>, Type)]>),
    Array(Box<Type>, usize),
    Sequence(Box<Type>),
}

/// Maximum number of fields and arrays of a message, counted through all nested types. The largest ROS
/// messages have a few hundred.
const LARGEST: usize = 10_000;
/// Maximum nesting depth of types.
const DEEPEST: usize = 64;

/// Resolves all names used by the definition of `root`.
///
/// # Errors
/// The unknown or unsupported type, and the type that uses it.
pub(crate) fn linked(items: &Items, root: &str) -> Result<Type, String> {
    if !items.contains_key(root) {
        let known: Vec<&str> = items.keys().map(String::as_str).collect();
        return Err(format!("it does not define `{root}`, only {}", known.join(", ")));
    }
    let mut linker = Linker { items, active: Vec::new(), done: BTreeMap::new(), parts: 0 };
    linker.item(root)
}

struct Linker<'s> {
    items: &'s Items,
    /// Types that are being resolved, outermost first.
    active: Vec<String>,
    done: BTreeMap<String, Type>,
    parts: usize,
}

impl Linker<'_> {
    fn item(&mut self, name: &str) -> Result<Type, String> {
        if let Some(known) = self.done.get(name) {
            return Ok(known.clone());
        }
        if self.active.iter().any(|active| active == name) {
            return Err(format!("type `{name}` contains itself"));
        }
        if self.active.len() >= DEEPEST {
            return Err(format!("it nests more than {DEEPEST} types"));
        }
        self.active.push(name.to_string());
        let linked = match &self.items[name] {
            Item::Alias(alias) => self.named(alias)?,
            Item::Struct(fields) => {
                let fields: Result<Vec<_>, String> = fields
                    .iter()
                    .map(|(name, named)| Ok((name.as_str().into(), self.named(named)?)))
                    .collect();
                Type::Struct(fields?.into())
            }
        };
        self.active.pop();
        self.done.insert(name.to_string(), linked.clone());
        Ok(linked)
    }

    fn named(&mut self, named: &Named) -> Result<Type, String> {
        self.parts += 1;
        if self.parts > LARGEST {
            return Err(format!("it has more than {LARGEST} fields"));
        }
        Ok(match named {
            Named::Scalar(scalar) => Type::Scalar(*scalar),
            Named::Text => Type::Text,
            Named::Array(entry, length) => Type::Array(Box::new(self.named(entry)?), *length),
            Named::Sequence(entry) => Type::Sequence(Box::new(self.named(entry)?)),
            Named::Name(name, scope) => match self.full_name(name, scope) {
                Some(full) => self.item(&full)?,
                None => builtin(name).ok_or_else(|| self.unknown(name))?,
            },
        })
    }

    fn unknown(&self, name: &str) -> String {
        let user = self.active.last().map_or("it", String::as_str);
        format!("`{user}` uses the type `{name}`, which the schema does not define")
    }

    /// Returns the full name of a type: in the innermost scope that defines it, otherwise the only type whose
    /// name ends with it.
    fn full_name(&self, name: &str, scope: &[String]) -> Option<String> {
        let inner = (0..=scope.len()).rev().map(|length| {
            let parts = scope[..length].iter().map(String::as_str).chain([name]);
            parts.collect::<Vec<_>>().join(SEPARATOR)
        });
        if let Some(found) = inner.into_iter().find(|full| self.items.contains_key(full)) {
            return Some(found);
        }
        let end = format!("{SEPARATOR}{name}");
        let mut ending = self.items.keys().filter(|known| known.ends_with(&end));
        let found = ending.next()?.clone();
        ending.next().is_none().then_some(found)
    }
}

/// Returns the type of a built-in time name, which some writers omit from the schema; `None` for other names.
fn builtin(name: &str) -> Option<Type> {
    let last = name.rsplit(SEPARATOR).next().unwrap_or(name);
    let is_time = ["Time", "Duration", "time", "duration"].contains(&last);
    let fields = [("sec", Scalar::Int32), ("nanosec", Scalar::Uint32)];
    is_time.then(|| Type::Struct(fields.map(|(name, scalar)| (name.into(), Type::Scalar(scalar))).into()))
}
