//! Wraps messages between words on narrow terminals.

use std::io::IsTerminal as _;

/// Minimum width at which lines are wrapped; on narrower terminals, the terminal wraps them.
const NARROWEST: usize = 20;

/// Returns the columns of the terminal behind standard error; `None` if there is no terminal.
pub(crate) fn width() -> Option<usize> {
    if !std::io::stderr().is_terminal() {
        return None;
    }
    let (columns, _) = ratatui::crossterm::terminal::size().ok()?;
    Some(usize::from(columns)).filter(|columns| *columns >= NARROWEST)
}

/// Wraps every line that is longer than `width` between words; continuations are indented.
///
/// Excerpts of files (`12 | gain = 1`), text that moves the cursor and words without blanks stay whole.
/// Colour codes have no width.
pub(crate) fn wrapped(text: &str, width: usize) -> String {
    if text.contains('\r') {
        return text.to_string();
    }
    text.split_inclusive('\n').map(|line| broken(line, width)).collect()
}

fn broken(line: &str, width: usize) -> String {
    let plain = anstream::adapter::strip_str(line).to_string();
    let after_number = plain.trim_start().trim_start_matches(|c: char| c.is_ascii_digit()).trim_start();
    if columns(line) <= width || after_number.starts_with('|') {
        return line.to_string();
    }
    let indent = indentation(&plain).min(width / 2);
    let mut text = String::new();
    let mut used = 0;
    for (index, word) in line.split_inclusive(' ').enumerate() {
        let room = columns(word.trim_end());
        if index > 0 && used + room > width && used > indent {
            text.truncate(text.trim_end_matches(' ').len());
            text.push('\n');
            text.push_str(&" ".repeat(indent));
            used = indent;
        }
        text.push_str(word);
        used += columns(word.trim_end_matches('\n'));
    }
    text
}

/// Returns the number of visible characters of a text.
fn columns(text: &str) -> usize {
    anstream::adapter::strip_str(text.trim_end_matches('\n')).to_string().chars().count()
}

/// Returns the indentation of the continuation of a line: below its first word, or below the words after `=
/// note: `.
fn indentation(line: &str) -> usize {
    let blanks = line.len() - line.trim_start().len();
    let note = line.find("= ").filter(|at| *at == blanks);
    match note.and_then(|at| line[at..].find(": ").map(|colon| at + colon + 2)) {
        Some(column) => column,
        None => blanks + 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_wrap_at_the_terminal_without_loss() {
        let text = "\x1b[1;33mwarning\x1b[0m: 3 meshes of `shoulder` are ignored, since no file of them is found in \
                    any of the folders of the package path\n  = note: give the folder that holds the package by `package_path`\n";
        for width in [30, 40, 79] {
            let lines = wrapped(text, width);
            assert!(lines.lines().all(|line| columns(line) <= width), "{width}: {lines}");
            let words = |text: &str| text.split_whitespace().map(str::to_string).collect::<Vec<_>>();
            assert_eq!(words(&lines), words(text), "{width}");
            assert!(lines.ends_with('\n'));
        }
        assert_eq!(wrapped(text, 500), text);
    }

    #[test]
    fn continuations_align_and_excerpts_stay_whole() {
        let note = "  = help: write one number or as many as there are joints\n";
        assert_eq!(
            wrapped(note, 34),
            "  = help: write one number or as\n          many as there are joints\n"
        );
        let excerpt =
            "12 | goals = [{ offset = [5.0, 0.0, 0.0], duration = \"1 s\" }]\n   |           ^^^^ too far\n";
        assert_eq!(wrapped(excerpt, 30), excerpt);
        assert_eq!(
            wrapped("\r12 of 100 are done by now, and more", 20),
            "\r12 of 100 are done by now, and more"
        );
    }
}
