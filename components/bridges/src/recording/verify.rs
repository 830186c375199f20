//! Verification: runs a recorded graph again and compares everything it publishes.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use motorium::declare::ClockKind;
use motorium::launcher::Options;
use motorium::session::{Session, SessionError};
use motorium::state::{DecodeError, Decoder, FieldValue, Stamp};
use motorium::transport::Tap;
use motorium::worker::Registry;

use super::spans::Spans;
use super::{EVENTS, ReadError, RecordedTopic, Recording, Samples, loggers, replaced};

/// Simulated time between two polls: at most the shortest delay that a recorder bridges.
const AT_A_TIME: Duration = Duration::from_millis(1);

/// Result of a verification.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Number of bitwise equal samples.
    pub samples: u64,
    /// Total simulated time of all repeated episodes.
    pub time: Duration,
    /// First difference, if any.
    pub difference: Option<Difference>,
}

/// A sample that differs from the recorded one.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Name of the topic.
    pub topic: String,
    /// Sequence number of the sample within its topic.
    pub sequence: u64,
    /// Index of the episode.
    pub episode: u64,
    /// Publication time within the episode, ns.
    pub time_ns: u64,
    /// Tick at which the sample was published, counted in periods of the publishing component from 0.
    pub tick: u64,
    /// Kind of the difference.
    pub what: What,
}

/// Kind of the difference.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// A field of the sample or of its stamp differs.
    Field {
        /// Name of the field, with the index of an array entry, such as `position[3]` or `stamp.source_time`.
        field: String,
        /// Value in the recording.
        recorded: String,
        /// Value in the repeated run.
        now: String,
    },
    /// The sample was recorded, but the repeated run did not publish it.
    Missing,
    /// The repeated run published a sample that was not recorded.
    Unexpected,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, sequence, episode, time_ns, tick, what } = self;
        write!(f, "topic `{topic}`, tick {tick} ({:.6} s", *time_ns as f64 * 1e-9)?;
        if *episode > 0 {
            write!(f, " of episode {episode}")?;
        }
        write!(f, ", sample {sequence})")?;
        match what {
            What::Field { field, recorded, now } => {
                write!(f, ", field `{field}`: recorded {recorded}, now {now}")
            }
            What::Missing => f.write_str(": recorded, but not published now"),
            What::Unexpected => f.write_str(": published now, but not recorded"),
        }
    }
}

/// The recording cannot be verified.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The graph cannot be run.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A topic cannot be read.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A real-time recording cannot be repeated bit for bit.
    #[error(
        "the run was recorded in real time, which is not reproducible; record a run with `--clock lockstep` to verify it"
    )]
    RealTime,
    /// Episodes were started by a program, so their seeds and times are not in the graph.
    #[error(
        "the recording contains episodes that a program started, so the graph alone cannot repeat them; only runs with \
         `--episodes N` can be verified"
    )]
    Episodes,
    /// The recording lacks messages that it declares.
    #[error("the recording lacks {missing} of its messages, so it cannot be compared")]
    Missing {
        /// Number of missing messages.
        missing: u64,
    },
    /// The recording has no samples.
    #[error("the recording contains no samples to compare")]
    Nothing,
    /// Samples were lost during the recording.
    #[error("{lost} samples of topic `{topic}` were lost, so the recording cannot be compared")]
    Lost {
        /// Name of the topic.
        topic: String,
        /// Number of lost samples.
        lost: u64,
    },
}

/// One topic on both sides.
struct Compared<'r> {
    /// Its index in the recording.
    index: usize,
    topic: &'r RecordedTopic,
    tap: Tap,
    decoder: Decoder,
    /// Period of its writer, ns.
    period_ns: u64,
    /// Recorded samples that have been read but not compared.
    waiting: VecDeque<(Stamp, Vec<u8>)>,
    message: Vec<u8>,
}

/// Repeats the graph of a recording in lockstep, and compares each sample bit for bit up to the end of the
/// recording. The components named in `replace` are replaced by `log.replay`.
///
/// # Errors
/// Returns an error if the recording cannot be verified, or if its graph does not run.
pub fn verify(
    recording: &Recording,
    registry: &Registry,
    options: &Options,
    replace: &[String],
) -> Result<Verification, VerifyError> {
    let plan = replaced(recording, replace)?;
    if plan.clock != ClockKind::Lockstep {
        return Err(VerifyError::RealTime);
    }
    if recording.missing() > 0 {
        return Err(VerifyError::Missing { missing: recording.missing() });
    }
    for topic in recording.topics() {
        if let Some(lost) = recording.lost(&topic.name).filter(|lost| *lost > 0) {
            return Err(VerifyError::Lost { topic: topic.name.clone(), lost });
        }
    }
    let mut options = options.clone();
    options.stand_in.extend(loggers(&plan));
    let (seed, episodes) = (plan.seed, plan.episodes);
    let periods: Vec<(String, u64)> = plan
        .topics
        .iter()
        .map(|topic| (topic.name.clone(), plan.components[topic.writer].period_ns()))
        .collect();
    let recorded_episodes = Spans::from_recording(recording, None)?.episodes();
    if recorded_episodes == 0 {
        return Err(VerifyError::Nothing);
    }
    if recorded_episodes > episodes.map_or(1, |episodes| episodes.count) {
        return Err(VerifyError::Episodes);
    }
    let mut session = Session::launch(plan, registry, &options)?;
    let mut compared = Vec::new();
    for (index, topic) in recording.topics().iter().enumerate().filter(|(_, topic)| topic.name != EVENTS) {
        compared.push(Compared {
            index,
            topic,
            tap: session.tap(&topic.name)?,
            decoder: Decoder::new(&topic.layout)?,
            period_ns: periods.iter().find(|(name, _)| *name == topic.name).map_or(1, |(_, period)| *period),
            waiting: VecDeque::new(),
            message: Vec::new(),
        });
    }
    let mut recorded = Recorded { samples: recording.samples(), left: 0 };
    recorded.left = compared.iter().map(|compared| compared.topic.samples).sum();
    let mut outcome = Verification { samples: 0, time: Duration::ZERO, difference: None };
    let mut before = Duration::ZERO;
    'run: while recorded.left > 0 {
        let end = session.plan().duration_ns.map_or(Duration::MAX, Duration::from_nanos);
        while recorded.left > 0 && session.time() < end && !session.is_episode_over() {
            // A single step could go beyond the end of the episode.
            match session.step_until(end.min(session.time() + AT_A_TIME)) {
                Ok(()) => {}
                // A run recorded until its failure fails again; missing samples are reported below.
                Err(SessionError::Ended(_)) => break 'run,
                Err(error) => return Err(error.into()),
            }
            outcome.time = before + session.time();
            outcome.difference = compare(&mut compared, &mut recorded, &mut outcome.samples)?;
            if outcome.difference.is_some() {
                break 'run;
            }
        }
        let next = session.episode() + 1;
        match episodes.filter(|episodes| next < episodes.count && recorded.left > 0) {
            Some(episodes) => {
                session.reset(episodes.seed(seed, next))?;
                before = outcome.time;
            }
            None => break,
        }
    }
    if outcome.difference.is_none() {
        // Actuators still publish after the last step, on their way to the safe state.
        outcome.difference = compare(&mut compared, &mut recorded, &mut outcome.samples)?;
    }
    if outcome.difference.is_none() {
        outcome.difference = missing(&mut compared, &mut recorded)?;
    }
    session.stop();
    Ok(outcome)
}

/// Recorded samples that have not been compared.
struct Recorded<'r> {
    samples: Samples<'r>,
    left: u64,
}

impl Recorded<'_> {
    /// Reads ahead until the topic `wanted` has a sample. Returns `false` if there is none.
    fn fill(&mut self, compared: &mut [Compared<'_>], wanted: usize) -> Result<bool, ReadError> {
        while compared[wanted].waiting.is_empty() {
            let Some(sample) = self.samples.next().transpose()? else { return Ok(false) };
            if let Some(of) = compared.iter_mut().find(|compared| compared.index == sample.topic) {
                of.waiting.push_back((sample.stamp, sample.bytes));
            }
        }
        Ok(true)
    }
}

/// Compares the values published since the last call. Returns the earliest difference.
fn compare(
    compared: &mut [Compared<'_>],
    recorded: &mut Recorded<'_>,
    samples: &mut u64,
) -> Result<Option<Difference>, VerifyError> {
    let mut first: Option<Difference> = None;
    for index in 0..compared.len() {
        loop {
            let Compared { tap, topic, message, .. } = &mut compared[index];
            message.clear();
            if !tap.read(|stamp, bytes| topic.derived().encode(stamp, bytes, message)) {
                break;
            }
            let now = topic.derived().decode(message);
            let topic = topic.name.clone();
            // A sample that was just encoded can be decoded.
            let (stamp, bytes) =
                now.map_err(|error| ReadError::Message { path: "".into(), topic, reason: Box::new(error) })?;
            if !recorded.fill(compared, index)? {
                // The recording ends here, like an interrupted one.
                continue;
            }
            let this = &mut compared[index];
            let Some(was) = this.waiting.pop_front() else { continue };
            recorded.left -= 1;
            if was == (stamp, bytes.clone()) {
                *samples += 1;
                continue;
            }
            let what = this.difference(&was, &(stamp, bytes))?;
            let found = this.difference_at(&was.0, what);
            if first
                .as_ref()
                .is_none_or(|first| (found.episode, found.time_ns) < (first.episode, first.time_ns))
            {
                first = Some(found);
            }
            break;
        }
    }
    Ok(first)
}

/// Returns the earliest sample that was recorded but not published again.
fn missing(
    compared: &mut [Compared<'_>],
    recorded: &mut Recorded<'_>,
) -> Result<Option<Difference>, VerifyError> {
    let mut first: Option<Difference> = None;
    for index in 0..compared.len() {
        if recorded.fill(compared, index)?
            && let Some((stamp, _)) = compared[index].waiting.front()
        {
            let found = compared[index].difference_at(stamp, What::Missing);
            if first
                .as_ref()
                .is_none_or(|first| (found.episode, found.time_ns) < (first.episode, first.time_ns))
            {
                first = Some(found);
            }
        }
    }
    Ok(first)
}

impl Compared<'_> {
    fn difference_at(&self, stamp: &Stamp, what: What) -> Difference {
        Difference {
            topic: self.topic.name.clone(),
            sequence: stamp.sequence,
            episode: stamp.episode,
            time_ns: stamp.publish_time,
            tick: stamp.publish_time / self.period_ns.max(1),
            what,
        }
    }

    /// Returns the first field in which two samples differ.
    fn difference(
        &self,
        (was, recorded): &(Stamp, Vec<u8>),
        (is, now): &(Stamp, Vec<u8>),
    ) -> Result<What, VerifyError> {
        if (was.episode, was.publish_time, was.sequence) < (is.episode, is.publish_time, is.sequence)
            && was.sequence != is.sequence
        {
            return Ok(What::Missing);
        }
        let (recorded, now) = (self.decoder.decode(recorded)?, self.decoder.decode(now)?);
        for ((name, was), (_, is)) in recorded.0.iter().zip(&now.0) {
            if let Some(what) = of_field(name, was, is) {
                return Ok(what);
            }
        }
        let stamps = [
            ("sequence", was.sequence, is.sequence),
            ("publish_time", was.publish_time, is.publish_time),
            ("source_time", was.source_time, is.source_time),
            ("state_time", was.state_time, is.state_time),
            ("episode", was.episode, is.episode),
            ("publisher", u64::from(was.publisher), u64::from(is.publisher)),
            ("restart_count", u64::from(was.restart_count), u64::from(is.restart_count)),
        ];
        let found = stamps.into_iter().find(|(_, was, is)| was != is);
        let (name, was, is) = found.unwrap_or(("sequence", was.sequence, is.sequence));
        let field = format!("stamp.{name}");
        Ok(What::Field { field, recorded: was.to_string(), now: is.to_string() })
    }
}

fn of_field(name: &str, was: &FieldValue, is: &FieldValue) -> Option<What> {
    let field = |field: String, recorded: String, now: String| Some(What::Field { field, recorded, now });
    if let (FieldValue::Text(was), FieldValue::Text(is)) = (was, is) {
        return if was == is { None } else { field(name.to_string(), format!("{was:?}"), format!("{is:?}")) };
    }
    let (was_all, is_all) = (was.numbers(), is.numbers());
    if was_all.len() != is_all.len() {
        let (was, is) = (was_all.len(), is_all.len());
        return field(name.to_string(), format!("{was} entries"), format!("{is} entries"));
    }
    let many = matches!(was, FieldValue::Many(_));
    // Compared as text, so that -0 and 0 differ.
    let differs = |(was, is): &(String, String)| was != is;
    let texts = was_all.iter().zip(is_all).map(|(was, is)| (format!("{was:?}"), format!("{is:?}")));
    let (index, (recorded, now)) = texts.enumerate().find(|(_, pair)| differs(pair))?;
    let bare = |text: String| {
        text.split_once('(').map_or(text.clone(), |(_, rest)| rest.trim_end_matches(')').to_string())
    };
    let name = if many { format!("{name}[{index}]") } else { name.to_string() };
    field(name, bare(recorded), bare(now))
}
