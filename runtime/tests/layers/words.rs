//! Wording: phrases that the project avoids, counted per crate in comments, strings and the book.
//!
//! The counts only go down. After removing some, lower the ceiling to the printed count.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::tokens::{PieceKind, pieces};
use crate::{root, sources};

/// What is counted, in the order of the columns of [`CEILINGS`].
const COLUMNS: [&str; 8] = [
    "that of, those of",
    "tell, tells, told",
    "goes on",
    "anew",
    "is none",
    "comment lines wider than 110",
    "functions with names of 60 characters or more",
    "functions named of, at, place, words, told, plain",
];

/// Phrases of the first columns, as words in lower case.
const PHRASES: [&[&[&str]]; 5] = [
    &[&["that", "of"], &["those", "of"]],
    &[&["tell"], &["tells"], &["told"]],
    &[&["goes", "on"]],
    &[&["anew"]],
    &[&["is", "none"]],
];

/// Largest width of a comment line in columns.
const WIDTH: usize = 110;
/// Shortest function name that is too long, in characters.
const LONG_NAME: usize = 60;
/// Function names that do not describe a result or an action.
const VAGUE: [&str; 6] = ["of", "at", "place", "words", "told", "plain"];

/// Largest count of each column per area: a crate, `docs` (the book and the pages at the root), or `graphs`.
const CEILINGS: [(&str, [usize; 8]); 28] = [
    ("runtime", [0, 1, 0, 0, 0, 10, 0, 3]),
    ("robots", [0, 0, 0, 0, 0, 7, 0, 1]),
    ("components/worlds", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/physics", [0, 0, 0, 0, 0, 3, 0, 0]),
    ("components/sensors", [0, 0, 0, 0, 0, 3, 0, 0]),
    ("robots/drive", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/qp", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/control", [0, 2, 0, 0, 0, 8, 0, 0]),
    ("components/locomotion", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/algebra", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/networks", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/recordings", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/primitives", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/library", [0, 0, 0, 0, 0, 2, 0, 0]),
    ("components/models", [0, 0, 0, 0, 0, 1, 0, 0]),
    ("components/learners", [0, 4, 0, 0, 0, 1, 0, 0]),
    ("components/policies", [0, 0, 0, 0, 0, 1, 0, 0]),
    ("components/can", [0, 0, 0, 0, 0, 9, 0, 0]),
    ("components/interfaces", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/pictures", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("components/bridges", [0, 0, 0, 0, 0, 3, 0, 1]),
    ("tests/ci", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("tests", [0, 0, 0, 0, 1, 0, 0, 0]),
    ("benches", [1, 0, 0, 0, 0, 0, 0, 0]),
    ("tools", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("tools/view", [0, 0, 0, 0, 0, 0, 0, 0]),
    ("docs", [0, 1, 0, 0, 0, 0, 0, 0]),
    ("graphs", [0, 0, 0, 0, 0, 0, 0, 0]),
];

type Counts = [usize; 8];

/// Adds the phrases of a text to the first columns.
fn count_phrases(text: &str, counts: &mut Counts) {
    let mut words = Vec::new();
    let mut word = String::new();
    for c in text.chars().chain([' ']) {
        if c.is_alphanumeric() || c == '\'' || c == '_' {
            word.extend(c.to_lowercase());
            continue;
        }
        if !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        // phrases do not cross punctuation
        if !c.is_whitespace() {
            words.push(c.to_string());
        }
    }
    for (column, phrases) in PHRASES.iter().enumerate() {
        for phrase in *phrases {
            let found = words.windows(phrase.len()).enumerate().filter(|(i, window)| {
                let after_there = *i > 0 && words[i - 1] == "there";
                window.iter().eq(phrase.iter()) && !(after_there && phrase == &["is", "none"])
            });
            counts[column] += found.count();
        }
    }
}

/// Counts all columns of a Rust source.
fn count_source(source: &str, counts: &mut Counts) {
    let mut comment = String::new();
    let mut after_fn = false;
    for piece in pieces(source) {
        match piece.kind {
            PieceKind::Comment => {
                comment += &format!(" {}", piece.text.trim_start_matches(['/', '!', '*']));
                continue;
            }
            PieceKind::Mark if piece.text.trim().is_empty() => continue,
            PieceKind::Literal => count_phrases(&piece.text.replace("\\n", " ").replace('\\', " "), counts),
            PieceKind::Name if after_fn => {
                counts[6] += usize::from(piece.text.chars().count() >= LONG_NAME);
                counts[7] += usize::from(VAGUE.contains(&piece.text.as_str()));
            }
            PieceKind::Name | PieceKind::Mark => {}
        }
        count_phrases(&std::mem::take(&mut comment), counts);
        after_fn = piece.kind == PieceKind::Name && piece.text == "fn";
    }
    count_phrases(&comment, counts);
    counts[5] += wide(source, "//");
}

/// Counts the comments of a graph file.
fn count_graph(text: &str, counts: &mut Counts) {
    let comments = text.lines().filter_map(|line| line.split_once('#')).map(|(_, comment)| comment);
    count_phrases(&comments.collect::<Vec<_>>().join(" "), counts);
    counts[5] += wide(text, "#");
}

/// Comment lines that are too wide.
fn wide(text: &str, mark: &str) -> usize {
    let is_wide = |line: &&str| line.trim_start().starts_with(mark) && line.chars().count() > WIDTH;
    text.lines().filter(is_wide).count()
}

/// All files below a folder with an extension, sorted.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable folder").path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|other| other == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The counts of every area of the repository.
fn counted() -> BTreeMap<String, Counts> {
    let root = root();
    let mut areas: Vec<String> = crate::crates::members(&root).into_values().collect();
    // nested crates come first: `tools/view` before `tools`
    areas.sort_by_key(|area| std::cmp::Reverse(area.len()));
    let mut counted: BTreeMap<String, Counts> = BTreeMap::new();
    for area in &areas {
        for path in sources(&root.join(area)) {
            let inner = path.strip_prefix(&root).expect("below the root");
            let owner = areas.iter().find(|area| inner.starts_with(area)).expect("its own area");
            // this file lists the phrases
            if owner == area
                && !inner.ends_with("layers/words.rs")
                && !inner.iter().any(|part| part == "target")
            {
                let text = std::fs::read_to_string(&path).expect("a source file");
                count_source(&text, counted.entry(area.clone()).or_default());
            }
        }
    }
    let at_root = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root.join(name));
    for page in files(&root.join("docs/src"), "md").into_iter().chain(at_root) {
        let text = std::fs::read_to_string(page).expect("a page");
        count_phrases(&text, counted.entry("docs".to_string()).or_default());
    }
    for graph in files(&root.join("graphs"), "toml") {
        let text = std::fs::read_to_string(graph).expect("a graph");
        count_graph(&text, counted.entry("graphs".to_string()).or_default());
    }
    counted
}

#[test]
fn phrase_counts_stay_below_their_ceilings() {
    let counted = counted();
    let ceilings: BTreeMap<&str, Counts> = CEILINGS.into_iter().collect();
    let mut found = Vec::new();
    for (area, counts) in &counted {
        let ceiling = ceilings.get(area.as_str()).copied().unwrap_or_default();
        for ((column, count), ceiling) in COLUMNS.iter().zip(counts).zip(ceiling) {
            if *count > ceiling {
                found.push(format!("{area}: {count} of \"{column}\", at most {ceiling} allowed"));
            }
        }
    }
    let table: String =
        counted.iter().map(|(area, counts)| format!("    ({area:?}, {counts:?}),\n")).collect();
    // `cargo only layers words -- --nocapture` prints the table to copy after a count has fallen
    println!("{table}");
    assert!(found.is_empty(), "{}\nhelp: reword the new ones", found.join("\n"));
}

#[test]
fn every_area_has_a_ceiling() {
    let counted: Vec<String> = counted().into_keys().collect();
    let mut areas = CEILINGS.map(|(area, _)| area.to_string());
    areas.sort();
    assert_eq!(counted, areas);
}

#[test]
fn phrases_are_found_in_comments_and_strings() {
    let count = |source: &str| {
        let mut counts = [0; 8];
        count_source(source, &mut counts);
        counts
    };
    assert_eq!(
        count("/// The length is that of\n/// the line.\nfn f() {}")[0],
        1,
        "across lines of a comment"
    );
    assert_eq!(count("fn f() { g(\"It tells, and told.\") }")[1], 2);
    assert_eq!(count("fn told() { tell.told() }"), [0, 0, 0, 0, 0, 0, 0, 1], "names of code are not phrases");
    assert_eq!(count("// It goes on. Begins anew. The file is none.")[2..5], [1, 1, 1]);
    assert_eq!(count("// Empty where there is none. Not that. Of these, one.")[..5], [0; 5]);
    assert_eq!(count(&format!("    // {}\n", "x".repeat(104)))[5], 1);
    assert_eq!(count(&format!("    // {}\n", "x".repeat(103)))[5], 0);
    assert_eq!(count(&format!("fn {}() {{}}", "a".repeat(60)))[6], 1);
    assert_eq!(count(&format!("fn {}() {{}}", "a".repeat(59)))[6], 0);
    assert_eq!(count("impl A { pub fn at<T>(&self) {} fn cat() {} }")[7], 1);
}
