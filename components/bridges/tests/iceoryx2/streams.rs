//! Streams and slices between a graph and stock programs.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::state::CloudPoint;
use motorium::testing::{Graph, Instance};
use motorium::transport::{SliceInput, SliceOutput};
use motorium_bridges::Iceoryx2Bridge;
use serde_json::{Value, json};

use super::{Foreign, Stock, name, target};

/// Step at which the foreign programs join the run.
const JOINS: u64 = 10;
/// Maximum slice length of the graph. The foreign program also sends longer slices.
const LONGEST: usize = 8;

/// Points of the slice with this number: at most six.
fn points(number: u64) -> Vec<CloudPoint> {
    let point = |index| CloudPoint { x: number as f32, y: index as f32, ..CloudPoint::default() };
    (0..number % 7).map(point).collect()
}

#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Foreigner {
    /// Reads both mirrored topics.
    Reads,
    /// Sends a value and a slice in each step.
    Sends,
    /// Sends 40 values in one step, and in others a non-finite value, an unnumbered value, and a slice that
    /// is too long.
    Overflows,
    /// Sends ten values in each step.
    Floods,
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlayerConfig {
    run: String,
    foreigner: Foreigner,
}

type Values = Subscriber<Stock, PoseTarget, Stamp>;
type Slices = Subscriber<Stock, [CloudPoint], Stamp>;
type ValueSender = Publisher<Stock, PoseTarget, Stamp>;
type SliceSender = Publisher<Stock, [CloudPoint], Stamp>;

/// Ports of the foreign program.
enum Ports {
    Reading((Foreign, Values, Slices)),
    Sending((Foreign, ValueSender, SliceSender)),
}

/// Publishes a value and a slice in each step, and is also the foreign program.
struct Player {
    config: PlayerConfig,
    poses: Output<PoseTarget>,
    cloud: SliceOutput<CloudPoint>,
    ports: Option<Ports>,
    /// Sequence numbers of the values and of the slices that the foreign program has read.
    read: [Vec<u64>; 2],
    sent: u64,
}

impl Component for Player {
    const KIND: &'static str = "test.player";
    const SUMMARY: &'static str = "publishes streams and slices";
    type Config = PlayerConfig;

    fn declare(_: &PlayerConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.stream_output::<PoseTarget>("poses", 16, "a stream");
        declare.slice_output::<CloudPoint>("cloud", LONGEST, 16, "slices");
        Ok(())
    }

    fn configure(config: PlayerConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (poses, cloud) = (setup.output("poses")?, setup.slice_output("cloud")?);
        Ok(Self { config, poses, cloud, ports: None, read: [Vec::new(), Vec::new()], sent: 0 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let number = tick.index + 1;
        self.poses.send(&target(number))?;
        let points = points(number);
        let mut loan = self.cloud.loan(points.len())?;
        loan.copy_from_slice(&points);
        loan.publish()?;
        if tick.index >= JOINS {
            self.be_foreign(tick.index);
        }
        Ok(())
    }

    fn result(&self) -> Option<Value> {
        Some(json!(self.read))
    }
}

impl Player {
    fn be_foreign(&mut self, tick: u64) {
        let Self { config, ports, read, sent, .. } = self;
        let reads = config.foreigner == Foreigner::Reads;
        let ports = ports.get_or_insert_with(|| {
            let foreign = Foreign::join(&config.run).unwrap();
            if reads {
                let (values, slices) = (subscribe(&foreign), subscribe_slices(&foreign));
                Ports::Reading((foreign, values, slices))
            } else {
                let (values, slices) = publishers(&foreign);
                Ports::Sending((foreign, values, slices))
            }
        });
        match ports {
            Ports::Reading((_, values, slices)) => {
                while let Some(sample) = values.receive().unwrap() {
                    let stamp = *sample.user_header();
                    assert_eq!((stamp.publisher, *sample), (0, target(stamp.sequence)));
                    read[0].push(stamp.sequence);
                }
                while let Some(sample) = slices.receive().unwrap() {
                    let stamp = *sample.user_header();
                    assert_eq!(sample.payload(), points(stamp.sequence), "{stamp:?}");
                    read[1].push(stamp.sequence);
                }
            }
            Ports::Sending((_, values, slices)) => {
                let mut numbered = |value: PoseTarget| {
                    *sent += 1;
                    send(values, *sent, value);
                };
                match (config.foreigner, tick) {
                    (Foreigner::Sends, _) => {
                        numbered(target(tick));
                        send_slice(slices, *sent, &points(tick));
                    }
                    (Foreigner::Overflows, 42) => numbered(target(0)),
                    (Foreigner::Overflows, 52) => (1..=40).for_each(|goal| numbered(target(goal))),
                    (Foreigner::Overflows, 62) => {
                        numbered(PoseTarget { position: [f64::NAN; 3], ..target(1) });
                        send_slice(slices, 1, &[CloudPoint::default(); LONGEST + 1]);
                        send(values, 0, target(99));
                    }
                    (Foreigner::Floods, _) => (0..10).for_each(|goal| numbered(target(goal))),
                    _ => {}
                }
            }
        }
    }
}

fn subscribe(foreign: &Foreign) -> Values {
    let service = foreign.0.service_builder(&"out/poses".try_into().unwrap());
    let service = service.publish_subscribe::<PoseTarget>().user_header::<Stamp>().open().unwrap();
    service.subscriber_builder().create().unwrap()
}

fn subscribe_slices(foreign: &Foreign) -> Slices {
    let service = foreign.0.service_builder(&"out/cloud".try_into().unwrap());
    let service = service.publish_subscribe::<[CloudPoint]>().user_header::<Stamp>().open().unwrap();
    service.subscriber_builder().create().unwrap()
}

fn publishers(foreign: &Foreign) -> (ValueSender, SliceSender) {
    let service = |name: &str| foreign.0.service_builder(&name.try_into().unwrap());
    let goals = || service("in/goals").publish_subscribe::<PoseTarget>();
    let obstacles = service("in/obstacles").publish_subscribe::<[CloudPoint]>().user_header::<Stamp>();
    assert!(goals().open().is_err(), "without the header");
    assert!(service("in/goals").publish_subscribe::<Wrench>().user_header::<Stamp>().open().is_err());
    let single = service("in/obstacles").publish_subscribe::<CloudPoint>().user_header::<Stamp>().open();
    assert!(single.is_err(), "single values in place of slices");
    let goals = goals().user_header::<Stamp>().open().unwrap().publisher_builder().create().unwrap();
    let obstacles = obstacles.open().unwrap();
    let obstacles = obstacles.publisher_builder().initial_max_slice_len(LONGEST + 1).create().unwrap();
    (goals, obstacles)
}

fn send(port: &ValueSender, sequence: u64, value: PoseTarget) {
    let mut sample = port.loan().unwrap();
    sample.user_header_mut().sequence = sequence;
    *sample.payload_mut() = value;
    sample.send().unwrap();
}

fn send_slice(port: &SliceSender, sequence: u64, points: &[CloudPoint]) {
    let mut sample = port.loan_slice(points.len()).unwrap();
    sample.user_header_mut().sequence = sequence;
    sample.payload_mut().copy_from_slice(points);
    sample.send().unwrap();
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
struct NoConfig {}

/// Reads the inbound topics: goals, and the numbers of non-empty slices.
struct Collector {
    goals: Input<PoseTarget>,
    obstacles: SliceInput<CloudPoint>,
    read: [Vec<u64>; 2],
}

impl Component for Collector {
    const KIND: &'static str = "test.collector";
    const SUMMARY: &'static str = "collects streams and slices";
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.stream_input::<PoseTarget>("goals", 64, "a stream");
        declare.slice_input::<CloudPoint>("obstacles", 16, "slices");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (goals, obstacles) = (setup.input("goals")?, setup.slice_input("obstacles")?);
        Ok(Self { goals, obstacles, read: [Vec::new(), Vec::new()] })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        while let Some(goal) = self.goals.next_unread() {
            self.read[0].push(goal.goal);
        }
        while let Some((stamp, slice)) = self.obstacles.next_unread() {
            assert_eq!(stamp.source_time, stamp.publish_time, "a foreign value begins a chain");
            let Some(first) = slice.first() else { continue };
            assert_eq!(slice, points(first.x as u64));
            self.read[1].push(first.x as u64);
        }
        Ok(())
    }

    fn result(&self) -> Option<Value> {
        Some(json!(self.read))
    }
}

fn table(text: &str) -> toml::Table {
    toml::from_str(text).unwrap()
}

/// A bridge with two mirrored and two inbound topics.
fn bridge(rate: &str, capacity: usize) -> Instance {
    let inbound = table(&format!(
        "goals = {{ type = \"motorium.PoseTarget\", pattern = {{ stream = {{ capacity = {capacity} }} }} }}\n\
         obstacles = {{ type = \"motorium.CloudPoint\", pattern = {{ slices = {{ capacity = 8, longest = {LONGEST} }} }} }}"
    ));
    Instance::of::<Iceoryx2Bridge>("bridge")
        .rate(rate)
        .subscribe("poses", "poses")
        .subscribe("cloud", "cloud")
        .publish("goals", "goals")
        .publish("obstacles", "obstacles")
        .config("out_streams", vec!["poses"])
        .config("out_slices", vec!["cloud"])
        .config("in", inbound)
}

fn run(test: &str, foreigner: &str, bridge: Instance, duration: &str) -> Report {
    let name = name(test);
    let player = Instance::of::<Player>("player")
        .rate("1 kHz")
        .publish("poses", "poses")
        .publish("cloud", "cloud")
        .config("run", name.as_str())
        .config("foreigner", foreigner);
    let collector = Instance::of::<Collector>("collector")
        .rate("1 kHz")
        .subscribe("goals", "goals")
        .subscribe("obstacles", "obstacles");
    let report = Graph::new(&name).with(player).with(bridge).with(collector).run(duration).unwrap();
    assert_eq!(report.exit, motorium::launcher::Exit::Finished, "{report:?}");
    report
}

fn numbers(report: &Report, component: &str) -> [Vec<u64>; 2] {
    serde_json::from_value(report.results[component].clone()).unwrap()
}

fn count(report: &Report, path: &str) -> u64 {
    let found = report.results["bridge"].pointer(path);
    found.and_then(Value::as_u64).unwrap_or_else(|| panic!("{path} in {}", report.results["bridge"]))
}

/// Number of allocations in the steps of the bridge.
fn allocations(report: &Report) -> Option<u64> {
    report.components.iter().find(|component| component.name == "bridge").unwrap().allocations
}

#[test]
fn every_value_and_slice_is_mirrored_in_order() {
    let report = run("every", "reads", bridge("200 Hz", 16), "500 ms");
    for (topic, read) in ["poses", "cloud"].into_iter().zip(numbers(&report, "player")) {
        let (first, last) = (read[0], read[read.len() - 1]);
        assert!(first <= JOINS + 2 && last >= 490, "{topic}: {first} to {last}");
        assert_eq!(read, (first..=last).collect::<Vec<_>>(), "{topic}");
        assert!(count(&report, &format!("/out/{topic}/mirrored")) >= last);
        for lost in ["unsent", "lost"] {
            assert_eq!(count(&report, &format!("/out/{topic}/{lost}")), 0, "{topic}");
        }
    }
    assert_eq!(allocations(&report), Some(0));
}

#[test]
fn values_lost_before_a_slow_bridge_are_counted() {
    let report = run("slow", "reads", bridge("20 Hz", 16), "500 ms");
    for (topic, read) in ["poses", "cloud"].into_iter().zip(numbers(&report, "player")) {
        let counted = |key: &str| count(&report, &format!("/out/{topic}/{key}"));
        // 50 values per step of the bridge, of which the queue holds 16
        assert_eq!(counted("lost"), 9 * 34, "{topic}");
        assert!(counted("mirrored") >= 9 * 16);
        let missing: u64 = read.windows(2).map(|pair| pair[1] - pair[0] - 1).sum();
        assert!(missing >= 8 * 34 && missing <= counted("lost"), "{topic}: {missing}");
    }
}

#[test]
fn foreign_streams_and_slices_arrive_in_order() {
    let report = run("fed", "sends", bridge("200 Hz", 16), "500 ms");
    let [goals, slices] = numbers(&report, "collector");
    assert!(goals.len() >= 480, "{}", goals.len());
    assert_eq!(goals, (JOINS..JOINS + goals.len() as u64).collect::<Vec<_>>());
    let last = slices[slices.len() - 1];
    assert!(last >= 480);
    assert_eq!(slices, (JOINS..=last).filter(|number| number % 7 > 0).collect::<Vec<_>>());
    for topic in ["goals", "obstacles"] {
        let counted = |key: &str| count(&report, &format!("/in/{topic}/{key}"));
        assert_eq!((counted("received"), counted("lost")), (counted("published"), 0), "{topic}");
    }
    assert_eq!(allocations(&report), Some(0));
}

#[test]
fn an_overflowed_queue_and_defects_are_counted() {
    let report = run("overflow", "overflows", bridge("200 Hz", 16), "200 ms");
    let counted = |key: &str| count(&report, &format!("/in/{key}"));
    // the first, the newest 16 of 40, and an unnumbered value
    let [goals, slices] = numbers(&report, "collector");
    assert_eq!(goals, [0].into_iter().chain(25..=40).chain([99]).collect::<Vec<_>>());
    assert_eq!((counted("goals/received"), counted("goals/published")), (19, 18));
    assert_eq!((counted("goals/lost"), counted("goals/refused/not_finite")), (24, 1));
    assert_eq!((slices.len(), counted("obstacles/refused/too_long")), (0, 1));
}

#[test]
fn a_stream_is_limited_to_its_rate() {
    let report = run("flood", "floods", bridge("200 Hz", 64), "300 ms");
    let counted = |key: &str| count(&report, &format!("/in/goals/{key}"));
    let (received, published) = (counted("received"), counted("published"));
    assert!(received > 2_500, "{received}");
    // 1 kHz, plus an initial burst of at most the capacity
    assert!((280..=300 + 64).contains(&published), "{published}");
    assert_eq!(counted("refused/above_max_rate"), received - published);
    assert_eq!(numbers(&report, "collector")[0].len() as u64, published);
}

#[test]
fn ports_that_carry_something_else_are_refused() {
    let player = || {
        Instance::of::<Player>("player")
            .rate("1 kHz")
            .publish("poses", "poses")
            .publish("cloud", "cloud")
            .config("run", "refused")
            .config("foreigner", "reads")
    };
    let refusal = |config: &str| {
        let config = table(config);
        let mut bridge = Instance::of::<Iceoryx2Bridge>("bridge").rate("200 Hz").subscribe("poses", "poses");
        for (key, value) in config {
            bridge = bridge.config(&key, value);
        }
        Graph::new("refused").with(player()).with(bridge).check().unwrap_err().render(false)
    };
    for (config, reason) in [
        ("out = [\"poses\"]\nout_streams = [\"poses\"]", "two ports are named `poses`"),
        ("out_slices = [\"poses\"]", "has slices at one port"),
        (
            "out = [\"poses\"]\nin.goals = { type = \"u8\", pattern = { stream = { capacity = 0 } } }",
            "a capacity of 0, expected 1 to 1024",
        ),
        (
            "out = [\"poses\"]\nin.goals = { type = \"u8\", pattern = { slices = { longest = 0, capacity = 1 } } }",
            "the maximum length of a slice is 0",
        ),
        (
            "out = [\"poses\"]\nin.stop = { type = \"motorium.EmergencyStop\", pattern = { stream = { capacity = 4 } } }",
            "an emergency stop must not wait in a queue",
        ),
        ("out = [\"poses\"]\nin.goals = { type = \"motorium.Pose\" }", "no built-in state `motorium.Pose`"),
    ] {
        let found = refusal(config);
        assert!(found.contains(reason), "{config}: {found}");
    }
}
