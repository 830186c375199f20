//! Evaluation of a graph's expectations against the report of its run.

use serde_json::Value;

use super::{ExpectationReport, Report};
use crate::nearest::suggest;
use crate::plan::Expectation;

/// Evaluates an expectation.
pub(super) fn verdict(expectation: &Expectation, report: &Report) -> ExpectationReport {
    let (found, problem) = match figure(report, &expectation.figure) {
        Ok(Value::Null) => (Value::Null, Some("it has no value in this run".to_string())),
        Ok(found) => (found, None),
        Err(problem) => (Value::Null, Some(problem)),
    };
    ExpectationReport {
        figure: expectation.figure.clone(),
        condition: expectation.condition(),
        met: expectation.is_met_by(&found),
        found,
        problem,
    }
}

/// Returns the value of a figure, from the result of its component or from the component's section of the
/// report.
fn figure(report: &Report, figure: &str) -> Result<Value, String> {
    let (component, path) = figure.split_once('.').unwrap_or((figure, ""));
    let result = report.results.get(component);
    let part = report.components.iter().find(|part| part.name == component);
    let part = part.and_then(|part| serde_json::to_value(part).ok());
    let found = result.and_then(|result| value_at(result, path)).or_else(|| value_at(part.as_ref()?, path));
    found.cloned().ok_or_else(|| {
        let keys = |value: Option<&Value>| -> Vec<String> {
            let object = value.and_then(Value::as_object);
            object.map(|object| object.keys().cloned().collect()).unwrap_or_default()
        };
        let known = [keys(result), keys(part.as_ref())].concat();
        let first = path.split('.').next().unwrap_or_default();
        let advice = suggest(first, known.iter().map(String::as_str), "its figures are");
        format!("`{component}` has no such figure; {advice}")
    })
}

/// Returns the value at a dotted path of keys and list indices.
fn value_at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    path.split('.').try_fold(value, |value, step| match value {
        Value::Array(values) => values.get(step.parse::<usize>().ok()?),
        value => value.get(step),
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::launcher::{ComponentReport, Exit};
    use crate::plan::ClockKind;

    fn report() -> Report {
        let result =
            json!({ "position_error_m": 2e-4, "tasks": { "cartesian": { "goals": [3, 4] } }, "worst": null });
        let part =
            ComponentReport { name: "controller".to_string(), restarts: 2, ..ComponentReport::default() };
        Report {
            version: 2,
            graph: "graph".to_string(),
            clock: ClockKind::Lockstep,
            duration_s: 1.0,
            realtime_factor: 1.0,
            state_hash: None,
            episodes: Vec::new(),
            exit: Exit::Finished,
            lost: Vec::new(),
            warnings: Vec::new(),
            idle_exit_ns: None,
            components: vec![part],
            latencies: Vec::new(),
            edges: Vec::new(),
            cores: Vec::new(),
            results: [("controller".to_string(), result)].into(),
            expectations: Vec::new(),
            events_left_out: 0,
            events: Vec::new(),
        }
    }

    fn verdict_on(expectation: &str) -> ExpectationReport {
        verdict(&expectation.parse().unwrap(), &report())
    }

    #[test]
    fn figures_are_read_from_the_result_then_the_report() {
        for met in [
            "controller.position_error_m <= 1e-3",
            "controller.tasks.cartesian.goals.1 == 4",
            "controller.restarts == 2",
            "controller.misses.long_step == 0",
        ] {
            assert!(verdict_on(met).met, "{met}");
        }
        let unmet = verdict_on("controller.position_error_m <= 1e-4");
        assert_eq!((unmet.met, &unmet.found), (false, &json!(2e-4)));
        assert_eq!(unmet.to_string(), "expected `controller.position_error_m` <= 0.0001, found 0.0002");
    }

    #[test]
    fn missing_figure_is_not_met_and_lists_alternatives() {
        let missing = verdict_on("controller.position_eror_m != 3");
        assert!(!missing.met);
        assert!(missing.to_string().contains("did you mean `position_error_m`?"), "{missing}");
        let null = verdict_on("controller.worst != 3");
        assert!(!null.met && null.to_string().ends_with("it has no value in this run"), "{null}");
    }
}
