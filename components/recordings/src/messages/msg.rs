//! Schemas in the ROS 2 message format. The definition of a message is followed by the definitions of the
//! types it uses, each after a line of `=` and a line `MSG: NAME`.

use super::definition::{Item, Items, Named, SEPARATOR, Scalar};

/// Minimum number of `=` in a line between two definitions.
const DIVIDER: usize = 3;

/// Parses the definitions of a schema.
///
/// # Errors
/// The number of the invalid line, with the reason.
pub(crate) fn items(root: &str, text: &str) -> Result<Items, String> {
    let mut items = Items::new();
    let mut name = root.to_string();
    let mut fields = Vec::new();
    let mut is_divided = false;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.len() >= DIVIDER && line.bytes().all(|byte| byte == b'=') {
            is_divided = true;
            continue;
        }
        if let Some(next) = line.strip_prefix("MSG:").filter(|_| is_divided) {
            insert(&mut items, &name, std::mem::take(&mut fields));
            (name, is_divided) = (next.trim().to_string(), false);
            continue;
        }
        let wrong = |reason: &str| format!("line {}: `{line}`: {reason}", index + 1);
        if let Some(field) = field(line, &scope(&name)).map_err(|reason| wrong(&reason))? {
            fields.push(field);
        }
    }
    insert(&mut items, &name, fields);
    Ok(items)
}

fn insert(items: &mut Items, name: &str, mut fields: Vec<(String, Named)>) {
    if fields.is_empty() {
        // C has no empty structures.
        fields.push(("structure_needs_at_least_one_member".to_string(), Named::Scalar(Scalar::Byte)));
    }
    items.entry(full_name(name)).or_insert(Item::Struct(fields));
}

/// Returns the full name of `pkg/msg/Name` or `pkg/Name`.
pub(crate) fn full_name(name: &str) -> String {
    let parts: Vec<&str> = name.split('/').collect();
    match parts[..] {
        [package, name] => [package, "msg", name].join(SEPARATOR),
        _ => parts.join(SEPARATOR),
    }
}

fn scope(name: &str) -> Vec<String> {
    let full = full_name(name);
    let mut parts: Vec<String> = full.split(SEPARATOR).map(str::to_string).collect();
    parts.pop();
    parts
}

/// Parses the field defined by a line; `None` for empty lines, comments and constants.
fn field(line: &str, scope: &[String]) -> Result<Option<(String, Named)>, String> {
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let (kind, rest) = line.split_once(char::is_whitespace).ok_or("expected a type and a name")?;
    let rest = rest.trim_start();
    let end = rest.find(|letter: char| !(letter.is_alphanumeric() || letter == '_')).unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if name.is_empty() {
        return Err("expected a type and a name".to_string());
    }
    if after.trim_start().starts_with('=') {
        return Ok(None);
    }
    Ok(Some((name.to_string(), named(kind, scope)?)))
}

fn named(kind: &str, scope: &[String]) -> Result<Named, String> {
    let (base, array) = match kind.split_once('[') {
        Some((base, array)) => (base, Some(array.strip_suffix(']').ok_or("`[` without `]`")?)),
        None => (kind, None),
    };
    let base = base.split_once("<=").map_or(base, |(base, _)| base);
    let entry = match base {
        "bool" => Named::Scalar(Scalar::Bool),
        "byte" | "char" | "uint8" => Named::Scalar(Scalar::Byte),
        "int8" => Named::Scalar(Scalar::Int8),
        "int16" => Named::Scalar(Scalar::Int16),
        "uint16" => Named::Scalar(Scalar::Uint16),
        "int32" => Named::Scalar(Scalar::Int32),
        "uint32" => Named::Scalar(Scalar::Uint32),
        "int64" => Named::Scalar(Scalar::Int64),
        "uint64" => Named::Scalar(Scalar::Uint64),
        "float32" => Named::Scalar(Scalar::Float32),
        "float64" => Named::Scalar(Scalar::Float64),
        "string" => Named::Text,
        "wstring" => return Err("wide strings are not supported".to_string()),
        // as in ROS 1
        "Header" => Named::Name(["std_msgs", "msg", "Header"].join(SEPARATOR), Vec::new()),
        other => {
            let is_name = |letter: char| letter.is_alphanumeric() || matches!(letter, '_' | '/');
            if !other.chars().all(is_name) {
                return Err(format!("`{other}` is not a type"));
            }
            let name = if other.contains('/') { full_name(other) } else { other.to_string() };
            Named::Name(name, scope.to_vec())
        }
    };
    Ok(match array {
        None => entry,
        Some(bound) if bound.is_empty() || bound.starts_with("<=") => Named::Sequence(Box::new(entry)),
        Some(length) => {
            let length = length.parse().map_err(|_| format!("`{length}` is not a length"))?;
            Named::Array(Box::new(entry), length)
        }
    })
}
