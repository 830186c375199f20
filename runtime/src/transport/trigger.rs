//! Waking up the components that a topic triggers.

use std::cell::Cell;
use std::path::PathBuf;

use iceoryx2::node::Node;
use iceoryx2::prelude::SemanticString as _;

use super::bell::Bell;
use super::topic::refused;
use super::{PortError, Shared};
use crate::os::{current_core, monotonic_ns};
use crate::plan::TopicPlan;
use crate::state::Digest;

/// So long a waiter looks at the bell of another core before it sleeps, ns: about what it costs to be woken there.
const SPIN_NS: u64 = 20_000;
/// Looks in vain before it sleeps at once this many times, doubled with every further vain look up to the largest.
const LARGEST_PAUSE: u32 = 64;

/// The ringing side of a topic's wake-up.
#[derive(Debug)]
pub(crate) struct Waker(Bell);

/// The waiting side of a topic's wake-up.
///
/// When the publisher runs on another core, waking costs far more than the data: the waiter then looks at the bell
/// for as long as being woken would take before it sleeps. Where that was in vain it tries ever more seldom, so a
/// component that waits for a millisecond at a time spends less than 0.1 % of its core on looking.
#[derive(Debug)]
pub struct Trigger {
    bell: Bell,
    heard: Cell<u32>,
    patience: Patience,
}

impl Waker {
    /// Makes the bell of a topic.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let bell = Bell::create(&file(node, topic));
        Ok(Self(bell.map_err(|error| refused(&topic.name, "making its bell")(&error))?))
    }

    /// Opens the bell of a topic.
    pub(crate) fn open(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let bell = Bell::open(&file(node, topic));
        Ok(Self(bell.map_err(|error| refused(&topic.name, "opening its bell")(&error))?))
    }

    /// Wakes all that wait.
    pub(crate) fn wake(&self) {
        self.0.ring();
    }
}

impl Trigger {
    pub(super) fn open(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let bell = Bell::open(&file(node, topic));
        let bell = bell.map_err(|error| refused(&topic.name, "opening its bell")(&error))?;
        let heard = Cell::new(bell.rings());
        Ok(Self { bell, heard, patience: Patience::default() })
    }

    /// Waits for the topic to be published, for the launcher to want something, or for a signal.
    pub fn wait(&self) {
        let heard = self.heard.get();
        if self.bell.rings() == heard && !self.look(heard) {
            self.bell.sleep(heard);
        }
        self.heard.set(self.bell.rings());
    }

    /// Whether there was a publication since the last look or wait; never waits.
    pub fn is_due(&self) -> bool {
        let rings = self.bell.rings();
        self.heard.replace(rings) != rings
    }

    /// Looks for a ring without sleeping, where that may be worth it.
    fn look(&self, heard: u32) -> bool {
        let elsewhere = self.bell.core().is_some_and(|core| core != current_core());
        if !elsewhere || !self.patience.has_some() {
            return false;
        }
        let end = monotonic_ns() + SPIN_NS;
        let mut found = false;
        while !found && monotonic_ns() < end {
            for _ in 0..8 {
                core::hint::spin_loop();
                found |= self.bell.rings() != heard;
            }
        }
        self.patience.learn(found);
        found
    }
}

/// Whether looking is worth it, learnt from how it went.
#[derive(Debug, Default)]
struct Patience {
    /// Waits to let pass without looking.
    pause: Cell<u32>,
    /// Waits that the next vain look costs.
    next_pause: Cell<u32>,
}

impl Patience {
    fn has_some(&self) -> bool {
        let pause = self.pause.get();
        self.pause.set(pause.saturating_sub(1));
        pause == 0
    }

    fn learn(&self, worth_it: bool) {
        if worth_it {
            self.next_pause.set(0);
        } else {
            let pause = (2 * self.next_pause.get()).clamp(1, LARGEST_PAUSE);
            self.next_pause.set(pause);
            self.pause.set(pause);
        }
    }
}

/// The file of a topic's bell, in the folder of its domain.
fn file(node: &Node<Shared>, topic: &TopicPlan) -> PathBuf {
    let mut digest = Digest::default();
    digest.write(topic.name.as_bytes());
    let root = String::from_utf8_lossy(node.config().global.root_path().as_bytes()).into_owned();
    PathBuf::from(root).join(format!("bell-{:016x}", digest.finish()))
}
