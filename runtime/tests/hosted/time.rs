//! Times of states, in both clocks.

use motorium::state::JointState;
use motorium::testing::{Function, Graph, Probe, Sample, Source, machine};

const PERIOD_NS: u64 = 2_000_000;

fn state() -> JointState {
    let mut state = JointState::default();
    state.set_count(1);
    state
}

/// Runs a source at 500 Hz and a chain of two functions that it triggers. Returns the samples of the source
/// and of the end of the chain.
fn chain(clock: &str) -> [Vec<Sample<JointState>>; 2] {
    let [first, last] = ["first", "last"].map(Probe::<JointState>::for_topic);
    let copy = |name: &str, from: &str, to: &str| {
        Function::new::<JointState, JointState>(name, from, to, |_, state| state.copied()).trigger(from)
    };
    let slow = |_: &motorium::component::Tick| {
        // publishes well after its release
        std::thread::sleep(std::time::Duration::from_micros(200));
        Some(state())
    };
    Graph::new("chain")
        .set("clock", clock)
        .with(Source::new("source", "first", slow).rate("500 Hz"))
        .with(copy("one", "first", "middle"))
        .with(copy("two", "middle", "last"))
        .with(&first.clone().triggered())
        .with(&last.clone().triggered())
        .run("200 ms")
        .unwrap();
    [first.samples(), last.samples()]
}

fn keeps_to_the_grid(samples: &[Sample<JointState>]) {
    assert!(samples.len() > 10, "{} samples", samples.len());
    assert!(samples.iter().all(|sample| sample.time_ns % PERIOD_NS == 0));
    assert!(samples.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
}

#[test]
fn state_in_lockstep_has_the_time_of_its_tick() {
    let [first, last] = chain("lockstep");
    keeps_to_the_grid(&first);
    keeps_to_the_grid(&last);
    assert_eq!(first.len(), 100);
    assert!(first.iter().all(|sample| sample.time_ns == sample.tick.time_ns));
    assert!(first.iter().zip(&last).all(|(first, last)| first.time_ns == last.time_ns));
}

#[test]
fn state_in_real_time_has_its_scheduled_release() {
    let _machine = machine(env!("CARGO_TARGET_TMPDIR"));
    let [first, last] = chain("realtime");
    for samples in [&first, &last] {
        keeps_to_the_grid(samples);
        for sample in samples {
            // the step lasted at least 200 us, which did not change the time of its state
            assert!(sample.stamp.publish_time - sample.stamp.state_time >= 200_000);
            assert!(sample.stamp.source_time > sample.stamp.state_time);
        }
    }
}
