//! Catalogue of all measurements, by name.

use super::{Bench, Outcome, Samples};
use crate::graphs::{self, LatentFiles, PolicyFiles, Ran};
use crate::pair::{self, PingPong, Transport};
use crate::raw_chain::{self, RawChain};
use crate::read::Reader;
use crate::{Distribution, MeasureError, read, timer};

/// A measurement that `motorium bench latency` can make.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Name of the case.
    pub name: String,
    /// Description of the measured value.
    pub what: String,
    /// `true` if the case is measured under background load.
    pub loaded: bool,
    /// `true` if `--quick` includes the case.
    pub quick: bool,
    /// Group of cases that are compared with each other and therefore measured alternately in slices; `None`
    /// for a separate case.
    pub group: Option<&'static str>,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Clock,
    Timer,
    PingPong { transport: Transport, across: bool, bytes: usize, paced: bool },
    Release { rate_hz: u32 },
    Chain { processes: usize },
    TracedChain { processes: usize },
    RawChain { processes: usize },
    Caterpillar,
    FanOut { readers: usize },
    Gate { gated: bool },
    Episode { first: bool },
    RawPorts { slices: bool },
    Panda,
    PandaPolicy,
    JointTargets { floor: bool },
    Latent,
    Read { bytes: usize, reader: Reader },
}

/// Time between two round trips of a paced ping-pong, ns: the receiver sleeps deeply.
const PACE_NS: u64 = 1_000_000;

/// Events per step kept by the trace of a traced chain, as in `motorium trace`.
const TRACED: usize = 1 << 14;

/// Groups of compared measurements.
const GROUPS: &[(&str, &[&str])] = &[
    (
        "polling across cores",
        &["floor.cache-line", "floor.plain.512", "floor.plain-checked.512", "hop.polling.across.512"],
    ),
    ("blocking on one core", &["floor.futex.same", "hop.blocking.same.512", "iceoryx2.same.512"]),
    ("blocking across cores", &["floor.futex.across", "hop.blocking.across.512", "iceoryx2.across.512"]),
    (
        "64 KiB across cores",
        &["floor.plain-blocking.65536", "floor.plain-checked.65536", "hop.blocking.across.65536"],
    ),
    (
        "1 MiB across cores",
        &["floor.plain-blocking.1048576", "floor.plain-checked.1048576", "hop.blocking.across.1048576"],
    ),
    ("release at 1 kHz", &["floor.timer", "release.1khz"]),
    ("chain of 4", &["floor.chain.4", "chain.4"]),
    ("chain of 8", &["floor.chain.8", "chain.8", "chain.8.traced"]),
    ("command gate", &["floor.gate", "gate"]),
    ("first step of an episode", &["floor.episode", "episode"]),
    ("blocking across cores, 1 kHz", &["floor.futex.across.1khz", "hop.blocking.across.1khz.512"]),
    ("steps of joint targets", &["floor.joint-targets", "joint-targets"]),
    ("Panda loop", &["panda", "panda.policy", "panda.loaded"]),
    ("release at 1 kHz, under load", &["floor.timer.loaded", "release.1khz.loaded"]),
    ("blocking on one core, under load", &["floor.futex.same.loaded", "hop.blocking.same.512.loaded"]),
];

/// Returns the group in which a measurement takes turns, if any.
pub(super) fn group(name: &str) -> Option<&'static str> {
    GROUPS.iter().find(|(_, names)| names.contains(&name)).map(|(group, _)| *group)
}

/// Returns all cases, in the order of measurement. Cases that are compared with each other are adjacent.
pub fn catalogue() -> Vec<Case> {
    use Transport::{
        Blocking, CacheLine, Futex, Plain, PlainBlocking, PlainBlockingChecked, PlainChecked, Polling, Stock,
    };
    let mut cases = Vec::new();
    let mut add = |name: String, what: String, quick: bool, kind: Kind| {
        let group = group(&name);
        cases.push(Case { name, what, loaded: false, quick, group, kind });
    };
    let ping_pong = |transport, across, bytes, paced| Kind::PingPong { transport, across, bytes, paced };
    let words = |across| if across { ("across", "across cores") } else { ("same", "on one core") };
    add("floor.clock".into(), "one reading of the clock, mean of 100".into(), true, Kind::Clock);
    add("floor.timer".into(), "wake-up by clock_nanosleep, 1 kHz".into(), true, Kind::Timer);
    let line = "cache line, half of a round trip across cores".to_string();
    add("floor.cache-line".into(), line, true, ping_pong(CacheLine, true, 64, false));
    let plain = "a word and 512 B of plain memory across cores, written and read".to_string();
    add("floor.plain.512".into(), plain, true, ping_pong(Plain, true, 512, false));
    let checked = "512 B of plain memory across cores, checked and stamped".to_string();
    add("floor.plain-checked.512".into(), checked, true, ping_pong(PlainChecked, true, 512, false));
    for bytes in [65_536, 1_048_576] {
        let what = format!("futex across cores and {} of plain memory, written and read", size(bytes));
        add(
            format!("floor.plain-blocking.{bytes}"),
            what,
            false,
            ping_pong(PlainBlocking, true, bytes, false),
        );
        let checked = format!("futex across cores and {} of plain memory, checked and stamped", size(bytes));
        let name = format!("floor.plain-checked.{bytes}");
        add(name, checked, false, ping_pong(PlainBlockingChecked, true, bytes, false));
    }
    let what = "reading the newest state of 1 MiB without touching its bytes".to_string();
    add("read.newest.1048576".into(), what, true, Kind::Read { bytes: 1_048_576, reader: Reader::Component });
    for bytes in [512, 1_048_576] {
        let what = format!("the same from outside the graph, {}", size(bytes));
        add(format!("read.outside.{bytes}"), what, true, Kind::Read { bytes, reader: Reader::Outside });
    }
    for bytes in [64, 512, 4096, 65_536, 1_048_576] {
        let size = size(bytes);
        let quick = bytes == 512;
        let (name, what) =
            (format!("hop.polling.across.{bytes}"), format!("polling hop across cores, {size}"));
        add(name, what, quick, ping_pong(Polling, true, bytes, false));
    }
    let what = "polling hop on one core, 512 B, yielding".to_string();
    add("hop.polling.same.512".into(), what, false, ping_pong(Polling, false, 512, false));
    for across in [false, true] {
        let (place, there) = words(across);
        let what = format!("raw futex hand-off {there}");
        add(format!("floor.futex.{place}"), what, true, ping_pong(Futex, across, 64, false));
        for bytes in [512, 64, 4096, 65_536, 1_048_576] {
            let what = format!("blocking hop {there}, {}", size(bytes));
            let name = format!("hop.blocking.{place}.{bytes}");
            add(name, what, bytes == 512, ping_pong(Blocking, across, bytes, false));
            if bytes == 512 {
                let what = format!("stock iceoryx2 event + publish-subscribe {there}, 512 B");
                add(format!("iceoryx2.{place}.512"), what, true, ping_pong(Stock, across, 512, false));
            }
        }
    }
    let what = "raw futex across cores, 1 kHz: the receiver sleeps".to_string();
    add("floor.futex.across.1khz".into(), what, false, ping_pong(Futex, true, 64, true));
    let what = "blocking hop across cores, 512 B, 1 kHz".to_string();
    add("hop.blocking.across.1khz.512".into(), what, false, ping_pong(Blocking, true, 512, true));
    for rate_khz in [1, 4] {
        let what = format!("release lateness at {rate_khz} kHz, sleep then spin");
        add(
            format!("release.{rate_khz}khz"),
            what,
            rate_khz == 1,
            Kind::Release { rate_hz: 1_000 * rate_khz },
        );
    }
    for processes in [2, 4, 8] {
        if processes > 2 {
            let what = format!("raw futex chain of {processes} processes on one core, 512 B, end to end");
            add(format!("floor.chain.{processes}"), what, processes == 4, Kind::RawChain { processes });
        }
        let what = format!("chain of {processes} processes on one core, end to end");
        add(format!("chain.{processes}"), what, processes == 4, Kind::Chain { processes });
    }
    let what = "chain of 8 processes on one core, each step traced, end to end".to_string();
    add("chain.8.traced".into(), what, false, Kind::TracedChain { processes: 8 });
    let what = "caterpillar of 17 processes on one core, end to end".to_string();
    add("chain.17".into(), what, false, Kind::Caterpillar);
    for readers in [1, 2, 4, 8] {
        let what = format!("fan-out to {readers} on one core, the last reader");
        add(format!("fan-out.{readers}"), what, false, Kind::FanOut { readers });
    }
    let what = "a command of 7 joints applied, its numbers and age checked and nothing else".to_string();
    add("floor.gate".into(), what, false, Kind::Gate { gated: false });
    let what = "a command of 7 joints applied through the command gate".to_string();
    add("gate".into(), what, false, Kind::Gate { gated: true });
    let what = "release to first instruction of a step within an episode, 1 kHz".to_string();
    add("floor.episode".into(), what, false, Kind::Episode { first: false });
    let what = "the same of the first step of an episode".to_string();
    add("episode".into(), what, false, Kind::Episode { first: true });
    for (name, slices) in [("stream", false), ("slices", true)] {
        let what = format!("raw port, {name} at 10 kHz: publication to reading, none lost");
        add(format!("raw.{name}.10khz"), what, false, Kind::RawPorts { slices });
    }
    let what = "step of an empty component, triggered as policy.joint_targets is".to_string();
    add("floor.joint-targets".into(), what, false, Kind::JointTargets { floor: true });
    let what = "step of policy.joint_targets at 1 kHz, with its policy at 50 Hz".to_string();
    add("joint-targets".into(), what, false, Kind::JointTargets { floor: false });
    add("latent".into(), "step of policy.latent for three arms at 1 kHz".into(), false, Kind::Latent);
    add("panda".into(), "Panda loop, state to command".into(), false, Kind::Panda);
    let what = "the same with a policy of 54,464 weights in the loop".to_string();
    add("panda.policy".into(), what, false, Kind::PandaPolicy);
    for name in
        ["floor.timer", "floor.futex.same", "hop.blocking.same.512", "release.1khz", "chain.4", "panda"]
    {
        let case = cases.iter().find(|case| case.name == name).cloned();
        cases.extend(case.map(|case| Case {
            name: format!("{name}.loaded"),
            what: format!("{}, under load", case.what),
            loaded: true,
            quick: false,
            group: group(&format!("{name}.loaded")),
            ..case
        }));
    }
    cases
}

fn size(bytes: usize) -> String {
    match bytes {
        1_048_576.. => format!("{} MiB", bytes >> 20),
        4096.. => format!("{} KiB", bytes >> 10),
        _ => format!("{bytes} B"),
    }
}

impl Case {
    /// Returns `true` if `word`, an argument of `--only`, selects the case. `word` may be the name of the
    /// case or the beginning of the name up to a dot.
    pub fn is_meant_by(&self, word: &str) -> bool {
        self.name.strip_prefix(word).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    }

    /// Returns `true` for a graph or a chain of processes, which is slow to start.
    pub(super) fn is_graph(&self) -> bool {
        !matches!(self.kind, Kind::Clock | Kind::Timer | Kind::Read { .. } | Kind::PingPong { .. })
    }

    /// Runs the measurement: returns all samples and the granted priority.
    pub(super) fn run(&self, bench: &Bench<'_>) -> Result<Outcome, MeasureError> {
        let core = bench.places.realtime;
        match &self.kind {
            Kind::Clock => Ok(Outcome::from_samples(timer::clock(), 0)),
            Kind::Read { bytes, reader } => {
                let reads = bench.samples.min(10_000);
                let (took, fifo) = read::newest(bench.registry, (*bytes, *reader), reads, core, bench.fifo)?;
                Ok(Outcome::from_samples(took, fifo))
            }
            Kind::Timer => {
                let measured = timer::timer(core, bench.fifo, 1_000 * bench.seconds as usize)?;
                Ok(Outcome::from_samples(measured.late_ns, u32::from(measured.fifo)))
            }
            Kind::PingPong { transport, across, bytes, paced } => {
                let other = bench.places.other.ok_or(MeasureError::Needs("a second core"));
                let samples = bench.samples;
                // Two samples per round trip, except one for the cache line and for a paced ping-pong.
                let rounds = match (transport, paced) {
                    (_, true) => bench.paced.min(samples),
                    (Transport::CacheLine, _) => samples,
                    _ => samples.div_ceil(2),
                };
                let ping_pong = PingPong {
                    transport: *transport,
                    bytes: *bytes,
                    cores: [if *across { other? } else { core }, core],
                    fifo: bench.fifo,
                    rounds,
                    warm_up: if *paced { rounds / 10 } else { rounds.min(1_000) },
                    pace_ns: if *paced { PACE_NS } else { 0 },
                };
                let measured = pair::measure(&bench.program, bench.registry, &ping_pong)?;
                Ok(Outcome::from_samples(measured.samples, measured.fifo))
            }
            Kind::Release { rate_hz } => {
                let seconds = if *rate_hz > 1_000 { bench.fast_seconds } else { bench.seconds };
                let ran = bench.launch(graphs::release(*rate_hz, seconds, core))?;
                Ok(graph(&ran, ran.lateness.first().cloned().unwrap_or_default()))
            }
            Kind::Chain { processes } => {
                way(&bench.launch(graphs::chain(*processes, bench.seconds, core))?, "tail")
            }
            Kind::TracedChain { processes } => {
                let text = graphs::chain(*processes, bench.seconds, core);
                let ran = graphs::run_traced(&bench.program, bench.registry, "bench.toml", text, TRACED)?;
                way(&ran, "tail")
            }
            Kind::RawChain { processes } => {
                let chain = RawChain {
                    processes: *processes,
                    core,
                    fifo: bench.fifo,
                    rounds: 1_000 * u64::from(bench.seconds),
                };
                let (samples, fifo) = raw_chain::measure(&bench.program, &chain)?;
                Ok(Outcome::from_samples(samples, fifo))
            }
            Kind::Caterpillar => way(&bench.launch(graphs::caterpillar(bench.seconds, core))?, "tail"),
            Kind::FanOut { readers } => {
                let ran = bench.launch(graphs::fan_out(*readers, bench.seconds, core))?;
                let tails = (1..=*readers).map(|i| way(&ran, &format!("tail-{i}")));
                let tails: Vec<_> = tails.collect::<Result<_, _>>()?;
                let last = tails.into_iter().max_by_key(|outcome| outcome.samples.p50());
                last.ok_or_else(|| MeasureError::Ended("no reader has measured anything".to_string()))
            }
            Kind::Gate { gated } => {
                let ran = bench.launch(graphs::gate(*gated, bench.seconds, core))?;
                let seen = ran.result("actuator", "step_ns");
                let none = || MeasureError::Ended("the actuator has followed no command".to_string());
                Ok(graph(&ran, seen.ok_or_else(none)?))
            }
            Kind::Episode { first } => {
                let ran = bench.launch(graphs::episodes(bench.seconds, core))?;
                let seen = ran.result("counter", if *first { "first_ns" } else { "other_ns" });
                let none = || MeasureError::Ended("no episode has begun".to_string());
                Ok(graph(&ran, seen.ok_or_else(none)?))
            }
            Kind::RawPorts { slices } => {
                let ran = bench.launch(graphs::raw_ports(*slices, bench.seconds, core))?;
                let none = || MeasureError::Ended("the sink has read nothing".to_string());
                let age: Distribution = ran.result("sink", "age_ns").ok_or_else(none)?;
                match ran.result::<u64>("sink", "lost") {
                    Some(0) => Ok(graph(&ran, age)),
                    lost => Err(MeasureError::Lost { lost: lost.unwrap_or_default(), read: age.count }),
                }
            }
            Kind::JointTargets { floor } => {
                let folder = PolicyFiles::new(50)?;
                let (text, component) = match floor {
                    true => (graphs::joint_reader(folder.path(), bench.seconds), "floor"),
                    false => (graphs::policy(folder.path(), false, bench.seconds), "targets"),
                };
                let ran = bench.launch(text)?;
                Ok(graph(&ran, ran.steps_of(component)?))
            }
            Kind::Latent => {
                let folder = LatentFiles::new()?;
                let ran = bench.launch(graphs::latent(folder.path(), bench.seconds))?;
                Ok(graph(&ran, ran.steps_of("mimic")?))
            }
            Kind::PandaPolicy => {
                let folder = PolicyFiles::new(1_000)?;
                let ran = bench.launch(graphs::policy(folder.path(), true, bench.panda_seconds))?;
                Ok(graph(&ran, ran.latencies.first().cloned().unwrap_or_default()))
            }
            Kind::Panda => {
                let ran = bench.launch(graphs::panda(bench.panda_seconds))?;
                Ok(graph(&ran, ran.latencies.first().cloned().unwrap_or_default()))
            }
        }
    }
}

impl Bench<'_> {
    fn launch(&self, text: String) -> Result<Ran, MeasureError> {
        graphs::run(&self.program, self.registry, "bench.toml", text)
    }
}

/// Returns the latency from the head of a chain to a relay's read of the payload.
fn way(ran: &Ran, relay: &str) -> Result<Outcome, MeasureError> {
    let seen = ran.result(relay, "way_ns");
    let seen = seen.ok_or_else(|| MeasureError::Ended(format!("`{relay}` has read nothing")))?;
    Ok(graph(ran, seen))
}

/// Measurements of a graph.
fn graph(ran: &Ran, seen: Distribution) -> Outcome {
    Outcome { samples: Samples::Histogram(seen), fifo: ran.fifo(), causes: Some(ran.causes()) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn case_names_are_unique() {
        let cases = catalogue();
        let names: BTreeSet<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        assert_eq!(names.len(), cases.len());
    }

    #[test]
    fn compared_cases_are_in_the_catalogue() {
        let cases = catalogue();
        for (group, names) in GROUPS {
            for name in *names {
                let case = cases.iter().find(|case| case.name == *name);
                assert_eq!(case.and_then(|case| case.group), Some(*group), "{name}");
            }
        }
    }

    #[test]
    fn a_word_means_a_name_or_a_family_of_names() {
        let meant = |word: &str| catalogue().iter().filter(|case| case.is_meant_by(word)).count();
        assert_eq!(meant("hop.blocking.same.512"), 2, "idle and under load");
        assert_eq!(meant("floor.timer.loaded"), 1);
        assert_eq!(meant("fan-out"), 4);
        assert_eq!(meant("fan"), 0);
    }
}
