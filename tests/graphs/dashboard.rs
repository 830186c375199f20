//! The Grafana dashboard, compared with the metrics of a run.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::exposition::Family;

/// Checks that each metric of the Grafana dashboard exists in the run, with the labels that the dashboard
/// uses, and that the dashboard shows all metrics.
pub(crate) fn assert_dashboard_matches(scraped: &BTreeMap<String, Family>) {
    let dashboard: Value = serde_json::from_str(include_str!("../../docs/grafana/motorium.json"))
        .expect("the dashboard is JSON");
    let panels = dashboard["panels"].as_array().expect("panels").iter();
    let targets = panels.filter_map(|panel| panel["targets"].as_array()).flatten();
    let mut shown: Vec<&str> = Vec::new();
    for target in targets {
        let (expression, legend) = (target["expr"].as_str().expect("one"), target["legendFormat"].as_str());
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
        for name in expression.split(|c: char| !is_name(c)).filter(|word| word.starts_with("motorium_")) {
            let of_family = |family: &&String| {
                let rest = name.strip_prefix(family.as_str());
                let kind = scraped[family.as_str()].kind.as_str();
                match kind {
                    "counter" => rest == Some("_total"),
                    "histogram" => rest.is_some_and(|rest| ["_bucket", "_sum", "_count"].contains(&rest)),
                    _ => rest == Some(""),
                }
            };
            let family = scraped.keys().find(of_family);
            let family = family.unwrap_or_else(|| panic!("there is no metric `{name}`: {expression}"));
            shown.push(family);
            let series = scraped[family].series();
            // Labels of the legend are among the labels that the expression keeps.
            let asked =
                legend.unwrap_or_default().split("{{").skip(1).filter_map(|rest| rest.split("}}").next());
            for label in asked.chain(["run"]) {
                assert!(series.iter().all(|labels| labels.contains_key(label)), "`{name}` has no `{label}`");
                let by = expression.split("by (").nth(1).and_then(|rest| rest.split(')').next());
                let kept = by.is_none_or(|by| label == "run" || by.split(", ").any(|kept| kept == label));
                assert!(kept, "`{label}` is not kept by {expression}");
            }
        }
    }
    for family in scraped.keys() {
        assert!(shown.contains(&family.as_str()), "the dashboard does not show `{family}`");
    }
}
