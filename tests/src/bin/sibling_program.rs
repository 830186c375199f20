//! A program that hosts kinds for `motorium`, as `motorium-bridges` does.

use std::path::PathBuf;

use motorium::prelude::*;

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct PushConfig {
    /// Force, N.
    force: f64,
    /// A file that must exist. Default: none.
    #[schemars(schema_with = "path")]
    file: Option<PathBuf>,
}

fn path(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    schemars::json_schema!({ "type": "string", "format": "path" })
}

/// Publishes a constant force.
struct Push {
    force: f64,
    wrench: Output<Wrench>,
}

impl Component for Push {
    const KIND: &'static str = "bridge.push";
    const SUMMARY: &'static str = "publishes a constant force";
    const RESETS: bool = true;
    type Config = PushConfig;

    fn declare(config: &PushConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if !(0.0..=100.0).contains(&config.force) {
            let error = ConfigError::key("force", format!("{} N, expected 0 to 100 N", config.force));
            return Err(error.advise("push less"));
        }
        if let Some(file) = config.file.as_ref().filter(|file| !file.is_file()) {
            return Err(ConfigError::key("file", format!("{} is no file", file.display())));
        }
        declare.output::<Wrench>("wrench", "the force");
        Ok(())
    }

    fn configure(config: PushConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { force: config.force, wrench: setup.output("wrench")? })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.wrench.send(&Wrench { force: [self.force, 0.0, 0.0], ..Wrench::default() })
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "force": self.force }))
    }
}

motorium::host!(Push);
