//! The files of a graph: the graph file, the files it extends, and the overlays of the command line.
//!
//! Files are found by their `extends` keys; their contents are merged in `merge`.

use std::path::{Path, PathBuf};

use toml::de::DeTable;

use super::diagnostic::Report;
use super::file::{self, LONGEST};
use super::source::{Source, Sources, Span};

/// Maximum number of files of one graph.
const MOST: usize = 32;
/// Maximum length of a chain of `extends`.
const DEEPEST: usize = 8;

/// A file of a graph.
struct Layer {
    /// Path as written.
    path: PathBuf,
    /// Path used for identity.
    identity: PathBuf,
    text: String,
    problem: Option<Problem>,
}

/// An extended file that cannot be used.
struct Problem {
    /// Position of its name in the text of the extending file.
    span: Span,
    message: String,
    advice: String,
}

/// All files of a graph; each overrides the previous ones.
#[derive(Default)]
pub(super) struct Layers {
    files: Vec<Layer>,
    named: usize,
}

impl Layers {
    /// Loads the graph file and the files it extends.
    pub(super) fn of_graph(path: &Path, text: String) -> Self {
        let mut layers = Self::default();
        layers.add(path, text);
        layers.named = layers.files.len() - 1;
        layers
    }

    /// Overlays a file and the files it extends on all others. A file that is already part of the graph is
    /// not added again.
    pub(super) fn add(&mut self, path: &Path, text: String) {
        let mut chain: Vec<Layer> = Vec::new();
        let mut next = Some((path.to_path_buf(), text));
        while let Some((path, text)) = next.take() {
            let identity = identity(&path);
            let mut layer = Layer { path, identity, text, problem: None };
            if let Some((span, base)) = layer.extends() {
                chain.push(layer);
                match self.base(&chain, &base) {
                    Ok(base) => next = base,
                    Err((message, advice)) => {
                        layer = chain.pop().expect("it was pushed above");
                        layer.problem = Some(Problem { span, message, advice });
                        chain.push(layer);
                    }
                }
            } else {
                chain.push(layer);
            }
        }
        self.files.extend(chain.into_iter().rev());
    }

    /// Returns the file extended by the last file of a chain; `None` if it is already part of the graph.
    fn base(&self, chain: &[Layer], base: &str) -> Result<Option<(PathBuf, String)>, (String, String)> {
        let last = chain.last().expect("a chain has a file");
        let path = last.path.parent().unwrap_or(Path::new("")).join(base);
        let (name, identity) = (path.display(), identity(&path));
        let refuse = |message: String, advice: &str| Err((message, advice.to_string()));
        if chain.iter().any(|layer| layer.identity == identity) {
            return refuse(
                format!("`{name}` extends itself"),
                "remove `extends` from one of the files of this cycle",
            );
        }
        if self.files.iter().any(|layer| layer.identity == identity) {
            return Ok(None);
        }
        if chain.len() == DEEPEST {
            let message = format!("more than {DEEPEST} files extend one another");
            return refuse(message, "merge some of them");
        }
        if self.files.len() + chain.len() >= MOST {
            return refuse(format!("the graph has more than {MOST} files"), "merge some of them");
        }
        let bytes = match file::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                let advice = file::near(&path).map_or_else(
                    || "the path is relative to the file that extends it".to_string(),
                    |near| format!("did you mean `{}`?", Path::new(base).with_file_name(near).display()),
                );
                return Err((format!("the file `{name}` cannot be read: {error}"), advice));
            }
        };
        let total =
            bytes.len() + chain.iter().chain(&self.files).map(|layer| layer.text.len()).sum::<usize>();
        if total as u64 > LONGEST {
            let message = format!(
                "the files of the graph have {total} bytes, expected at most {LONGEST} (16 MiB) together"
            );
            return refuse(message, "check that this is the intended file");
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Some((path, text))),
            Err(_) => refuse(format!("the file `{name}` is not UTF-8 text"), "save the file as UTF-8"),
        }
    }

    /// Returns the number of files and their total size, bytes.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.files.len(), self.files.iter().map(|layer| layer.text.len()).sum())
    }

    /// Maximum number of files, and maximum total size, bytes.
    pub(super) const LIMITS: (usize, usize) = (MOST, LONGEST as usize);

    /// Returns the texts, and a function that reports file problems once there is a report.
    pub(super) fn into_sources(self) -> (Sources, Problems) {
        let mut sources = Sources::new(self.named);
        let mut problems = Vec::new();
        for layer in self.files {
            let folder = file::folder_of(&layer.path);
            sources.add_file(layer.path.display().to_string(), layer.text, folder);
            let start = sources.files().last().map_or(0, |source: &Source| source.start);
            problems.extend(layer.problem.map(|problem| Problem {
                span: start + problem.span.start..start + problem.span.end,
                ..problem
            }));
        }
        (sources, Problems(problems))
    }
}

/// An error in the files of a graph.
pub(super) struct Problems(Vec<Problem>);

impl Problems {
    pub(super) fn report(self, report: &mut Report) {
        for Problem { span, message, advice } in self.0 {
            report.error(message).label(&span, "the file extended here").advise(advice);
        }
    }
}

impl Layer {
    /// Returns the extended file with the position of its name.
    fn extends(&self) -> Option<(Span, String)> {
        // most files are parsed once
        if !self.text.contains("extends") {
            return None;
        }
        let (table, _) = DeTable::parse_recoverable(&self.text);
        let value = table.get_ref().get("extends")?;
        Some((value.span(), value.get_ref().as_str()?.to_string()))
    }
}

/// Returns the path that identifies a file.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}
