//! Analysis of a recorded run: rates, latencies, gaps, tracking errors, events.

use std::collections::BTreeMap;

use motorium::plan::Plan;
use motorium::region::EventKind;
use motorium::state::{Event, JointCommand, JointState, StateBuffer as _, from_bytes};

use super::{EVENTS, ReadError, Recording};

/// The analysis of a recording.
#[derive(Debug, Clone, Default)]
pub struct Analysis {
    /// Time from the first sample to the last, s.
    pub duration_s: f64,
    /// Each topic.
    pub topics: Vec<TopicAnalysis>,
    /// Each topic of joint commands with the resulting state of its actuator.
    pub tracking: Vec<Tracking>,
    /// Events in the order of their times.
    pub events: Vec<EventLine>,
}

/// One topic.
#[derive(Debug, Clone, Default)]
pub struct TopicAnalysis {
    /// Its name.
    pub name: String,
    /// Name of its type.
    pub type_name: String,
    /// Samples in the recording.
    pub samples: u64,
    /// Number of samples missing between the first and the last.
    pub gaps: u64,
    /// Times from the source of a sample to its publication, ns, rising.
    pub latency_ns: Vec<u64>,
    /// Times between one publication and the next, ns, rising.
    pub interval_ns: Vec<u64>,
}

/// Errors of joints against their commands.
#[derive(Debug, Clone)]
pub struct Tracking {
    /// The topic of the commands.
    pub command: String,
    /// The topic of the states.
    pub state: String,
    /// Root mean square and maximum deviation of each joint's position from the command, rad or m.
    pub joints: Vec<(f64, f64)>,
}

/// An event.
#[derive(Debug, Clone, PartialEq)]
pub struct EventLine {
    /// Time since the first sample, s.
    pub time_s: f64,
    /// 0 information, 1 warning, 2 error.
    pub severity: u32,
    /// Name of its kind, such as `missed`.
    pub kind: &'static str,
    /// Its words.
    pub text: String,
}

/// Returns the quantile `part` of sorted values; 0 without values.
pub fn quantile(rising: &[u64], part: f64) -> u64 {
    let index = (part * rising.len() as f64).ceil() as usize;
    rising.get(index.saturating_sub(1).min(rising.len().saturating_sub(1))).copied().unwrap_or(0)
}

/// Sums of one pair of topics.
struct Sums {
    command: usize,
    state: usize,
    newest: Option<JointCommand>,
    squares: Vec<f64>,
    most: Vec<f64>,
    count: f64,
}

/// Reads a recording and analyses its content.
///
/// # Errors
/// A message is damaged.
pub fn analyse(recording: &Recording, plan: &Plan) -> Result<Analysis, ReadError> {
    let mut analysis = Analysis::default();
    let topics = recording.topics();
    let mut last: Vec<Option<(u64, u32, u64, u64)>> = vec![None; topics.len()];
    analysis.topics = topics
        .iter()
        .map(|topic| TopicAnalysis {
            name: topic.name.clone(),
            type_name: topic.layout.type_name.clone(),
            ..TopicAnalysis::default()
        })
        .collect();
    let mut sums = pairs(recording, plan);
    let mut begin_ns = u64::MAX;
    let mut end_ns = 0;
    for sample in recording.in_order() {
        let sample = sample?;
        begin_ns = begin_ns.min(sample.time_ns);
        end_ns = end_ns.max(sample.time_ns);
        let of_topic = &mut analysis.topics[sample.topic];
        let stamp = &sample.stamp;
        of_topic.samples += 1;
        if of_topic.name == EVENTS {
            let Some(event) = from_bytes::<Event>(&sample.bytes) else { continue };
            analysis.events.push(EventLine {
                time_s: (sample.time_ns - begin_ns) as f64 * 1e-9,
                severity: event.severity,
                kind: EventKind::from_number(event.code).map_or("other", EventKind::name),
                text: event.as_str().to_string(),
            });
            continue;
        }
        of_topic.latency_ns.push(stamp.publish_time.saturating_sub(stamp.source_time));
        let this = (stamp.episode, stamp.restart_count, stamp.sequence, stamp.publish_time);
        if let Some((episode, _, sequence, time)) = last[sample.topic].replace(this)
            && episode == stamp.episode
        {
            of_topic.gaps += stamp.sequence.saturating_sub(sequence + 1);
            of_topic.interval_ns.push(stamp.publish_time.saturating_sub(time));
        }
        for sum in &mut sums {
            sum.take(sample.topic, &sample.bytes);
        }
    }
    analysis.duration_s = end_ns.saturating_sub(begin_ns) as f64 * 1e-9;
    for topic in &mut analysis.topics {
        topic.latency_ns.sort_unstable();
        topic.interval_ns.sort_unstable();
    }
    analysis.tracking = sums.into_iter().filter_map(|sum| sum.result(recording)).collect();
    Ok(analysis)
}

/// Pairs each topic of commands with the first topic of states published by its reader.
fn pairs(recording: &Recording, plan: &Plan) -> Vec<Sums> {
    let mut by_command = BTreeMap::new();
    for (index, topic) in plan.topics.iter().enumerate() {
        if topic.layout.type_name != JointCommand::NAME {
            continue;
        }
        let outputs = topic.readers.iter().flat_map(|reader| {
            let component = &plan.components[*reader];
            let input = component.inputs.iter().find(|input| input.topic == Some(index));
            // With several robots: the port with the same name before the dot.
            let of = |port: &str| port.split_once('.').map(|(robot, _)| robot.to_string());
            let robot = input.and_then(|input| of(&input.port));
            component.outputs.iter().filter(move |output| of(&output.port) == robot)
        });
        let state = outputs
            .filter(|output| output.layout.type_name == JointState::NAME)
            .find_map(|output| output.topic);
        if let Some(state) = state
            && let (Some(command), Some(state)) =
                (recording.topic(&topic.name), recording.topic(&plan.topics[state].name))
        {
            by_command.insert(command, state);
        }
    }
    let sums = |(command, state)| Sums {
        command,
        state,
        newest: None,
        squares: Vec::new(),
        most: Vec::new(),
        count: 0.0,
    };
    by_command.into_iter().map(sums).collect()
}

impl Sums {
    fn take(&mut self, topic: usize, bytes: &[u8]) {
        if topic == self.command {
            self.newest = from_bytes(bytes);
        } else if topic == self.state
            && let (Some(command), Some(state)) = (&self.newest, from_bytes::<JointState>(bytes))
        {
            let count = command.count().min(state.count());
            self.squares.resize(count.max(self.squares.len()), 0.0);
            self.most.resize(self.squares.len(), 0.0);
            self.count += 1.0;
            for joint in 0..count {
                // Effort and velocity control leave the position open.
                if command.kp()[joint] > 0.0 {
                    let error = (state.position()[joint] - command.position()[joint]).abs();
                    self.squares[joint] += error * error;
                    self.most[joint] = self.most[joint].max(error);
                }
            }
        }
    }

    fn result(self, recording: &Recording) -> Option<Tracking> {
        let name = |index: usize| recording.topics()[index].name.clone();
        let rms = self.squares.iter().map(|sum| (sum / self.count.max(1.0)).sqrt());
        (self.count > 0.0).then(|| Tracking {
            command: name(self.command),
            state: name(self.state),
            joints: rms.zip(self.most.iter().copied()).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantile_is_the_smallest_sufficient_value() {
        let values: Vec<u64> = (1..=100).collect();
        assert_eq!((quantile(&values, 0.5), quantile(&values, 0.99), quantile(&values, 1.0)), (50, 99, 100));
        assert_eq!((quantile(&[], 0.5), quantile(&[7], 0.01)), (0, 7));
    }
}
