//! The book matches the program: its graphs run, its component moves a robot, its tables are complete.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value as Json;

use crate::program::printed;

mod components;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tools are in the workspace").to_path_buf()
}

fn read(path: impl AsRef<Path>) -> String {
    let path = workspace().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The pages of the book and the README: path and text.
fn pages() -> Vec<(PathBuf, String)> {
    let mut folders = vec![workspace().join("docs/src")];
    let mut pages = vec![(workspace().join("README.md"), read("README.md"))];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("the book is there").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                let text = read(&path);
                pages.push((path, text));
            }
        }
    }
    pages.sort();
    pages
}

/// The fenced blocks whose first line is ```` ```KIND ````, with their page.
fn blocks(kind: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for (path, text) in pages() {
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            let Some(opened) = line.strip_prefix("```") else { continue };
            let body: Vec<&str> = lines.by_ref().take_while(|line| !line.starts_with("```")).collect();
            if opened == kind {
                found.push((path.clone(), body.join("\n") + "\n"));
            }
        }
    }
    found
}

fn motorium(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_motorium"))
        .args(arguments)
        .current_dir(workspace())
        .output()
        .expect("motorium starts")
}

fn json(arguments: &[&str]) -> Json {
    let output = motorium(arguments);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{arguments:?}: {error}"))
}

fn assert_can_run(page: &Path, graph: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("graph.toml");
    std::fs::write(&file, graph).expect("the graph can be written");
    let output = motorium(&["check", file.to_str().expect("a plain path")]);
    assert!(
        output.status.success(),
        "{}:\n{graph}\n{}",
        page.display(),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn every_graph_of_the_book_can_run() {
    let graphs = blocks("toml");
    assert!(graphs.len() >= 2, "there are whole graphs in the book");
    for (page, graph) in graphs {
        assert_can_run(&page, &graph);
    }
}

#[test]
fn every_overlay_graph_of_the_book_can_run() {
    let overlays = blocks("toml overlay");
    assert!(!overlays.is_empty(), "there are such graphs in the book");
    let below = workspace().join("graphs/panda-reach.toml");
    for (page, graph) in overlays {
        assert_can_run(&page, &graph.replace("panda-reach.toml", below.to_str().expect("a plain path")));
    }
}

/// The graph of the README, with its tables replaced by the tables of a fragment.
fn with_fragment(fragment: &str) -> String {
    let headers: Vec<&str> = fragment.lines().filter(|line| line.starts_with('[')).collect();
    let text = read("graphs/panda-reach.toml");
    let (mut graph, mut header, mut kept) = (String::new(), "", true);
    for line in text.lines() {
        if line.starts_with('[') {
            header = line.split_whitespace().next().unwrap_or(line);
            kept = !headers.contains(&header);
        }
        // A table `[x.config]` replaces a line `config = ...` in `[x]`.
        let key = line.split('=').next().unwrap_or_default().trim();
        let table = header.replace(']', &format!(".{key}]"));
        if kept && !headers.contains(&table.as_str()) {
            graph += &format!("{line}\n");
        }
    }
    graph + fragment
}

#[test]
fn graph_fragments_of_the_book_check_in_a_whole_graph() {
    let fragments = blocks("toml fragment");
    assert!(fragments.len() >= 4, "there are parts of graphs in the book");
    for (page, fragment) in fragments {
        assert_can_run(&page, &with_fragment(&fragment));
    }
}

#[test]
fn book_profile_matches_the_catalogue() {
    let file = read("robots/catalogue/planar-3r/planar-3r.toml");
    assert_eq!(blocks("toml profile").into_iter().map(|(_, text)| text).collect::<Vec<_>>(), [file]);
}

/// Names in backticks.
fn quoted(text: &str) -> BTreeSet<String> {
    let words = text.split('`').skip(1).step_by(2);
    words.flat_map(|words| words.split(['.', ' ', '=', '{', '}', ',', '"'])).map(str::to_string).collect()
}

/// All keys that a schema describes, including the definitions it refers to.
fn keys(schema: &Json, root: &Json, found: &mut BTreeSet<String>) {
    keys_within(schema, root, &mut BTreeSet::new(), found);
}

/// Like [`keys`], without the `known` definitions, because some are recursive.
fn keys_within<'a>(
    schema: &'a Json,
    root: &'a Json,
    known: &mut BTreeSet<&'a str>,
    found: &mut BTreeSet<String>,
) {
    match schema {
        Json::Object(object) => {
            if let Some(Json::Object(properties)) = object.get("properties") {
                found.extend(properties.keys().cloned());
            }
            if let Some(name) = object.get("$ref").and_then(Json::as_str) {
                let target = root.pointer(name.trim_start_matches('#')).expect("references lead somewhere");
                // Primitives are described in the library, not in the book.
                if !name.ends_with("StoredModel") && known.insert(name) {
                    keys_within(target, root, known, found);
                }
            }
            object.values().for_each(|value| keys_within(value, root, known, found));
        }
        Json::Array(items) => items.iter().for_each(|item| keys_within(item, root, known, found)),
        _ => {}
    }
}

fn assert_documented(wanted: &BTreeSet<String>, pages: &[&str]) {
    let text: String = pages.iter().map(|page| read(format!("docs/src/{page}"))).collect();
    let known = quoted(&text);
    let missing: Vec<&String> = wanted.difference(&known).collect();
    assert!(missing.is_empty(), "{pages:?} say nothing of {missing:?}");
}

#[test]
fn every_key_of_a_graph_file_and_of_every_kind_is_in_the_book() {
    let schema = json(&["schema", "graph"]);
    let mut graph = schema.clone();
    let rules =
        graph.pointer_mut("/definitions/WholeComponent/allOf").map(Json::take).expect("rules for kinds");
    let mut wanted = BTreeSet::new();
    keys(&graph["properties"], &graph, &mut wanted);
    let tables = graph["properties"].as_object().expect("keys at the top");
    wanted.extend(tables.keys().cloned());
    // a terrain is described where it is simulated
    assert_documented(
        &wanted,
        &["graph-file.md", "graph-file-components.md", "kinds/physics-articulated.md"],
    );
    let mut kinds = 0;
    for rule in rules.as_array().expect("a list of rules") {
        let Some(kind) = rule.pointer("/if/properties/kind/const").and_then(Json::as_str) else { continue };
        let mut wanted = BTreeSet::new();
        keys(&rule["then"]["properties"]["config"], &schema, &mut wanted);
        assert!(!wanted.is_empty(), "{kind} has a configuration");
        let page = format!("kinds/{}.md", kind.replace(['.', '_'], "-"));
        assert!(read("docs/src/kinds.md").contains(&format!("[`{kind}`]({page})")), "{kind} is not listed");
        // tables shared by many kinds are on one page, to which the others link
        let text = read(format!("docs/src/{page}"));
        let shared = [
            ("(../graph-file.md#world)", "graph-file.md"),
            ("(../graph-file.md#world)", "kinds/physics-articulated.md"),
            ("(sensor-imu.md#configuration)", "kinds/sensor-imu.md"),
        ];
        let shared = shared.iter().filter(|(link, _)| text.contains(link)).map(|(_, page)| *page);
        let pages: Vec<&str> = std::iter::once(page.as_str()).chain(shared).collect();
        assert_documented(&wanted, &pages);
        kinds += 1;
    }
    assert!(kinds >= 5, "only {kinds} kinds");
}

#[test]
fn table_of_kinds_matches_the_command() {
    let page = read("docs/src/kinds.md");
    let kinds = json(&["kinds", "--json"]);
    for line in kinds.as_array().expect("a list") {
        let (kind, summary) = (line["kind"].as_str().expect("a name"), line["summary"].as_str());
        let row = page.lines().find(|row| row.starts_with(&format!("| [`{kind}`]")));
        let summary_cell = row.and_then(|row| row.split(" | ").nth(1));
        assert_eq!(summary_cell, summary, "{kind}");
    }
}

/// Keys that the tables of a page explain: names in backticks in the first column of tables that begin with
/// `key`.
fn tabled(text: &str) -> BTreeSet<String> {
    let (mut keys, mut explains) = (BTreeSet::new(), false);
    let mut before = "";
    for line in text.lines() {
        if line.starts_with('|') && !before.starts_with('|') {
            explains = line.starts_with("| key ");
        } else if explains && line.starts_with("| `") {
            let cell = line.split(" | ").next().unwrap_or_default();
            // the key of `kind = "twin"`, not its value
            let names = cell.split('`').skip(1).step_by(2).filter_map(|words| words.split(" =").next());
            keys.extend(names.flat_map(|name| name.split(['.', ' ', '[', ']'])).map(str::to_string));
        }
        before = line;
    }
    keys.into_iter().filter(|key| key.starts_with(|c: char| c.is_ascii_lowercase())).collect()
}

#[test]
fn keys_explained_on_kind_pages_exist() {
    let schema = json(&["schema", "graph"]);
    let rules = schema.pointer("/definitions/WholeComponent/allOf").and_then(Json::as_array);
    let mut explained = 0;
    for rule in rules.expect("rules for kinds") {
        let Some(kind) = rule.pointer("/if/properties/kind/const").and_then(Json::as_str) else { continue };
        let mut known = BTreeSet::new();
        keys(&rule["then"]["properties"]["config"], &schema, &mut known);
        let listed = tabled(&read(format!("docs/src/kinds/{}.md", kind.replace(['.', '_'], "-"))));
        explained += listed.len();
        let unknown: Vec<&String> = listed.difference(&known).collect();
        assert!(unknown.is_empty(), "the page of {kind} explains keys that it does not have: {unknown:?}");
    }
    assert!(explained > 200, "{explained} keys");
}

#[test]
fn every_field_of_the_report_is_in_the_book() {
    let schema = json(&["schema", "report"]);
    let mut wanted = BTreeSet::new();
    keys(&schema, &schema, &mut wanted);
    assert!(wanted.len() > 30, "{wanted:?}");
    assert_documented(&wanted, &["report.md"]);
}

#[test]
fn every_field_of_benchmark_files_is_in_the_book() {
    let schema = json(&["schema", "bench"]);
    let mut wanted = BTreeSet::new();
    keys(&schema, &schema, &mut wanted);
    assert!(wanted.len() > 40, "{wanted:?}");
    assert_documented(&wanted, &["latency.md", "report.md"]);
}

/// Compares a picture of the book with the output of the command that draws it.
fn assert_drawn(file: &str, arguments: &[&str]) {
    let output = motorium(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Real-time components run on the last core of the machine.
    let last = motorium::os::machine::online_cores().last().copied().unwrap_or(0);
    let drawn = String::from_utf8(output.stdout).expect("text").replace(&format!("core {last},"), "core 1,");
    let hint = format!("motorium {} > {file}", arguments.join(" "));
    assert!(read(file) == drawn, "{file} is out of date: {hint}");
}

#[test]
fn pictures_of_readme_and_catalogue_are_current() {
    assert_drawn("docs/src/images/panda-reach.svg", &["graph", "graphs/panda-reach.toml", "--format", "svg"]);
    let pictures = std::fs::read_dir(workspace().join("docs/src/robots")).expect("a folder").flatten();
    let names: Vec<String> =
        pictures.filter_map(|entry| Some(entry.file_name().to_str()?.to_string())).collect();
    assert!(names.len() >= 19, "{names:?}");
    for name in names {
        let file = format!("docs/src/robots/{name}");
        match name.rsplit_once('.') {
            Some((robot, "svg")) => {
                assert_drawn(&file, &["robot", "draw", robot, "--size", "420x420", "--com"]);
            }
            Some((robot, "png")) => {
                let folder = tempfile::tempdir().expect("a folder");
                let drawn = folder.path().join(&name);
                let drawn = drawn.to_str().expect("a plain path");
                let arguments = ["robot", "draw", robot, "--visual", "--size", "420x420", "--output"];
                printed(&[&arguments[..], &[drawn]].concat());
                let current = std::fs::read(drawn).expect("the picture");
                let kept = std::fs::read(workspace().join(&file)).expect("the picture");
                assert!(kept == current, "{file} is out of date: motorium {} {file}", arguments.join(" "));
            }
            _ => panic!("{file} is not a picture of a robot"),
        }
    }
}

/// The anchors of the headings of a page.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings =
        text.lines().filter_map(|line| line.strip_prefix('#')).map(|line| line.trim_start_matches('#'));
    let slug = |heading: &str| -> String {
        let kept = |c: &char| c.is_alphanumeric() || matches!(c, '-' | '_' | ' ');
        heading
            .trim()
            .chars()
            .filter(kept)
            .map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() })
            .collect()
    };
    headings.map(slug).collect()
}

#[test]
fn links_resolve_and_every_page_is_in_the_summary() {
    let summary = read("docs/src/SUMMARY.md");
    let book = workspace().join("docs/src");
    let within = book.canonicalize().expect("the book is there");
    for (path, text) in pages() {
        let folder = path.parent().expect("a page is in a folder");
        if let Some(place) = path.strip_prefix(&book).ok().filter(|place| !place.ends_with("SUMMARY.md")) {
            assert!(summary.contains(&format!("({})", place.display())), "{} is not listed", place.display());
        }
        let prose: String = text.split("```").step_by(2).collect();
        for link in prose.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            // links to other sites are not checked
            if link.starts_with("http") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { folder.join(file) };
            assert!(target.exists(), "{}: `{link}` leads nowhere", path.display());
            if path.starts_with(&book) {
                // `mdbook` copies the files of this folder and no others
                let found = target.canonicalize().expect("it exists");
                assert!(found.starts_with(&within), "{}: `{link}` leads out of the book", path.display());
            }
            if !anchor.is_empty() {
                let known = anchors(&read(&target));
                assert!(known.contains(anchor), "{}: no heading `{anchor}` in {known:?}", path.display());
            }
        }
    }
}

#[test]
fn every_row_of_the_fault_tables_names_an_existing_test() {
    let sources: String = std::fs::read_dir(workspace().join("tests/graphs"))
        .expect("the tests of graphs are there")
        .flatten()
        .map(|entry| read(entry.path()))
        .collect();
    let page = read("docs/src/faults.md");
    let (signals, rest) = page.split_once("\n## A component\n").expect("it has the section");
    let rows: Vec<&str> =
        rest.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| fault |")).collect();
    assert!(rows.len() > 30, "{} rows", rows.len());
    for row in rows {
        let named = row.trim_end_matches(" |").rsplit("| ").next().unwrap_or_default().trim_matches('`');
        assert!(sources.contains(&format!("#[test]\nfn {named}()")), "no test is named `{named}`:\n{row}");
    }
    // The outcomes themselves are compared by `.ci/run`.
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_string()).collect::<Vec<_>>();
    let matrix: Vec<_> = signals.lines().filter(|line| line.starts_with("| ")).map(cells).collect();
    let head =
        ["", "fault", "physics", "encoder", "policy", "controller", "launcher", "guard", "observer", ""];
    assert_eq!(matrix[0], head);
    let faults: Vec<&str> = matrix[2..].iter().map(|row| row[1].as_str()).collect();
    assert_eq!(faults, motorium_benches::kill::Fault::ALL.map(motorium_benches::kill::Fault::name));
    let outcome =
        |cell: &String| ["continues", "safe state", "no actuator"].iter().any(|o| cell.starts_with(o));
    assert!(matrix[2..].iter().all(|row| row[2..9].iter().all(outcome)), "{matrix:?}");
}
