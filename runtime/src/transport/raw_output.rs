//! The writing side of a topic whose type is known at run time only.

#![allow(unsafe_code)] // a claimed slot is filled as bytes

use std::rc::Rc;

use iceoryx2::node::Node;

use super::latest::{StateWriter, TopicMemory};
use super::output::{Wired, stamp};
use super::topic::{fits, refused};
use super::{Context, PortError, Probe, Shared};
use crate::declare::TopicPattern;
use crate::plan::{PortPlan, TopicPlan};
use crate::region::add;
use crate::state::{ContentCheck, ContentDefect, TypeLayout};

/// An output port that writes a state of a layout given at run time: the one writer of its topic.
///
/// Declare it with [`Declare::raw_output`](crate::declare::Declare::raw_output). Values published on an output that the
/// graph leaves unwired are checked, and read by nobody.
#[derive(Debug)]
pub struct RawOutput {
    layout: TypeLayout,
    check: ContentCheck,
    wired: Option<(String, Rc<StateWriter>, Rc<TopicMemory>, Wired)>,
    context: Rc<Context>,
}

/// A value that was not published. Holds no heap memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RawError {
    /// Its content must not reach a reader.
    #[error(transparent)]
    Content(#[from] ContentDefect),
    /// The step is past its deadline, and the component's `on_overrun` is `hold`.
    #[error("the step is past its deadline")]
    Late,
}

impl RawOutput {
    pub(crate) fn unwired(port: &PortPlan, context: Rc<Context>) -> Result<Self, PortError> {
        let layout = port.layout.clone();
        let check = ContentCheck::new(&layout)
            .map_err(|error| refused(&port.port, "reading the layout of its type")(&error))?;
        Ok(Self { layout, check, wired: None, context })
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        topic: (usize, &TopicPlan),
        port: &PortPlan,
        probes: Vec<Probe>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let (index, topic) = topic;
        fits(&port.layout, topic, &port.port)?;
        if topic.pattern != TopicPattern::State {
            return Err(refused(&topic.name, "opening a port for bytes")(&"it is a stream, not a state"));
        }
        let mut output = Self::unwired(port, context)?;
        let memory = output.context.memory(node, topic)?;
        let state = Rc::new(StateWriter::new(memory.clone()));
        let wired = Wired::new(index, memory.clone(), Some(state.clone()), probes);
        output.wired = Some((topic.name.clone(), state, memory, wired));
        Ok(output)
    }

    /// The worker ends every step of this output's component.
    pub(crate) fn ending_steps(mut self, stays_on_core: bool) -> Self {
        if let Some((.., wired)) = &mut self.wired {
            wired.ending_steps(&self.context, stays_on_core);
        }
        self
    }

    /// Name of the topic, if the graph wires this output.
    pub fn topic(&self) -> Option<&str> {
        self.wired.as_ref().map(|(name, ..)| name.as_str())
    }

    /// Layout of the values.
    pub fn layout(&self) -> &TypeLayout {
        &self.layout
    }

    /// Checks the content of a value without publishing it.
    ///
    /// # Errors
    /// The first defect.
    pub fn check(&self, bytes: &[u8]) -> Result<(), ContentDefect> {
        self.check.check(bytes)
    }

    /// Publishes a copy of a value under a stamp of this component and wakes the components that it triggers.
    ///
    /// # Errors
    /// It is not published: it holds a number that is not finite or a count that does not fit, has another size than
    /// the type, or comes too late.
    pub fn publish(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        self.publish_value(bytes, None)
    }

    /// As [`publish`](Self::publish), of a value that was measured at `source_time_ns` on `CLOCK_MONOTONIC`, such as the time
    /// at which it was received. A time in the future counts as the present. In lockstep, where times are simulated, it is
    /// not looked at.
    ///
    /// # Errors
    /// As `publish`.
    pub fn publish_from(&mut self, bytes: &[u8], source_time_ns: u64) -> Result<(), RawError> {
        self.publish_value(bytes, Some(source_time_ns))
    }

    fn publish_value(&mut self, bytes: &[u8], source_time_ns: Option<u64>) -> Result<(), RawError> {
        let context = &*self.context;
        if let Err(defect) = self.check.check(bytes) {
            add(&context.block().refused, 1);
            return Err(defect.into());
        }
        let Some((_, state, memory, wired)) = &mut self.wired else { return Ok(()) };
        let now = context.clock().now_ns();
        if context.withholds(now) {
            add(&context.block().refused, 1);
            return Err(RawError::Late);
        }
        // SAFETY: this output is the one user of its writer's slot, and borrowed mutably; the reference ends here.
        unsafe { state.bytes_mut() }.copy_from_slice(bytes);
        let mut stamp = stamp(context, state.number(), now);
        if let Some(source_time) = source_time_ns.filter(|_| !context.clock().is_lockstep()) {
            stamp.source_time = source_time.min(now);
        }
        if context.clock().is_lockstep() {
            wired.digest(context, stamp, |digest| self.check.digest(bytes, digest));
        }
        memory.publish_from(context.core());
        state.publish(stamp);
        wired.announce(context, stamp);
        Ok(())
    }
}
