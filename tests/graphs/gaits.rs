//! Robots that go by themselves: whole graphs, in lockstep.

use crate::support::{machine, run, workspace};

#[test]
fn the_quadruped_trots_forward() {
    let _machine = machine();
    let graph = workspace().join("graphs/quadruped-trot.toml");
    let ended = run(&graph, &["--clock", "lockstep", "--for", "6 s"]);
    let report = ended.report();
    let physics = &report.results["physics"];
    let numbers = |key: &str| -> Vec<f64> {
        let values = physics[key].as_array().unwrap_or_else(|| panic!("no {key} in {physics}"));
        values.iter().map(|value| value.as_f64().expect("a number")).collect()
    };
    let number = |key: &str| physics[key].as_f64().unwrap_or_else(|| panic!("no {key} in {physics}"));
    let (travel, rpy) = ([number("base_travel_x_m"), number("base_travel_y_m")], numbers("base_rpy"));
    assert!(travel[0] > 0.5, "it went {} m ahead in 6 s", travel[0]);
    assert!(travel[1].abs() < 0.3 * travel[0], "and {} m aside", travel[1]);
    assert!(rpy[0].abs() < 0.2 && rpy[1].abs() < 0.2, "its base leans: {rpy:?}");
    let lowest = number("base_height_lowest_m");
    assert!(lowest > 0.15, "its base came down to {lowest} m");
    assert_eq!(report.components[0].refused, 0);
    for component in &report.components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
        assert_eq!(component.allocations_apart.unwrap_or(0), 0, "{}", component.name);
    }
    let again = run(&graph, &["--clock", "lockstep", "--for", "6 s"]);
    assert_eq!(report.state_hash, again.report().state_hash);
}
