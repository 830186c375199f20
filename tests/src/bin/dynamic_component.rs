//! A component whose configuration defines its ports. It scales the numbers of a topic of any built-in type,
//! or publishes constant numbers.

use motorium::component::{ConfigureError, DynamicComponent, Episode, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::raw::{RawInput, RawOutput};
use motorium::state::{TypeLayout, built_in};
use serde_json::{Value, json};

#[derive(Default)]
struct Scaler {
    ports: Option<(RawInput, RawOutput)>,
    gain: f64,
    /// Places of the numbers of the type, bytes.
    numbers: Vec<usize>,
    value: Vec<u8>,
    steps: u64,
    resets: u64,
}

/// Returns the layout of the type that the configuration names.
fn layout(config: &Value) -> Result<TypeLayout, ConfigError> {
    let name = config["type"].as_str().unwrap_or_default();
    let found = built_in().into_iter().find(|layout| layout.type_name == name);
    found.ok_or_else(|| ConfigError::key("type", format!("there is no built-in state `{name}`")))
}

/// Places of all `f64` in a type.
fn numbers(layout: &TypeLayout) -> Vec<usize> {
    let doubles = layout.fields.iter().filter(|field| field.kind.trim_start_matches('[').starts_with("f64"));
    doubles.flat_map(|field| (field.offset..field.offset + field.size).step_by(8)).collect()
}

impl DynamicComponent for Scaler {
    fn kind(&self) -> &str {
        "test.scaler"
    }

    fn summary(&self) -> &str {
        "scales the numbers of any type"
    }

    fn schema(&self) -> Value {
        json!({
            "type": "object",
            "description": "Type and gain.",
            "properties": {
                "type": { "type": "string", "description": "Built-in state." },
                "gain": { "type": "number", "description": "Factor. Default 1." },
                "constant": { "type": "number", "description": "Value in place of an input. Default none." },
                "resets": { "type": "boolean", "description": "It can be reset. Default false." }
            },
            "required": ["type"],
            "additionalProperties": false
        })
    }

    fn declare(&self, config: &Value, declare: &mut Declare) -> Result<(), ConfigError> {
        let layout = layout(config)?;
        declare.optional_raw_input("input", "values to scale, of the same type");
        declare.raw_output("output", layout, "the scaled values");
        if config["resets"] == true {
            declare.resets();
        }
        Ok(())
    }

    fn configure(&mut self, config: Value, setup: &mut Setup) -> Result<(), ConfigureError> {
        let layout = layout(&config)?;
        let constant = config["constant"].as_f64().unwrap_or_default();
        self.gain = config["gain"].as_f64().unwrap_or(1.0);
        (self.numbers, self.value) = (numbers(&layout), vec![0; layout.size]);
        for place in &self.numbers {
            self.value[*place..place + 8].copy_from_slice(&constant.to_ne_bytes());
        }
        self.ports = Some((setup.raw_input("input")?, setup.raw_output("output")?));
        Ok(())
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let Self { ports: Some((input, output)), gain, numbers, value, .. } = self else { return Ok(()) };
        self.steps += 1;
        if input.topic().is_some() {
            let Some(read) = input.next_unread() else { return Ok(()) };
            value.copy_from_slice(read.bytes);
            for place in numbers {
                let Some(bytes) = value[*place..].first_chunk_mut() else { continue };
                *bytes = (f64::from_ne_bytes(*bytes) * *gain).to_ne_bytes();
            }
        }
        output.publish(value).map_err(|error| StepError::failed(error.to_string()))
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.resets += 1;
        Ok(())
    }

    fn result(&self) -> Option<Value> {
        let last = self.numbers.iter().filter_map(|place| self.value[*place..].first_chunk());
        let last: Vec<f64> = last.map(|bytes| f64::from_ne_bytes(*bytes)).collect();
        Some(json!({ "steps": self.steps, "resets": self.resets, "last": last }))
    }
}

fn main() -> std::process::ExitCode {
    motorium::program::main_of(Scaler::default())
}
