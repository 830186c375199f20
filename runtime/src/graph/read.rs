//! Reading of TOML tables key by key, so that every error is found.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::diagnostic::{Diagnostic, Report};
use super::source::Span;
use crate::nearest::{list, nearest};

/// A TOML value with its position.
pub(super) type Value<'i> = Spanned<DeValue<'i>>;

/// The value at a key of the file.
#[derive(Debug, Clone)]
pub(super) struct At<T> {
    /// The value; `None` if it was invalid. The error has then been reported.
    pub value: Option<T>,
    /// Position of the value in the file.
    pub span: Span,
    /// Position of the key; for an element of an array, the position of the value.
    pub key: Span,
}

impl<T> At<T> {
    /// Returns the value if it is valid.
    pub(super) fn get(&self) -> Option<&T> {
        self.value.as_ref()
    }
}

/// Returns the valid value of an optional key.
pub(super) fn good<T>(key: &Option<At<T>>) -> Option<&T> {
    key.as_ref().and_then(At::get)
}

/// Returns the valid value of a key, or its default if it is missing or was refused.
pub(super) fn good_or<T: Copy>(key: &Option<At<T>>, default: T) -> T {
    good(key).copied().unwrap_or(default)
}

impl<T: schemars::JsonSchema> schemars::JsonSchema for At<T> {
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }

    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        T::json_schema(generator)
    }
}

/// A type that can be read from a TOML value. Errors are reported under the name `key`.
pub(super) trait Read<'i>: Sized {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self>;
}

/// The keys of one table, consumed one by one; [`Keys::finish`] reports the remaining ones.
pub(super) struct Keys<'t, 'i, 'r> {
    table: &'t DeTable<'i>,
    known: Vec<&'static str>,
    report: &'r mut Report,
}

impl<'t, 'i, 'r> Keys<'t, 'i, 'r> {
    /// Creates the keys of a table.
    pub(super) fn new(table: &'t DeTable<'i>, report: &'r mut Report) -> Self {
        Self { table, known: Vec::new(), report }
    }

    /// Reads the keys of the table at `key`, if it is a table.
    pub(super) fn read(key: &str, value: &'t Value<'i>, report: &'r mut Report) -> Option<Self> {
        let table = table(key, value, report)?;
        Some(Self::new(table, report))
    }

    /// Reads the value at a key.
    pub(super) fn take<T: Read<'i>>(&mut self, name: &'static str) -> Option<At<T>> {
        self.known.push(name);
        let (key, value) = self.table.get_key_value(name)?;
        let read = T::read(name, value, self.report);
        Some(At { value: read, span: value.span(), key: key.span() })
    }

    /// Returns the findings so far.
    pub(super) fn report(&mut self) -> &mut Report {
        self.report
    }

    /// Reports unknown keys of the table named by `context`. Returns the most similar known keys, whose
    /// absence need not be reported again.
    pub(super) fn finish(self, context: &str) -> Vec<&'static str> {
        let mut meant = Vec::new();
        for key in self.table.keys().filter(|key| !self.known.contains(&key.get_ref().as_ref())) {
            let name = key.get_ref().as_ref();
            let near = nearest(name, self.known.iter().copied());
            meant.extend(self.known.iter().copied().find(|known| Some(*known) == near));
            let advice = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the keys of {context} are {}", list(self.known.iter().copied())),
            };
            self.report
                .error(format!("unknown key `{name}` in {context}"))
                .label(&key.span(), "not a key that is known here")
                .advise(advice);
        }
        meant
    }
}

/// Returns the names and values of a table with user-defined keys, in file order.
pub(super) fn entries<'t, 'i>(table: &'t DeTable<'i>) -> Vec<(&'t Spanned<DeString<'i>>, &'t Value<'i>)> {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    entries
}

/// Returns the table at a key.
pub(super) fn table<'t, 'i>(key: &str, value: &'t Value<'i>, report: &mut Report) -> Option<&'t DeTable<'i>> {
    let table = value.get_ref().as_table();
    if table.is_none() {
        let advice = match key.rsplit_once('.') {
            Some((_, name)) => format!("write `[{key}]`, or `{name} = {{ ... }}`"),
            None => format!("write `{key} = {{ ... }}`"),
        };
        mismatch(key, value, "a table", report).advise(advice);
    }
    table
}

/// Returns the text at a key.
pub(super) fn text<'t>(
    key: &str,
    value: &'t Value<'_>,
    expected: &str,
    report: &mut Report,
) -> Option<&'t str> {
    let text = value.get_ref().as_str();
    if text.is_none() {
        mismatch(key, value, expected, report);
    }
    text
}

/// Reports a value of the wrong type.
pub(super) fn mismatch<'r>(
    key: &str,
    value: &Value<'_>,
    expected: &str,
    report: &'r mut Report,
) -> &'r mut Diagnostic {
    let found = match value.get_ref() {
        DeValue::String(text) => format!("the text \"{text}\""),
        DeValue::Integer(number) => format!("the whole number {}", number.as_str()),
        DeValue::Float(number) => format!("the number {}", number.as_str()),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date or time of day".to_string(),
        DeValue::Array(_) => "an array".to_string(),
        DeValue::Table(_) => "a table".to_string(),
    };
    let advice = match value.get_ref() {
        DeValue::Integer(number) => format!("for text put it in quotes: \"{}\"", number.as_str()),
        DeValue::Float(number) => format!("for text put it in quotes: \"{}\"", number.as_str()),
        DeValue::String(text) if text.parse::<f64>().is_ok() => format!("leave the quotes out: {text}"),
        DeValue::String(text) if matches!(text.as_ref(), "true" | "false") => {
            format!("leave the quotes out: {text}")
        }
        _ => "see the JSON Schema of graph files for the expected value: `motorium schema`".to_string(),
    };
    report
        .error(format!("`{key}` is {found}, expected {expected}"))
        .label(&value.span(), format!("expected {expected}"))
        .advise(advice)
}
