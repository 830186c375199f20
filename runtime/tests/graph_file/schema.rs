//! The JSON Schema of graph files.

use std::collections::BTreeSet;
use std::path::Path;

use motorium::graph::schema;
use serde_json::{Value as Json, json};

use super::{graphs, kinds, stem};

fn document() -> Json {
    schema(&kinds::registry()).to_value()
}

/// Reads a graph file as JSON.
fn read(path: &Path) -> Json {
    let text = std::fs::read_to_string(path).expect("the file");
    toml::from_str::<Json>(&text).expect("TOML")
}

#[test]
fn schema_accepts_good_graphs() {
    let validator = jsonschema::validator_for(&document()).expect("a schema");
    let good = graphs("runtime/tests/graph_file/good");
    for path in good.into_iter().chain(graphs("runtime/tests/graph_file/warned")) {
        let errors: Vec<String> =
            validator.iter_errors(&read(&path)).map(|error| error.to_string()).collect();
        assert!(errors.is_empty(), "{}: {errors:?}", path.display());
    }
}

/// Errors that an editor detects with the schema alone.
const SEEN_BY_EDITORS: [&str; 37] = [
    "bad-component-name",
    "bad-graph-name",
    "bad-topic-name",
    "config-missing",
    "config-not-finite",
    "config-of-the-wrong-type",
    "core-listed-twice",
    "duration-of-unknown-unit",
    "empty",
    "history-too-long",
    "kind-and-exec",
    "latency-without-a-limit",
    "many-mistakes-at-once",
    "negative-seed",
    "no-components",
    "no-cores",
    "no-kind",
    "no-name",
    "no-rate-and-no-trigger",
    "number-where-text-belongs",
    "phase-without-rate",
    "priority-out-of-range",
    "rate-and-trigger",
    "rate-negative",
    "rate-of-unknown-unit",
    "rate-that-is-a-time",
    "rate-without-unit",
    "restart-at-most-zero",
    "robot-without-model",
    "spin-share-of-nothing",
    "text-where-a-table-belongs",
    "unknown-choice",
    "unknown-config-key",
    "unknown-key-at-the-top",
    "unknown-key-in-a-component",
    "unknown-key-in-safety",
    "unknown-kind",
];

#[test]
fn schema_refuses_errors_visible_to_editors() {
    let validator = jsonschema::validator_for(&document()).expect("a schema");
    let is_toml =
        |path: &Path| !matches!(stem(path).as_str(), "not-toml" | "same-key-twice" | "same-component-twice");
    let refused: Vec<String> = graphs("graphs/broken")
        .into_iter()
        .filter(|path| is_toml(path) && !validator.is_valid(&read(path)))
        .map(|path| stem(&path))
        .collect();
    assert_eq!(refused, SEEN_BY_EDITORS);
}

#[test]
fn every_key_is_described() {
    let document = document();
    let mut tables = vec![("the graph".to_string(), &document)];
    let definitions = document["definitions"].as_object().expect("definitions");
    tables.extend(definitions.iter().map(|(name, table)| (name.clone(), table)));
    for (name, table) in tables {
        for (key, described) in table["properties"].as_object().into_iter().flatten() {
            let description = described["description"].as_str().unwrap_or_default();
            assert!(!description.is_empty(), "`{key}` of {name} has no description");
        }
    }
}

#[test]
fn schema_has_exactly_the_keys_that_are_read() {
    // the error for a table with only an unknown key lists all known keys
    let document = document();
    let tables = [
        ("", "", "/properties"),
        ("cores", "[cores]\nzzzzzz = 1", "/definitions/Cores/properties"),
        ("realtime", "[realtime]\nzzzzzz = 1", "/definitions/Realtime/properties"),
        ("robot", "[robot.r]\nzzzzzz = 1", "/definitions/Robot/properties"),
        ("component", "[component.c]\nzzzzzz = 1", "/definitions/Component/properties"),
        ("restart", "[component.c]\nrestart = { zzzzzz = 1 }", "/definitions/Restart/properties"),
        ("latency", "[[latency]]\nzzzzzz = 1", "/definitions/Latency/properties"),
        ("safety", "[safety]\nzzzzzz = 1", "/definitions/Safety/properties"),
    ];
    for (name, text, pointer) in tables {
        let text = if text.is_empty() { "zzzzzz = 1".to_string() } else { text.to_string() };
        let error =
            motorium::graph::check("graph.toml".as_ref(), text, &[], &kinds::registry(), &super::machine())
                .expect_err("an unknown key");
        let report =
            error.reports().into_iter().find(|report| report.message.contains("zzzzzz")).expect("its report");
        let advice = report.advice.expect("advice");
        let read: BTreeSet<&str> = advice
            .split('`')
            .skip(1)
            .step_by(2)
            .filter(|key| {
                !advice.contains(&format!("keys of `{key}`"))
                    && !advice.contains(&format!("robot `{key}`"))
                    && !advice.contains(&format!("component `{key}`"))
            })
            .collect();
        let known = document.pointer(pointer).and_then(Json::as_object).expect(pointer);
        let known: BTreeSet<&str> = known.keys().map(String::as_str).collect();
        assert_eq!(read, known, "{name}");
    }
}

#[test]
fn schema_has_exactly_the_choices_that_are_read() {
    let document = document();
    // all words of these must be accepted: the schema is generated from the plan, the reader has a list
    for (name, override_path) in [
        ("ClockKind", "clock"),
        ("OnDenied", "realtime.on_denied"),
        ("OnOverrun", "physics.on_overrun"),
        ("OnError", "physics.on_error"),
        ("OnFailure", "physics.on_failure"),
        ("RestartWhen", "physics.restart.when"),
        ("OnMiss", "latency.0.on_miss"),
        ("SafeState", "safety.safe_state"),
        ("Schedule", "policy.schedule"),
    ] {
        let words: Vec<String> = document["definitions"][name]["oneOf"]
            .as_array()
            .unwrap_or_else(|| panic!("{name} is a choice: {}", document["definitions"][name]))
            .iter()
            .filter_map(|choice| Some(choice["const"].as_str()?.to_string()))
            .collect();
        assert!(words.len() > 1, "{name}");
        for word in words {
            let set = format!("{override_path}={word}");
            let loaded = super::load_with(&super::good("panda-reach"), &["policy.budget=50 us", &set]);
            assert!(loaded.is_ok(), "{set}: {}", loaded.expect_err("refused").render(false));
        }
    }
}

#[test]
fn schema_and_plan_have_equal_defaults() {
    let document = document();
    let text = |pointer: &str| document.pointer(pointer).cloned().unwrap_or_default();
    let plan = super::load(&super::good("minimal")).expect("a good graph").plan;
    let component = &plan.components[0];
    let tuned = matches!(component.spin, motorium::plan::Spin::Tuned { .. });
    let spin_share = component.spin.at_most_ns() as f64 / component.period_ns() as f64;
    let spin_share = (spin_share * 1e3).round() / 1e3;
    let shown = |ns: u64| json!(motorium::units::TimeSpan { ns }.to_string());
    let data = |value: &dyn erased::Data| value.data();
    for (pointer, actual) in [
        ("/properties/clock/default", data(&plan.clock)),
        ("/properties/seed/default", data(&plan.seed)),
        ("/definitions/Realtime/properties/spin/default", json!(if tuned { "auto" } else { "fixed" })),
        ("/definitions/Realtime/properties/spin_share/default", json!(spin_share)),
        ("/definitions/Realtime/properties/idle_exit/default", shown(plan.scheduling.idle_exit_ns)),
        ("/definitions/Realtime/properties/on_denied/default", data(&plan.scheduling.on_denied)),
        ("/definitions/Component/properties/on_overrun/default", data(&component.on_overrun)),
        ("/definitions/Component/properties/on_error/default", data(&component.on_error)),
        ("/definitions/Component/properties/on_failure/default", data(&component.on_failure)),
        ("/definitions/Restart/properties/when/default", data(&component.restart.when)),
        ("/definitions/Restart/properties/at_most/default", data(&component.restart.at_most)),
        ("/definitions/Restart/properties/window/default", shown(component.restart.window_ns)),
        ("/definitions/Restart/properties/within/default", shown(component.restart.within_ns)),
        ("/definitions/Safety/properties/stale_after/default", shown(plan.safety.stale_after_ns)),
        ("/definitions/Safety/properties/safe_state/default", data(&plan.safety.gate.safe_state)),
        ("/definitions/Safety/properties/settle/default", shown(plan.safety.settle_ns)),
    ] {
        assert_eq!(text(pointer), actual, "{pointer}");
    }
}

/// Values of different types in one table.
mod erased {
    pub(super) trait Data {
        fn data(&self) -> serde_json::Value;
    }

    impl<T: serde::Serialize> Data for T {
        fn data(&self) -> serde_json::Value {
            serde_json::to_value(self).expect("data")
        }
    }
}
