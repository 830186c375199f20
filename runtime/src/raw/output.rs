//! The writing side of a topic whose type is known only at run time.

#![allow(unsafe_code)] // a claimed slot is filled as bytes

use std::rc::Rc;

use crate::context::{Context, Withheld};
use crate::declare::TopicPattern;
use crate::plan::PortPlan;
use crate::state::{ContentCheck, ContentDefect, TypeLayout};
use crate::transport::latest::StateWriter;
use crate::transport::{
    OutputPlace, Participant, PortError, TopicWriter, Unpublished, checked, fits, refused,
};

/// An output port that writes a state whose layout is given at run time. It is the only writer of its topic.
///
/// Declare it with [`Declare::raw_output`](crate::declare::Declare::raw_output). Values published on an
/// unwired output are checked and discarded.
#[derive(Debug)]
pub struct RawOutput {
    layout: TypeLayout,
    check: ContentCheck,
    wired: Option<(String, Rc<StateWriter>, TopicWriter)>,
    context: Rc<Context>,
}

/// Error of publishing a value. Owns no heap memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RawError {
    /// The content is invalid.
    #[error(transparent)]
    Content(#[from] ContentDefect),
    /// The slice is longer than the output declares, or a stream of single values received more or fewer than
    /// one value.
    #[error("{found} elements to publish, expected {}", if *longest == 1 { "1".to_string() } else { format!("at most {longest}") })]
    Length {
        /// Number of elements found.
        found: usize,
        /// Maximum number of elements.
        longest: usize,
    },
    /// iceoryx2 did not send the value, or readers still use all samples of the stream.
    #[error("iceoryx2 did not send the sample, or readers still use all samples")]
    NotSent,
    /// The step is past its deadline, and `on_overrun` of the component is `hold`.
    #[error("the step is past its deadline and `on_overrun` is `hold`")]
    Late,
    /// The source time is more than 1 ms in the future.
    #[error("the source time is {ahead_ns} ns in the future, expected at most 1 ms")]
    SourceInFuture {
        /// Difference between the source time and the current time, ns.
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
        participant: &Participant,
        place: OutputPlace<'_>,
        port: &PortPlan,
    ) -> Result<Self, PortError> {
        let topic = place.topic;
        fits(&port.layout, topic, &port.port)?;
        if topic.pattern != TopicPattern::State {
            return Err(refused(&topic.name, "opening a port for bytes")(
                &"the topic is a stream, expected a state",
            ));
        }
        let mut output = Self::unwired(port, participant.context().clone())?;
        let memory = participant.memory(topic)?;
        let state = Rc::new(StateWriter::new(memory.clone()));
        let writer = TopicWriter::new(participant, place, memory, Some(state.clone()));
        output.wired = Some((topic.name.clone(), state, writer));
        Ok(output)
    }

    /// Returns the name of the topic, or `None` if the output is unwired.
    pub fn topic(&self) -> Option<&str> {
        self.wired.as_ref().map(|(name, ..)| name.as_str())
    }

    /// Returns the layout of the values.
    pub fn layout(&self) -> &TypeLayout {
        &self.layout
    }

    /// Checks the content of a value without publishing it.
    ///
    /// # Errors
    /// Returns the first defect of the content.
    pub fn check(&self, bytes: &[u8]) -> Result<(), ContentDefect> {
        self.check.check(bytes)
    }

    /// Publishes a copy of a value, stamped by this component, and wakes the components that the topic
    /// triggers.
    ///
    /// # Errors
    /// A number is not finite, a count exceeds its array, the size differs from the size of the type, or the
    /// step is past its deadline. In each case nothing is published.
    pub fn publish(&mut self, bytes: &[u8]) -> Result<(), RawError> {
        self.finish(bytes, None)
    }

    /// Publishes a copy of a value like [`publish`](Self::publish), but with an explicit source time, ns on
    /// the clock of stamps. See [`Loan::publish_from`](crate::transport::Loan::publish_from).
    ///
    /// # Errors
    /// Same as [`publish`](Self::publish), or the source time is more than 1 ms in the future.
    pub fn publish_from(&mut self, bytes: &[u8], source_ns: u64) -> Result<(), RawError> {
        self.finish(bytes, Some(source_ns))
    }

    #[inline(always)]
    fn finish(&mut self, bytes: &[u8], source_ns: Option<u64>) -> Result<(), RawError> {
        let Self { check, wired, context, .. } = self;
        // Checked before the copy, because bytes of another size do not fit the slot.
        checked(context, check.check(bytes))?;
        let Some((_, state, topic)) = wired else { return Ok(()) };
        let stop = || bytes.first_chunk().map_or(0, |stop| u64::from_ne_bytes(*stop));
        topic.latch_if_pressed(context, stop);
        // SAFETY: this output is the only user of its writer's slot and is borrowed mutably; the reference
        // ends here.
        unsafe { state.bytes_mut() }.copy_from_slice(bytes);
        let digest = |bytes: &&[u8], digest: &mut _| check.digest(bytes, digest);
        let check = |_: &_| Ok::<(), ContentDefect>(());
        topic.publish((context, source_ns), bytes, check, digest, |_, _| false)?;
        Ok(())
    }
}

impl<D: Into<RawError>> From<Unpublished<D>> for RawError {
    fn from(reason: Unpublished<D>) -> Self {
        match reason {
            Unpublished::Invalid(defect) => defect.into(),
            Unpublished::Withheld(Withheld::InFuture { ahead_ns }) => Self::SourceInFuture { ahead_ns },
            Unpublished::Withheld(Withheld::Late) => Self::Late,
            Unpublished::NotSent => Self::NotSent,
        }
    }
}
