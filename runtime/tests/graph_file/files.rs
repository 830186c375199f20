//! Complete files: broken files with their exact errors, good files with their plans.

use motorium::severity::Severity;
use serde_json::Value as Json;

use super::{anywhere, good, graphs, load, stem};

/// Returns the graphs of a folder that are refused when they are read. This excludes a well-formed graph that
/// is refused by admission, which has its own test.
fn refused(folder: &str) -> impl Iterator<Item = std::path::PathBuf> {
    graphs(folder).into_iter().filter(|path| stem(path) != "overloaded")
}

#[test]
fn every_broken_graph_has_its_exact_error() {
    for folder in ["graphs/broken", "runtime/tests/graph_file/broken"] {
        for path in refused(folder) {
            let error = match load(&path) {
                Ok(_) => panic!("{} should be refused", path.display()),
                Err(error) => error,
            };
            insta::assert_snapshot!(format!("broken__{}", stem(&path)), anywhere(&error.render(false)));
        }
    }
}

#[test]
fn every_error_has_position_and_advice() {
    for path in refused("graphs/broken") {
        let error = load(&path).expect_err("a broken graph");
        assert!(error.diagnostics().iter().any(|diagnostic| diagnostic.severity() == Severity::Error));
        for report in error.reports() {
            assert!(report.line.is_some() && report.column.is_some(), "{}: {report:?}", path.display());
            assert!(
                report.advice.is_some_and(|advice| !advice.is_empty()),
                "{}: {}",
                path.display(),
                report.message
            );
        }
    }
}

#[test]
fn error_as_data_has_the_content_of_its_text() {
    let path =
        graphs("graphs/broken").into_iter().find(|path| stem(path) == "wrong-type").expect("that file");
    let error = load(&path).expect_err("a broken graph");
    let text = serde_json::to_string_pretty(&error).expect("data");
    insta::assert_snapshot!("wrong-type-as-data", anywhere(&text));
}

#[test]
fn colours_are_optional() {
    let error = load(&graphs("graphs/broken")[0]).expect_err("a broken graph");
    assert!(error.render(true).contains('\u{1b}'));
    assert!(!error.render(false).contains('\u{1b}'));
}

#[test]
fn allowed_but_unintended_settings_are_warnings() {
    for path in graphs("runtime/tests/graph_file/warned") {
        let checked = load(&path).unwrap_or_else(|error| panic!("{}", error.render(false)));
        let warnings: Vec<String> = checked.warnings.iter().map(|warning| warning.render(false)).collect();
        assert!(!warnings.is_empty(), "{} should give a warning", path.display());
        insta::assert_snapshot!(format!("warned__{}", stem(&path)), anywhere(&warnings.join("\n\n")));
    }
}

#[test]
fn good_graphs_have_their_exact_plans() {
    for path in graphs("runtime/tests/graph_file/good") {
        let checked = load(&path).unwrap_or_else(|error| panic!("{}", error.render(false)));
        assert_eq!(checked.warnings, [], "{}", path.display());
        let mut plan = serde_json::to_value(&checked.plan).expect("plans travel as JSON");
        name_layouts(&mut plan);
        let text = serde_json::to_string_pretty(&plan).expect("JSON");
        insta::assert_snapshot!(format!("good__{}", stem(&path)), anywhere(&text));
    }
}

/// Replaces layouts by the names of their types, because layouts have separate tests.
fn name_layouts(value: &mut Json) {
    match value {
        Json::Object(object) => {
            for (key, value) in object.iter_mut() {
                match value.get("type_name").cloned() {
                    Some(name) if key == "layout" => *value = name,
                    _ => name_layouts(value),
                }
            }
        }
        Json::Array(array) => array.iter_mut().for_each(name_layouts),
        _ => {}
    }
}

#[test]
fn missing_file_is_reported_with_a_similar_one() {
    let error = load(&good("panda-rech")).expect_err("no such file");
    assert!(error.render(false).contains("did you mean"), "{}", error.render(false));
    assert!(error.render(false).contains("panda-reach.toml"), "{}", error.render(false));
}

#[test]
fn binary_file_is_refused_at_its_first_invalid_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("graph.toml");
    std::fs::write(&path, b"name = \"a\"\n# \xff\n").expect("a file");
    let error = load(&path).expect_err("not UTF-8");
    let report = &error.reports()[0];
    assert_eq!((report.line, report.column), (Some(2), Some(3)));
}

#[test]
fn events_respect_the_interval_and_pass_on_its_period() {
    use motorium::plan::{Activation, SchedulingClass, Spin};
    let plan = |set: &[&str]| super::load_with(&good("on-events"), set).expect("a good graph").plan;
    let bus = &plan(&[]).components[0];
    assert_eq!(bus.activation, Activation::Descriptor { min_interval_ns: 2_000_000 });
    assert_eq!((bus.spin, bus.class), (Spin::Fixed { ns: 0 }, SchedulingClass::Fifo(80)));
    assert_eq!((bus.period_ns(), bus.liveness.hang_after_ns), (2_000_000, 200_000_000));
    let slower = plan(&["bus.activate.min_interval=30 ms"]);
    assert_eq!(
        (slower.components[0].period_ns(), slower.components[1].period_ns()),
        (30_000_000, 30_000_000)
    );
    assert_eq!(slower.components[0].liveness.hang_after_ns, 600_000_000);
}

#[test]
fn plan_survives_serialisation() {
    let plan = load(&good("everything")).expect("a good graph").plan;
    let text = serde_json::to_string(&plan).expect("JSON");
    assert_eq!(serde_json::from_str::<motorium::plan::Plan>(&text).expect("the same plan"), plan);
}

#[test]
fn component_seed_depends_only_on_its_name() {
    let plan = load(&good("panda-reach")).expect("a good graph").plan;
    let text = std::fs::read_to_string(good("panda-reach")).expect("the file");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("graph.toml");
    let first = "[component.first]\nkind = \"policy.phase\"\nrate = \"1 Hz\"\npublish.phase = \"first\"\n\n";
    std::fs::write(&path, text.replace("[component.physics]", &format!("{first}[component.physics]")))
        .expect("a file");
    let moved = load(&path).expect("still a good graph").plan;
    let seed = |plan: &motorium::plan::Plan, name: &str| {
        plan.components.iter().find(|component| component.name == name).map(|component| component.seed)
    };
    assert_eq!(seed(&plan, "encoder"), seed(&moved, "encoder"));
    assert_ne!(seed(&plan, "encoder"), seed(&plan, "physics"));
}
