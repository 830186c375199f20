//! `<include>`: files that replace the element that references them.

use std::path::{Path, PathBuf};

use super::document::parse_document;
use super::error::{MjcfError, MjcfProblem};
use crate::file::read_bounded;
use crate::formats::lines::Lines;
use crate::{FilePosition, ModelWarning, Position};

/// Maximum size of an included file, bytes.
const LONGEST: u64 = 16 * 1024 * 1024;

/// Text of an MJCF file with all included files inserted, and the origin of each part.
pub struct Expanded {
    /// The text, without `<include>` elements.
    pub text: String,
    /// The main file and its included files, in order.
    files: Vec<(Option<PathBuf>, String)>,
    /// Start in `text`, file index, and start in that file.
    parts: Vec<(usize, usize, usize)>,
}

/// Replaces each `<include>` by the content of the root element of the included file. Paths are relative to
/// the folder of the main file, and each file is included at most once, as in MuJoCo.
///
/// # Errors
/// An included file is not well-formed XML, cannot be read, or is included twice.
pub fn expand(text: &str, file: Option<&Path>) -> Result<Expanded, MjcfError> {
    let mut expanded = Expanded {
        text: String::with_capacity(text.len()),
        files: vec![(file.map(Path::to_owned), text.to_owned())],
        parts: Vec::new(),
    };
    expanded.append(0)?;
    Ok(expanded)
}

impl Expanded {
    /// Appends a file: the whole main file, or the content of the root element of an included file.
    fn append(&mut self, index: usize) -> Result<(), MjcfError> {
        let text = self.files[index].1.clone();
        let document = parse_document(&text)
            .map_err(|error| MjcfError { file: self.files[index].0.clone(), ..error })?;
        let root = document.root_element();
        let whole = match (root.first_child(), root.last_child()) {
            _ if index == 0 => 0..text.len(),
            (Some(first), Some(last)) => first.range().start..last.range().end,
            _ => return Ok(()),
        };
        let mut at = whole.start;
        for node in root.descendants().filter(|node| node.has_tag_name("include")) {
            let place = node.range();
            self.part(index, at..place.start, &text);
            at = place.end;
            let problem = |problem: String| {
                let (file, position) = (self.files[index].0.clone(), Lines::new(&text).position(place.start));
                Err(MjcfError { file, at: position, problem: Box::new(MjcfProblem::Other(problem)) })
            };
            let Some(name) = node.attribute("file") else {
                return problem("<include> has no attribute \"file\"".to_owned());
            };
            let Some(main) = &self.files[0].0 else {
                return problem(format!(
                    "<include> of \"{name}\": a text that is not from a file has no folder to search"
                ));
            };
            let path = main.parent().unwrap_or(Path::new("")).join(name);
            if self.files.iter().any(|(known, _)| known.as_deref() == Some(&path)) {
                return problem(format!("<include> of \"{name}\": each file can be included only once"));
            }
            let read = read_bounded(&path, LONGEST).map_err(|error| error.to_string());
            let read = read.and_then(|bytes| String::from_utf8(bytes).map_err(|error| error.to_string()));
            match read {
                Err(error) => {
                    return problem(format!(
                        "<include> of \"{name}\": cannot read {}: {error}",
                        path.display()
                    ));
                }
                Ok(text) => self.files.push((Some(path), text)),
            }
            self.append(self.files.len() - 1)?;
        }
        self.part(index, at..whole.end, &text);
        Ok(())
    }

    fn part(&mut self, file: usize, range: std::ops::Range<usize>, text: &str) {
        if !range.is_empty() {
            self.parts.push((self.text.len(), file, range.start));
            self.text.push_str(&text[range]);
        }
    }

    /// Maps a position in the expanded text to a file and a position in it.
    fn origin(&self, at: Position) -> (Option<&Path>, Position) {
        let line = self.text.split_inclusive('\n').take(at.line as usize - 1).map(str::len).sum::<usize>();
        let column =
            self.text[line..].chars().take(at.column as usize - 1).map(char::len_utf8).sum::<usize>();
        let offset = line + column;
        let part = self.parts.partition_point(|(start, ..)| *start <= offset).saturating_sub(1);
        let Some((start, file, from)) = self.parts.get(part) else { return (self.files[0].0.as_deref(), at) };
        let (path, text) = &self.files[*file];
        (path.as_deref(), Lines::new(text).position((from + offset - start).min(text.len())))
    }

    /// Converts the position of an error in the expanded text to its position in the original file.
    pub fn located(&self, error: MjcfError) -> MjcfError {
        if error.file.is_some() {
            return error;
        }
        let (file, at) = self.origin(error.at);
        MjcfError { file: file.map(Path::to_owned), at, ..error }
    }

    /// Converts the position of a warning in the expanded text to its position in the original file. Names
    /// the file, unless it is the main file.
    pub fn located_warning(&self, warning: ModelWarning) -> ModelWarning {
        let name = |file: Option<&Path>, what: String| {
            let included = file.filter(|file| Some(*file) != self.files[0].0.as_deref());
            let name = included.and_then(Path::file_name).map(|name| name.to_string_lossy());
            name.map_or(what.clone(), |name| format!("{name}: {what}"))
        };
        match warning {
            ModelWarning::Ignored { what, at, count, reason } => {
                let (file, at) = self.origin(at);
                ModelWarning::Ignored { what: name(file, what), at, count, reason }
            }
            ModelWarning::Degrees { what, format, angle, at: Some(at) } => {
                let (file, at) = self.origin(at);
                ModelWarning::Degrees { what: name(file, what), format, angle, at: Some(at) }
            }
            other => other,
        }
    }

    /// Returns a position of the expanded text in its file.
    pub(crate) fn file_position(&self, at: Position) -> FilePosition {
        let (file, at) = self.origin(at);
        FilePosition { file: file.map(Path::to_owned), at }
    }
}
