//! `log.console`: prints the newest values of topics of any type as lines, on standard error.
//!
//! The step only copies bytes to a bounded queue; a separate thread decodes them with the layout of their
//! topic and prints them. A slow terminal or a full pipe never blocks the graph: lines that do not fit into
//! the queue are dropped and counted.

mod queue;

use std::fmt::{self, Write as _};
use std::io::Write as _;
use std::time::Duration;

use motorium::component::StopRequest;
use motorium::prelude::*;
use motorium::raw::RawInput;
use motorium::state::{Decoded, Decoder, FieldValue, Number};

use queue::{Receiver, Sender, queue};

/// Inputs that can be wired without being listed in `inputs`: common states of robot graphs.
const USUAL: [&str; 8] =
    ["joint_state", "joint_command", "base_state", "target", "wrench", "imu", "phase", "emergency_stop"];

/// Configuration of `log.console`.
///
/// ```toml
/// inputs = ["weights", "left_state"]
/// digits = 2
/// ```
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConsoleLogConfig {
    /// Names of additional inputs. Each accepts a topic of any type except slices. Default: none.
    pub inputs: Vec<String>,
    /// Digits after the decimal point, 0 to 12. Default 3.
    pub digits: u8,
    /// Maximum number of queued lines, at least 1; further lines are dropped. Default 256.
    pub backlog: usize,
}

impl Default for ConsoleLogConfig {
    fn default() -> Self {
        Self { inputs: Vec::new(), digits: 3, backlog: 256 }
    }
}

/// A component that prints the newest value of every wired input, once per step.
pub struct ConsoleLog {
    inputs: Vec<RawInput>,
    queue: Sender,
    printed: u64,
    dropped: u64,
}

impl Component for ConsoleLog {
    const KIND: &'static str = "log.console";
    const SUMMARY: &'static str = "prints the newest samples of topics";
    const RESETS: bool = true;
    type Config = ConsoleLogConfig;

    fn declare(config: &ConsoleLogConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if config.digits > 12 {
            return Err(ConfigError::key("digits", format!("{} digits, expected 0 to 12", config.digits)));
        }
        if config.backlog == 0 {
            return Err(ConfigError::key("backlog", "0 lines, expected at least 1"));
        }
        for (index, name) in config.inputs.iter().enumerate() {
            if USUAL.contains(&name.as_str()) || config.inputs[..index].contains(name) {
                return Err(ConfigError::key("inputs", format!("two inputs are named `{name}`")));
            }
        }
        for name in USUAL {
            declare.optional_raw_input(name, "state to print, of any type");
        }
        for name in &config.inputs {
            declare.raw_input(name, "state to print, of any type");
        }
        Ok(())
    }

    fn configure(config: ConsoleLogConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (mut inputs, mut formats) = (Vec::new(), Vec::new());
        for name in USUAL.into_iter().chain(config.inputs.iter().map(String::as_str)) {
            let input = setup.raw_input(name)?;
            let Some(layout) = input.layout() else { continue };
            let decoder = Decoder::new(layout).map_err(ConfigureError::failed)?;
            formats.push(Format { name: name.to_string(), decoder, digits: usize::from(config.digits) });
            inputs.push(input);
        }
        if inputs.is_empty() {
            let advice = "subscribe = { joint_state = \"TOPIC\" }, or list additional inputs in `inputs`";
            return Err(ConfigureError::failed(format!("nothing to print: no input is wired; add {advice}")));
        }
        let largest = inputs.iter().filter_map(RawInput::layout).map(|layout| layout.size).max().unwrap_or(0);
        let (queue, lines) = queue(config.backlog, largest);
        setup.helper("printer", move |stop| print_all(lines, &formats, stop))?;
        Ok(Self { inputs, queue, printed: 0, dropped: 0 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        for (index, input) in self.inputs.iter_mut().enumerate() {
            let Some(value) = input.next_unread() else { continue };
            if self.queue.send(tick.time(), index, value.bytes) {
                self.printed += 1;
            } else {
                self.dropped += 1;
            }
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        // The counts cover the whole run, so there is nothing to reset.
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "lines": self.printed, "dropped": self.dropped }))
    }
}

/// Format of the lines of one input.
struct Format {
    name: String,
    decoder: Decoder,
    digits: usize,
}

impl Format {
    fn line(&self, time: f64, bytes: &[u8]) -> String {
        let mut line = format!("{time:9.3} s  {}:", self.name);
        match self.decoder.decode(bytes) {
            // writing to a string does not fail
            Ok(Decoded(fields)) => fields.iter().for_each(|(name, value)| {
                let _ = self.field(&mut line, name, value);
            }),
            Err(error) => {
                let _ = write!(line, "  {error}");
            }
        }
        line
    }

    fn field(&self, line: &mut String, name: &str, value: &FieldValue) -> fmt::Result {
        write!(line, "  {name} ")?;
        if let FieldValue::Text(words) = value {
            return write!(line, "{words:?}");
        }
        let many = matches!(value, FieldValue::Many(_));
        line.push_str(if many { "[" } else { "" });
        for (i, number) in value.numbers().iter().enumerate() {
            line.push_str(if i == 0 { "" } else { " " });
            match number {
                Number::Double(number) => write!(line, "{number:.*}", self.digits)?,
                Number::Single(number) => write!(line, "{number:.*}", self.digits)?,
                whole => write!(line, "{whole}")?,
            }
        }
        line.push_str(if many { "]" } else { "" });
        Ok(())
    }
}

/// Prints lines until the component has stopped and the queue is empty.
fn print_all(mut lines: Receiver, formats: &[Format], stop: &StopRequest) {
    loop {
        // Polling saves the step the system call that waking this thread would require.
        let last_round = stop.wait(Duration::from_millis(20));
        let mut out = std::io::stderr().lock();
        // Standard error may be closed; the graph continues without it.
        while lines
            .receive(|entry| writeln!(out, "{}", formats[entry.input].line(entry.time, entry.bytes)))
            .is_some()
        {}
        let _ = out.flush();
        drop(out);
        if last_round {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use motorium::testing::{Graph, Instance, Source};

    use super::*;

    motorium::state_buffer! {
        /// A user-defined type that no crate of this workspace knows.
        struct Grip as "test.Grip" {
            closed: u64,
            width: f64,
            fingers: [f64; 2],
        }
    }

    #[test]
    fn line_shows_every_field_and_the_joints_in_use() {
        let format =
            |layout| Format { name: "x".to_string(), decoder: Decoder::new(&layout).unwrap(), digits: 2 };
        let bytes = motorium::state::encode(&JointState::layout(), "position=[0.5, -1.25]").unwrap();
        assert_eq!(
            format(JointState::layout()).line(1.5, &bytes),
            "    1.500 s  x:  count 2  position [0.50 -1.25]  velocity [0.00 0.00]  effort [0.00 0.00]"
        );
        let bytes = motorium::state::encode(&Grip::layout(), "closed=1 width=0.08 fingers=[1, 2]").unwrap();
        assert_eq!(
            format(Grip::layout()).line(0.0, &bytes),
            "    0.000 s  x:  closed 1  width 0.08  fingers [1.00 2.00]"
        );
    }

    #[test]
    fn topics_of_any_type_are_printed_once_per_value() {
        let source =
            Source::new("gripper", "grip", |tick| Some(Grip { closed: tick.index, ..Grip::default() }));
        let state = Source::new("arm", "state", |_| Some(JointState::default()));
        let console = Instance::of::<ConsoleLog>("console")
            .rate("100 Hz")
            .config("inputs", vec!["grip"])
            .subscribe("grip", "grip")
            .subscribe("joint_state", "state");
        let report = Graph::new("printed").with(source).with(state).with(console).run("100 ms").unwrap();
        let result = &report.results["console"];
        assert_eq!((result["lines"].as_u64(), result["dropped"].as_u64()), (Some(20), Some(0)));
    }

    #[test]
    fn duplicate_input_names_are_rejected() {
        for inputs in [vec!["a".to_string(), "a".to_string()], vec!["target".to_string()]] {
            let config = ConsoleLogConfig { inputs, ..ConsoleLogConfig::default() };
            let error = ConsoleLog::declare(&config, &mut Declare::new(None)).unwrap_err();
            assert!(error.message.contains("two inputs are named"), "{}", error.message);
        }
    }
}
