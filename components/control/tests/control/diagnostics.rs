//! The output `diagnostics` of `control.qp`.

use motorium::launcher::Report;
use motorium::state::ControlDiagnostics;
use motorium::testing::Probe;

use crate::component::number;
use crate::graph::{Targets, controller, graph};

/// A run whose diagnostics are recorded, and the recorded diagnostics.
fn watched(config: &str) -> (Report, Vec<ControlDiagnostics>) {
    let probe = Probe::<ControlDiagnostics>::for_topic("panda/diagnostics").triggered();
    let controller = controller(config).publish("diagnostics", "panda/diagnostics");
    let report = graph("{}", Targets::default(), controller).with(&probe).run("4 s").unwrap();
    (report, probe.values())
}

#[test]
fn a_velocity_step_reports_residuals_and_active_limits() {
    let (report, steps) = watched("{ limits = { velocity = { fraction = 0.1 } } }");
    assert!(steps.len() > 3_900, "{} steps", steps.len());
    assert!(steps.iter().all(|step| step.status == ControlDiagnostics::SOLVED && step.count() == 2));
    // a measured time would differ from run to run
    assert!(steps.iter().all(|step| step.solve_time == 0));
    let limited = steps.iter().filter(|step| step.constraints > 0).count();
    assert!((10..steps.len()).contains(&limited), "{limited} steps at a limit");
    for step in &steps {
        assert_eq!(step.constraint().len(), step.constraints as usize);
        assert!(step.constraint().iter().all(|kind| *kind == ControlDiagnostics::JOINT));
        assert!(step.index().iter().all(|joint| *joint < 8));
        assert!(step.side().iter().all(|side| side.abs() == 1));
        // without an active limit the hand follows its target
        assert!(step.constraints > 0 || step.residual()[0] < 1e-2, "{step:?}");
    }
    assert!(steps.iter().any(|step| step.residual()[0] > 0.1), "slower than its target");
    let component = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
}

#[test]
fn relaxed_step_reports_iterations_of_its_own_solution() {
    // the hand is to rest while all joints move, so every step is relaxed from the first one on
    let config = "{ on_infeasible = \"relax\", limits = { velocity = { fraction = 0.01 } }, tasks = [\
        { constraint = { task = { cartesian = { gain = 0.0 } } } },\
        { constraint = { task = { posture = { name = \"away\", gain = 5.0, weight = 1.0, positions = [0.6, -0.5, 0.3, -2.0, 0.2, 1.8, 0.5, 0.02] } } } },\
        { posture = {} } ] }";
    let (report, steps) = watched(config);
    let solver = &report.results["controller"]["solver"];
    assert_eq!(solver["steps_relaxed"].as_u64(), Some(steps.len() as u64), "{solver}");
    assert!(steps.iter().all(|step| step.status == ControlDiagnostics::RELAXED));
    assert!(steps[0].iterations > 0, "the joints are at their limits: {:?}", steps[0]);
}

#[test]
fn diagnostics_of_torques_do_not_change_the_commands() {
    let config = "{ inverse_dynamics = { torque_fraction = 0.4 }, tasks = [{ cartesian = {} }, { posture = { weight = 0.01 } }] }";
    let (report, steps) = watched(config);
    let solver = &report.results["controller"]["solver"];
    let at_torque_limit = steps.iter().filter(|step| step.constraint().contains(&ControlDiagnostics::TORQUE));
    assert_eq!(Some(at_torque_limit.count() as u64), solver["steps_at_a_torque_limit"].as_u64());
    let most = steps.iter().map(|step| step.iterations).max().unwrap();
    assert_eq!(f64::from(most), number(&solver["iterations"]["max"]));
    let largest = steps.iter().map(|step| step.residual()[0]).fold(0.0, f64::max);
    assert_eq!(largest, number(&report.results["controller"]["tasks"]["cartesian"]["residual"]["max"]));
    let component = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    let (again, _) = watched(config);
    assert_eq!(report.state_hash, again.state_hash);
    let unwired = graph("{}", Targets::default(), controller(config)).run("4 s").unwrap();
    assert_eq!(unwired.results["plant"]["q"], report.results["plant"]["q"]);
}
