//! `log.console`: prints the newest samples of topics as lines, on standard error.
//!
//! The step only copies numbers into a bounded queue; a thread beside it formats and prints them. A slow terminal or a full pipe
//! never holds up the graph: lines are dropped and counted instead.

mod line;

use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use motorium::prelude::*;
use rtrb::{Consumer, Producer, RingBuffer};

use line::{Line, Print};

/// Configuration of `log.console`.
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ConsoleLogConfig {
    /// Digits after the decimal point, 0 to 12. Default 3.
    pub digits: u8,
    /// Lines that may wait to be printed, at least 1; further lines are dropped. Default 256.
    pub backlog: usize,
}

impl Default for ConsoleLogConfig {
    fn default() -> Self {
        Self { digits: 3, backlog: 256 }
    }
}

/// A component that prints the newest sample of every wired input, once per step.
pub struct ConsoleLog {
    inputs: Vec<Box<dyn Source>>,
    queue: Producer<Line>,
    printed: u64,
    dropped: u64,
    printer: Option<JoinHandle<()>>,
    finished: Arc<AtomicBool>,
}

/// An input of any type that can be printed.
trait Source {
    /// Fills the line with the newest sample that was not logged yet.
    fn fill(&mut self, line: &mut Line) -> bool;

    /// Logs the first sample of an episode, whatever its number.
    fn reset(&mut self);
}

struct Typed<T: StateBuffer> {
    name: &'static str,
    input: Input<T>,
    last: (u32, u64),
}

impl<T: StateBuffer + Print> Source for Typed<T> {
    fn fill(&mut self, line: &mut Line) -> bool {
        let Some(sample) = self.input.latest() else { return false };
        let stamp = sample.stamp();
        if (stamp.restart_count, stamp.sequence) == self.last {
            return false;
        }
        line.port = self.name;
        line.groups.clear();
        sample.print(&mut line.groups);
        self.last = (stamp.restart_count, stamp.sequence);
        true
    }

    fn reset(&mut self) {
        self.last = (0, 0);
    }
}

macro_rules! ports {
    ($( $name:literal : $type:ty, $doc:literal; )*) => {
        fn declare_ports(declare: &mut Declare) {
            $( declare.optional_input::<$type>($name, $doc); )*
        }

        fn open_ports(setup: &mut Setup) -> Result<Vec<Box<dyn Source>>, ConfigureError> {
            let mut inputs: Vec<Box<dyn Source>> = Vec::new();
            $(
                let input = setup.input::<$type>($name)?;
                if input.is_wired() {
                    inputs.push(Box::new(Typed { name: $name, input, last: (0, 0) }));
                }
            )*
            Ok(inputs)
        }
    };
}

ports! {
    "joint_state": JointState, "joint state to print";
    "joint_command": JointCommand, "joint command to print";
    "base_state": BaseState, "base state to print";
    "target": PoseTarget, "pose and twist target to print";
    "wrench": Wrench, "wrench to print";
    "imu": ImuSample, "inertial measurement to print";
    "phase": Phase, "phase to print";
    "emergency_stop": EmergencyStop, "emergency stop to print";
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
        declare_ports(declare);
        Ok(())
    }

    fn configure(config: ConsoleLogConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let inputs = open_ports(setup)?;
        if inputs.is_empty() {
            let advice = "subscribe = { joint_state = \"TOPIC\" }, or another of its inputs";
            return Err(ConfigureError::failed(format!(
                "nothing to print: none of its inputs is wired; add {advice}"
            )));
        }
        let (queue, lines) = RingBuffer::new(config.backlog);
        let finished = Arc::new(AtomicBool::new(false));
        let printer = std::thread::Builder::new().name("printer".to_string()).spawn({
            let finished = finished.clone();
            move || print_all(lines, usize::from(config.digits), &finished)
        });
        let printer = Some(printer.map_err(ConfigureError::failed)?);
        Ok(Self { inputs, queue, printed: 0, dropped: 0, printer, finished })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let mut line = Line::at_time(tick.time());
        for input in &mut self.inputs {
            if !input.fill(&mut line) {
                continue;
            }
            match self.queue.push(line) {
                Ok(()) => self.printed += 1,
                Err(_) => self.dropped += 1,
            }
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.inputs.iter_mut().for_each(|input| input.reset());
        Ok(())
    }

    fn stop(&mut self) {
        self.finished.store(true, Relaxed);
        if let Some(printer) = self.printer.take() {
            printer.thread().unpark();
            let _ = printer.join();
        }
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "lines": self.printed, "dropped": self.dropped }))
    }
}

/// Prints lines until the component is finished and nothing is left.
fn print_all(mut lines: Consumer<Line>, digits: usize, finished: &AtomicBool) {
    loop {
        let last_round = finished.load(Relaxed);
        let mut out = std::io::stderr().lock();
        while let Ok(line) = lines.pop() {
            // Standard error may be closed: that must not stop the graph.
            let _ = writeln!(out, "{}", line.display(digits));
        }
        let _ = out.flush();
        drop(out);
        if last_round {
            return;
        }
        // Polling keeps the step free of the system call that waking this thread would take.
        std::thread::park_timeout(Duration::from_millis(20));
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_built_in_state_buffer_has_an_input() {
        let mut declare = Declare::new(None);
        ConsoleLog::declare(&ConsoleLogConfig::default(), &mut declare).expect("the default configuration");
        let ports = declare.into_declaration().ports;
        let printed: BTreeSet<_> = ports.into_iter().map(|port| port.layout.type_name).collect();
        let built_in: BTreeSet<_> =
            motorium::state::built_in().into_iter().map(|layout| layout.type_name).collect();
        assert_eq!(printed, built_in);
    }
}
