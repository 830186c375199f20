//! Foxglove channels for the topics of a graph's plan.

use motorium::declare::TopicPattern;
use motorium::plan::Plan;
use motorium::state::{Stamp, TypeLayout};

use super::{Derived, DerivedError, Drawing, DrawnError, Schema};

/// A sequence of messages with one schema, derived from the samples of one topic.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name of the channel: the topic name. A drawn channel appends `/` and the name of the drawing.
    pub name: String,
    /// Index of the topic in the plan.
    pub topic: usize,
    /// Content of the messages.
    pub content: Content,
}

/// Content of the messages of a channel: exact samples, or drawings for viewers.
#[derive(Debug, Clone)]
pub enum Content {
    /// All fields and the stamp of each sample.
    Exact(Derived),
    /// A drawing for viewers, in one of Foxglove's message types.
    Drawn(Box<Drawing>),
}

impl Channel {
    /// Returns the schema of the messages.
    pub fn schema(&self) -> &Schema {
        match &self.content {
            Content::Exact(derived) => derived.schema(),
            Content::Drawn(drawing) => drawing.schema(),
        }
    }

    /// Returns `true` if every sample must be encoded. This applies to exact channels and log lines.
    pub fn needs_every_sample(&self) -> bool {
        match &self.content {
            Content::Exact(_) => true,
            Content::Drawn(drawing) => drawing.needs_every_sample(),
        }
    }

    /// Returns the plan index of the form topic, or `None` if the samples need no description. The form topic
    /// describes the samples of the channel's topic, such as their image format. Pass its samples to
    /// [`note`](Self::note).
    pub fn form_topic(&self) -> Option<usize> {
        match &self.content {
            Content::Exact(_) => None,
            Content::Drawn(drawing) => drawing.form_topic(),
        }
    }

    /// Records a sample of the [form topic](Self::form_topic); samples of other topics are ignored.
    pub fn note(&mut self, topic: usize, bytes: &[u8]) {
        if let Content::Drawn(drawing) = &mut self.content
            && drawing.form_topic() == Some(topic)
        {
            drawing.note(bytes);
        }
    }

    /// Encodes a sample of the topic as a message and appends it to `out`. `time_ns` is the time of the
    /// sample on the reader's clock, since 1970 or since the start of the run; drawn messages contain it.
    ///
    /// # Errors
    /// Returns an error if the sample does not fit its type or its robot; `out` is then unchanged.
    pub fn encode(
        &mut self,
        stamp: &Stamp,
        bytes: &[u8],
        time_ns: u64,
        out: &mut Vec<u8>,
    ) -> Result<(), DrawnError> {
        match &mut self.content {
            Content::Exact(derived) if bytes.len() == derived.size() => {
                derived.encode(stamp, bytes, out);
                Ok(())
            }
            Content::Exact(_) => Err(DrawnError::Size(bytes.len())),
            Content::Drawn(drawing) => drawing.encode(bytes, time_ns, out),
        }
    }
}

/// Returns the channels of one topic, the exact channel first. A topic of slices has no exact channel,
/// because slices have no fixed layout. Images have only a drawn channel.
///
/// ```
/// # fn of(plan: &motorium::plan::Plan) -> Result<(), motorium_bridges::foxglove::DerivedError> {
/// for topic in 0..plan.topics.len() {
///     for channel in motorium_bridges::foxglove::channels(plan, topic)? {
///         println!("{}: {}", channel.name, channel.schema().name);
///     }
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Returns an error if the layout of the topic has a field that cannot be encoded.
pub fn channels(plan: &Plan, topic: usize) -> Result<Vec<Channel>, DerivedError> {
    let of_topic = &plan.topics[topic];
    let name = &of_topic.name;
    let exact = match of_topic.pattern {
        TopicPattern::Slices { .. } => None,
        TopicPattern::State | TopicPattern::Stream { .. } => Some(exact(name, topic, &of_topic.layout)?),
    };
    let drawn = Drawing::of_topic(plan, topic).into_iter().map(|drawing| Channel {
        name: format!("{name}/{}", drawing.name()),
        topic,
        content: Content::Drawn(Box::new(drawing)),
    });
    Ok(exact.into_iter().chain(drawn).collect())
}

fn exact(name: &str, topic: usize, layout: &TypeLayout) -> Result<Channel, DerivedError> {
    Ok(Channel { name: name.to_string(), topic, content: Content::Exact(Derived::new(layout)?) })
}
