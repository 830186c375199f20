//! `motorium model eval`: the outputs of a network for given inputs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use motorium_models::onnx;
use serde::Serialize;
use serde_json::Value;

use crate::out::outln;

/// Run a network on given inputs, as `policy.network` does, and print its outputs.
///
/// Example: motorium model eval policy.onnx --inputs in.json --json
#[derive(Debug, clap::Args)]
pub(super) struct Eval {
    /// The network, an ONNX file
    #[arg(value_name = "FILE.onnx")]
    file: PathBuf,
    /// Inputs by name, nested lists of numbers: {"obs": [[0.1, -0.2]]}, or in the order of the network:
    /// {"inputs": [[[0.1, -0.2]]]}
    #[arg(long, value_name = "IN.json")]
    inputs: PathBuf,
    /// Print JSON: {"outputs": [[...], ...]}, one flat list for each output, with names and shapes
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    outputs: Vec<Vec<f32>>,
    names: Vec<String>,
    shapes: Vec<Vec<usize>>,
}

impl Eval {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let at = |path: &Path| path.display().to_string();
        let bytes = std::fs::read(&self.file).with_context(|| at(&self.file))?;
        let model = onnx::Model::read(&bytes).with_context(|| at(&self.file))?;
        let text = std::fs::read_to_string(&self.inputs).with_context(|| at(&self.inputs))?;
        let given = serde_json::from_str(&text).with_context(|| at(&self.inputs))?;
        let tensors = tensors(&model, &given).with_context(|| at(&self.inputs))?;
        let shapes: Vec<Vec<usize>> = tensors.iter().map(|(shape, _)| shape.clone()).collect();
        let mut program = model.program_with(&shapes).with_context(|| at(&self.file))?;
        for (index, (_, values)) in tensors.iter().enumerate() {
            program.input_mut(index).copy_from_slice(values);
        }
        program.run();
        let outputs = program.outputs();
        let report = Report {
            outputs: (0..outputs.len()).map(|index| program.output(index).to_vec()).collect(),
            names: outputs.iter().map(|output| output.name.clone()).collect(),
            shapes: outputs.iter().map(|output| output.shape.clone()).collect(),
        };
        for (name, values) in report.names.iter().zip(&report.outputs) {
            if let Some(value) = values.iter().find(|value| !value.is_finite()) {
                bail!(
                    "output \"{name}\" is {value}; help: check the inputs and the weights for large numbers"
                );
            }
        }
        if self.json {
            outln!("{}", serde_json::to_string(&report)?);
        } else {
            for ((name, shape), values) in report.names.iter().zip(&report.shapes).zip(&report.outputs) {
                let values: Vec<String> = values.iter().map(ToString::to_string).collect();
                outln!("{name} {shape:?}: {}", values.join(" "));
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the shape and numbers of each input of a model.
fn tensors(model: &onnx::Model, given: &Value) -> anyhow::Result<Vec<(Vec<usize>, Vec<f32>)>> {
    let inputs = model.inputs();
    let names: Vec<&str> = inputs.iter().map(|input| &input.name[..]).collect();
    let Value::Object(given) = given else {
        bail!("found no object, expected the inputs by name ({})", names.join(", "));
    };
    let listed = match given.get("inputs") {
        Some(Value::Array(listed)) if !names.contains(&"inputs") => {
            if listed.len() != names.len() || given.len() != 1 {
                bail!("{} inputs, expected {} ({})", listed.len(), names.len(), names.join(", "));
            }
            Some(listed)
        }
        _ => None,
    };
    if let (None, Some(unknown)) = (listed, given.keys().find(|name| !names.contains(&&name[..]))) {
        bail!("input \"{unknown}\" is unknown, expected {}", names.join(", "));
    }
    let mut tensors = Vec::new();
    for (index, input) in inputs.iter().enumerate() {
        let name = &input.name;
        let value = listed.map_or_else(|| given.get(name), |listed| listed.get(index));
        let value =
            value.with_context(|| format!("input \"{name}\" is missing, expected {}", names.join(", ")))?;
        let (mut shape, mut values) = (Vec::new(), Vec::new());
        flatten(value, 0, &mut shape, &mut values).with_context(|| format!("input \"{name}\""))?;
        // one row of a batch
        if shape.len() + 1 == input.shape.len() && !matches!(input.shape[0], onnx::Length::Fixed(2..)) {
            shape.insert(0, 1);
        }
        tensors.push((shape, values));
    }
    Ok(tensors)
}

/// Appends the numbers of nested lists with equal lengths.
fn flatten(value: &Value, depth: usize, shape: &mut Vec<usize>, values: &mut Vec<f32>) -> anyhow::Result<()> {
    match value {
        Value::Array(items) => {
            match shape.get(depth) {
                None if values.is_empty() => shape.push(items.len()),
                Some(length) if *length == items.len() => {}
                other => bail!("a list of {} numbers beside lists of {}", items.len(), other.unwrap_or(&0)),
            }
            items.iter().try_for_each(|item| flatten(item, depth + 1, shape, values))
        }
        Value::Number(number) if depth == shape.len() => {
            let number = number.as_f64().context("a number that is too large")?;
            values.push(number as f32);
            Ok(())
        }
        other => bail!("found `{other}`, expected nested lists of numbers with equal lengths"),
    }
}
