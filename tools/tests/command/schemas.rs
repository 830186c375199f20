//! The JSON Schemas in `docs/schema` match the output of the program.

use std::path::Path;

use crate::program::printed;

fn is_current(document: &str) {
    let file = format!("docs/schema/{document}.schema.json");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(&file);
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let printed = printed(&["schema", document]);
    assert!(committed == printed, "{file} is out of date: cargo run -- schema {document} > {file}");
}

#[test]
fn the_schema_of_graph_files_is_current() {
    is_current("graph");
}

#[test]
fn the_schema_of_reports_is_current() {
    is_current("report");
}

#[test]
fn schema_of_top_is_current() {
    is_current("top");
}

#[test]
fn the_schema_of_benchmarks_is_current() {
    is_current("bench");
}

#[test]
fn the_schema_of_errors_is_current() {
    is_current("error");
}

#[test]
fn graph_schema_has_every_kinds_configuration() {
    let schema = crate::program::json(&["schema"]);
    let kinds = schema["definitions"]["Component"]["properties"]["kind"]["oneOf"].as_array().expect("kinds");
    let names: Vec<_> = kinds.iter().filter_map(|kind| kind["const"].as_str()).collect();
    assert!(names.contains(&"physics.articulated") && names.contains(&"control.qp"), "{names:?}");
}

#[test]
fn report_schema_requires_all_common_fields() {
    let schema = crate::program::json(&["schema", "report"]);
    let required: Vec<_> =
        schema["required"].as_array().expect("keys").iter().filter_map(|key| key.as_str()).collect();
    for key in
        ["version", "graph", "clock", "duration_s", "realtime_factor", "state_hash", "exit", "components"]
    {
        assert!(required.contains(&key), "{key} is missing in {required:?}");
    }
}
