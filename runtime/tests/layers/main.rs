//! The layers of the workspace: dependencies ("arrows") between the modules of the runtime and between the
//! crates, found in the sources. A dependency on a higher layer, a cycle, or a layer above its size limit
//! fails a test.

mod crates;
mod cycles;
mod modules;
mod paths;
mod size;
mod tokens;
mod words;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use paths::Arrow;

/// The modules of the runtime, bottom up. Each may only use modules before it.
const LAYERS: [&str; 25] = [
    "atomics",
    "units",
    "severity",
    "nearest",
    "state",
    "telemetry",
    "declare",
    "plan",
    "os",
    "region",
    "context",
    "domain",
    "parameter",
    "transport",
    "raw",
    "run_folder",
    "component",
    "safety",
    "worker",
    "schedule",
    "graph",
    "launcher",
    "session",
    "program",
    "testing",
];
/// A module of names only, which may use any other module and which no other module may use.
const PRELUDE: &str = "prelude";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_path_buf()
}

/// Returns all Rust files below a folder, sorted.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("a readable folder").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Returns the module path of a file below `src`: `transport/input.rs` is `transport::input`.
fn module_of(file: &Path) -> Vec<String> {
    let mut parts: Vec<String> =
        file.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if parts.last().is_some_and(|last| last == "mod" || last == "lib") {
        parts.pop();
    }
    parts
}

/// Returns the arrows between the top modules of the runtime in product code.
fn arrows() -> Vec<Arrow> {
    let src = root().join("runtime/src");
    let files: Vec<(Vec<String>, Vec<tokens::Token>)> = sources(&src)
        .iter()
        .map(|file| {
            let text = std::fs::read_to_string(file).expect("a source file");
            (module_of(file.strip_prefix(&src).expect("below src")), tokens::product(tokens::tokens(&text)))
        })
        .collect();
    let tests =
        files.iter().flat_map(|(module, tokens)| paths::test_modules(module, tokens)).collect::<Vec<_>>();
    let macros: BTreeMap<String, String> =
        files.iter().flat_map(|(module, tokens)| paths::exported_macros(module, tokens)).collect();
    files
        .iter()
        .filter(|(module, _)| !module.is_empty() && !tests.iter().any(|test| module.starts_with(test)))
        .flat_map(|(module, tokens)| paths::arrows(module, tokens, &macros))
        .collect()
}

fn wrong(arrow: &Arrow) -> Option<String> {
    let rank = |module: &str| LAYERS.iter().position(|layer| *layer == module);
    if arrow.from == PRELUDE {
        return None;
    }
    match (rank(&arrow.from), rank(&arrow.to)) {
        (Some(from), Some(to)) if to < from => None,
        (Some(_), Some(_)) => {
            Some(format!("{} uses {}, which stands above it ({})", arrow.from, arrow.to, arrow.place))
        }
        (None, _) => Some(format!("`{}` has no place in the layers ({})", arrow.from, arrow.place)),
        (_, None) => Some(format!("`{}` has no place in the layers ({})", arrow.to, arrow.place)),
    }
}

#[test]
fn every_module_of_the_runtime_uses_only_those_below_it() {
    let arrows = arrows();
    let mut found: Vec<String> = arrows.iter().filter_map(wrong).collect();
    found.sort();
    found.dedup();
    assert!(found.is_empty(), "{}", found.join("\n"));
    // the parser finds arrows in use lines and in paths
    for (from, to) in
        [("worker", "component"), ("graph", "schedule"), ("safety", "transport"), ("testing", "launcher")]
    {
        assert!(
            arrows.iter().any(|arrow| arrow.from == from && arrow.to == to),
            "{from} -> {to} is not seen"
        );
    }
}

#[test]
fn every_module_of_the_runtime_has_its_layer() {
    let lib = std::fs::read_to_string(root().join("runtime/src/lib.rs")).expect("lib.rs");
    let tokens = tokens::product(tokens::tokens(&lib));
    let mut declared: Vec<&str> = tokens
        .windows(2)
        .filter_map(|pair| match pair {
            [word, tokens::Token::Name(name, _)] if word.is("mod") => Some(name.as_str()),
            _ => None,
        })
        .collect();
    declared.sort_unstable();
    let mut layers: Vec<&str> = LAYERS.into_iter().chain([PRELUDE]).collect();
    layers.sort_unstable();
    assert_eq!(declared, layers);
}

#[test]
fn crates_depend_downwards_only() {
    let found = crates::wrong_dependencies(&root());
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn algorithms_of_wings_do_not_use_the_runtime() {
    let found = crates::runtime_in_algorithms(&root());
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Returns the arrows of one file of module `os::inner`.
fn arrows_in(text: &str) -> Vec<(String, String)> {
    let tokens = tokens::product(tokens::tokens(text));
    let macros = BTreeMap::from([("state_buffer".to_string(), "state".to_string())]);
    paths::arrows(&["os".to_string(), "inner".to_string()], &tokens, &macros)
        .into_iter()
        .map(|arrow| (arrow.from, arrow.to))
        .collect()
}

#[test]
fn step_code_is_compiled_in_the_crate_of_its_kind() {
    let (inlined, found) = crates::inlined_kinds(&root());
    assert!(inlined.is_empty(), "see `Kind::of`: {}", inlined.join("\n"));
    assert!(found >= 10, "{found} functions of kinds found");
}

#[test]
fn arrows_are_found_in_every_form_of_a_path() {
    let to = |text: &str| arrows_in(text).into_iter().map(|(_, to)| to).collect::<Vec<_>>();
    assert_eq!(to("use crate::launcher::Report;"), ["launcher"]);
    assert_eq!(
        to("use crate::{launcher::{Report, self}, plan::Plan, worker};"),
        ["launcher", "plan", "worker"]
    );
    assert_eq!(to("fn f() { crate::launcher::guard::main(&folder) }"), ["launcher"]);
    assert_eq!(to("fn f() -> Option<crate :: launcher :: Report> {}"), ["launcher"]);
    assert_eq!(to("macro_rules! m { () => { $crate::program::main() } }"), ["program"]);
    assert_eq!(to("use super::super::launcher::Report;"), ["launcher"]);
    assert_eq!(to("mod deeper { use super::super::super::graph::check; }"), ["graph"]);
    assert_eq!(to("crate::state_buffer! { }"), ["state"]);
    assert_eq!(to("const X: u8 = b'\"'; use crate::graph::check;"), ["graph"]);
    assert_eq!(to("fn f<'a>(x: &'a str) -> crate::plan::Plan {}"), ["plan"]);
}

#[test]
fn comments_texts_and_tests_draw_no_arrows() {
    let none: [&str; 10] = [
        "// use crate::launcher::Report;",
        "/* crate::launcher /* nested */ crate::graph */",
        "/// [`Report`](crate::launcher::Report)",
        "const T: &str = \"crate::launcher::x\"; const R: &str = r#\"crate::graph::\"y\"#;",
        "#[cfg(test)] mod tests { use crate::launcher::Report; fn f() { if true { crate::graph::x() } } }",
        "#[cfg(test)]\nuse crate::launcher::Report;",
        "#[cfg(test)] #[allow(dead_code)] pub(crate) fn f() { crate::launcher::x() }",
        "#[cfg(all(test, unix))] impl A { fn f() { crate::launcher::x() } }",
        "pub(crate) fn f() {} pub(in crate::os) fn g() {} use super::sibling; use crate::os::x;",
        "#[cfg(doc)] use crate::launcher::Report;",
    ];
    for text in none {
        assert_eq!(arrows_in(text), [], "{text}");
    }
    // code after a test is parsed again
    assert_eq!(arrows_in("#[cfg(test)] mod tests; use crate::plan::Plan;").len(), 1);
    assert_eq!(arrows_in("#[cfg(not(test))] use crate::plan::Plan;").len(), 1);
}
