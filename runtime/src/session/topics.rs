//! The topics of a session: reading the newest values, and publishing in place of a component.

use std::any::Any;
use std::rc::Rc;

use super::{Session, SessionError, TopicReader};
use crate::context::Context;
use crate::launcher::LaunchError;
use crate::nearest::suggest;
use crate::plan::{PortPlan, TopicPlan};
use crate::raw::{RawError, RawOutput};
use crate::state::{Stamp, StateBuffer, TypeLayout};
use crate::transport::{Connect, Output, OutputPlace, Participant, PortError, Tap};

/// A copy of a topic's value at the time when the session read it.
///
/// ```
/// # use motorium::session::Value;
/// # use motorium::state::JointState;
/// fn age_s(value: &Value<JointState>, now_ns: u64) -> f64 {
///     now_ns.saturating_sub(value.stamp.publish_time) as f64 * 1e-9
/// }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value<T> {
    /// Stamp of the value: its sequence number, times and publisher.
    pub stamp: Stamp,
    /// Content of the value.
    pub value: T,
}

/// A writer that publishes on a topic in place of a component. Values are stamped with the time of the call
/// to [`Session::writer`].
#[derive(Debug)]
pub struct TopicWriter<'s> {
    output: &'s mut RawOutput,
    context: &'s Rc<Context>,
    now_ns: u64,
}

impl TopicWriter<'_> {
    /// Returns the layout of the topic's values.
    pub fn layout(&self) -> &TypeLayout {
        self.output.layout()
    }

    /// Publishes a value in the [layout](Self::layout) of the topic. Components triggered by the topic step
    /// in the next round.
    ///
    /// # Errors
    /// The value has the wrong size, a number is not finite, or a count exceeds its array.
    pub fn publish(&mut self, bytes: &[u8]) -> Result<(), SessionError> {
        self.finish(|output| output.publish(bytes))
    }

    /// Publishes a value like [`publish`](Self::publish), but with an explicit source time: the time at which
    /// the value was measured, ns on the clock of [`Session::stamp_ns`].
    ///
    /// # Errors
    /// Same as [`publish`](Self::publish), or the time is more than 1 ms in the future.
    pub fn publish_from(&mut self, bytes: &[u8], source_ns: u64) -> Result<(), SessionError> {
        self.finish(|output| output.publish_from(bytes, source_ns))
    }

    fn finish(
        &mut self,
        send: impl FnOnce(&mut RawOutput) -> Result<(), RawError>,
    ) -> Result<(), SessionError> {
        self.context.enter_new_episode();
        self.context.enter_step(self.now_ns, self.now_ns, u64::MAX);
        send(self.output).map_err(|error| SessionError::Topic {
            topic: self.output.topic().unwrap_or_default().to_string(),
            reason: error.to_string(),
        })?;
        self.context.deferred().finish(self.context.first_lines());
        Ok(())
    }
}

/// An output of any type, and the connection to establish before the output is used.
type Opened = (Box<dyn Any>, Option<Rc<dyn Connect>>);

impl Session<'_> {
    /// Returns a copy of the newest value of a topic in this episode, or `None` before the first publication.
    /// On a stream, only values published after the first call are visible.
    ///
    /// # Errors
    /// The topic does not exist, its type is not `T`, or it contains slices.
    pub fn read<T: StateBuffer>(&mut self, topic: &str) -> Result<Option<Value<T>>, SessionError> {
        let index = self.topic(topic)?;
        crate::transport::same_layout::<T>(&self.launch.plan().topics[index], "the session")?;
        let place = match self.ports.readers.iter().position(|(open, _)| *open == index) {
            Some(place) => place,
            None => self.open_reader(index)?,
        };
        let (_, reader) = &mut self.ports.readers[place];
        reader.poll();
        let value = reader.value::<T>()?;
        Ok(value.zip(reader.stamp()).map(|(value, stamp)| Value { stamp: *stamp, value: *value }))
    }

    /// Opens a reader of the newest value of a topic, without copying and without knowing its type. The
    /// reader must stay on the thread that opened it.
    ///
    /// ```no_run
    /// # use motorium::session::{Session, SessionError};
    /// fn print_ages(session: &mut Session<'_>) -> Result<(), SessionError> {
    ///     let mut picture = session.reader("camera/image")?;
    ///     session.step()?;
    ///     if picture.poll() {
    ///         let (bytes, stamp) = (picture.bytes().map_or(0, <[u8]>::len), picture.stamp());
    ///         println!("{bytes} bytes of {} {:?}", picture.layout().type_name, stamp);
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// The graph has no such topic, or four programs outside the graph already read the topic.
    pub fn reader(&self, topic: &str) -> Result<TopicReader, SessionError> {
        let index = self.topic(topic)?;
        let domain = self.launch.folder().domain().map_err(LaunchError::from)?;
        Ok(TopicReader::open(&domain, &self.launch.plan().topics[index])?)
    }

    /// Opens a reader of every value that is published on a topic from now on, in order. On a topic of
    /// slices, each value consists of the bytes of all elements. The reader must stay on the thread that
    /// opened it.
    ///
    /// ```no_run
    /// # use motorium::session::{Session, SessionError};
    /// fn count(session: &mut Session<'_>) -> Result<u64, SessionError> {
    ///     let mut tap = session.tap("panda/joint_state")?;
    ///     session.step()?;
    ///     let mut values = 0;
    ///     while tap.read(|_, _| values += 1) {}
    ///     Ok(values)
    /// }
    /// ```
    ///
    /// # Errors
    /// The graph has no such topic, or four programs outside the graph already read the topic.
    pub fn tap(&self, topic: &str) -> Result<Tap, SessionError> {
        let index = self.topic(topic)?;
        let domain = self.launch.folder().domain().map_err(LaunchError::from)?;
        Ok(Tap::open(&domain, &self.launch.plan().topics[index])?)
    }

    /// Publishes a value in place of the component that writes the topic, stamped with the current time of
    /// the run.
    ///
    /// Components triggered by the topic step in the next round.
    ///
    /// # Errors
    /// The session does not replace the component that writes the topic
    /// ([`Options::standing_in_for`](crate::launcher::Options::standing_in_for)), the type of the topic is
    /// not `T`, or a number of the value is not finite.
    pub fn publish<T: StateBuffer>(&mut self, topic: &str, value: &T) -> Result<(), SessionError> {
        self.publish_at(topic, value, None)
    }

    /// Publishes a value like [`publish`](Self::publish), but with an explicit source time: the time at which
    /// the value was measured, received or recorded, ns on the clock of [`stamp_ns`](Self::stamp_ns).
    /// Latencies and the ages of commands are measured from this time.
    ///
    /// ```no_run
    /// # use motorium::{session::{Session, SessionError}, state::PoseTarget};
    /// /// Publishes a target that a camera saw 20 ms ago.
    /// fn seen(session: &mut Session<'_>, target: &PoseTarget) -> Result<(), SessionError> {
    ///     let seen_ns = session.stamp_ns().saturating_sub(20_000_000);
    ///     session.publish_from("panda/target", target, seen_ns)
    /// }
    /// ```
    ///
    /// # Errors
    /// Same as [`publish`](Self::publish), or the time is more than 1 ms in the future.
    pub fn publish_from<T: StateBuffer>(
        &mut self,
        topic: &str,
        value: &T,
        source_ns: u64,
    ) -> Result<(), SessionError> {
        self.publish_at(topic, value, Some(source_ns))
    }

    /// Opens a writer that publishes in place of the component that writes the topic. Intended for topics
    /// whose type is only known at run time. Values are stamped with the time of this call.
    ///
    /// ```no_run
    /// # use motorium::session::{Session, SessionError};
    /// /// Publishes a value that another program has sent as bytes.
    /// fn forward(session: &mut Session<'_>, bytes: &[u8]) -> Result<(), SessionError> {
    ///     let mut writer = session.writer("panda/target")?;
    ///     assert_eq!(writer.layout().size, bytes.len());
    ///     writer.publish(bytes)
    /// }
    /// ```
    ///
    /// # Errors
    /// The session does not replace the component that writes the topic
    /// ([`Options::standing_in_for`](crate::launcher::Options::standing_in_for)), the topic is not a state,
    /// or the session has already published a typed value on the topic.
    pub fn writer(&mut self, topic: &str) -> Result<TopicWriter<'_>, SessionError> {
        self.check_alive()?;
        let index = self.topic(topic)?;
        let now_ns = self.stamp_ns();
        let place = match self.ports.writers.iter().position(|(open, ..)| *open == index) {
            Some(place) => place,
            None => self.open_writer(index, |participant, place| {
                let (name, topic) = (place.topic.name.clone(), place.topic);
                let (pattern, layout) = (topic.pattern, topic.layout.clone());
                let port = PortPlan { port: name, topic: Some(place.index), pattern, layout };
                Ok((Box::new(RawOutput::open(participant, place, &port)?), None))
            })?,
        };
        let (_, output, context) = &mut self.ports.writers[place];
        let output = output.downcast_mut::<RawOutput>().ok_or_else(|| SessionError::Topic {
            topic: topic.to_string(),
            reason: "the session has already published a typed value on this topic".to_string(),
        })?;
        Ok(TopicWriter { output, context, now_ns })
    }

    fn publish_at<T: StateBuffer>(
        &mut self,
        topic: &str,
        value: &T,
        source_ns: Option<u64>,
    ) -> Result<(), SessionError> {
        self.check_alive()?;
        let index = self.topic(topic)?;
        let now_ns = self.stamp_ns();
        let place = match self.ports.writers.iter().position(|(open, ..)| *open == index) {
            Some(place) => place,
            None => self.open_writer(index, |participant, place| {
                let output = Output::<T>::open(participant, place, "the session")?;
                let connection = output.connection();
                Ok((Box::new(output), connection))
            })?,
        };
        let refused = |reason: String| SessionError::Topic { topic: topic.to_string(), reason };
        let (_, output, context) = &mut self.ports.writers[place];
        let output = output.downcast_mut::<Output<T>>();
        let output = output.ok_or_else(|| {
            refused("the session has already published a different type on this topic".to_string())
        })?;
        context.enter_new_episode();
        context.enter_step(now_ns, now_ns, u64::MAX);
        let sent = output.loan().and_then(|mut loan| {
            *loan = *value;
            match source_ns {
                Some(source_ns) => loan.publish_from(source_ns),
                None => loan.publish(),
            }
        });
        sent.map_err(|error| refused(error.to_string()))?;
        context.deferred().finish(context.first_lines());
        Ok(())
    }

    fn topic(&self, name: &str) -> Result<usize, SessionError> {
        self.launch.check()?;
        let topics = &self.launch.plan().topics;
        topics.iter().position(|topic| topic.name == name).ok_or_else(|| SessionError::NoTopic {
            topic: name.to_string(),
            advice: suggest(name, topics.iter().map(|topic| topic.name.as_str()), "it has"),
        })
    }

    /// Joins the iceoryx2 domain of the run when it is first needed.
    fn join(&mut self) -> Result<(), SessionError> {
        if self.ports.node.is_none() {
            let domain = self.launch.folder().domain().map_err(LaunchError::from)?;
            self.ports.node = Some(Rc::new(domain.node().map_err(LaunchError::from)?));
        }
        Ok(())
    }

    fn open_reader(&mut self, index: usize) -> Result<usize, SessionError> {
        self.join()?;
        let plan = &self.launch.plan().topics[index];
        let Some(node) = &self.ports.node else { return Err(not_joined(plan)) };
        let domain = self.launch.folder().domain().map_err(LaunchError::from)?;
        let reader = TopicReader::join(&domain, node, plan)?;
        self.ports.readers.push((index, reader));
        Ok(self.ports.readers.len() - 1)
    }

    fn open_writer(
        &mut self,
        index: usize,
        open: impl FnOnce(&Participant, OutputPlace<'_>) -> Result<Opened, PortError>,
    ) -> Result<usize, SessionError> {
        self.join()?;
        let plan = self.launch.plan();
        let topic: &TopicPlan = &plan.topics[index];
        let Some(node) = &self.ports.node else { return Err(not_joined(topic)) };
        let writer = &plan.components[topic.writer].name;
        if !self.launch.stands_in_for(writer) {
            return Err(SessionError::NotOurs { topic: topic.name.clone(), writer: writer.clone() });
        }
        let context = Rc::new(Context::new(plan, topic.writer, self.launch.region().clone()));
        context.enter_new_episode();
        let participant = Participant::new(node.clone(), context.clone());
        let is_emergency_stop = plan.is_emergency_stop(index);
        let place = OutputPlace { index, topic, probes: Vec::new(), wakes_late: false, is_emergency_stop };
        let (output, connection) = open(&participant, place)?;
        if let Some(port) = connection {
            let refused = |reason| SessionError::Topic { topic: topic.name.clone(), reason };
            port.connect().map_err(refused)?;
        }
        self.ports.writers.push((index, output, context));
        Ok(self.ports.writers.len() - 1)
    }
}

fn not_joined(topic: &TopicPlan) -> SessionError {
    SessionError::Topic {
        topic: topic.name.clone(),
        reason: "the session has not joined the domain of the run".to_string(),
    }
}
