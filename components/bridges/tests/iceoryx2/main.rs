//! The bridge between a graph and stock iceoryx2 programs, which run in a source of the graph or in a
//! separate process.

mod streams;

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{Node, NodeBuilder, SignalHandlingMode, ipc_threadsafe};
use motorium::launcher::{Exit, Report};
use motorium::prelude::*;
use motorium::run_folder::RunFolder;
use motorium::state::EmergencyStop;
use motorium::testing::{Function, Graph, Instance, Probe, Source, machine};
use motorium_bridges::Iceoryx2Bridge;
use serde_json::Value;

motorium::count_allocations!();

type Stock = ipc_threadsafe::Service;

/// A stock program that has joined a run.
struct Foreign(Node<Stock>);

impl Foreign {
    /// Joins the newest run of a graph with the configuration of a stock program, except for the domain.
    fn join(graph: &str) -> Option<Self> {
        let folder = RunFolder::list().into_iter().find(|run| run.id().starts_with(graph))?;
        let domain = folder.domain().ok()?;
        let mut config = iceoryx2::config::Config::default();
        config.global.set_root_path(domain.config().global.root_path());
        config.global.prefix = domain.config().global.prefix;
        let node = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        node.create::<Stock>().ok().map(Self)
    }

    fn publisher(&self) -> Option<Publisher<Stock, PoseTarget, ()>> {
        let service = self.0.service_builder(&"in/arm/target".try_into().unwrap());
        service.publish_subscribe::<PoseTarget>().open().ok()?.publisher_builder().create().ok()
    }

    fn subscriber(&self) -> Subscriber<Stock, JointState, Stamp> {
        let service = self.0.service_builder(&"out/arm/state".try_into().unwrap());
        let service = service.publish_subscribe::<JointState>().user_header::<Stamp>().open().unwrap();
        service.subscriber_builder().create().unwrap()
    }
}

fn name(test: &str) -> String {
    format!("{test}-{}", std::process::id())
}

/// Target with this goal number.
fn target(goal: u64) -> PoseTarget {
    PoseTarget { orientation: [0.0, 0.0, 0.0, 1.0], goal, ..PoseTarget::default() }
}

fn state(tick: u64) -> JointState {
    let mut state = JointState::default();
    state.set_count(2);
    state.position_mut()[1] = tick as f64;
    state
}

/// A bridge at 200 Hz that mirrors `arm/state` and feeds `arm/target`.
fn bridge(max_rate: &str) -> Instance {
    let limits = [("type", "motorium.PoseTarget"), ("max_rate", max_rate)];
    let limits = toml::Table::from_iter(limits.map(|(key, value)| (key.to_string(), value.into())));
    Instance::of::<Iceoryx2Bridge>("bridge")
        .rate("200 Hz")
        .subscribe("state", "arm/state")
        .publish("target", "arm/target")
        .config("out", vec!["state"])
        .config("in", toml::Table::from_iter([("target".to_string(), toml::Value::Table(limits))]))
}

/// A graph whose source of `arm/state` is also a foreign program: `act` is called every millisecond, from the
/// tenth on.
fn graph(
    name: &str,
    max_rate: &str,
    mut act: impl FnMut(&Foreign, &Publisher<Stock, PoseTarget, ()>, u64) + Send + 'static,
) -> (Graph, Probe<PoseTarget>) {
    let (probe, run) = (Probe::for_topic("arm/target").triggered(), name.to_string());
    let mut ports = None;
    let source = Source::new("arm", "arm/state", move |tick| {
        if tick.index >= 10 {
            let (foreign, publisher) = ports.get_or_insert_with(|| {
                let foreign = Foreign::join(&run).unwrap();
                let publisher = foreign.publisher().unwrap();
                (foreign, publisher)
            });
            act(foreign, publisher, tick.index);
        }
        Some(state(tick.index))
    });
    (Graph::new(name).with(source).with(bridge(max_rate)).with(&probe), probe)
}

#[test]
fn a_pressed_stop_wins_over_newer_values_and_limits() {
    let limits = [("type", "motorium.EmergencyStop"), ("max_rate", "1 Hz")];
    let limits = toml::Table::from_iter(limits.map(|(key, value)| (key.to_string(), value.into())));
    let bridge = Instance::of::<Iceoryx2Bridge>("bridge")
        .rate("200 Hz")
        .publish("stop", "stop")
        .config("in", toml::Table::from_iter([("stop".to_string(), toml::Value::Table(limits))]));
    let (name, probe) = (name("pressed"), Probe::<EmergencyStop>::for_topic("stop").triggered());
    let run = name.clone();
    let mut port = None;
    let source = Source::new("arm", "arm/state", move |tick| {
        if tick.index >= 10 {
            let (_, publisher) = port.get_or_insert_with(|| {
                let foreign = Foreign::join(&run).unwrap();
                let service = foreign.0.service_builder(&"in/stop".try_into().unwrap());
                let service = service.publish_subscribe::<EmergencyStop>().open().unwrap();
                let publisher = service.publisher_builder().create().unwrap();
                (foreign, publisher)
            });
            // Released, pressed and released again within one step of the bridge, twice.
            if tick.index == 42 || tick.index == 82 {
                for stop in [0, tick.index, 0] {
                    publisher.send_copy(EmergencyStop { stop }).unwrap();
                }
            }
        }
        Some(state(tick.index))
    });
    Graph::new(&name).with(source).with(bridge).with(&probe).run("200 ms").unwrap();
    let pressed: Vec<u64> =
        probe.samples().iter().map(|sample| sample.value.stop).filter(|stop| *stop != 0).collect();
    assert_eq!(pressed, [42, 82]);
}

fn inbound(report: &Report) -> &Value {
    &report.results["bridge"]["in"]["arm/target"]
}

#[test]
fn foreign_values_are_published_in_order_with_own_stamps() {
    let (graph, probe) = graph(&name("in-order"), "1 kHz", |_, publisher, tick| {
        if tick % 20 == 0 {
            publisher.send_copy(target(tick / 20)).unwrap();
        }
    });
    let report = graph.run("1 s").unwrap();
    let samples = probe.samples();
    let goals: Vec<u64> = samples.iter().map(|sample| sample.value.goal).collect();
    assert_eq!(goals, (1..50).collect::<Vec<u64>>());
    let bridge = report.components.iter().position(|component| component.name == "bridge").unwrap();
    for (index, Stamp { sequence, publisher, publish_time, source_time, .. }) in
        samples.iter().map(|sample| sample.stamp).enumerate()
    {
        assert_eq!((sequence, publisher as usize), (index as u64 + 1, bridge));
        assert_eq!(source_time, publish_time, "a foreign value begins a chain");
        assert!(
            publish_time <= 1_000_000_000,
            "the bridge's clock counts, not the program's: {publish_time}"
        );
    }
    assert_eq!(
        (inbound(&report)["received"].as_u64(), inbound(&report)["published"].as_u64()),
        (Some(49), Some(49))
    );
}

#[test]
fn rate_limit_publishes_the_newest_and_counts_the_rest() {
    let (graph, probe) = graph(&name("too-fast"), "50 Hz", |_, publisher, tick| {
        publisher.send_copy(target(tick)).unwrap();
    });
    let report = graph.run("1 s").unwrap();
    let samples = probe.samples();
    assert!((48..=50).contains(&samples.len()), "{} values", samples.len());
    for pair in samples.windows(2) {
        let (before, after) = (pair[0].stamp.state_time, pair[1].stamp.state_time);
        assert!(after - before >= 20_000_000, "{} ns between two values", after - before);
        assert_eq!(pair[1].value.goal - pair[0].value.goal, 20, "the newest of 20 values");
    }
    let counts = inbound(&report);
    let (received, published) = (counts["received"].as_u64().unwrap(), counts["published"].as_u64().unwrap());
    assert_eq!(published, samples.len() as u64);
    let above = counts["refused"]["above_max_rate"].as_u64().unwrap();
    assert!(received >= 980 && (received - published - above) <= 1, "{counts}");
}

#[test]
fn non_finite_values_never_reach_the_graph() {
    let (graph, probe) = graph(&name("not-finite"), "1 kHz", |_, publisher, tick| {
        let mut value = target(tick);
        value.linear_velocity[2] = if tick % 2 == 0 { f64::NAN } else { f64::NEG_INFINITY };
        publisher.send_copy(value).unwrap();
    });
    let report = graph.run("500 ms").unwrap();
    assert_eq!(probe.samples().len(), 0);
    let refused = inbound(&report)["refused"]["not_finite"].as_u64().unwrap();
    assert_eq!(Some(refused), inbound(&report)["received"].as_u64());
    assert!(refused > 450, "{refused}");
    assert_eq!(report.exit, Exit::Finished);
}

#[test]
fn values_queued_during_a_stall_are_rejected() {
    let (graph, probe) = graph(&name("too-old"), "1 kHz", |_, publisher, tick| {
        if tick == 100 {
            (1..=3).for_each(|goal| assert!(publisher.send_copy(target(goal)).is_ok()));
            std::thread::sleep(Duration::from_millis(150));
        }
        if tick == 200 {
            publisher.send_copy(target(4)).unwrap();
        }
    });
    let report = graph.run("300 ms").unwrap();
    assert_eq!(inbound(&report)["refused"]["too_old"].as_u64(), Some(3), "{}", inbound(&report));
    assert_eq!(probe.values().iter().map(|value| value.goal).collect::<Vec<_>>(), [4]);
}

#[test]
fn a_service_rejects_other_types_and_headers() {
    let (graph, probe) = graph(&name("other-type"), "1 kHz", |foreign, publisher, tick| {
        if tick == 50 {
            let service = || foreign.0.service_builder(&"in/arm/target".try_into().unwrap());
            assert!(service().publish_subscribe::<Wrench>().open().is_err());
            assert!(service().publish_subscribe::<PoseTarget>().user_header::<Stamp>().open().is_err());
            publisher.send_copy(target(1)).unwrap();
        }
    });
    graph.run("100 ms").unwrap();
    assert_eq!(probe.samples().len(), 1);
}

#[test]
fn mirrored_state_keeps_stamp_and_bytes() {
    let mut subscriber = None;
    let mut last = 0;
    let (graph, _) = graph(&name("mirror"), "1 kHz", move |foreign, _, tick| {
        let subscriber = subscriber.get_or_insert_with(|| foreign.subscriber());
        while let Some(sample) = subscriber.receive().unwrap() {
            let stamp = *sample.user_header();
            assert!(stamp.sequence > last && stamp.sequence <= tick, "{stamp:?} at {tick}");
            last = stamp.sequence;
            assert_eq!((stamp.publisher, *sample), (0, state(stamp.sequence - 1)));
        }
        assert!(last + 6 >= tick || tick < 20, "sequence {last} at {tick}");
    });
    let report = graph.run("500 ms").unwrap();
    assert_eq!(report.exit, Exit::Finished, "{report:?}");
    let counts = &report.results["bridge"]["out"]["arm/state"];
    assert_eq!((counts["mirrored"].as_u64(), counts["unsent"].as_u64()), (Some(100), Some(0)));
}

#[test]
fn a_graph_with_a_misconfigured_bridge_is_refused() {
    let refusal = |bridge: Instance| {
        let source = Source::new("arm", "arm/state", |_| None::<JointState>);
        let error = Graph::new("refused").with(source).with(bridge).check().unwrap_err();
        error.render(false)
    };
    let empty = Instance::of::<Iceoryx2Bridge>("bridge").rate("200 Hz");
    assert!(refusal(empty.subscribe("state", "arm/state")).contains("the bridge has no ports"));
    let of_type = |name: &str| toml::Table::from_iter([("type".to_string(), name.into())]);
    let feeding = |name: &str| {
        let ports = toml::Table::from_iter([("target".to_string(), toml::Value::Table(of_type(name)))]);
        Instance::of::<Iceoryx2Bridge>("bridge").rate("200 Hz").config("in", ports)
    };
    let text = refusal(feeding("motorium.Pose").publish("target", "arm/target"));
    assert!(text.contains("there is no built-in state `motorium.Pose`"), "{text}");
    let text = refusal(bridge("0 Hz"));
    assert!(text.contains("max_rate") || text.contains("the rate"), "{text}");
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
struct NoConfig {}

/// A component that declares a topic of slices.
struct Planner;

impl Component for Planner {
    const KIND: &'static str = "test.planner";
    const SUMMARY: &'static str = "declares a plan of several poses";
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.slice_output::<PoseTarget>("plan", 8, 2, "poses to come");
        Ok(())
    }

    fn configure(_: NoConfig, _: &mut Setup) -> Result<Self, ConfigureError> {
        Err(ConfigureError::failed("it is only checked"))
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        Ok(())
    }
}

#[test]
fn a_topic_of_slices_is_not_mirrored_as_a_state() {
    let planner = Instance::of::<Planner>("planner").rate("10 Hz").publish("plan", "arm/plan");
    let mirror = Instance::of::<Iceoryx2Bridge>("bridge").rate("200 Hz");
    let mirror = mirror.subscribe("plan", "arm/plan").config("out", vec!["plan"]);
    let error = Graph::new("slices").with(planner).with(mirror).check().unwrap_err().render(false);
    assert!(error.contains("has slices at one port"), "{error}");
}

/// Foreign program of the next test. It sends as fast as possible until it is killed.
#[test]
fn flood() {
    let Ok(graph) = std::env::var("MOTORIUM_FLOODED_GRAPH") else { return };
    let foreign = loop {
        if let Some(foreign) = Foreign::join(&graph) {
            break foreign;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let publisher = loop {
        if let Some(publisher) = foreign.publisher() {
            break publisher;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let subscriber = foreign.subscriber();
    for goal in 0.. {
        let mut value = target(goal);
        value.position[0] = if goal % 3 == 0 { f64::NAN } else { 0.5 };
        let _ = publisher.send_copy(value);
        let _ = subscriber.receive();
    }
}

#[test]
fn flooding_programs_affect_only_the_limited_topic() {
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let name = name("flooded");
    let (probe, reader) = (
        Probe::<PoseTarget>::for_topic("arm/target").triggered(),
        Probe::<JointState>::for_topic("arm/state").triggered(),
    );
    let normal = |instance: Instance| instance.set("schedule", "normal");
    let graph = Graph::new(&name)
        .set("clock", "realtime")
        .with(normal(Source::new("arm", "arm/state", |tick| Some(state(tick.index))).into()))
        .with(normal(bridge("50 Hz")))
        .with(normal(
            Function::new("reader", "arm/target", "arm/copy", |_, value: Option<&PoseTarget>| value.copied())
                .into(),
        ))
        .with(normal((&probe).into()))
        .with(normal((&reader).into()));
    let flooded = name.clone();
    let program = move || -> Child {
        Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "flood", "--test-threads", "1"])
            .env("MOTORIUM_FLOODED_GRAPH", &flooded)
            .stdout(Stdio::null())
            .spawn()
            .unwrap()
    };
    let killed = std::thread::spawn({
        let mut programs = vec![program()];
        move || {
            for _ in 0..3 {
                std::thread::sleep(Duration::from_millis(900));
                programs.last_mut().unwrap().kill().unwrap();
                programs.last_mut().unwrap().wait().unwrap();
                programs.push(program());
            }
            programs
        }
    });
    let report = graph.run("4 s").unwrap();
    for mut program in killed.join().unwrap() {
        let _ = program.kill();
        let _ = program.wait();
    }
    assert_eq!(report.exit, Exit::Finished);
    let counts = inbound(&report);
    let refused = &counts["refused"];
    let of = |value: &Value| value.as_u64().unwrap();
    assert!(of(&refused["above_max_rate"]) > 100 && of(&refused["not_finite"]) > 100, "{counts}");
    // At most 50 per second, the first immediately, during 4 s and the half second in which actuators settle.
    assert!((20..=226).contains(&of(&counts["published"])), "{counts}");
    let bridge = report.components.iter().position(|component| component.name == "bridge").unwrap();
    for pair in probe.samples().windows(2) {
        assert_eq!(pair[0].stamp.publisher as usize, bridge);
        assert!(pair[1].stamp.state_time - pair[0].stamp.state_time >= 20_000_000);
    }
    assert!(reader.samples().iter().all(|sample| sample.stamp.publisher == 0));
    for component in &report.components {
        assert_eq!((component.allocations, component.restarts), (Some(0), 0), "{component:?}");
    }
    let left: Vec<_> =
        std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.file_name()).collect();
    assert!(left.iter().all(|left| !left.to_string_lossy().contains(&name)), "{left:?}");
}
