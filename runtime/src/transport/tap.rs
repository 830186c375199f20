//! Reading a topic from outside the graph, by its layout only.

use iceoryx2::node::Node;

use super::latest::{self, TopicMemory};
use super::stream::{Queue, open_queue, parts, receive};
use super::{PortError, refused};
use crate::declare::TopicPattern;
use crate::domain::{Domain, Shared};
use crate::os::{Lock, OtherProcess, Owned};
use crate::plan::TopicPlan;
use crate::state::{Digest, Stamp, TypeLayout};

/// A reader of every value of a topic, in order, from outside the graph. Intended for tools and recorders.
///
/// A tap costs the writer nothing, and the writer never waits for a tap. Older values of a state are read
/// from the topic's slots, which contain at least the number of values that the graph sets as `history`.
/// Values overwritten before they were read are counted ([`missed`](Self::missed)). A topic supports four
/// taps at a time. A tap is released immediately when its process is killed.
#[derive(Debug)]
pub struct Tap {
    layout: TypeLayout,
    source: Owned<Source>,
    _node: Owned<Node<Shared>>,
}

#[derive(Debug)]
enum Source {
    State(Box<latest::Tap>),
    Stream {
        queue: Queue,
        /// Restart count of the publisher and number of the last value read.
        last: (u32, u64),
        missed: u64,
    },
}

/// A copy of a value that a tap has read.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Stamp of the value: its sequence number, times and publisher.
    pub stamp: Stamp,
    /// Bytes of the value, in the layout of the topic.
    pub bytes: Vec<u8>,
}

/// Returns the index of the topic's first lock among the tap locks of all topics.
fn first_place(topic: &str) -> u32 {
    let mut digest = Digest::default();
    digest.write(topic.as_bytes());
    (digest.finish() as u32 >> 4) * latest::SIDE_PINS as u32
}

/// Claims one of a topic's pins for readers outside the graph, together with the lock that guards it. The
/// system releases the lock when this process ends.
pub(crate) fn side_pin(
    domain: &Domain,
    topic: &TopicPlan,
    memory: &TopicMemory,
) -> Result<(Lock, usize), PortError> {
    let (file, first) = (domain.lock_file(), first_place(&topic.name));
    let take = |place: usize| Lock::take(&file, first + place as u32).ok().flatten();
    let free = memory.side_pins().enumerate().find_map(|(place, pin)| Some((take(place)?, pin)));
    free.ok_or_else(|| {
        let full = &"four programs outside the graph already read the topic, expected at most three";
        refused(&topic.name, "reading it from outside")(full)
    })
}

impl Tap {
    /// Joins a topic. The first value read is the newest value of a state, or the next published value of a
    /// stream. On a topic of slices, such as images, the bytes of each value are consecutive elements with
    /// the [layout](Self::layout).
    ///
    /// # Errors
    /// The run or the topic cannot be opened, or four other programs already read the topic.
    pub fn open(domain: &Domain, topic: &TopicPlan) -> Result<Self, PortError> {
        let node = domain.node().map_err(|error| refused(&topic.name, "joining the run")(&error))?;
        let source = if topic.pattern == TopicPattern::State {
            let memory = TopicMemory::open(&node, topic)?;
            let place = side_pin(domain, topic, &memory)?;
            Source::State(Box::new(latest::Tap::join(memory, place)))
        } else {
            Source::Stream { queue: open_queue(&node, topic)?, last: (0, 0), missed: 0 }
        };
        Ok(Self { layout: topic.layout.clone(), source: Owned::new(source), _node: Owned::new(node) })
    }

    /// Returns the layout of the topic's values or, on a topic of slices, of their elements.
    pub fn layout(&self) -> &TypeLayout {
        &self.layout
    }

    /// Returns the number of values that were overwritten before this tap read them.
    pub fn missed(&self) -> u64 {
        match &*self.source {
            Source::State(tap) => tap.missed(),
            Source::Stream { missed, .. } => *missed,
        }
    }

    /// Checks that the current process opened this tap. In a forked child, a tap reads nothing and dropping
    /// it has no effect.
    ///
    /// # Errors
    /// The tap was opened by another process.
    pub fn check(&self) -> Result<(), OtherProcess> {
        self.source.check()
    }

    /// Passes the stamp and bytes of the next unread value to `read`, without copying. Returns `false` if
    /// there is no unread value.
    pub fn read(&mut self, read: impl FnOnce(&Stamp, &[u8])) -> bool {
        if !self.source.is_own() {
            return false;
        }
        match &mut *self.source {
            Source::State(tap) => tap.next(read),
            Source::Stream { queue, last, missed } => {
                let Some(sample) = receive(queue) else { return false };
                let (stamp, bytes) = parts(&sample);
                if last.1 > 0 {
                    *missed += stamp.sequence.saturating_sub(last.1 + 1);
                }
                *last = (stamp.restart_count, stamp.sequence);
                read(stamp, bytes);
                true
            }
        }
    }

    /// Returns a copy of the next unread value, or `None` if there is no unread value.
    pub fn next_unread(&mut self) -> Option<Sample> {
        let mut sample = None;
        self.read(|stamp, bytes| sample = Some(Sample { stamp: *stamp, bytes: bytes.to_vec() }));
        sample
    }
}
