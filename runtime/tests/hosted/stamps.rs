//! Source times set by a component, and the deadline of a step, in both clocks.

use motorium::component::RunClock;
use motorium::launcher::Report;
use motorium::plan::ClockKind;
use motorium::prelude::*;
use motorium::region::Refusal;
use motorium::safety::{CommandGate, JointLimits, Measured};
use motorium::testing::{Function, Graph, Instance, Probe, Sample, machine};

const MS: u64 = 1_000_000;

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct SensorConfig {
    /// Age of its samples, ms; negative for a source time in the future.
    age_ms: i64,
}

/// Publishes a command with an older source time, and the time left until its deadline.
struct Sensor {
    command: Output<JointCommand>,
    left: Output<Wrench>,
    clock: RunClock,
    config: SensorConfig,
}

impl Component for Sensor {
    const KIND: &'static str = "test.sensor";
    const SUMMARY: &'static str = "publishes older measurements";
    type Config = SensorConfig;

    fn declare(_: &SensorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointCommand>("command", "a command");
        declare.output::<Wrench>("left", "ms: time of the step, its deadline, time left");
        Ok(())
    }

    fn configure(config: SensorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (command, left) = (setup.output("command")?, setup.output("left")?);
        Ok(Self { command, left, clock: setup.clock(), config })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let ms = |ns: u64| ns as f64 * 1e-6;
        let times = [ms(tick.time_ns), ms(tick.deadline_ns), ms(self.clock.left_ns(tick))];
        self.left.send(&Wrench { force: times, ..Wrench::default() })?;
        let now_ns = self.clock.stamp_ns(self.clock.now_ns());
        let mut command = self.command.loan()?;
        *command = JointCommand::default();
        command.set_count(1);
        command.publish_from(now_ns.saturating_add_signed(-self.config.age_ms * MS as i64))
    }
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoConfig {}

/// An actuator of one joint.
struct Drive {
    command: Input<JointCommand>,
    gate: CommandGate,
}

impl Component for Drive {
    const KIND: &'static str = "test.drive";
    const SUMMARY: &'static str = "applies commands";
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.actuator();
        declare.input::<JointCommand>("command", "commands");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let gate = setup.command_gate(vec![JointLimits::new("joint").with_effort(10.0)])?;
        Ok(Self { command: setup.input("command")?, gate })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let mut gravity = |effort: &mut [f64]| effort.fill(0.0);
        let measured = Measured { position: &[0.0], velocity: &[0.0], gravity: &mut gravity };
        self.gate.check(&mut self.command, measured);
        Ok(())
    }
}

/// Returns a graph of a sensor at 1 kHz, whose commands pass through another component to a drive that
/// accepts source ages up to 20 ms.
fn graph(clock: &str, age_ms: i64) -> Graph {
    let sensor = Instance::of::<Sensor>("sensor")
        .rate("1 kHz")
        .publish("command", "measured")
        .publish("left", "left")
        .config("age_ms", age_ms)
        .set("on_error", "hold");
    let pass = Function::new::<JointCommand, JointCommand>("pass", "measured", "command", |_, command| {
        command.copied()
    });
    let drive = Instance::of::<Drive>("drive").trigger("command").subscribe("command", "command");
    Graph::from_toml(
        "name = \"stamps\"\nclock = \"lockstep\"\nlatency = [{ from = \"measured\", to = \"command\", max = \"25 ms\" }]\n",
    )
    .set("clock", clock)
    .set("safety.source_stale_after", "20 ms")
    .set("safety.stale_after", "20 ms")
    .with(sensor)
    .with(pass.trigger("measured"))
    .with(drive)
}

fn ages(report_of: Graph) -> (Report, Vec<Sample<JointCommand>>) {
    let probe = Probe::<JointCommand>::for_topic("command").triggered();
    let report = report_of.with(&probe).run("500 ms").unwrap();
    (report, probe.samples())
}

fn stale_sources(report: &Report) -> u64 {
    let gate = report.components.iter().find_map(|component| component.gate.as_ref()).expect("a gate");
    gate.refused.iter().filter(|refused| refused.reason == Refusal::StaleSource).map(|r| r.count).sum()
}

fn refused(report: &Report) -> u64 {
    report.components.iter().find(|component| component.name == "sensor").unwrap().refused
}

#[test]
fn source_time_propagates_down_the_chain_in_lockstep() {
    let (report, samples) = ages(graph("lockstep", 15));
    assert_eq!(samples.len(), 500);
    assert!(
        samples[15..].iter().all(|sample| sample.stamp.publish_time - sample.stamp.source_time == 15 * MS)
    );
    assert_eq!((report.latencies[0].missed, stale_sources(&report)), (0, 0));

    let (report, samples) = ages(graph("lockstep", 30));
    assert!(
        samples[30..].iter().all(|sample| sample.stamp.publish_time - sample.stamp.source_time == 30 * MS)
    );
    // before 30 ms the source time is the start of the run, so 25 ms and 20 ms are exceeded from then on
    assert_eq!((report.latencies[0].missed, stale_sources(&report)), (500 - 26, 500 - 21));
}

#[test]
fn gate_refuses_a_live_component_with_old_measurements() {
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let (report, samples) = ages(graph("realtime", 30));
    assert!(samples.len() > 50, "{} samples", samples.len());
    assert!(samples.iter().all(|sample| sample.stamp.publish_time - sample.stamp.source_time >= 30 * MS));
    assert!(stale_sources(&report) > 50, "{report:?}");
    assert_eq!(report.latencies[0].missed, report.latencies[0].count);
}

#[test]
fn source_time_beyond_a_millisecond_ahead_is_refused() {
    let (report, samples) = ages(graph("lockstep", -2));
    assert_eq!((samples.len(), refused(&report)), (0, 500));
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!(sensor.errors, 500);

    let (report, samples) = ages(graph("lockstep", -1));
    assert_eq!((samples.len(), refused(&report)), (500, 0));
    assert!(samples.iter().all(|sample| sample.stamp.source_time == sample.stamp.publish_time));
}

#[test]
fn deadline_of_a_step_is_a_period_after_its_time() {
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    for (clock, kind) in [("lockstep", ClockKind::Lockstep), ("realtime", ClockKind::Realtime)] {
        let left = Probe::<Wrench>::for_topic("left").triggered();
        let report = graph(clock, 0).with(&left).run("300 ms").unwrap();
        assert_eq!(report.clock, kind);
        let values = left.values();
        assert!(values.len() > 50, "{} steps", values.len());
        for Wrench { force: [time, deadline, left], .. } in values {
            assert!((deadline - time - 1.0).abs() < 1e-9, "{time} ms, deadline {deadline} ms");
            match kind {
                ClockKind::Lockstep => assert_eq!(left, deadline - time),
                ClockKind::Realtime => assert!(left < 1.0, "{left} ms left of a step that has begun"),
            }
        }
    }
}

#[test]
fn source_time_costs_no_allocation() {
    let (report, _) = ages(graph("lockstep", 5));
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!(sensor.allocations, Some(0));
}
