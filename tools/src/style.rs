//! Colours on a terminal, none elsewhere.

use std::fmt::Display;

fn paint(code: &str, text: impl Display) -> String {
    format!("\x1b[{code}m{text}\x1b[0m")
}

/// Something is wrong.
pub(crate) fn error(text: impl Display) -> String {
    paint("1;31", text)
}

/// Something needs attention.
pub(crate) fn warning(text: impl Display) -> String {
    paint("1;33", text)
}

/// Something is right.
pub(crate) fn good(text: impl Display) -> String {
    paint("1;32", text)
}

/// Returns a heading or a name.
pub(crate) fn strong(text: impl Display) -> String {
    paint("1", text)
}

/// Something of lesser interest.
pub(crate) fn dim(text: impl Display) -> String {
    paint("2", text)
}
