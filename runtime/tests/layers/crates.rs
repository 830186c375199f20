//! Dependencies between the crates of the workspace.

use std::collections::BTreeMap;
use std::path::Path;

use crate::tokens::{self, Token};

/// Wings that may use other wings, as listed in CONTRIBUTING.md; all others communicate only by topics.
const BETWEEN_WINGS: [(&str, &[&str]); 10] = [
    ("bridges", &["pictures", "recordings", "worlds"]),
    ("control", &["qp", "worlds"]),
    ("locomotion", &["control", "qp"]),
    ("library", &["algebra", "primitives", "recordings"]),
    ("models", &["algebra", "networks"]),
    (
        "learners",
        &[
            "algebra",
            "primitives",
            "library",
            "locomotion",
            "models",
            "physics",
            "recordings",
            "sensors",
            "worlds",
        ],
    ),
    ("physics", &["worlds"]),
    ("pictures", &["worlds"]),
    ("policies", &["primitives", "library", "models", "learners", "recordings"]),
    ("sensors", &["worlds"]),
];

/// Wings below `robots`, which are plain libraries that use no other crate of the workspace.
const BELOW_ROBOTS: [&str; 1] = ["networks"];

/// Wings without algorithms.
const COMPONENTS_ALONE: [&str; 3] = ["components/policies", "components/interfaces", "components/bridges"];

/// Returns the folders of the members of the workspace, by the names of their crates.
pub(crate) fn members(root: &Path) -> BTreeMap<String, String> {
    let manifest = read(&root.join("Cargo.toml"));
    let folders = manifest["workspace"]["members"].as_array().expect("members").iter();
    folders
        .map(|folder| {
            let folder = folder.as_str().expect("a folder").to_string();
            let name = read(&root.join(&folder).join("Cargo.toml"))["package"]["name"]
                .as_str()
                .expect("a name")
                .to_string();
            (name, folder)
        })
        .collect()
}

fn read(path: &Path) -> toml::Table {
    std::fs::read_to_string(path).expect("a manifest").parse().expect("a manifest")
}

/// Returns `true` if the crate in one folder may use the crate in another.
fn may_use(from: &str, to: &str) -> bool {
    let wing = |folder: &str| folder.strip_prefix("components/").map(str::to_string);
    match (wing(from), wing(to)) {
        (_, Some(to)) if from == "robots" => BELOW_ROBOTS.contains(&to.as_str()),
        // the leaf below all crates that command joints
        _ if to == "robots/drive" => from != "tools/view",
        _ if matches!(from, "runtime" | "robots" | "robots/drive") => false,
        (Some(from), _) if BELOW_ROBOTS.contains(&from.as_str()) => false,
        (Some(from), Some(to)) => {
            BETWEEN_WINGS.iter().any(|(wing, others)| *wing == from && others.contains(&to.as_str()))
        }
        (Some(_), None) => matches!(to, "runtime" | "robots"),
        // the command is the last but one, because tests of whole graphs use it
        (None, _) => match from {
            "benches" => to != "tools" && to != "tests",
            "tools" => to != "tests" && to != "tools/view",
            // a separate program, started by the command
            "tools/view" => to != "tests" && to != "tools",
            _ => from == "tests",
        },
    }
}

/// Returns dependencies between members that violate the layers.
pub(crate) fn wrong_dependencies(root: &Path) -> Vec<String> {
    let members = members(root);
    let mut found = Vec::new();
    for (name, folder) in &members {
        let manifest = read(&root.join(folder).join("Cargo.toml"));
        let dependencies = manifest.get("dependencies").and_then(toml::Value::as_table);
        for dependency in dependencies.into_iter().flat_map(toml::Table::keys) {
            if let Some(to) = members.get(dependency)
                && !may_use(folder, to)
            {
                found.push(format!("{name} depends on {dependency}"));
            }
        }
    }
    found
}

/// Modules of a wing that use the runtime outside its `component` module: the tasks and limits of
/// `control.qp` and the checks of their keys, which contain equations and configuration in one file, and
/// the pictures of plans and schedules.
const WITH_RUNTIME: [(&str, &[&str]); 2] =
    [("components/control", &["checks.rs", "limits", "tasks"]), ("components/pictures", &["graph"])];

/// Returns the files of wings, outside their `component` modules, that use the runtime. Its plain units are
/// allowed, because the settings of an algorithm may be the configuration of its component. Policies,
/// interfaces and bridges are only components.
pub(crate) fn runtime_in_algorithms(root: &Path) -> Vec<String> {
    let wings = members(root).into_values().filter(|folder| folder.starts_with("components/"));
    let mut found = Vec::new();
    for wing in wings.filter(|wing| !COMPONENTS_ALONE.contains(&wing.as_str())) {
        let src = root.join(&wing).join("src");
        for file in crate::sources(&src) {
            let part = file.strip_prefix(&src).expect("below src");
            let first = part.iter().next().expect("a file").to_string_lossy().into_owned();
            let is_listed =
                |(area, modules): &(&str, &[&str])| *area == wing && modules.contains(&first.as_str());
            if first.starts_with("component") || WITH_RUNTIME.iter().any(is_listed) {
                continue;
            }
            let text = std::fs::read_to_string(&file).expect("a source file");
            let tokens = tokens::product(tokens::tokens(&text));
            let named = tokens
                .windows(4)
                .find(|path| path[0].is("motorium") && path[1].is(":") && !path[3].is("units"));
            if let Some([Token::Name(_, line), ..]) = named {
                found.push(format!("{wing}/src/{}, line {line}", part.display()));
            }
        }
    }
    found
}

/// Returns the functions that provide kinds and may be inlined, against the advice of `Kind::of`, and the
/// number of all such functions.
pub(crate) fn inlined_kinds(root: &Path) -> (Vec<String>, usize) {
    let offers = |line: &str| {
        let function = line.strip_prefix("pub fn ").or_else(|| line.strip_prefix("pub(crate) fn "));
        let given = function.and_then(|rest| rest.split_once("() -> "));
        given.is_some_and(|(_, given)| {
            ["Kind ", "[Kind; ", "Vec<Kind> "].iter().any(|kinds| given.starts_with(kinds))
        })
    };
    let (mut inlined, mut found) = (Vec::new(), 0);
    for path in ["components", "benches/src"].iter().flat_map(|folder| crate::sources(&root.join(folder))) {
        let source = std::fs::read_to_string(&path).expect("a source file");
        for (before, line) in source.lines().zip(source.lines().skip(1)).filter(|(_, line)| offers(line)) {
            found += 1;
            if before != "#[inline(never)]" {
                inlined.push(format!("{}: {line}", path.display()));
            }
        }
    }
    (inlined, found)
}
