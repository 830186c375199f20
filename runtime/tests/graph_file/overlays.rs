//! `extends` and `--with`: overlaid files, with errors shown in the files that contain them.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use motorium::graph::{Checked, GraphError, Override, load_with};
use motorium::plan::{Plan, SafeState};

use super::{anywhere, good, kinds, load, machine};

fn overlay(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/graph_file/overlays").join(name)
}

fn with(graph: &Path, overlays: &[PathBuf], set: &[&str]) -> Result<Checked, GraphError> {
    let set: Vec<Override> = set.iter().map(|text| text.parse().expect("an override")).collect();
    load_with(graph, overlays, &set, &kinds::registry(), &machine())
}

fn plan(loaded: Result<Checked, GraphError>) -> Plan {
    loaded.unwrap_or_else(|error| panic!("{}", error.render(false))).plan
}

fn refused(loaded: Result<Checked, GraphError>) -> String {
    anywhere(&loaded.expect_err("a mistake").render(false))
}

#[test]
fn extended_graph_differs_only_by_its_keys() {
    let (base, variant) = (plan(load(&good("panda-reach"))), plan(load(&overlay("variant.toml"))));
    assert_eq!((variant.name.as_str(), variant.seed), ("variant", base.seed));
    assert_eq!(variant.safety.gate.safe_state, SafeState::Damp);
    let names: Vec<&str> = variant.components.iter().map(|component| component.name.as_str()).collect();
    assert_eq!(names, ["physics", "encoder", "policy", "controller"], "the console is removed");
    let [physics, encoder, policy, controller] = variant.components.as_slice() else { unreachable!() };
    assert_eq!((physics, policy), (&base.components[0], &base.components[2]));
    assert_eq!(encoder.config, serde_json::json!({}));
    assert_eq!(controller.budget_ns, Some(120_000));
    assert_eq!(controller.config["damping"], 1e-4);
    assert_eq!(controller.config["tasks"], base.components[3].config["tasks"], "others are unchanged");
}

#[test]
fn files_are_layered_in_order_and_overrides_come_last() {
    let variant = plan(load(&overlay("twice.toml")));
    assert_eq!((variant.name.as_str(), variant.seed), ("variant", 8));
    assert_eq!(variant.components[1].config, serde_json::json!({ "velocity_noise": 1e-3 }));
    let quiet = [overlay("quiet.toml")];
    let noise = |plan: &Plan| plan.components[1].config["position_noise"].as_f64();
    assert_eq!(noise(&plan(with(&good("panda-reach"), &quiet, &[]))), Some(0.0));
    let set = ["encoder.config.position_noise=2e-5"];
    assert_eq!(noise(&plan(with(&good("panda-reach"), &quiet, &set))), Some(2e-5));
}

#[test]
fn every_file_is_applied_once() {
    // the variant extends the graph that it overlays
    let over = plan(with(&good("panda-reach"), &[overlay("variant.toml")], &[]));
    let mut alone = plan(load(&overlay("variant.toml")));
    alone.file = over.file.clone();
    assert_eq!(over, alone);
}

#[test]
fn paths_are_relative_to_the_file_that_contains_them() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("below")).expect("a folder");
    let text = std::fs::read_to_string(good("panda-reach")).expect("the file");
    let base = folder.path().join("below/base.toml");
    std::fs::write(&base, &text).expect("a file");
    let top = folder.path().join("top.toml");
    std::fs::write(&top, "extends = \"below/base.toml\"\n").expect("a file");
    // in one file or extended by an empty file: the same plan, except for the path of the file
    let (mut one, mut two) = (plan(load(&base)), plan(load(&top)));
    let robot = two.components[0].robot.as_ref().expect("a robot");
    assert_eq!(robot.base, base.parent().unwrap().canonicalize().unwrap(), "relative to their file");
    (one.file, two.file) = Default::default();
    assert_eq!(one, two);
    // a model in the folder of the overlay that names it
    let model = "[robot.panda]\nurdf = \"arm.urdf\"\n";
    std::fs::create_dir(folder.path().join("beside")).expect("a folder");
    let beside = folder.path().join("beside/model.toml");
    std::fs::write(&beside, model).expect("a file");
    std::fs::write(folder.path().join("beside/arm.urdf"), "").expect("a file");
    let error = with(&top, std::slice::from_ref(&beside), &[]).expect_err("an empty model");
    assert!(error.render(false).contains("it has no `<robot>` element"), "{}", error.render(false));
    let report = error.reports().remove(0);
    assert_eq!((report.file, report.line), (beside.display().to_string(), Some(2)));
}

#[test]
fn error_is_shown_in_the_file_that_contains_it() {
    insta::assert_snapshot!("overlay__mistakes", refused(load(&overlay("mistakes.toml"))));
    insta::assert_snapshot!("overlay__circle", refused(load(&overlay("circle.toml"))));
    insta::assert_snapshot!("overlay__missing", refused(load(&overlay("missing.toml"))));
    insta::assert_snapshot!("overlay__number", refused(load(&overlay("number.toml"))));
    let over = |name: &str| refused(with(&good("panda-reach"), &[overlay(name)], &[]));
    insta::assert_snapshot!("overlay__half", over("other/half.toml"));
    insta::assert_snapshot!("overlay__model", over("other/model.toml"));
    insta::assert_snapshot!("overlay__not-there", over("quit.toml"));
    let set = ["extends=\"variant.toml\"", "physics.budget=2 ms"];
    insta::assert_snapshot!("overlay__set", refused(with(&overlay("variant.toml"), &[], &set)));
}

#[test]
fn extending_files_are_bounded_in_number_and_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |k: usize| folder.path().join(format!("{k}.toml"));
    for k in 0..9 {
        std::fs::write(file(k), format!("extends = \"{}.toml\"\n", k + 1)).expect("a file");
    }
    std::fs::write(file(9), "name = \"last\"\n").expect("a file");
    let text = refused(load(&file(0)));
    assert!(text.contains("more than 8 files extend one another"), "{text}");
    assert!(refused(load(&file(2))).contains("the graph has no components"), "eight files are fine");
    let many: Vec<PathBuf> = (0..33).map(|k| folder.path().join(format!("over-{k}.toml"))).collect();
    for path in &many {
        std::fs::write(path, "seed = 1\n").expect("a file");
    }
    assert!(with(&good("panda-reach"), &many[..31], &[]).is_ok());
    let text = refused(with(&good("panda-reach"), &many, &[]));
    assert!(text.contains("expected at most 32 files"), "{text}");
    let mut half = String::from("name = \"half\"\n");
    writeln!(half, "# {}", "x".repeat(9 << 20)).expect("room");
    std::fs::write(file(1), &half).expect("a file");
    std::fs::write(file(0), format!("extends = \"1.toml\"\n{half}")).expect("a file");
    let text = refused(load(&file(0)));
    assert!(text.contains("expected at most 16777216 (16 MiB) together"), "{text}");
    let text = refused(with(&file(1), &[file(0)], &[]));
    assert!(text.contains("expected at most 32 files of 16777216 bytes"), "{text}");
}
