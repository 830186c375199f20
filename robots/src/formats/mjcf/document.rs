//! XML parsing.

use roxmltree::{Document, ParsingOptions};

use super::error::{MjcfError, MjcfProblem};
use crate::Position;

/// Parses a text as XML.
///
/// # Errors
///
/// [`MjcfProblem::Xml`] with its position in the text, but without the path of the file.
pub fn parse_document(text: &str) -> Result<Document<'_>, MjcfError> {
    let options = ParsingOptions { allow_dtd: true, ..Default::default() };
    Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        let message = error.to_string().replace(&format!(" at {at}"), "");
        let at = Position { line: at.row, column: at.col };
        MjcfError { file: None, at, problem: Box::new(MjcfProblem::Xml(message)) }
    })
}
