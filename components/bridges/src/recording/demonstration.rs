//! Demonstrations of a task: pairs of observations and actions.

use motorium::nearest::{list, suggest};
use motorium::state::{Action, Observation, StateBuffer, from_bytes};

use super::{ReadError, Recording};

/// Observations of a recording, paired with the resulting actions.
///
/// ```no_run
/// use motorium_bridges::recording::{Demonstration, Recording};
///
/// let recording = Recording::open("out/run.mcap".as_ref())?;
/// let shown = Demonstration::read(&recording, None, Some("cart/action"))?;
/// println!("{} actions of {} numbers", shown.len(), shown.outputs);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    /// Number of values in an observation.
    pub inputs: usize,
    /// Number of values in an action.
    pub outputs: usize,
    /// Observations in time order, concatenated.
    pub observations: Vec<f64>,
    /// Actions in the same order, one per observation, concatenated.
    pub actions: Vec<f64>,
}

/// The demonstration cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DemonstrationError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The recording has no topic with this name.
    #[error("the recording has no topic `{topic}`; {advice}")]
    NoTopic {
        /// Name of the topic.
        topic: String,
        /// Similar topic, or all topics.
        advice: String,
    },
    /// The type of the topic differs from the expected type.
    #[error("topic `{topic}` has the type {found}, expected {expected}")]
    Type {
        /// Name of the topic.
        topic: String,
        /// Type of the topic.
        found: String,
        /// Expected type of observations or actions.
        expected: &'static str,
    },
    /// The recording has no topic of the expected type, or several.
    #[error("{}", choice(.type_name, .topics))]
    Choice {
        /// Name of the type.
        type_name: &'static str,
        /// Topics of the type.
        topics: Vec<String>,
    },
    /// Samples of a topic differ in length.
    #[error("a sample of topic `{topic}` has {found} numbers, expected {expected} as in previous samples")]
    Width {
        /// Name of the topic.
        topic: String,
        /// Length of the sample.
        found: usize,
        /// Length of the previous samples.
        expected: usize,
    },
    /// No action belongs to any observation.
    #[error(
        "no action on `{action}` belongs to an observation on `{observation}`; \
         expected one in the same episode, before the next observation"
    )]
    Empty {
        /// Topic of the observations.
        observation: String,
        /// Topic of the actions.
        action: String,
    },
}

/// Formats the error for a type with no topic, or with several.
fn choice(type_name: &str, topics: &[String]) -> String {
    let count = topics.len();
    if topics.is_empty() {
        return format!(
            "the recording has no topic of type {type_name}, expected one\n\
             help: record a graph with a `learner.task` and a policy"
        );
    }
    let names = list(topics.iter().map(String::as_str));
    format!(
        "the recording has {count} topics of type {type_name} ({names}), expected one\nhelp: name one of them"
    )
}

impl Demonstration {
    /// Reads a demonstration from a topic of observations and a topic of actions. If a topic is `None`, the
    /// only topic with observations (or with actions) is read.
    ///
    /// Each action is paired with the latest observation at the time of the action, if both belong to the
    /// same episode. If several actions precede the next observation, the first one is used. Observations
    /// without an action are skipped.
    ///
    /// # Errors
    ///
    /// Returns an error if the recording cannot be read, if a topic is missing, ambiguous or of the wrong
    /// type, if samples differ in length, or if no action belongs to an observation.
    pub fn read(
        recording: &Recording,
        observation: Option<&str>,
        action: Option<&str>,
    ) -> Result<Self, DemonstrationError> {
        let observed = topic::<Observation>(recording, observation)?;
        let acted = topic::<Action>(recording, action)?;
        let topics = [observed, acted].map(|topic| recording.topics()[topic].name.clone());
        let mut shown = Self { inputs: 0, outputs: 0, observations: Vec::new(), actions: Vec::new() };
        let mut waiting: Option<Observation> = None;
        // all values of a lockstep tick have the same time: an action belongs to the observation of its tick,
        // even if the observation follows it in the file
        let mut early: Option<(u64, Action)> = None;
        for sample in recording.in_order() {
            let sample = sample?;
            if let Some((_, action)) = early.take_if(|(time_ns, _)| *time_ns != sample.time_ns) {
                shown.push(&mut waiting, &action, [&topics[0], &topics[1]])?;
            }
            if sample.topic == observed {
                waiting = from_bytes(&sample.bytes);
            } else if sample.topic == acted
                && early.is_none()
                && let Some(action) = from_bytes::<Action>(&sample.bytes)
            {
                early = Some((sample.time_ns, action));
            }
        }
        if let Some((_, action)) = early {
            shown.push(&mut waiting, &action, [&topics[0], &topics[1]])?;
        }
        if shown.is_empty() {
            let [observation, action] = topics;
            return Err(DemonstrationError::Empty { observation, action });
        }
        Ok(shown)
    }

    /// Returns the number of pairs of an observation and an action.
    pub fn len(&self) -> usize {
        self.actions.len().checked_div(self.outputs).unwrap_or(0)
    }

    /// Returns `true` if there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends the pending observation and the action if both belong to the same episode.
    fn push(
        &mut self,
        waiting: &mut Option<Observation>,
        action: &Action,
        topics: [&str; 2],
    ) -> Result<(), DemonstrationError> {
        let Some(observation) = waiting.take_if(|observation| observation.episode == action.episode) else {
            return Ok(());
        };
        let is_first = self.observations.is_empty();
        for (width, found, topic) in [
            (&mut self.inputs, observation.count(), topics[0]),
            (&mut self.outputs, action.count(), topics[1]),
        ] {
            if is_first {
                *width = found;
            } else if *width != found {
                return Err(DemonstrationError::Width { topic: topic.to_string(), found, expected: *width });
            }
        }
        self.observations.extend_from_slice(observation.value());
        self.actions.extend_from_slice(action.value());
        Ok(())
    }
}

/// Returns the topic with this name, or the only topic of the type.
fn topic<T: StateBuffer>(recording: &Recording, name: Option<&str>) -> Result<usize, DemonstrationError> {
    let topics = recording.topics();
    if let Some(name) = name {
        let index = recording.topic(name).ok_or_else(|| DemonstrationError::NoTopic {
            topic: name.to_string(),
            advice: suggest(name, topics.iter().map(|topic| topic.name.as_str()), "its topics are"),
        })?;
        let found = topics[index].layout.type_name.clone();
        if found != T::NAME {
            return Err(DemonstrationError::Type { topic: name.to_string(), found, expected: T::NAME });
        }
        return Ok(index);
    }
    let of_type: Vec<usize> =
        (0..topics.len()).filter(|index| topics[*index].layout.type_name == T::NAME).collect();
    match of_type[..] {
        [index] => Ok(index),
        _ => {
            let topics = of_type.iter().map(|index| topics[*index].name.clone()).collect();
            Err(DemonstrationError::Choice { type_name: T::NAME, topics })
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use motorium::state::{Stamp, Wrench, encode};

    use super::*;
    use crate::foxglove::Derived;
    use crate::recording::LAYOUT;
    use crate::recording::file::Writer;

    /// A sample of the recording: topic, time, episode and the first number.
    type Sample = (&'static str, u64, u64, f64);

    fn recorded(file: &Path, samples: &[Sample]) -> Recording {
        let (mut writer, _) = Writer::create(file).unwrap();
        let mut channels = BTreeMap::new();
        for (topic, layout) in [
            ("task/observation", Observation::layout()),
            ("expert/action", Action::layout()),
            ("policy/action", Action::layout()),
            ("wrench", Wrench::layout()),
        ] {
            let derived = Derived::new(&layout).unwrap();
            let metadata = BTreeMap::from([(LAYOUT.to_string(), serde_json::to_string(&layout).unwrap())]);
            let channel = writer.channel(topic, derived.schema(), &metadata).unwrap();
            channels.insert(topic, (channel, layout, derived));
        }
        for (sequence, (topic, time_ns, episode, number)) in (1..).zip(samples) {
            let (channel, layout, derived) = &channels[topic];
            let numbers = if topic.ends_with("action") { vec![*number] } else { vec![*number, -number] };
            let bytes = encode(layout, &format!("episode={episode} value={numbers:?}")).unwrap();
            let (stamp, mut message) = (Stamp { sequence, ..Stamp::default() }, Vec::new());
            derived.encode(&stamp, &bytes, &mut message);
            writer.message(*channel, sequence, (*time_ns, *time_ns), &message).unwrap();
        }
        writer.finish().unwrap();
        Recording::open(file).unwrap()
    }

    #[test]
    fn actions_belong_to_the_latest_observation_in_episode() {
        let folder = tempfile::tempdir().unwrap();
        let recording = recorded(
            &folder.path().join("a.mcap"),
            &[
                ("expert/action", 0, 0, 9.0), // before all observations
                ("task/observation", 1, 0, 1.0),
                ("task/observation", 2, 0, 2.0), // replaces one that nobody answered
                ("policy/action", 2, 0, 7.0),
                ("expert/action", 3, 0, 20.0),
                ("expert/action", 4, 0, 21.0), // the second answer
                ("expert/action", 5, 0, 30.0), // in the tick of its observation, but ahead of it in the file
                ("task/observation", 5, 0, 3.0),
                ("task/observation", 6, 0, 4.0),
                ("expert/action", 7, 1, 40.0), // of the next episode
                ("task/observation", 8, 1, 5.0),
                ("expert/action", 9, 1, 50.0),
            ],
        );
        let shown = Demonstration::read(&recording, None, Some("expert/action")).unwrap();
        assert_eq!((shown.inputs, shown.outputs, shown.len()), (2, 1, 3));
        assert_eq!(shown.actions, [20.0, 30.0, 50.0]);
        assert_eq!(shown.observations, [2.0, -2.0, 3.0, -3.0, 5.0, -5.0]);
        let other = Demonstration::read(&recording, Some("task/observation"), Some("policy/action")).unwrap();
        assert_eq!((other.actions, other.observations), (vec![7.0], vec![2.0, -2.0]));
    }

    #[test]
    fn topics_are_checked() {
        let folder = tempfile::tempdir().unwrap();
        let recording = recorded(&folder.path().join("a.mcap"), &[("task/observation", 1, 0, 1.0)]);
        let refused = |observation, action| Demonstration::read(&recording, observation, action).unwrap_err();
        let DemonstrationError::Choice { topics, .. } = refused(None, None) else { panic!("two experts") };
        assert_eq!(topics, ["expert/action", "policy/action"]);
        assert!(matches!(refused(Some("task"), None), DemonstrationError::NoTopic { .. }));
        assert!(matches!(refused(Some("wrench"), None), DemonstrationError::Type { .. }));
        assert!(matches!(refused(None, Some("expert/action")), DemonstrationError::Empty { .. }));
    }
}
