//! Sources, functions and probes.

use motorium::launcher::Exit;
use motorium::state::{JointState, Phase, Wrench};
use motorium::testing::{Function, Graph, Probe, Source, allocations, machine};

fn joint(position: f64) -> JointState {
    let mut state = JointState::default();
    state.set_count(1);
    state.position_mut()[0] = position;
    state
}

/// Returns a graph that counts at 1 kHz in `count` and doubles the count in `doubled`.
fn doubling() -> Graph {
    Graph::new("doubling").with(Source::new("counter", "count", |tick| Some(joint(tick.index as f64)))).with(
        Function::new::<JointState, Wrench>("doubler", "count", "doubled", |_, count| {
            Some(Wrench { force: [2.0 * count?.position()[0], 0.0, 0.0], ..Wrench::default() })
        })
        .trigger("count"),
    )
}

#[test]
fn probe_records_every_value_of_a_chain_once_and_in_order() {
    let probe = Probe::<Wrench>::for_topic("doubled");
    let report = doubling().with(&probe).run("20 ms").unwrap();
    assert_eq!(report.exit, Exit::Finished);
    let doubled: Vec<f64> = probe.values().iter().map(|wrench| wrench.force[0]).collect();
    let expected: Vec<f64> = (0..20).map(|index| 2.0 * f64::from(index)).collect();
    assert_eq!(doubled, expected);
    let samples = probe.samples();
    assert!(samples.iter().enumerate().all(|(i, sample)| sample.stamp.sequence == i as u64 + 1));
    assert!(samples.iter().enumerate().all(|(i, sample)| sample.tick.index == i as u64));
}

#[test]
fn source_publishes_nothing_if_its_closure_returns_none() {
    let probe = Probe::<JointState>::for_topic("even");
    let even =
        |tick: &motorium::component::Tick| tick.index.is_multiple_of(2).then(|| joint(tick.index as f64));
    Graph::new("even").with(Source::new("source", "even", even)).with(&probe).run("10 ms").unwrap();
    let seen: Vec<f64> = probe.values().iter().map(|state| state.position()[0]).collect();
    assert_eq!(seen, [0.0, 2.0, 4.0, 6.0, 8.0]);
}

#[test]
fn slow_probe_reads_the_newest_value_only() {
    let probe = Probe::<JointState>::for_topic("count").rate("100 Hz");
    let source = Source::new("counter", "count", |tick| Some(joint(tick.index as f64)));
    Graph::new("slow").with(source).with(&probe).run("30 ms").unwrap();
    let seen: Vec<f64> = probe.values().iter().map(|state| state.position()[0]).collect();
    assert_eq!(seen, [0.0, 10.0, 20.0]);
}

#[test]
fn parts_are_added_to_the_text_of_a_graph_file() {
    let text = "name = \"text\"\nclock = \"lockstep\"\nseed = 3\n";
    let probe = Probe::<Phase>::for_topic("phase").triggered();
    let source =
        Source::new("source", "phase", |tick| Some(Phase { phase: tick.time(), ..Phase::default() }));
    let report = Graph::from_toml(text).with(source.rate("100 Hz")).with(&probe).run("50 ms").unwrap();
    assert_eq!(report.graph, "text");
    assert_eq!(probe.values().len(), 5);
    let times: Vec<u64> = probe.samples().iter().map(|sample| sample.time_ns / 1_000_000).collect();
    assert_eq!(times, [0, 10, 20, 30, 40]);
}

#[test]
fn equal_runs_of_closures_have_equal_state_hashes() {
    let run = || doubling().with(&Probe::<Wrench>::for_topic("doubled")).run("50 ms").unwrap().state_hash;
    assert!(run().is_some());
    assert_eq!(run(), run());
}

#[test]
fn refused_graph_has_the_errors_of_check() {
    let error = doubling().set("counter.rat", "\"1 kHz\"").run("1 ms").unwrap_err();
    assert!(format!("{error:?}").contains("did you mean `rate`?"), "{error:?}");
}

#[test]
fn only_an_allocating_closure_step_counts_allocations() {
    let probe = Probe::<Wrench>::for_topic("doubled");
    let report = doubling().with(&probe).run("500 ms").unwrap();
    for component in &report.components {
        assert_eq!(component.allocations, Some(0), "{}", component.name);
    }
    let wasteful = Source::new("wasteful", "count", |tick| {
        let list = std::hint::black_box(vec![tick.index as f64]);
        Some(joint(list[0]))
    });
    let report = Graph::new("wasteful")
        .with(wasteful)
        .with(&Probe::<JointState>::for_topic("count"))
        .run("500 ms")
        .unwrap();
    assert_eq!(report.components[0].allocations, Some(report.components[0].steps - 100));
    assert_eq!(allocations(|| std::hint::black_box(Vec::<u8>::with_capacity(9))), 1);
    assert_eq!(allocations(|| std::hint::black_box(1 + 1)), 0);
}

#[test]
fn parts_run_in_real_time() {
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let probe = Probe::<Wrench>::for_topic("doubled").triggered();
    let report = doubling().with(&probe).set("clock", "realtime").run("200 ms").unwrap();
    assert_eq!(report.exit, Exit::Finished);
    let doubled: Vec<f64> = probe.values().iter().map(|wrench| wrench.force[0]).collect();
    assert!(!doubled.is_empty() && doubled.is_sorted(), "{doubled:?}");
}
