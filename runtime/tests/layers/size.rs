//! The size of a layer in lines of code, without tests.

use std::path::Path;

use crate::{root, sources};

/// Upper bound on the lines of code of the transport. Anything beyond belongs in a separate layer.
const TRANSPORT: usize = 2_200;

/// Counts the lines of code of a source, without blank lines, comments, and tests at its end.
fn lines_of_code(text: &str) -> usize {
    let is_code = |line: &&str| !line.is_empty() && !line.starts_with("//");
    let product = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    product.lines().map(str::trim).filter(is_code).count()
}

/// Counts the lines of code below a folder, without its `tests` folder.
fn size_of(folder: &Path) -> usize {
    let files = sources(folder).into_iter().filter(|file| !file.starts_with(folder.join("tests")));
    files.map(|file| lines_of_code(&std::fs::read_to_string(file).expect("a source file"))).sum()
}

#[test]
fn transport_stays_below_its_size_limit() {
    let lines = size_of(&root().join("runtime/src/transport"));
    assert!((1_000..TRANSPORT).contains(&lines), "{lines} lines of code, fewer than {TRANSPORT} are allowed");
}

#[test]
fn blank_lines_comments_and_tests_are_not_counted() {
    let text = "//! Doc.\n\nuse a::b; // why\n\n/// Doc.\nfn f() {\n    // why\n    g();\n}\n\n#[cfg(test)]\nmod tests {\n}\n";
    assert_eq!(lines_of_code(text), 4);
    assert_eq!(lines_of_code("#[cfg(test)]\nfn f() {}\n"), 2, "single items under `cfg(test)` count");
}
