//! `motorium model list`: the kinds of models and their properties.

use std::process::ExitCode;

use motorium_models::approximator::{CLASSES, Data, Parameters, Scope};

use crate::out::outln;

/// List the kinds of models with their properties: parameters, distributions, scope, and the data they need.
///
/// The columns follow table 2.4 of Delhaisse's thesis (2019).
///
/// Example: motorium model list
#[derive(Debug, clap::Args)]
pub(super) struct List {
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl List {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&CLASSES)?);
            return Ok(ExitCode::SUCCESS);
        }
        outln!(
            "{:<33} {:<10} {:<10} {:<10} {:<10} {:<13} {:<9} data",
            "model",
            "parameters",
            "predicts",
            "generative",
            "scope",
            "interpretable",
            "universal"
        );
        for class in CLASSES {
            let parameters = match class.parameters {
                Parameters::Linear => "linear",
                Parameters::Nonlinear => "nonlinear",
                Parameters::Data => "the data",
            };
            let scope = match class.scope {
                Scope::Step => "step",
                Scope::Trajectory => "trajectory",
            };
            let data = match class.data {
                Data::One => "one demonstration",
                Data::Little => "tens to hundreds",
                Data::Much => "thousands",
            };
            let predicts = if class.probabilistic { "density" } else { "value" };
            let yes = |holds: bool| if holds { "yes" } else { "no" };
            outln!(
                "{:<33} {parameters:<10} {predicts:<10} {:<10} {scope:<10} {:<13} {:<9} {data}",
                class.name,
                yes(class.generative),
                yes(class.interpretable),
                yes(class.universal)
            );
        }
        Ok(ExitCode::SUCCESS)
    }
}
