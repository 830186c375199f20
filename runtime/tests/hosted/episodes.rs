//! Episodes: a reset leaves nothing behind in queues, slices and rounds.

use std::time::Duration;

use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::prelude::*;
use motorium::raw::RawInput;
use motorium::session::Session;
use motorium::transport::{SliceInput, SliceOutput};
use motorium::worker::{Kind, Registry, RobotSource};

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoConfig {}

/// Publishes numbers derived from its step and the episode's seed as a stream of single values, as slices,
/// and as a state.
struct Feed {
    single: Output<Wrench>,
    slices: SliceOutput<f64>,
    state: Output<Wrench>,
    other: Output<Wrench>,
    seed: f64,
}

fn wrench(number: f64) -> Wrench {
    Wrench { force: [number, 0.0, 0.0], ..Wrench::default() }
}

impl Component for Feed {
    const KIND: &'static str = "test.feed";
    const SUMMARY: &'static str = "publishes";
    const RESETS: bool = true;
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.stream_output::<Wrench>("single", 8, "single values");
        declare.slice_output::<f64>("slices", 4, 8, "slices");
        declare.output::<Wrench>("state", "the newest value");
        declare.stream_output::<Wrench>("other", 8, "single values, read as bytes");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let seed = (setup.seed() % 1_000) as f64;
        let (single, slices) = (setup.output("single")?, setup.slice_output("slices")?);
        Ok(Self { single, slices, state: setup.output("state")?, other: setup.output("other")?, seed })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let number = self.seed + tick.index as f64;
        self.single.send(&wrench(number))?;
        self.other.send(&wrench(-number))?;
        let mut slice = self.slices.loan(1 + tick.index as usize % 4)?;
        slice.fill(number);
        slice.publish()?;
        // Not in every step, so that readers sometimes find an older value.
        if tick.index.is_multiple_of(3) { self.state.send(&wrench(number)) } else { Ok(()) }
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.seed = (episode.seed % 1_000) as f64;
        Ok(())
    }
}

/// Reads all topics, too rarely to empty the queues, and publishes sums of the read values.
struct Eat {
    single: Input<Wrench>,
    slices: SliceInput<f64>,
    state: Input<Wrench>,
    raw: RawInput,
    sums: Output<Wrench>,
    lost: u64,
}

impl Component for Eat {
    const KIND: &'static str = "test.eat";
    const SUMMARY: &'static str = "reads";
    const RESETS: bool = true;
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.stream_input::<Wrench>("single", 8, "single values");
        declare.slice_input::<f64>("slices", 8, "slices");
        declare.input::<Wrench>("state", "the newest value");
        declare.raw_input("raw", "the newest value as bytes");
        declare.output::<Wrench>("sums", "sums of what was read");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            single: setup.input("single")?,
            slices: setup.slice_input("slices")?,
            state: setup.input("state")?,
            raw: setup.raw_input("raw")?,
            sums: setup.output("sums")?,
            lost: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let mut sums = Wrench::default();
        // Two of the five values since the last step.
        for _ in 0..2 {
            let held = self.single.current().map_or(-1.0, |value| value.force[0]);
            sums.force[0] += held + self.single.next_unread().map_or(0.0, |value| value.force[0]);
            let held = self.slices.current().map_or(-1.0, |(_, slice)| slice.len() as f64);
            sums.force[1] += held + self.slices.next_unread().map_or(0.0, |(_, slice)| slice.iter().sum());
        }
        sums.force[2] = self.state.latest().map_or(-1.0, |value| value.force[0]);
        sums.torque[0] =
            self.raw.next_unread().map_or(-1.0, |value| value.bytes.iter().map(|b| f64::from(*b)).sum());
        sums.torque[1] = (self.single.lost() + self.slices.lost() - self.lost) as f64;
        sums.torque[2] = tick.index as f64;
        self.sums.send(&sums)
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.lost = self.single.lost() + self.slices.lost();
        Ok(())
    }
}

const GRAPH: &str = r#"
    name = "feeding"
    clock = "lockstep"
    seed = 4
    [component.feed]
    kind = "test.feed"
    rate = "1 kHz"
    publish = { single = "single", slices = "slices", state = "state", other = "other" }
    [component.eat]
    kind = "test.eat"
    rate = "200 Hz"
    phase = "2 ms"
    subscribe = { single = "single", slices = "slices", state = "state", raw = "other" }
    publish = { sums = "sums" }
"#;

fn feeding(options: &Options) -> Session<'static> {
    let kinds = [Kind::of::<Feed>(), Kind::of::<Eat>()];
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds);
    let checked = graph::check("feeding.toml".as_ref(), GRAPH.into(), &[], &registry, &Machine::detect());
    let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    Session::launch(plan, &registry, options).expect("it starts")
}

/// Returns the sums in each step of the reader, and the hash of the episode.
fn meal(session: &mut Session<'_>, ms: u64) -> (Vec<Wrench>, String) {
    let mut sums = Vec::new();
    for round in 1..=ms {
        session.step_until(Duration::from_millis(round)).expect("it steps");
        if round % 5 == 3 {
            sums.push(session.read::<Wrench>("sums").expect("a state").expect("was published").value);
        }
    }
    (sums, session.state_hash())
}

#[test]
fn reset_empties_queues_slices_and_states() {
    for options in [Options::inline(), Options::threads()] {
        let mut session = feeding(&options);
        let first = meal(&mut session, 38);
        assert!(
            first.0.iter().any(|sums| sums.torque[1] > 0.0),
            "queues overflow, so they are full at the reset"
        );
        for _ in 0..3 {
            session.reset(4).expect("both can be set back");
            assert!(session.read::<Wrench>("sums").expect("a state").is_none());
            assert_eq!(meal(&mut session, 38), first);
        }
        session.reset(5).expect("both can be set back");
        assert_ne!(meal(&mut session, 38), first, "another seed");
        session.reset(4).expect("both can be set back");
        assert_eq!(meal(&mut session, 11).0, first.0[..2], "an episode may be shorter");
        session.reset(4).expect("both can be set back");
        assert_eq!(meal(&mut session, 38), first);
        let report = session.stop();
        assert_eq!(report.episodes.len(), 7);
        assert_eq!(report.components[0].steps, 6 * 38 + 11);
        assert!((report.duration_s - 0.239).abs() < 1e-9, "{}", report.duration_s);
        assert!((report.components[0].rate_hz - 1_000.0).abs() < 1.0, "{}", report.components[0].rate_hz);
    }
}

#[test]
fn single_rounds_equal_a_step_over_the_same_time() {
    let (mut stretch, mut rounds) = (feeding(&Options::inline()), feeding(&Options::inline()));
    stretch.step_until(Duration::from_millis(25)).expect("it steps");
    for _ in 0..25 {
        rounds.step().expect("it steps");
    }
    assert_eq!(rounds.state_hash(), stretch.state_hash());
    assert!(rounds.time() < Duration::from_millis(25));
}

#[test]
fn observer_of_a_session_sees_its_start_and_end() {
    let kinds = [Kind::of::<Feed>(), Kind::of::<Eat>()];
    let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds);
    let checked = graph::check("feeding.toml".as_ref(), GRAPH.into(), &[], &registry, &Machine::detect());
    let plan = checked.expect("a good graph").plan;
    let mut seen = Vec::new();
    let mut session = Session::observed(plan, &registry, &Options::inline(), |event| {
        seen.push(format!("{event:?}").split([' ', '(', '{']).next().unwrap_or_default().to_string());
    })
    .expect("it starts");
    session.step_until(Duration::from_millis(20)).expect("it steps");
    session.stop();
    assert_eq!(seen[..2], ["Created", "Started"]);
    assert!(seen.iter().any(|event| event == "Status"), "{seen:?}");
}
