//! Checks that the components of expected figures exist.

use super::draft::Draft;
use crate::graph::diagnostic::Report;
use crate::graph::model::GraphTable;
use crate::graph::read::good;
use crate::nearest::suggest;
use crate::plan::Expectation;

/// Resolves the expectations of a graph.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    report: &mut Report,
) -> Vec<Expectation> {
    let expectations = good(&graph.expect).map_or(&[][..], |expectations| &expectations.0);
    for (expectation, span) in expectations {
        let (component, figure) = (expectation.component(), &expectation.figure);
        let names = drafts.iter().map(|draft| draft.name);
        if !names.clone().any(|name| name == component) {
            let advice = suggest(component, names, "the components of the graph are");
            report
                .error(format!("`{figure}` does not begin with the name of a component"))
                .label(span, format!("there is no component `{component}`"))
                .advise(advice);
        } else if component.len() == figure.len() {
            report
                .error(format!("`{figure}` names no figure of the component"))
                .label(span, "expected such as `controller.position_error_m`")
                .advise(
                    "figures are values in the component's result or in its part of the report: see `motorium run --json`",
                );
        }
    }
    expectations.iter().map(|(expectation, _)| expectation.clone()).collect()
}
