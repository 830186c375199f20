//! Couplings of `policy.dmp` to errors, obstacles and forces.

use std::f64::consts::{FRAC_PI_2, PI};

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_policies::DmpPolicy;

fn policy(config: &str) -> Instance {
    let config: toml::Table = format!("config = {config}").parse().unwrap();
    Instance::of::<DmpPolicy>("policy")
        .rate("1 kHz")
        .publish("target", "target")
        .set("config", config["config"].clone())
}

/// The targets of a run, and its report.
fn run(graph: Graph, time: &str) -> (Vec<PoseTarget>, Report) {
    let target = Probe::<PoseTarget>::for_topic("target");
    let report = graph.with(&target).run(time).unwrap();
    let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
    assert_eq!(policy.allocations, Some(0));
    (target.values(), report)
}

fn along_x(rest: &str) -> Graph {
    let config = format!(
        "{{ start = {{ position = [0.0, 0.0, 0.0] }}, goals = [{{ position = [0.4, 0.0, 0.0], duration = \"2 s\" }}]{rest} }}"
    );
    Graph::new("couplings-test").with(policy(&config))
}

#[test]
fn movement_avoids_an_obstacle_and_reaches_its_goal() {
    let nearest = |targets: &[PoseTarget]| {
        let distance = |target: &PoseTarget| {
            let [x, y, z] = target.position;
            ((x - 0.2).powi(2) + (y - 0.01).powi(2) + z * z).sqrt()
        };
        targets.iter().map(distance).fold(f64::INFINITY, f64::min)
    };
    let (straight, _) = run(along_x(""), "3 s");
    let (round, report) = run(along_x(", obstacles = { points = [[0.2, 0.01, 0.0]] }"), "3 s");
    assert!((nearest(&straight) - 0.01).abs() < 1e-4 && nearest(&round) > 0.03, "{}", nearest(&round));
    let last = round.last().unwrap();
    assert!((last.position[0] - 0.4).hypot(last.position[1]) < 1e-3, "{last:?}");
    assert!(report.results["policy"]["couplings"]["largest_acceleration"].as_f64().unwrap() > 0.5);
}

#[test]
fn a_movement_yields_to_a_force_by_its_spring() {
    let force = |newton: f64| {
        Source::new("sensor", "wrench", move |_| Some(Wrench { force: [0.0, newton, 0.0], torque: [0.0; 3] }))
    };
    let config = "{ start = { position = [0.0, 0.0, 0.0] }, goals = [{ position = [0.0, 0.0, 0.0], duration = \"2 s\" }], \
                  yielding = { inertia = 4.0, deadband = 2.0 } }";
    let pushed = |newton: f64| {
        let yielding = policy(config).subscribe("wrench", "wrench");
        run(Graph::new("couplings-test").with(force(newton)).with(yielding), "2 s").0
    };
    assert!(
        pushed(1.5).iter().all(|target| target.position == [0.0; 3]),
        "within the deadband nothing moves"
    );
    // (F - deadband) / m over K / T^2, with K = 25^2 / 4
    let expected = (10.0 - 2.0) / 4.0 * 4.0 / 156.25;
    let [x, y, z] = pushed(10.0).last().unwrap().position;
    assert!((y - expected).abs() < 0.01 * expected && (x, z) == (0.0, 0.0), "{y}, expected {expected}");
}

#[test]
fn a_movement_waits_for_an_arm_that_cannot_follow() {
    // an arm that does not move
    let state = || {
        Source::new("arm", "state", |_| {
            let mut state = JointState::default();
            state.set_count(3);
            state.position_mut().copy_from_slice(&[0.5, 0.8, 0.8]);
            state.velocity_mut().fill(0.0);
            Some(state)
        })
    };
    let way = |rest: &str| {
        let config = format!("{{ goals = [{{ offset = [-0.2, 0.0, 0.0], duration = \"1 s\" }}]{rest} }}");
        let policy = policy(&config).robot("arm").subscribe("joint_state", "state");
        let graph = Graph::new("couplings-test").robot("arm", "planar-3r").with(state()).with(policy);
        let (targets, report) = run(graph, "1.2 s");
        let (first, last) = (targets[0].position, targets.last().unwrap());
        // the published velocity is the rate of the position
        let before = &targets[targets.len() - 2];
        let slope = (last.position[0] - before.position[0]) / 1e-3;
        assert!((slope - last.linear_velocity[0]).abs() < 2e-3, "{slope} and {}", last.linear_velocity[0]);
        ((last.position[0] - first[0]).abs(), report)
    };
    let (free, report) = way("");
    assert!((free - 0.2).abs() < 1e-6 && report.results["policy"]["couplings"].is_null());
    let (waiting, report) = way(", phase_stop = { distance = 0.01 }");
    assert!((0.005..0.08).contains(&waiting), "{waiting} m ahead of an arm at rest");
    let slowest = report.results["policy"]["couplings"]["slowest_rate"].as_f64().unwrap();
    // 1 / (1 + (error / distance)^2)
    assert!((slowest - (1.0 + (waiting / 0.01).powi(2)).recip()).abs() < 0.05 * slowest, "{slowest}");
}

#[test]
fn invalid_couplings_are_refused() {
    for (rest, words) in [
        (", phase_stop = { distance = 0.1 }", "not measured where `start` is configured"),
        (", obstacles = { points = [] }", "at least one"),
        (", obstacles = { points = [[0.0, 0.0, 0.0]], reach = 0.0 }", "expected a positive number"),
        (", yielding = { inertia = -1.0 }", "expected a positive number"),
    ] {
        let error = along_x(rest).check().expect_err("it is refused").render(false);
        assert!(error.contains(words), "no `{words}` in\n{error}");
    }
}

#[test]
fn unreachable_goals_are_refused_or_cause_a_warning() {
    let graph = |goals: &str| {
        let policy =
            policy(&format!("{{ goals = [{goals}] }}")).robot("arm").subscribe("joint_state", "state");
        let state = Source::new("arm", "state", |_| None::<JointState>);
        Graph::new("reach-test").robot("arm", "planar-3r").with(state).with(policy)
    };
    let far = "{ position = [5.0, 0.0, 0.0], duration = \"1 s\" }";
    let error = graph(far).check().expect_err("it is refused").render(false);
    assert!(error.contains("5.000 m from the first joint") && error.contains("reach 1.200 m"), "{error}");
    let near = "{ position = [0.5, 0.0, 0.0], duration = \"1 s\" }";
    let beside = "{ offset = [0.0, 2.0, 0.0], duration = \"1 s\" }";
    assert!(graph(&format!("{near}, {beside}")).check().is_err(), "relative to a known position");
    let checked = graph(&format!("{beside}, {near}")).check().expect("the start is unknown");
    let warnings: Vec<String> = checked.warnings.iter().map(|warning| format!("{warning:?}")).collect();
    assert!(
        warnings.iter().any(|warning| warning.contains("if the robot starts in its home pose")),
        "{warnings:?}"
    );
    assert!(graph(near).check().expect("it is within reach").warnings.is_empty());
}

#[test]
fn goals_without_joint_positions_cause_a_warning() {
    let warnings = |robot: &str, goals: &str| {
        let policy =
            policy(&format!("{{ goals = [{goals}] }}")).robot("arm").subscribe("joint_state", "state");
        let state = Source::new("arm", "state", |_| None::<JointState>);
        let checked = Graph::new("reach-test").robot("arm", robot).with(state).with(policy).check();
        checked
            .expect("a warning, no error")
            .warnings
            .iter()
            .map(|w| w.message().to_string())
            .collect::<Vec<_>>()
    };
    let above_its_plane = "{ position = [0.5, 0.0, 0.3], duration = \"1 s\" }";
    let text = warnings("planar-3r", above_its_plane).join("\n");
    assert!(text.contains("goal 0: the nearest positions found are 0.300 m away"), "{text}");

    // nearly stretched, a tool that points back at the base would need another half metre
    let goal = |x: f64, [roll, pitch]: [f64; 2]| {
        format!("{{ position = [{x}, 0.0, 0.4], rpy = [{roll}, {pitch}, 0.0], duration = \"1 s\" }}")
    };
    let down = goal(0.5, [PI, 0.0]);
    assert_eq!(warnings("panda", &down), Vec::<String>::new());
    let text = warnings("panda", &format!("{down}, {}", goal(0.8, [0.0, -FRAC_PI_2]))).join("\n");
    assert!(
        text.contains("goal 1") && text.contains("the position of the goal alone can be reached"),
        "{text}"
    );
}
