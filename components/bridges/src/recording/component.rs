//! `log.record`: records every sample of chosen topics into an MCAP file.
//!
//! In real time, one thread reads the topics by taps, on the shared cores with the lowest real-time priority.
//! Another thread writes the file at normal priority. The steps of the component do nothing, and the
//! publishers are not affected. In lockstep the steps record, so no sample is lost at any speed.
//!
//! An error that ends a recording, such as a full disk, does not end the run.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use motorium::declare::{ClockKind, Taps, TopicPattern};
use motorium::plan::Plan;
use motorium::prelude::*;
use motorium::telemetry::set_apart;
use motorium::units::TimeSpan;

use super::outcome::{Outcome, note};
use super::recorder::Recorder;
use super::settings::Settings;
use super::threads;

/// Longest interval between two polls of the topics. Each poll costs processor time and evicts cache lines of
/// the publishers, so polls are infrequent.
const POLL: Duration = Duration::from_millis(50);
/// Poll interval for topics with an unknown period.
const OFTEN: Duration = Duration::from_millis(5);

/// Configuration of `log.record`.
///
/// ```toml
/// output = "out/run.mcap"
/// topics = ["*"]
/// drawn_every = "50 ms"
/// bridges = "200 ms"
/// attach = []
/// ```
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordConfig {
    /// Path of the file, relative to the folder of the graph; an existing file is replaced.
    #[schemars(extend("format" = "path"))]
    pub output: PathBuf,
    /// Names of the recorded topics; `*` matches any characters. Default: all topics of single values.
    #[serde(default = "all")]
    pub topics: Vec<String>,
    /// Minimum interval between two messages of a viewer channel, such as link poses. Exact channels contain
    /// every sample. Default 20 ms.
    #[serde(default = "drawn_every")]
    pub drawn_every: TimeSpan,
    /// Longest delay of the recorder that loses no samples, 1 ms to 10 s. The graph buffers the values of
    /// each state for this time. The recorder polls four times within this time, and at least every 50 ms.
    /// Default 200 ms.
    #[serde(default = "bridges")]
    pub bridges: TimeSpan,
    /// Length of the last part of a failed run that is recorded. The samples are kept in memory and written
    /// when the run ends with an error; a successful run leaves no file. Default: the whole run is written.
    #[serde(default)]
    pub last: Option<TimeSpan>,
    /// Files to attach to the recording. Default: an empty list.
    #[serde(default)]
    #[schemars(extend("format" = "path"))]
    pub attach: Vec<PathBuf>,
}

fn all() -> Vec<String> {
    vec!["*".to_string()]
}

fn drawn_every() -> TimeSpan {
    TimeSpan { ns: 20_000_000 }
}

fn bridges() -> TimeSpan {
    TimeSpan { ns: 200_000_000 }
}

impl RecordConfig {
    fn taps(&self) -> Taps {
        Taps::new(self.topics.iter().map(String::as_str), self.bridges.into())
    }
}

/// A component that records every sample of chosen topics into an MCAP file.
pub struct Record {
    output: PathBuf,
    /// The recorder in lockstep, where the steps record.
    recorder: Option<Recorder>,
    outcome: Arc<Mutex<Outcome>>,
}

impl Component for Record {
    const KIND: &'static str = "log.record";
    const SUMMARY: &'static str = "records every sample of topics into an MCAP file";
    const RESETS: bool = true;
    type Config = RecordConfig;

    fn declare(config: &RecordConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if config.output.as_os_str().is_empty() {
            return Err(ConfigError::key("output", "the path is empty")
                .advise("name a file such as \"out/run.mcap\""));
        }
        let allowed = Duration::from_millis(1)..=Duration::from_secs(10);
        if !allowed.contains(&config.bridges.into()) {
            let found = format!("{}, expected 1 ms to 10 s", config.bridges);
            return Err(ConfigError::key("bridges", found));
        }
        if config.last.is_some_and(|last| last.ns == 0) {
            let found = "0 s, expected a time above 0";
            return Err(ConfigError::key("last", found).advise("name a time such as \"30 s\""));
        }
        let steps_record = declare.clock() == ClockKind::Lockstep;
        if steps_record && declare.period().is_some_and(|period| period > config.bridges.into()) {
            let found = format!("{}, expected at least one period of the component", config.bridges);
            return Err(ConfigError::key("bridges", found)
                .advise("raise the rate of the component, or increase `bridges`"));
        }
        declare.taps(config.taps());
        Ok(())
    }

    fn configure(config: RecordConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let output = setup.folder().join(&config.output);
        let attached = |path: &PathBuf| {
            let path = setup.folder().join(path);
            let content = std::fs::read(&path)
                .map_err(|error| ConfigureError::failed(format!("{}: {error}", path.display())))?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok::<_, ConfigureError>((name, content))
        };
        let settings = Settings {
            output: output.clone(),
            taps: config.taps(),
            drawn_every_ns: config.drawn_every.ns,
            last_ns: config.last.map(|last| last.ns),
            attachments: config.attach.iter().map(attached).collect::<Result<_, _>>()?,
        };
        let observer = setup.observer()?;
        let outcome = Arc::new(Mutex::new(Outcome::default()));
        if observer.plan().clock == ClockKind::Lockstep {
            let (recorder, _) = Recorder::open(observer, settings).map_err(ConfigureError::failed)?;
            return Ok(Self { output, recorder: Some(recorder), outcome });
        }
        let poll = poll(bridged(observer.plan(), &settings.taps), config.bridges.into());
        let (sender, receiver) = crossbeam_channel::bounded(1);
        let (reading, writing) = threads::link();
        let shared = outcome.clone();
        setup.helper("recorder", move |stop| {
            // Taps belong to the thread that opens them.
            match Recorder::open(observer, settings) {
                Ok((recorder, file)) => {
                    let (readers, sink) = recorder.split();
                    let _ = sender.send(Ok((sink, file)));
                    threads::read(readers, reading, stop, poll, &shared);
                }
                Err(error) => drop(sender.send(Err(error))),
            }
        })?;
        let opened = receiver
            .recv()
            .map_err(|_| ConfigureError::failed("the recorder ended before it started recording"))?;
        let (sink, file) = opened.map_err(ConfigureError::failed)?;
        let shared = outcome.clone();
        // The writer ends after the reader, once everything is written.
        setup.helper("writer", move |_| threads::write(sink, &writing, &shared))?;
        setup.helper("sync", move |stop| threads::sync(&file, stop))?;
        Ok(Self { output, recorder: None, outcome })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        self.drain();
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        // The samples of the previous episode are still available.
        self.drain();
        Ok(())
    }

    fn stop(&mut self) {
        if let Some(recorder) = self.recorder.take() {
            note(&self.outcome, None, recorder.finish());
        }
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Outcome { counts, cpu_ns, ended } =
            self.outcome.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let lost = |reason| format!("the recording {} ended before the run: {reason}", self.output.display());
        let shortfalls: Vec<String> = ended.as_ref().map(lost).into_iter().collect();
        Some(serde_json::json!({
            "shortfalls": shortfalls,
            "file": self.output,
            "samples": counts.samples,
            "lost": counts.lost,
            "bytes": counts.bytes,
            "cpu_s": cpu_ns[0].zip(cpu_ns[1]).map(|(reading, writing)| (reading + writing) as f64 * 1e-9),
            "ended": ended,
        }))
    }
}

impl Record {
    /// Records in lockstep; in real time a thread records.
    fn drain(&mut self) {
        let Some(recorder) = &mut self.recorder else { return };
        if let Err(error) = set_apart(|| recorder.drain()) {
            let counts = recorder.counts();
            self.recorder = None;
            note(&self.outcome, Some(counts), Err(error));
        }
    }
}

/// Returns the shortest time after which a topic overwrites a value.
fn bridged(plan: &Plan, taps: &Taps) -> Option<Duration> {
    let of_topics = plan.topics.iter().filter(|topic| taps.includes(&topic.name)).map(|topic| {
        let values = match topic.pattern {
            TopicPattern::State => topic.history,
            TopicPattern::Stream { capacity } | TopicPattern::Slices { capacity, .. } => capacity,
        };
        Duration::from_nanos(plan.components[topic.writer].period_ns().saturating_mul(values as u64))
    });
    of_topics.min()
}

/// Poll interval: four polls before a value is overwritten, and four within the permitted delay of the
/// recorder.
fn poll(bridged: Option<Duration>, bridges: Duration) -> Duration {
    let often = OFTEN.min(bridges / 4);
    (bridged.unwrap_or(bridges).min(bridges) / 4).clamp(often, POLL.max(often))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_polled_four_times_before_overwriting() {
        let looks = |bridged: u64, bridges: u64| {
            poll(Some(Duration::from_millis(bridged)), Duration::from_millis(bridges)).as_micros()
        };
        assert_eq!(looks(200, 200), 50_000);
        assert_eq!(looks(5_000, 5_000), 50_000, "a viewer of the file sees it grow");
        assert_eq!(looks(66, 200), 16_500, "a camera with room for two pictures");
        assert_eq!(looks(4, 200), 5_000, "very fast topics may lose samples to save processor time");
        assert_eq!(looks(200, 8), 2_000);
        assert_eq!(looks(0, 1), 250, "a topic without a known period");
        assert_eq!(poll(None, Duration::from_millis(200)), POLL, "nothing is recorded");
    }
}
