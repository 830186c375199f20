//! `--set`: equivalent to an edit of the file, with errors shown in the override.

use motorium::declare::ParameterValue;
use motorium::graph::Override;
use motorium::plan::{Activation, ClockKind, Plan};

use super::{anywhere, good, load, load_with};

fn plan(overrides: &[&str]) -> Plan {
    load_with(&good("panda-reach"), overrides).unwrap_or_else(|error| panic!("{}", error.render(false))).plan
}

fn refused(overrides: &[&str]) -> String {
    let error = load_with(&good("panda-reach"), overrides).expect_err("a mistake");
    anywhere(&error.render(false))
}

#[test]
fn values_of_the_graph_and_of_components_are_set() {
    let plan = plan(&[
        "clock=lockstep",
        "duration=2.5 s",
        "physics.rate=500 Hz",
        "component.policy.params.speed=2",
        "controller.config.tasks.0.weight=3.5",
        "latency.0.max=1 ms",
        "safety.safe_state=\"damp\"",
        "physics.config.gravity=[0, 0, -1.62]",
    ]);
    assert_eq!(plan.clock, ClockKind::Lockstep);
    assert_eq!(plan.duration_ns, Some(2_500_000_000));
    assert_eq!(plan.components[0].activation, Activation::Periodic { period_ns: 2_000_000, phase_ns: 0 });
    assert_eq!(plan.components[0].config["gravity"][2], -1.62);
    assert_eq!(plan.components[2].parameters[0].initial, ParameterValue::Float(2.0));
    assert_eq!(plan.components[3].config["tasks"][0]["weight"], 3.5);
    assert_eq!(plan.components[3].config["tasks"][0]["frame"], "hand", "its neighbours are unchanged");
    assert_eq!(plan.latencies[0].max_ns, 1_000_000);
}

#[test]
fn override_is_equivalent_to_an_edit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("graph.toml");
    let text = std::fs::read_to_string(good("panda-reach")).expect("the file");
    std::fs::write(&path, text.replace("rate = \"200 Hz\"", "rate = \"100 Hz\"")).expect("a file");
    let mut edited = load(&path).expect("a good graph").plan;
    let mut set = plan(&["policy.rate=100 Hz"]);
    // only the path of the file differs
    for plan in [&mut edited, &mut set] {
        plan.file = "graph.toml".into();
        plan.components.iter_mut().for_each(|component| component.folder = "".into());
        plan.components.iter_mut().filter_map(|component| component.robot.as_mut()).for_each(|robot| {
            robot.base = "".into();
        });
    }
    assert_eq!(edited, set);
}

#[test]
fn last_of_two_overrides_applies() {
    assert_eq!(plan(&["seed=1", "seed=2"]).seed, 2);
}

#[test]
fn invalid_value_is_shown_in_the_override() {
    insta::assert_snapshot!("set__rate-without-unit", refused(&["physics.rate=500"]));
    insta::assert_snapshot!(
        "set__config-refused",
        refused(&["seed=3", "controller.config.tasks.0.weight=-2"])
    );
    insta::assert_snapshot!("set__budget-and-period-in-two-places", refused(&["physics.budget=2 ms"]));
    insta::assert_snapshot!("set__half-an-array", refused(&["physics.config.gravity=[0, 0"]));
    insta::assert_snapshot!("set__nothing", refused(&["duration="]));
}

#[test]
fn nonexistent_path_is_shown_in_the_override() {
    insta::assert_snapshot!("set__unknown-key-of-the-graph", refused(&["clok=lockstep"]));
    insta::assert_snapshot!("set__unknown-component", refused(&["contoller.rate=1 kHz"]));
    insta::assert_snapshot!("set__unknown-component-with-prefix", refused(&["component.fysics.rate=1 kHz"]));
    insta::assert_snapshot!("set__unknown-key-of-a-component", refused(&["physics.rte=1 kHz"]));
    insta::assert_snapshot!("set__unknown-key-of-a-config", refused(&["physics.config.gravitas=1"]));
    insta::assert_snapshot!("set__into-a-value", refused(&["physics.rate.value=1"]));
    insta::assert_snapshot!("set__beyond-an-array", refused(&["latency.1.max=1 ms"]));
    insta::assert_snapshot!("set__empty-part", refused(&["physics..rate=1 kHz"]));
    insta::assert_snapshot!("set__component-as-a-value", refused(&["physics=3"]));
}

#[test]
fn argument_without_a_path_or_a_value_is_refused() {
    assert!("lockstep".parse::<Override>().is_err());
    assert!("=lockstep".parse::<Override>().is_err());
    let set: Override = "a.b=c=d".parse().expect("an override");
    assert_eq!((set.path.as_str(), set.value.as_str()), ("a.b", "c=d"));
}

#[test]
fn robot_names_may_have_capital_letters() {
    let plan = plan(&["robot.UR5e.urdf=panda", "controller.robot=UR5e"]);
    assert_eq!(plan.components[3].robot.as_ref().map(|robot| robot.name.as_str()), Some("UR5e"));
    let refused = refused(&["robot.UR5\u{e9}.urdf=panda"]);
    assert!(refused.contains("`A`-`Z`") && refused.contains("call it `UR5_`"), "{refused}");
}
