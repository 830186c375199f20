//! Schemas in the OMG interface definition language, as used by ROS 2 and DDS.

use std::collections::BTreeMap;

use super::definition::{Item, Items, Named, SEPARATOR, Scalar};

/// Parses the definitions of a schema. ROS 2 files are divided by lines of `=` and `IDL: NAME`.
///
/// # Errors
/// The line of an unsupported or invalid construct.
pub(crate) fn items(text: &str) -> Result<Items, String> {
    let tokens = tokens(text)?;
    let mut parser = Parser {
        tokens: &tokens,
        position: 0,
        scope: Vec::new(),
        items: Items::new(),
        constants: BTreeMap::new(),
        bases: Vec::new(),
    };
    while parser.position < tokens.len() {
        parser.definition()?;
    }
    parser.inherit()?;
    Ok(parser.items)
}

/// A word, a number, a string or a symbol, with its line.
type Token = (String, usize);

fn tokens(text: &str) -> Result<Vec<Token>, String> {
    let mut tokens = Vec::new();
    let mut is_comment = false;
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        let trimmed = line.trim_start();
        let is_divider = trimmed.starts_with("===") || trimmed.starts_with("IDL:");
        if !is_comment && (is_divider || trimmed.starts_with('#')) {
            continue;
        }
        let mut rest = line;
        loop {
            if is_comment {
                let Some((_, after)) = rest.split_once("*/") else { break };
                (rest, is_comment) = (after, false);
            }
            rest = rest.trim_start();
            let Some(first) = rest.chars().next() else { break };
            if rest.starts_with("//") {
                break;
            }
            if rest.starts_with("/*") {
                (rest, is_comment) = (&rest[2..], true);
                continue;
            }
            let is_word = |letter: char| letter.is_alphanumeric() || matches!(letter, '_' | ':' | '.');
            let length = if first == '"' || first == '\'' {
                text_length(rest, first)
                    .ok_or_else(|| format!("line {number}: a string without a closing quote"))?
            } else if is_word(first) {
                rest.find(|letter| !is_word(letter)).unwrap_or(rest.len())
            } else {
                first.len_utf8()
            };
            tokens.push((rest[..length].to_string(), number));
            rest = &rest[length..];
        }
    }
    Ok(tokens)
}

/// Returns the length of a string literal with its quotes; `None` if the closing quote is missing.
fn text_length(text: &str, quote: char) -> Option<usize> {
    let mut is_escaped = false;
    for (place, letter) in text.char_indices().skip(1) {
        if letter == quote && !is_escaped {
            return Some(place + quote.len_utf8());
        }
        is_escaped = letter == '\\' && !is_escaped;
    }
    None
}

struct Parser<'t> {
    tokens: &'t [Token],
    position: usize,
    scope: Vec<String>,
    items: Items,
    constants: BTreeMap<String, usize>,
    /// Structures with the name and scope of their base structure.
    bases: Vec<(String, Named)>,
}

/// Maximum nesting depth of a schema.
const DEEPEST: usize = 64;

impl Parser<'_> {
    fn peek(&self) -> &str {
        self.tokens.get(self.position).map_or("", |(token, _)| token)
    }

    fn next(&mut self) -> &str {
        let token = self.tokens.get(self.position).map_or("", |(token, _)| token.as_str());
        self.position += 1;
        token
    }

    fn takes(&mut self, token: &str) -> bool {
        let is_it = self.peek() == token;
        self.position += usize::from(is_it);
        is_it
    }

    fn wrong(&self, expected: &str) -> String {
        let last = self.tokens.last().map_or(1, |(_, line)| *line);
        let (found, line) = match self.tokens.get(self.position) {
            Some((token, line)) => (format!("`{token}`"), *line),
            None => ("the end".to_string(), last),
        };
        format!("line {line}: found {found}, expected {expected}")
    }

    fn expect(&mut self, token: &str) -> Result<(), String> {
        if self.takes(token) { Ok(()) } else { Err(self.wrong(&format!("`{token}`"))) }
    }

    fn identifier(&mut self) -> Result<String, String> {
        if !self.peek().starts_with(|letter: char| letter.is_alphabetic() || letter == '_') {
            return Err(self.wrong("a name"));
        }
        Ok(self.next().to_string())
    }

    fn full(&self, name: &str) -> String {
        self.scope.iter().map(String::as_str).chain([name]).collect::<Vec<_>>().join(SEPARATOR)
    }

    /// Skips annotations. Annotations that change the encoding are rejected.
    fn annotations(&mut self) -> Result<(), String> {
        while self.takes("@") {
            let name = self.identifier()?;
            if ["optional", "bit_bound", "mutable", "appendable", "external"].contains(&name.as_str()) {
                self.position -= 1;
                return Err(self.wrong("types without this annotation"));
            }
            if self.takes("(") {
                let mut depth = 1;
                while depth > 0 {
                    match self.next() {
                        "(" => depth += 1,
                        ")" => depth -= 1,
                        "" => return Err(self.wrong("`)`")),
                        _ => {}
                    }
                }
            }
        }
        Ok(())
    }

    fn definition(&mut self) -> Result<(), String> {
        self.annotations()?;
        match self.peek() {
            "module" => {
                self.position += 1;
                let name = self.identifier()?;
                if self.scope.len() >= DEEPEST {
                    return Err(self.wrong("less deeply nested modules"));
                }
                self.expect("{")?;
                self.scope.push(name);
                while !self.takes("}") {
                    if self.peek().is_empty() {
                        return Err(self.wrong("`}`"));
                    }
                    self.definition()?;
                }
                self.scope.pop();
            }
            "struct" => {
                self.position += 1;
                self.structure()?;
            }
            "typedef" => {
                self.position += 1;
                let kind = self.kind(0)?;
                for (name, named) in self.declarators(&kind)? {
                    self.items.insert(self.full(&name), Item::Alias(named));
                }
            }
            "enum" => {
                self.position += 1;
                let name = self.identifier()?;
                self.items.insert(self.full(&name), Item::Alias(Named::Scalar(Scalar::Uint32)));
                self.expect("{")?;
                while !self.takes("}") {
                    self.annotations()?;
                    self.identifier()?;
                    if self.peek() != "}" {
                        self.expect(",")?;
                    }
                }
            }
            "const" => {
                self.position += 1;
                self.kind(0)?;
                let name = self.identifier()?;
                self.expect("=")?;
                if let Ok(value) = self.peek().parse() {
                    self.constants.insert(name, value);
                }
                while !matches!(self.peek(), ";" | "") {
                    self.position += 1;
                }
            }
            _ => return Err(self.wrong("`module`, `struct`, `typedef`, `enum` or `const`")),
        }
        self.takes(";");
        Ok(())
    }

    fn structure(&mut self) -> Result<(), String> {
        let name = self.identifier()?;
        let full = self.full(&name);
        if self.peek() == ";" {
            return Ok(());
        }
        if self.takes(":") {
            let base = Named::Name(self.identifier()?, self.scope.clone());
            self.bases.push((full.clone(), base));
        }
        self.expect("{")?;
        let mut fields = Vec::new();
        while !self.takes("}") {
            self.annotations()?;
            let kind = self.kind(0)?;
            fields.extend(self.declarators(&kind)?);
            self.expect(";")?;
        }
        self.items.insert(full, Item::Struct(fields));
        Ok(())
    }

    /// Parses names with their array lengths, separated by commas.
    fn declarators(&mut self, kind: &Named) -> Result<Vec<(String, Named)>, String> {
        let mut declared = Vec::new();
        loop {
            let name = self.identifier()?;
            let mut lengths = Vec::new();
            while self.takes("[") {
                lengths.push(self.length()?);
                self.expect("]")?;
            }
            let array = |entry, length: &usize| Named::Array(Box::new(entry), *length);
            declared.push((name, lengths.iter().rev().fold(kind.clone(), array)));
            if !self.takes(",") {
                return Ok(declared);
            }
        }
    }

    fn length(&mut self) -> Result<usize, String> {
        let last = self.peek().rsplit(SEPARATOR).next().unwrap_or_default();
        let length = last.parse().ok().or_else(|| self.constants.get(last).copied());
        let length = length.ok_or_else(|| self.wrong("a length"))?;
        self.position += 1;
        Ok(length)
    }

    fn kind(&mut self, depth: usize) -> Result<Named, String> {
        if depth > DEEPEST {
            return Err(self.wrong("less deeply nested sequences"));
        }
        let scalar = match self.peek() {
            "boolean" => Scalar::Bool,
            "octet" | "char" | "uint8" => Scalar::Byte,
            "int8" => Scalar::Int8,
            "short" | "int16" => Scalar::Int16,
            "uint16" => Scalar::Uint16,
            "int32" => Scalar::Int32,
            "uint32" => Scalar::Uint32,
            "int64" => Scalar::Int64,
            "uint64" => Scalar::Uint64,
            "float" => Scalar::Float32,
            "double" => Scalar::Float64,
            "long" => {
                self.position += 1;
                if self.peek() == "double" {
                    return Err(self.wrong("numbers of at most 8 bytes"));
                }
                let scalar = if self.takes("long") { Scalar::Int64 } else { Scalar::Int32 };
                return Ok(Named::Scalar(scalar));
            }
            "unsigned" => {
                self.position += 1;
                if self.takes("short") {
                    return Ok(Named::Scalar(Scalar::Uint16));
                }
                self.expect("long")?;
                let scalar = if self.takes("long") { Scalar::Uint64 } else { Scalar::Uint32 };
                return Ok(Named::Scalar(scalar));
            }
            "string" => {
                self.position += 1;
                if self.takes("<") {
                    self.length()?;
                    self.expect(">")?;
                }
                return Ok(Named::Text);
            }
            "sequence" => {
                self.position += 1;
                self.expect("<")?;
                let entry = self.kind(depth + 1)?;
                if self.takes(",") {
                    self.length()?;
                }
                self.expect(">")?;
                return Ok(Named::Sequence(Box::new(entry)));
            }
            "wstring" | "wchar" | "union" | "map" | "fixed" | "any" => {
                return Err(self.wrong("numbers, strings, sequences and structures"));
            }
            _ => {
                let name = self.identifier()?;
                let name = name.strip_prefix(SEPARATOR).unwrap_or(&name).to_string();
                return Ok(Named::Name(name, self.scope.clone()));
            }
        };
        self.position += 1;
        Ok(Named::Scalar(scalar))
    }

    /// Inserts the fields of a base structure at the front of the structures that extend it.
    fn inherit(&mut self) -> Result<(), String> {
        for (name, base) in std::mem::take(&mut self.bases) {
            let Named::Name(wanted, scope) = &base else { continue };
            let candidates = (0..=scope.len()).rev().map(|length| {
                scope[..length]
                    .iter()
                    .map(String::as_str)
                    .chain([wanted.as_str()])
                    .collect::<Vec<_>>()
                    .join(SEPARATOR)
            });
            let found = candidates.into_iter().find_map(|full| self.items.get(&full).cloned());
            let (Some(Item::Struct(mut fields)), Some(Item::Struct(own))) =
                (found, self.items.get_mut(&name))
            else {
                return Err(format!("`{name}` extends `{wanted}`, which is not a structure of the schema"));
            };
            fields.append(own);
            *own = fields;
        }
        Ok(())
    }
}
