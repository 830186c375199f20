//! Initial values of parameters.

use super::draft::Draft;
use crate::graph::diagnostic::Report;
use crate::graph::read::good;
use crate::nearest::suggest;
use crate::plan::ParameterPlan;

/// Resolves the parameters of every component, in the order of their declaration.
pub(super) fn resolve(drafts: &[Draft<'_, '_>], report: &mut Report) -> Vec<Vec<ParameterPlan>> {
    drafts.iter().map(|draft| of_component(draft, report)).collect()
}

fn of_component(draft: &Draft<'_, '_>, report: &mut Report) -> Vec<ParameterPlan> {
    let Some(declaration) = &draft.declaration else { return Vec::new() };
    let mut plans: Vec<ParameterPlan> = declaration
        .parameters
        .iter()
        .map(|declaration| ParameterPlan {
            initial: declaration.default.clone(),
            declaration: declaration.clone(),
        })
        .collect();
    for (name, at) in good(&draft.table.params).iter().flat_map(|params| &params.0) {
        let Some(plan) = plans.iter_mut().find(|plan| plan.declaration.name == *name) else {
            let names = declaration.parameters.iter().map(|parameter| parameter.name.as_str());
            let advice = match declaration.parameters.as_slice() {
                [] => "leave `params` out; fixed settings belong in `config`".to_string(),
                _ => suggest(name, names, "its parameters are"),
            };
            report
                .error(format!("{} has no parameter `{name}`", draft.what()))
                .label(&at.key, "unknown parameter")
                .advise(advice);
            continue;
        };
        let Some(value) = at.get() else { continue };
        match plan.declaration.admit(value.clone()) {
            Ok(value) => plan.initial = value,
            Err(message) => {
                let unit = match plan.declaration.unit.as_str() {
                    "" => String::new(),
                    unit => format!(" (in {unit})"),
                };
                report
                    .error(format!("component `{}`: {message}", draft.name))
                    .label(&at.span, "cannot be its initial value")
                    .note(format!("`{name}`{unit}: {}", plan.declaration.doc))
                    .advise(format!("its default is {}", plan.declaration.default));
            }
        }
    }
    plans
}
