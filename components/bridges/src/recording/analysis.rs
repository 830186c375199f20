//! Analysis of a recorded run: rates, latencies, gaps, tracking errors, events.

use std::collections::BTreeMap;

use motorium::plan::Plan;
use motorium::region::EventKind;
use motorium::state::{Event, JointCommand, JointState, StateBuffer as _, from_bytes};

use super::{EVENTS, Envelope, ReadError, Recording};

/// Results of the analysis of a recording.
#[derive(Debug, Clone, Default)]
pub struct Analysis {
    /// Time from the first sample to the last, s.
    pub duration_s: f64,
    /// Results for each topic.
    pub topics: Vec<TopicAnalysis>,
    /// Tracking errors for each topic of joint commands, paired with the resulting joint states.
    pub tracking: Vec<Tracking>,
    /// Events in time order.
    pub events: Vec<EventLine>,
}

/// Results for one topic.
#[derive(Debug, Clone, Default)]
pub struct TopicAnalysis {
    /// Name of the topic.
    pub name: String,
    /// Name of the topic's type.
    pub type_name: String,
    /// Number of samples in the recording.
    pub samples: u64,
    /// Number of samples missing between the first and the last sample.
    pub gaps: u64,
    /// Delays from each sample's source time to its publication, in ascending order, ns.
    pub latency_ns: Vec<u64>,
    /// Times between consecutive publications, in ascending order, ns.
    pub interval_ns: Vec<u64>,
    /// Minimum and maximum latency \[ns\] over the time since the first sample \[s\].
    pub latencies: Envelope,
}

/// Tracking errors of the joints of one robot.
#[derive(Debug, Clone)]
pub struct Tracking {
    /// Topic of the commands.
    pub command: String,
    /// Topic of the joint states.
    pub state: String,
    /// Results for each joint.
    pub joints: Vec<TrackedJoint>,
}

/// Tracking error of one joint.
#[derive(Debug, Clone, Default)]
pub struct TrackedJoint {
    /// Root mean square deviation from the commanded position, rad or m; 0 without position commands.
    pub rms: f64,
    /// Maximum deviation from the commanded position, rad or m.
    pub most: f64,
    /// Commanded positions as points: time since the first sample \[s\], and position \[rad or m\]. Times
    /// without a position command are omitted.
    pub commanded: Vec<(f64, f64)>,
    /// Measured positions as points, at the same times as the points of `commanded`.
    pub measured: Vec<(f64, f64)>,
}

/// An event of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct EventLine {
    /// Time since the first sample, s.
    pub time_s: f64,
    /// Severity: 0 information, 1 warning, 2 error.
    pub severity: u32,
    /// Kind of the event; `None` if the launcher did not report it.
    pub kind: Option<EventKind>,
    /// Number associated with the event, such as a number of missed steps.
    pub value: f64,
    /// Text of the event.
    pub text: String,
}

/// Returns the quantile `part` (0 to 1) of values in ascending order, or 0 if there are no values.
pub fn quantile(rising: &[u64], part: f64) -> u64 {
    let index = (part * rising.len() as f64).ceil() as usize;
    rising.get(index.saturating_sub(1).min(rising.len().saturating_sub(1))).copied().unwrap_or(0)
}

/// Number of time intervals of a drawn curve.
const STRETCHES: usize = 300;

/// One pair of topics.
struct Pair {
    command: usize,
    state: usize,
    newest: Option<JointCommand>,
    /// Start and end of the recording, s since the first sample.
    ends: (f64, f64),
    joints: Vec<Joint>,
    count: f64,
}

/// Sums of one joint of a pair.
#[derive(Clone)]
struct Joint {
    squares: f64,
    most: f64,
    commanded: Envelope,
    measured: Envelope,
}

/// Analyses a recording.
///
/// # Errors
/// Returns an error if a message is damaged.
pub fn analyse(recording: &Recording, plan: &Plan) -> Result<Analysis, ReadError> {
    let mut analysis = Analysis::default();
    let (first_ns, last_ns) = recording.times().unwrap_or_default();
    let ends = (0.0, last_ns.saturating_sub(first_ns) as f64 * 1e-9);
    let topics = recording.topics();
    let mut last: Vec<Option<(u64, u32, u64, u64)>> = vec![None; topics.len()];
    analysis.topics = topics
        .iter()
        .map(|topic| TopicAnalysis {
            name: topic.name.clone(),
            type_name: topic.layout.type_name.clone(),
            latencies: Envelope::new(ends, STRETCHES),
            ..TopicAnalysis::default()
        })
        .collect();
    let mut pairs = pairs(recording, plan, ends);
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
                kind: EventKind::from_number(event.code),
                value: event.value,
                text: event.as_str().to_string(),
            });
            continue;
        }
        let time_s = (sample.time_ns - begin_ns) as f64 * 1e-9;
        let latency_ns = stamp.publish_time.saturating_sub(stamp.source_time);
        of_topic.latency_ns.push(latency_ns);
        of_topic.latencies.take(time_s, latency_ns as f64);
        let this = (stamp.episode, stamp.restart_count, stamp.sequence, stamp.publish_time);
        if let Some((episode, _, sequence, time)) = last[sample.topic].replace(this)
            && episode == stamp.episode
        {
            of_topic.gaps += stamp.sequence.saturating_sub(sequence + 1);
            of_topic.interval_ns.push(stamp.publish_time.saturating_sub(time));
        }
        for pair in &mut pairs {
            pair.take(sample.topic, time_s, &sample.bytes);
        }
    }
    analysis.duration_s = end_ns.saturating_sub(begin_ns) as f64 * 1e-9;
    for topic in &mut analysis.topics {
        topic.latency_ns.sort_unstable();
        topic.interval_ns.sort_unstable();
    }
    analysis.tracking = pairs.into_iter().filter_map(|pair| pair.result(recording)).collect();
    Ok(analysis)
}

/// Pairs each command topic with the first state topic published by its reader.
fn pairs(recording: &Recording, plan: &Plan, ends: (f64, f64)) -> Vec<Pair> {
    let mut by_command = BTreeMap::new();
    for (index, topic) in plan.topics.iter().enumerate() {
        if topic.layout.type_name != JointCommand::NAME {
            continue;
        }
        let outputs = topic.readers.iter().flat_map(|reader| {
            let component = &plan.components[*reader];
            let input = component.inputs.iter().find(|input| input.topic == Some(index));
            // With several robots: the port with the same prefix before the dot.
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
    let pair = |(command, state)| Pair { command, state, newest: None, ends, joints: Vec::new(), count: 0.0 };
    by_command.into_iter().map(pair).collect()
}

impl Pair {
    fn take(&mut self, topic: usize, time_s: f64, bytes: &[u8]) {
        if topic == self.command {
            self.newest = from_bytes(bytes);
        } else if topic == self.state
            && let (Some(command), Some(state)) = (&self.newest, from_bytes::<JointState>(bytes))
        {
            let count = command.count().min(state.count());
            let envelope = Envelope::new(self.ends, STRETCHES);
            let joint = Joint { squares: 0.0, most: 0.0, commanded: envelope.clone(), measured: envelope };
            self.joints.resize(count.max(self.joints.len()), joint);
            self.count += 1.0;
            for (index, joint) in self.joints.iter_mut().enumerate().take(count) {
                // Without position gain, the command controls velocity or effort.
                if command.kp()[index] > 0.0 {
                    let (commanded, measured) = (command.position()[index], state.position()[index]);
                    let error = (measured - commanded).abs();
                    joint.squares += error * error;
                    joint.most = joint.most.max(error);
                    joint.commanded.take(time_s, commanded);
                    joint.measured.take(time_s, measured);
                }
            }
        }
    }

    fn result(self, recording: &Recording) -> Option<Tracking> {
        let name = |index: usize| recording.topics()[index].name.clone();
        let joint = |joint: &Joint| TrackedJoint {
            rms: (joint.squares / self.count.max(1.0)).sqrt(),
            most: joint.most,
            commanded: joint.commanded.points(),
            measured: joint.measured.points(),
        };
        (self.count > 0.0).then(|| Tracking {
            command: name(self.command),
            state: name(self.state),
            joints: self.joints.iter().map(joint).collect(),
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
