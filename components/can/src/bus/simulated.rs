//! Bus in simulated time, with exact bit times, arbitration and error counters.

use std::collections::VecDeque;

use super::bits::{Bits, Rates};
pub use super::report::ErrorState;
use super::{Bus, Received};
use crate::frame::{Form, Frame};

/// Event on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame arrived at all other nodes.
    Delivered {
        /// Index of the node that sent the frame.
        sender: usize,
        /// The frame that arrived.
        frame: Frame,
        /// Time of the frame's last bit, ns.
        time_ns: u64,
    },
    /// A frame was disturbed and will be sent again.
    Disturbed {
        /// Index of the node that sent the frame.
        sender: usize,
        /// State of the node after the error.
        state: ErrorState,
        /// `true` if the frame was not acknowledged because no other node is on the bus.
        is_unacknowledged: bool,
        /// Time of the error, ns.
        time_ns: u64,
    },
}

/// One controller on the bus.
#[derive(Debug)]
struct Node {
    queue: VecDeque<(Frame, u64)>,
    inbox: VecDeque<Received>,
    /// `true` if received frames are queued for a port.
    listens: bool,
    transmit_errors: u32,
    receive_errors: u32,
    is_off: bool,
    /// Earliest time of the node's next transmission, ns: an error-passive node suspends transmission after
    /// an error.
    suspended_ns: u64,
}

/// Bus in simulated time.
///
/// A frame starts when the bus is free; if several frames are waiting, the one with the lowest identifier
/// wins arbitration. The duration of a frame follows from its exact number of bits, including stuff bits. A
/// disturbed sender increments its transmit error counter by eight and retransmits. The sender becomes
/// error-passive at 128 and bus-off above 255. Two nodes that send different frames with the same identifier
/// disturb each other. A frame without a receiver is not acknowledged and is repeated. Packets of a serial
/// line are sent one after the other, without error detection. The bus is deterministic: its behaviour
/// depends only on its input.
#[derive(Debug)]
pub struct SimulatedBus {
    rates: Rates,
    nodes: Vec<Node>,
    depth: usize,
    /// Time from which the bus is free, ns.
    free_ns: u64,
    busy_ns: u64,
    disturbed: u32,
}

/// Number of bits of an error: flag, its echo, delimiter, interframe space.
const ERROR_BITS: u32 = 12 + 8 + 3;
/// Number of bits between two frames.
const PAUSE_BITS: u32 = 3;
/// Number of bits for which an error-passive node suspends transmission after sending.
const SUSPEND_BITS: u32 = 8;

impl SimulatedBus {
    /// Creates a bus with `nodes` nodes. Each node has a send queue of `depth` frames.
    pub fn new(rates: Rates, nodes: usize, depth: usize) -> Self {
        let node = |_| Node {
            queue: VecDeque::with_capacity(depth),
            inbox: VecDeque::with_capacity(depth),
            listens: false,
            transmit_errors: 0,
            receive_errors: 0,
            is_off: false,
            suspended_ns: 0,
        };
        let nodes = (0..nodes).map(node).collect();
        Self { rates, nodes, depth, free_ns: 0, busy_ns: 0, disturbed: 0 }
    }

    /// Queues a frame for transmission by `node` from `ready_ns` on. Returns `false` if the queue is full or
    /// the node is bus-off.
    pub fn enqueue(&mut self, node: usize, frame: Frame, ready_ns: u64) -> bool {
        let sender = &mut self.nodes[node];
        let fits = sender.queue.len() < self.depth && !sender.is_off;
        if fits {
            sender.queue.push_back((frame, ready_ns));
        }
        fits
    }

    /// Returns the next event that ends at or before `until_ns`. A caller that answers a frame must enqueue
    /// the answer before the next call.
    pub fn next(&mut self, until_ns: u64) -> Option<Event> {
        let waits = |node: &Node| node.queue.front().map(|(_, ready)| (*ready).max(node.suspended_ns));
        let first_ns = self.nodes.iter().filter_map(waits).min()?;
        let start_ns = first_ns.max(self.free_ns);
        let ready = self.nodes.iter().enumerate();
        let ready = ready.filter(|(_, node)| waits(node).is_some_and(|ready| ready <= start_ns));
        let frame_of = |node: &Node| node.queue.front().map_or_else(Frame::default, |(frame, _)| *frame);
        let (sender, frame) = ready
            .clone()
            .map(|(index, node)| (index, frame_of(node)))
            .min_by_key(|(_, frame)| frame.id.arbitration())?;
        let rival = ready.map(|(index, node)| (index, frame_of(node))).find(|(index, other)| {
            *index != sender && other.id.arbitration() == frame.id.arbitration() && *other != frame
        });
        let lasts_ns = Bits::from_frame(&frame).ns(&self.rates);
        let is_packet = frame.form == Form::Packet;
        let alone = self.nodes.iter().enumerate().all(|(index, node)| index == sender || node.is_off);
        if !is_packet && (rival.is_some() || alone || self.disturbed > 0) {
            let time_ns = start_ns + lasts_ns;
            let over_ns = time_ns + self.bits_ns(ERROR_BITS);
            if over_ns > until_ns {
                return None;
            }
            self.disturbed = self.disturbed.saturating_sub(u32::from(rival.is_none() && !alone));
            self.busy_ns += over_ns - start_ns;
            self.free_ns = over_ns;
            if let Some((rival, _)) = rival {
                self.count_error(rival, over_ns, false);
            }
            self.count_error(sender, over_ns, alone);
            let state = self.state(sender);
            return Some(Event::Disturbed { sender, state, is_unacknowledged: alone, time_ns });
        }
        let time_ns = start_ns + lasts_ns - if is_packet { 0 } else { self.bits_ns(PAUSE_BITS) };
        if time_ns > until_ns {
            return None;
        }
        self.busy_ns += lasts_ns;
        self.free_ns = start_ns + lasts_ns;
        for (index, node) in self.nodes.iter_mut().enumerate() {
            if index == sender {
                node.queue.pop_front();
                node.transmit_errors = node.transmit_errors.saturating_sub(1);
            } else if !node.is_off {
                node.receive_errors = node.receive_errors.saturating_sub(1);
                if node.listens && node.inbox.len() < node.inbox.capacity() {
                    node.inbox.push_back(Received { frame, time_ns });
                }
            }
        }
        Some(Event::Delivered { sender, frame, time_ns })
    }

    fn count_error(&mut self, sender: usize, now_ns: u64, was_alone: bool) {
        for (index, node) in self.nodes.iter_mut().enumerate() {
            if index != sender && !node.is_off {
                node.receive_errors = (node.receive_errors + 1).min(255);
            }
        }
        let suspended_ns = now_ns + self.bits_ns(SUSPEND_BITS);
        let is_passive = self.state(sender) == ErrorState::Passive;
        let node = &mut self.nodes[sender];
        // a lone error-passive node stops incrementing its transmit error counter: missing acknowledgements
        // alone never cause bus-off
        if !(was_alone && is_passive) {
            node.transmit_errors += 8;
        }
        if is_passive {
            node.suspended_ns = suspended_ns;
        }
        if node.transmit_errors > 255 {
            (node.is_off, node.suspended_ns) = (true, 0);
            node.queue.clear();
        }
    }

    fn bits_ns(&self, bits: u32) -> u64 {
        Bits { nominal: bits, fast: 0 }.ns(&self.rates)
    }

    /// Returns the state of a node.
    pub fn state(&self, node: usize) -> ErrorState {
        let node = &self.nodes[node];
        match node.transmit_errors.max(node.receive_errors) {
            _ if node.is_off => ErrorState::Off,
            128.. => ErrorState::Passive,
            _ => ErrorState::Active,
        }
    }

    /// Disturbs the next `frames` frames on the wire.
    pub fn disturb(&mut self, frames: u32) {
        self.disturbed += frames;
    }

    /// Switches a node to bus-off, as its error counters would.
    pub fn switch_off(&mut self, node: usize) {
        let node = &mut self.nodes[node];
        (node.is_off, node.transmit_errors) = (true, 256);
        node.queue.clear();
    }

    /// Restarts a node with zero error counters.
    pub fn restart(&mut self, node: usize) {
        let node = &mut self.nodes[node];
        (node.is_off, node.transmit_errors, node.receive_errors, node.suspended_ns) = (false, 0, 0, 0);
    }

    /// Returns the number of frames in a node's send queue.
    pub fn waiting(&self, node: usize) -> usize {
        self.nodes[node].queue.len()
    }

    /// Returns the total time for which the bus carried bits, ns.
    pub fn busy_ns(&self) -> u64 {
        self.busy_ns
    }

    /// Returns the bus as seen by one node at `now_ns`. From then on, frames received by the node are queued.
    pub fn port(&mut self, node: usize, now_ns: u64) -> Port<'_> {
        self.nodes[node].listens = true;
        Port { bus: self, node, now_ns }
    }
}

/// Bus as seen by one node at a given time.
#[derive(Debug)]
pub struct Port<'a> {
    bus: &'a mut SimulatedBus,
    node: usize,
    now_ns: u64,
}

impl Bus for Port<'_> {
    fn send(&mut self, frames: &[Frame]) -> usize {
        frames.iter().take_while(|frame| self.bus.enqueue(self.node, **frame, self.now_ns)).count()
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        self.bus.nodes[self.node].listens = true;
        while self.bus.next(self.now_ns).is_some() {}
        let inbox = &mut self.bus.nodes[self.node].inbox;
        let mut count = 0;
        for (place, received) in frames.iter_mut().zip(core::iter::from_fn(|| inbox.pop_front())) {
            *place = received;
            count += 1;
        }
        count
    }
}
