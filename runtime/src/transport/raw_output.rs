//! The writing side of a topic whose type is known at run time only.

#![allow(unsafe_code)] // a claimed slot is filled as bytes

use std::rc::Rc;

use iceoryx2::node::Node;

use super::latest::{StateWriter, TopicMemory};
use super::output::Wired;
use super::stamping::{source_time, stamp};
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
    /// The given source time lies in the future.
    #[error("its source time is {ahead_ns} ns in the future")]
    SourceInFuture {
        /// Distance from the present, ns.
        ahead_ns: u64,
    },
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
        self.finish(bytes, None)
    }

    /// As [`publish`](Self::publish), with the source time of the value, ns on the clock of stamps: see
    /// [`Loan::publish_from`](super::Loan::publish_from).
    ///
    /// # Errors
    /// As [`publish`](Self::publish); and the source time is in the future by more than 1 ms.
    pub fn publish_from(&mut self, bytes: &[u8], source_ns: u64) -> Result<(), RawError> {
        self.finish(bytes, Some(source_ns))
    }

    #[inline(always)]
    fn finish(&mut self, bytes: &[u8], source_ns: Option<u64>) -> Result<(), RawError> {
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
        let source =
            source_time(context, source_ns, now).map_err(|ahead_ns| RawError::SourceInFuture { ahead_ns })?;
        // SAFETY: this output is the one user of its writer's slot, and borrowed mutably; the reference ends here.
        unsafe { state.bytes_mut() }.copy_from_slice(bytes);
        let stamp = stamp(context, state.number(), now, source);
        if context.clock().is_lockstep() {
            wired.digest(context, stamp, |digest| self.check.digest(bytes, digest));
        }
        memory.publish_from(context.core());
        state.publish(stamp);
        wired.announce(context, stamp);
        Ok(())
    }
}
