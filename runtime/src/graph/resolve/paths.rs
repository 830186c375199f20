//! Relative paths in a `config` table, which refer to the folder of their file.
//!
//! A component resolves its paths against the folder of its robot. If the files of a graph are in several
//! folders, paths in files of other folders are made absolute. The JSON Schema of the kind defines which
//! values are paths: texts and lists of the format `path`, except for the fixed texts that the schema lists
//! under `words`.

use std::borrow::Cow;
use std::path::Path;

use serde_json::Value as Json;
use toml::de::DeValue;

use super::siblings::Home;
use crate::graph::read::Value;
use crate::graph::source::{Sources, Span};

/// Deepest nesting that is followed.
const DEEPEST: usize = 64;

/// Makes the paths of a `config` table absolute that do not refer to `folder`.
pub(super) fn rebase(config: &mut Value<'_>, kind: &Home<'_>, folder: &Path, sources: &Sources) {
    if sources.files().iter().all(|file| file.folder == *folder) {
        return;
    }
    let (schema, definitions) = kind.config_schema();
    Paths { definitions: &definitions, folder, sources }.follow(config, &schema, 0);
}

struct Paths<'s> {
    definitions: &'s Json,
    folder: &'s Path,
    sources: &'s Sources,
}

impl Paths<'_> {
    fn follow(&self, value: &mut Value<'_>, schema: &Json, depth: usize) {
        if depth > DEEPEST {
            return;
        }
        if let Some(name) = schema["$ref"].as_str().and_then(|path| path.rsplit('/').next()) {
            self.follow(value, &self.definitions[name], depth + 1);
        }
        for choices in ["allOf", "anyOf", "oneOf"] {
            for choice in schema[choices].as_array().into_iter().flatten() {
                self.follow(value, choice, depth + 1);
            }
        }
        let span = value.span();
        match value.get_mut() {
            DeValue::Table(table) => {
                for (key, value) in table.iter_mut() {
                    let own = &schema["properties"][key.get_ref().as_ref()];
                    self.follow(
                        value,
                        if own.is_null() { &schema["additionalProperties"] } else { own },
                        depth + 1,
                    );
                }
            }
            DeValue::Array(array) => {
                let paths = schema["format"] == "path";
                for value in array.iter_mut() {
                    self.follow(value, if paths { schema } else { &schema["items"] }, depth + 1);
                }
            }
            DeValue::String(text) if schema["format"] == "path" => self.rebase(text, &span, &schema["words"]),
            _ => {}
        }
    }

    fn rebase(&self, text: &mut Cow<'_, str>, span: &Span, words: &Json) {
        let folder = self.sources.folder(span);
        let word = words.as_array().into_iter().flatten().any(|word| word == text.as_ref());
        if folder != self.folder && !word && Path::new(text.as_ref()).is_relative() {
            *text = folder.join(text.as_ref()).to_string_lossy().into_owned().into();
        }
    }
}
