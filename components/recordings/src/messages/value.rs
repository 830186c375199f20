//! Decoded messages, and access to their fields by path.

use std::fmt;
use std::sync::Arc;

/// A number of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Unsigned integer, or a boolean as 0 or 1.
    Natural(u64),
    /// Signed integer.
    Integer(i64),
    /// Number in single precision.
    Single(f32),
    /// Number in double precision.
    Double(f64),
}

impl Number {
    /// Returns the number in double precision; integers beyond 2^53 are rounded.
    pub fn as_f64(self) -> f64 {
        match self {
            Self::Natural(number) => number as f64,
            Self::Integer(number) => number as f64,
            Self::Single(number) => f64::from(number),
            Self::Double(number) => number,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Natural(number) => number.fmt(f),
            Self::Integer(number) => number.fmt(f),
            Self::Single(number) => number.fmt(f),
            Self::Double(number) => number.fmt(f),
        }
    }
}

/// A decoded message or one of its fields.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(Number),
    /// A string.
    Text(String),
    /// An array of bytes, such as the pixels of an image.
    Bytes(Vec<u8>),
    /// An array.
    List(Vec<Value>),
    /// Named fields, in the order of the schema.
    Record(Vec<(Arc<str>, Value)>),
}

/// A number or a string at the end of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf<'v> {
    /// A number.
    Number(Number),
    /// A string.
    Text(&'v str),
}

impl Value {
    /// Returns the value at a path such as `pose.position.x` or `joints[2].position`. The path "" returns the
    /// whole value.
    ///
    /// ```
    /// use motorium_recordings::messages::{Number, Value};
    ///
    /// let joints = Value::List(vec![Value::Number(Number::Double(0.5))]);
    /// let state = Value::Record(vec![("position".into(), joints)]);
    /// assert_eq!(state.get("position[0]"), Some(&Value::Number(Number::Double(0.5))));
    /// assert_eq!(state.get("velocity"), None);
    /// ```
    pub fn get(&self, path: &str) -> Option<&Self> {
        let mut value = self;
        for name in path.split('.').filter(|_| !path.is_empty()) {
            let (name, indices) = match name.find('[') {
                Some(start) => name.split_at(start),
                None => (name, ""),
            };
            if !name.is_empty() {
                let Self::Record(fields) = value else { return None };
                value = &fields.iter().find(|(known, _)| **known == *name)?.1;
            }
            if !(indices.is_empty() || indices.ends_with(']')) {
                return None;
            }
            for index in indices.split_terminator(']') {
                let Self::List(entries) = value else { return None };
                value = entries.get(index.strip_prefix('[')?.parse::<usize>().ok()?)?;
            }
        }
        Some(value)
    }

    /// Returns the entries of an array of numbers, or a single number as one entry; `None` for other values.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Number(number) => Some(vec![number.as_f64()]),
            Self::Bytes(bytes) => Some(bytes.iter().map(|byte| f64::from(*byte)).collect()),
            Self::List(entries) => entries
                .iter()
                .map(|entry| match entry {
                    Self::Number(number) => Some(number.as_f64()),
                    _ => None,
                })
                .collect(),
            Self::Text(_) | Self::Record(_) => None,
        }
    }

    /// Returns the entries of an array of strings; `None` for other values.
    pub fn texts(&self) -> Option<Vec<&str>> {
        let Self::List(entries) = self else { return None };
        entries
            .iter()
            .map(|entry| match entry {
                Self::Text(text) => Some(text.as_str()),
                _ => None,
            })
            .collect()
    }

    /// Calls `visit` with the path and content of every number and string, in order. Arrays of bytes are
    /// skipped.
    pub fn visit<'v>(&'v self, visit: &mut impl FnMut(&str, Leaf<'v>)) {
        self.visit_at(&mut String::new(), visit);
    }

    fn visit_at<'v>(&'v self, path: &mut String, visit: &mut impl FnMut(&str, Leaf<'v>)) {
        let length = path.len();
        match self {
            Self::Number(number) => visit(path, Leaf::Number(*number)),
            Self::Text(text) => visit(path, Leaf::Text(text)),
            Self::Bytes(_) => {}
            Self::List(entries) => {
                for (index, entry) in entries.iter().enumerate() {
                    path.push_str(&format!("[{index}]"));
                    entry.visit_at(path, visit);
                    path.truncate(length);
                }
            }
            Self::Record(fields) => {
                for (name, value) in fields {
                    if !path.is_empty() {
                        path.push('.');
                    }
                    path.push_str(name);
                    value.visit_at(path, visit);
                    path.truncate(length);
                }
            }
        }
    }

    /// Returns the names of the entries of the array of numbers at a path; `None` if the array has no names.
    /// The names are a list of strings next to the array, with the same length, called `name`, `names` or
    /// `joint_names`, as in `sensor_msgs/msg/JointState`.
    pub fn names_of(&self, path: &str) -> Option<Vec<&str>> {
        let entries = self.get(path)?.numbers()?.len();
        let parent = path.rsplit_once('.').map_or("", |(parent, _)| parent);
        let Self::Record(fields) = self.get(parent)? else { return None };
        let is_names = |name: &str| ["name", "names", "joint_names"].contains(&name);
        let found = fields.iter().filter(|(name, _)| is_names(name)).filter_map(|(_, value)| value.texts());
        found.into_iter().find(|names| names.len() == entries)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f64) -> Value {
        Value::Number(Number::Double(value))
    }

    #[test]
    fn parts_are_found_by_their_paths() {
        let point = |x: f64| Value::Record(vec![("x".into(), number(x))]);
        let message = Value::Record(vec![
            ("points".into(), Value::List(vec![point(1.0), point(2.0)])),
            ("name".into(), Value::List(vec![Value::Text("a".into()), Value::Text("b".into())])),
            ("position".into(), Value::List(vec![number(3.0), number(4.0)])),
            ("pixels".into(), Value::Bytes(vec![1, 2])),
        ]);
        let mut paths = Vec::new();
        message.visit(&mut |path, _| paths.push(path.to_string()));
        assert_eq!(paths, ["points[0].x", "points[1].x", "name[0]", "name[1]", "position[0]", "position[1]"]);
        for path in &paths {
            assert!(message.get(path).is_some(), "{path}");
        }
        assert_eq!(message.get("points[1].x").unwrap().numbers().unwrap(), [2.0]);
        for path in ["points[2].x", "points.x", "points[x]", "position[0", "nothing", "points[0].x.y"] {
            assert!(message.get(path).is_none(), "{path}");
        }
        assert_eq!(message.names_of("position").unwrap(), ["a", "b"]);
        assert_eq!(message.names_of("pixels").unwrap(), ["a", "b"]);
        assert_eq!(message.names_of("points[0].x"), None);
    }
}
