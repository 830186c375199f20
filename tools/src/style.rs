//! Colours on a terminal, none elsewhere.

use std::fmt::Display;

fn paint(code: &str, text: impl Display) -> String {
    format!("\x1b[{code}m{text}\x1b[0m")
}

/// Styles a text that reports an error.
pub(crate) fn error(text: impl Display) -> String {
    paint("1;31", text)
}

/// Styles a text that needs attention.
pub(crate) fn warning(text: impl Display) -> String {
    paint("1;33", text)
}

/// Styles a text that reports a success.
pub(crate) fn good(text: impl Display) -> String {
    paint("1;32", text)
}

/// Styles a heading or a name.
pub(crate) fn strong(text: impl Display) -> String {
    paint("1", text)
}

/// Styles a text of lesser interest.
pub(crate) fn dim(text: impl Display) -> String {
    paint("2", text)
}
