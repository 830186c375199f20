//! Expectations of a run, in the graph and on the command line, and their verdicts.

use crate::program::{motorium, run};

const REACH: &str = "../graphs/panda-reach.toml";

/// Runs the shipped graph in lockstep and returns exit code, report and standard error.
fn reach(arguments: &[&str]) -> (Option<i32>, serde_json::Value, String) {
    let fixed = ["run", REACH, "--clock", "lockstep", "--hosting", "inline", "--for", "5 s", "--json"];
    let output = run(&[&fixed[..], arguments].concat());
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), serde_json::from_slice(&output.stdout).unwrap_or_default(), errors)
}

const OUT_OF_REACH: &str = "policy.config.goals=[{offset=[5.0,0.0,0.0],duration=\"1 s\",dwell=\"500 ms\"}]";

#[test]
fn missed_goal_makes_the_run_unsuccessful() {
    let (code, report, errors) = reach(&["--set", OUT_OF_REACH, "--set", "policy.config.repeat=once"]);
    assert_eq!(code, Some(8), "{errors}");
    let result = &report["results"]["controller"];
    assert_eq!((&result["goals_reached"], &result["goals_missed"]), (&0.into(), &1.into()), "{result}");
    assert!(result["position_error_m"].as_f64().is_some_and(|error| error > 4.0), "{result}");
    assert!(errors.contains("error: expected `controller.goals_missed` == 0"), "{errors}");
    let of_graph = &report["expectations"][0];
    assert_eq!((&of_graph["figure"], &of_graph["met"]), (&"controller.goals_missed".into(), &false.into()));
    let (code, report, errors) = reach(&["--set", OUT_OF_REACH, "--no-expect"]);
    assert_eq!((code, &report["expectations"]), (Some(0), &serde_json::json!([])), "{errors}");
}

#[test]
fn met_expectations_succeed_and_others_print_values() {
    let met = ["--expect", "controller.position_error_m <= 1e-3", "--expect", "physics.steps == 5000"];
    let (code, report, errors) = reach(&met);
    assert_eq!(code, Some(0), "{errors}");
    let all = report["expectations"].as_array().expect("the verdicts are listed");
    assert!(all.len() == 3 && all.iter().all(|each| each["met"] == true), "{all:?}");
    let (code, _, errors) = reach(&["--expect", "controller.position_error_m<1e-9"]);
    assert_eq!(code, Some(8));
    assert!(errors.contains("expected `controller.position_error_m` < 1e-9, found "), "{errors}");
    let (code, _, errors) = reach(&["--expect", "controller.position_eror_m < 1"]);
    assert_eq!(code, Some(8));
    assert!(errors.contains("did you mean `position_error_m`?"), "{errors}");
}

#[test]
fn bad_expectations_are_refused_before_the_start() {
    let (code, _, _) = reach(&["--expect", "controler.goals_missed == 0"]);
    assert_eq!(code, Some(3));
    let output = run(&["check", REACH, "--set", "expect.controler.goals_missed=0"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("there is no component `controler`"), "{errors}");
    assert!(errors.contains("did you mean `controller`?"), "{errors}");
    let none = run(&["check", REACH, "--set", "expect.controller.goals_missed=\"none\""]);
    let errors = String::from_utf8_lossy(&none.stderr);
    assert!(none.status.code() == Some(3) && errors.contains("expected a condition"), "{errors}");
    let wrong = motorium(&["run", REACH, "--expect", "controller.goals_missed"]).output().expect("it starts");
    assert_eq!(wrong.status.code(), Some(2), "{}", String::from_utf8_lossy(&wrong.stderr));
}
