//! Graphs with several floating-base robots in one simulation.

use std::path::PathBuf;

use motorium::graph;
use motorium::launcher::{Exit, Options as RunOptions, Report};
use motorium::session::run;

use crate::component::registry;
use crate::engines::has_mujoco;

fn graph_text(kind: &str) -> String {
    let driver = |name: &str, offset: f64| {
        format!(
            r#"
[component.{name}-driver]
kind = "test.driver"
trigger = "{name}/joint_state"
subscribe = {{ state = "{name}/joint_state" }}
publish = {{ command = "{name}/joint_command" }}
config = {{ offset = {offset}, until = 100000, stiffness = 60.0 }}
"#
        )
    };
    let port = |port: &str| {
        let one = |name: &str| format!(r#""{name}.{port}" = "{name}/{port}""#);
        ["one", "arm", "two"].map(one).join(", ")
    };
    format!(
        r#"
name = "several-articulations"
clock = "lockstep"

[world]
ground = {{ friction = 0.8 }}

[robot.one]
urdf = "quadruped"

[robot.arm]
urdf = "panda"
base = {{ position = [1.5, 0.0, 0.0] }}

[robot.two]
urdf = "quadruped"
base = {{ position = [3.0, 0.0, 0.26] }}

[component.physics]
kind = "{kind}"
robots = ["one", "arm", "two"]
rate = "1 kHz"
subscribe = {{ {} }}
publish = {{ {}, "two.base_state" = "two/base_state", "one.contacts" = "one/contacts" }}
{}{}{}
[safety]
stale_after = "5 ms"
safe_state = "hold"
"#,
        port("joint_command"),
        port("joint_state"),
        driver("one", 0.0),
        driver("arm", 0.05),
        driver("two", 0.0)
    )
}

fn check(text: String) -> Result<graph::Checked, graph::GraphError> {
    let path = PathBuf::from("several-articulations.toml");
    graph::check(&path, text, &[], &registry(), &graph::Machine::detect())
}

fn run_graph(kind: &str) -> Report {
    let mut plan = check(graph_text(kind)).unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    plan.duration_ns = Some(1_000_000_000);
    run(plan, &registry(), &RunOptions::threads(), &mut |_| ()).unwrap()
}

#[test]
fn several_robots_run_without_allocation() {
    for kind in ["physics.articulated"].into_iter().chain(has_mujoco().then_some("physics.mujoco")) {
        let report = run_graph(kind);
        assert_eq!(report.exit, Exit::Finished, "{report:?}");
        let physics = report.components.iter().find(|component| component.name == "physics").unwrap();
        assert_eq!(physics.allocations, Some(0), "{kind}");
        let robots = &report.results["physics"]["robots"];
        for (name, x) in [("one", 0.0), ("two", 3.0)] {
            let position = &robots[name]["base_position"];
            let (found, height) = (position[0].as_f64().unwrap(), position[2].as_f64().unwrap());
            assert!((found - x).abs() < 0.05 && (0.1..0.3).contains(&height), "{kind}: {name} at {position}");
            assert!(robots[name]["base_height_lowest_m"].as_f64().unwrap() > 0.1, "{robots}");
            assert_eq!(robots[name]["joints"].as_array().unwrap().len(), 12);
        }
        assert!(robots["arm"]["base_position"].is_null(), "{robots}");
    }
}

#[test]
fn graph_error_names_the_feature_that_rapier_lacks() {
    let error = check(graph_text("physics.rapier")).expect_err("rapier has no floating bases");
    let text = error.render(false);
    assert!(text.contains("floating base") && text.contains("physics.articulated"), "{text}");
}

#[test]
fn several_floating_robots_are_randomised_separately() {
    for kind in ["physics.articulated"].into_iter().chain(has_mujoco().then_some("physics.mujoco")) {
        // MuJoCo's hard ground throws a robot into the air if a foot starts in the ground.
        let start = if kind == "physics.mujoco" { "" } else { "start = [-0.05, 0.05], " };
        let config = format!(
            "rate = \"1 kHz\"\nconfig = {{ randomise = {{ mass = [0.9, 1.1], {start}base = {{ x = [0.2, 0.4], z = [0.0, 0.01] }}, \
             robots = {{ arm = {{ mass = [2.0, 2.0] }} }} }} }}"
        );
        let text = format!("seed = 4\n{}", graph_text(kind).replacen("rate = \"1 kHz\"", &config, 1));
        let mut plan = check(text).unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
        plan.duration_ns = Some(300_000_000);
        let report = run(plan, &registry(), &RunOptions::inline(), &mut |_| ()).unwrap();
        let physics = &report.results["physics"];
        let drawn = &physics["randomised"][0]["robots"];
        let masses = |robot: &str| -> Vec<f64> {
            drawn[robot]["mass"].as_object().unwrap().values().map(|mass| mass.as_f64().unwrap()).collect()
        };
        assert_eq!(masses("arm"), [2.0; 9], "{kind}");
        let (one, two) = (masses("one"), masses("two"));
        assert!(one.len() == 13 && one.iter().all(|mass| (0.9..=1.1).contains(mass)), "{kind}: {one:?}");
        assert_ne!(one, two, "{kind}: equal robots draw differently");
        assert!(drawn["arm"]["base"].is_null(), "{kind}: the arm is fixed to the world");
        for (name, x) in [("one", 0.0), ("two", 3.0)] {
            let along = drawn[name]["base"]["x"].as_f64().unwrap();
            let position = &physics["robots"][name]["base_position"];
            let (found, height) = (position[0].as_f64().unwrap(), position[2].as_f64().unwrap());
            assert!(
                (0.2..0.4).contains(&along) && (found - x - along).abs() < 0.05,
                "{kind}: {name} at {position}"
            );
            assert!((0.1..0.3).contains(&height), "{kind}: {name} at {position}");
        }
    }
}
