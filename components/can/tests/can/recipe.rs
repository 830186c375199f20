//! Checks that every protocol follows the recipe for drive protocols in CONTRIBUTING.md.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Names that identify the protocols of each folder in code.
const FOLDERS: [(&str, &[&str]); 5] = [
    ("cia402", &["cia402"]),
    ("mit", &["mit", "damiao", "cubemars", "robstride"]),
    ("moteus", &["moteus"]),
    ("odrive", &["odrive"]),
    ("servo", &["feetech", "dynamixel"]),
];
/// Files outside of the recipe that may name a protocol: kinds of devices found by a scan, and the codec of
/// `Table::drive`.
const OTHERS: [&str; 3] = ["protocols/device.rs", "lib.rs", "table/mod.rs"];
/// Maximum number of files that a new protocol touches.
const MOST: usize = 6;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Paths of the numbered steps of the recipe, below the root.
fn recipe() -> Vec<String> {
    let text = std::fs::read_to_string(root().join("CONTRIBUTING.md")).unwrap();
    let start = text.find("A **drive protocol**").expect("a recipe for a drive protocol");
    let section = text[start..].split("\nA **robot**").next().unwrap();
    let quoted = |line: &str| line.split('`').skip(1).step_by(2).map(str::to_string).collect::<Vec<_>>();
    let folder = quoted(section.lines().next().unwrap()).pop().expect("its folder");
    let steps = section.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    let path = |line: &str| {
        let path = quoted(line).into_iter().find(|path| path.ends_with(".rs") || path.ends_with(".md"));
        let path = path.expect("each step names a file");
        if path.starts_with("docs/") { path } else { format!("{folder}{path}") }
    };
    steps.map(path).collect()
}

/// Names in the code of a source, in lower case, excluding comments, string literals and tests.
fn names(source: &str) -> BTreeSet<String> {
    let product = source.split("#[cfg(test)]").next().unwrap();
    let code = product.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n");
    let code: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    let words = code.split(|c: char| !(c.is_alphanumeric() || c == '_'));
    words.map(str::to_lowercase).collect()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn a_protocol_has_the_files_of_the_recipe() {
    let recipe = recipe();
    assert!(recipe.len() <= MOST, "{recipe:?}");
    for (folder, _) in FOLDERS {
        for path in &recipe {
            let path = root().join(path.replace("NAME", folder));
            // a long file may be split into a folder
            assert!(path.exists() || path.with_extension("").is_dir(), "{}", path.display());
        }
    }
}

#[test]
fn only_files_of_the_recipe_distinguish_protocols() {
    let src = root().join("components/can/src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let recipe: Vec<PathBuf> = recipe().iter().map(|path| root().join(path)).collect();
    let mut wrong = Vec::new();
    for file in files {
        let below = file.strip_prefix(&src).unwrap();
        let used = names(&std::fs::read_to_string(&file).unwrap());
        for (folder, protocols) in FOLDERS {
            let is_own = below.starts_with(Path::new("protocols").join(folder));
            if is_own || recipe.contains(&file) || OTHERS.iter().any(|other| below == Path::new(other)) {
                continue;
            }
            wrong.extend(
                protocols.iter().filter(|name| used.contains(**name)).map(|name| (file.clone(), *name)),
            );
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn the_page_of_the_adapter_describes_every_protocol() {
    let schema = serde_json::to_value(schemars::schema_for!(motorium_can::Protocol)).unwrap();
    let names: Vec<&str> = schema["oneOf"]
        .as_array()
        .expect("one of the names")
        .iter()
        .filter_map(|one| one["const"].as_str())
        .collect();
    assert!(names.len() >= 10, "{schema:#}");
    let page = recipe().into_iter().find(|path| path.ends_with(".md")).unwrap();
    let page = std::fs::read_to_string(root().join(page)).unwrap();
    for name in names {
        assert!(page.contains(&format!("`\"{name}\"`")), "{name}");
    }
}
