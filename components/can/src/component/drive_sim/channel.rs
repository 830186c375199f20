//! One simulated bus: its nodes, and the adapter's interface to it.

use super::axis::Axis;
use crate::component::wire::BATCH;
use crate::{Condition, Frame, SimulatedBus, Table};

/// One bus. Node 0 is the adapter. The drives start at node 1, followed by a babbling node and a twin of a
/// drive.
pub(super) struct Channel {
    pub(super) bus: SimulatedBus,
    pub(super) babbler: usize,
    pub(super) twin: usize,
    pub(super) babbled_ns: u64,
    /// Last reported condition of the adapter's interface.
    pub(super) condition: Condition,
    pub(super) is_down: bool,
    pub(super) was_off: bool,
    /// Nodes that are connected to the bus, including bus-off nodes.
    connected: Vec<bool>,
    /// Maximum number of queued frames of the adapter, like the queues of a Linux interface and its
    /// controller.
    room: usize,
    pub(super) unsent: u8,
    pub(super) is_unacknowledged: bool,
}

impl Channel {
    /// Returns the free space in the queue, frames.
    pub(super) fn room(&self) -> usize {
        self.room.saturating_sub(self.bus.waiting(0))
    }

    /// Queues a frame of the computer, or drops it if there is no room.
    pub(super) fn hand_over(&mut self, frame: Frame, ready_ns: u64) {
        let fits = self.room() > 0 && self.bus.enqueue(0, frame, ready_ns);
        self.unsent = self.unsent.saturating_add(u8::from(!fits));
    }

    /// Connects or disconnects a node; a reconnected node restarts.
    pub(super) fn connect(&mut self, node: usize, is_connected: bool) {
        match (self.connected[node], is_connected) {
            (true, false) => self.bus.switch_off(node),
            (false, true) => self.bus.restart(node),
            _ => {}
        }
        self.connected[node] = is_connected;
    }
}

/// Number of frames that a Linux interface buffers: ten in its queue, two in its controller.
const ROOM: usize = 12;

/// Creates the simulated buses, and assigns a node to each drive.
pub(super) fn channels(table: &Table, axes: &mut [Axis]) -> Vec<Channel> {
    let channel = |index: usize| {
        let mut nodes = 1;
        for axis in axes.iter_mut().filter(|axis| axis.bus == index) {
            (axis.node, nodes) = (nodes, nodes + 1);
        }
        Channel {
            bus: SimulatedBus::new(table.rates(index), nodes + 2, BATCH),
            babbler: nodes,
            twin: nodes + 1,
            babbled_ns: 0,
            condition: Condition::Active,
            is_down: false,
            was_off: false,
            connected: vec![true; nodes + 2],
            room: ROOM.max(nodes - 1),
            unsent: 0,
            is_unacknowledged: false,
        }
    };
    (0..table.buses.len()).map(channel).collect()
}
