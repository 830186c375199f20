//! Exchange of frames between the adapter and its drives: topics for simulated buses, sockets for real ones.

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::CanFrame;
use motorium::transport::{SliceInput, SliceOutput};

use super::account::BusAccount;
use crate::adapter::Adapter;
use crate::bus::socket::Waiting;
use crate::bus::{Bus, Received};
use crate::component::interfaces;
use crate::component::wire::{self, BATCH};
use crate::{Frame, RealBus, Table};

/// Maximum time spent disabling drives at the end, ns. An ODrive confirms in its next heartbeat.
const RELEASE_NS: u64 = 300_000_000;
/// Time to wait for the answers to each round of orders, ns.
const RELEASE_EVERY_NS: u64 = 5_000_000;
/// Rounds after the first one.
const RELEASES: u32 = 2;

/// Channel through which frames are exchanged.
pub(super) enum Exchange {
    /// Simulated buses: frames pass through topics, and answers arrive in a later step.
    Topics(Box<Topics>),
    /// Real buses: the step waits for the answers.
    Sockets(Sockets),
}

impl Exchange {
    /// Processes all received frames, and updates the conditions of the buses.
    pub(super) fn collect(&mut self, adapter: &mut Adapter, buses: &mut [BusAccount]) {
        match self {
            Self::Topics(topics) => topics.collect(adapter, buses),
            Self::Sockets(sockets) => sockets.collect(adapter, buses),
        }
    }

    /// Sends the batch of this cycle. Frames that are not accepted are dropped: the next cycle has newer
    /// commands.
    pub(super) fn send(
        &mut self,
        tick: &Tick,
        adapter: &mut Adapter,
        buses: &mut [BusAccount],
        frames: &mut Vec<Frame>,
    ) -> Result<(), StepError> {
        match self {
            Self::Topics(topics) => topics.send(tick, adapter, buses, frames),
            Self::Sockets(sockets) => {
                sockets.send(adapter, buses, frames);
                Ok(())
            }
        }
    }

    /// Waits for the answers to this cycle's batch, if the step order requires it.
    pub(super) fn await_answers(&mut self, adapter: &mut Adapter, buses: &mut [BusAccount]) {
        if let Self::Sockets(sockets) = self {
            sockets.await_answers(adapter, buses);
        }
    }
}

/// Topics of simulated buses.
pub(super) struct Topics {
    pub(super) received: SliceInput<CanFrame>,
    pub(super) sent: SliceOutput<CanFrame>,
    batch: Vec<CanFrame>,
}

impl Topics {
    pub(super) fn new(received: SliceInput<CanFrame>, sent: SliceOutput<CanFrame>) -> Self {
        Self { received, sent, batch: Vec::with_capacity(BATCH) }
    }

    fn collect(&mut self, adapter: &mut Adapter, buses: &mut [BusAccount]) {
        while let Some((_, frames)) = self.received.next_unread() {
            for frame in frames {
                let Some(bus) = buses.get_mut(frame.bus as usize) else { continue };
                if let Some(news) = wire::news_of(frame) {
                    bus.apply(&news);
                    // an adapter that cannot send cannot command; the drives' watchdogs disable them
                    if !bus.condition.can_send() {
                        adapter.trip();
                    }
                } else if let Some(data) = wire::from_topic(frame) {
                    bus.received(&data);
                    let received = Received { frame: data, time_ns: frame.receive_time };
                    adapter.take(frame.bus as usize, &received);
                } else {
                    bus.counts.dropped += 1;
                }
            }
        }
    }

    fn send(
        &mut self,
        tick: &Tick,
        adapter: &mut Adapter,
        buses: &mut [BusAccount],
        frames: &mut Vec<Frame>,
    ) -> Result<(), StepError> {
        self.batch.clear();
        for (index, bus) in buses.iter_mut().enumerate() {
            frames.clear();
            adapter.write(index, frames);
            let room = if bus.condition.can_send() { BATCH - self.batch.len() } else { 0 };
            let count = frames.len().min(room);
            bus.sent(frames, count);
            self.batch.extend(frames[..count].iter().map(|frame| wire::to_topic(frame, index, 0)));
            adapter.sent(index, count, tick.time_ns);
        }
        let mut out = self.sent.loan(self.batch.len())?;
        out.copy_from_slice(&self.batch);
        out.publish()
    }
}

/// Sockets of real buses.
pub(super) struct Sockets {
    buses: Vec<RealBus>,
    inbox: Vec<Received>,
    waiting: Waiting,
    clock: RunClock,
    /// Maximum time that a step waits for answers, ns; `None` if they are read in the next step.
    answer_within_ns: Option<u64>,
}

impl Sockets {
    /// Opens the interfaces of a table.
    pub(super) fn open(
        table: &Table,
        clock: RunClock,
        answer_within_ns: Option<u64>,
    ) -> Result<Self, ConfigError> {
        let buses = interfaces::open(table)?;
        let waiting = Waiting::with_capacity(buses.len());
        Ok(Self { buses, inbox: vec![Received::default(); BATCH], waiting, clock, answer_within_ns })
    }

    /// Configures the adapter for buses without bit times.
    pub(super) fn prepare(&self, adapter: &mut Adapter) {
        for (index, _) in self.buses.iter().enumerate().filter(|(_, bus)| bus.is_virtual()) {
            adapter.without_bit_times(index);
        }
    }

    fn collect(&mut self, adapter: &mut Adapter, accounts: &mut [BusAccount]) {
        let start_ns = self.clock.stamp_ns(0);
        for (index, (bus, account)) in self.buses.iter_mut().zip(accounts).enumerate() {
            loop {
                let count = bus.receive(&mut self.inbox);
                for received in &self.inbox[..count] {
                    account.received(&received.frame);
                    let time_ns = received.time_ns.saturating_sub(start_ns);
                    adapter.take(index, &Received { frame: received.frame, time_ns });
                }
                // a bus with continuous traffic must not block the loop
                if count < self.inbox.len() {
                    break;
                }
            }
            account.follow(bus);
            // an adapter that cannot send cannot command; the drives' watchdogs disable them
            if !bus.condition().can_send() {
                adapter.trip();
            }
        }
    }

    fn send(&mut self, adapter: &mut Adapter, accounts: &mut [BusAccount], frames: &mut Vec<Frame>) {
        for (index, (bus, account)) in self.buses.iter_mut().zip(accounts).enumerate() {
            frames.clear();
            adapter.write(index, frames);
            let now_ns = self.clock.now_ns();
            let count = bus.send(frames);
            account.sent(frames, count);
            adapter.sent(index, count, now_ns);
        }
    }

    /// Orders the released drives to disable until each has confirmed that it is off, for at most
    /// [`RELEASE_NS`]. Returns `true` if all have confirmed.
    pub(super) fn release(
        &mut self,
        adapter: &mut Adapter,
        accounts: &mut [BusAccount],
        frames: &mut Vec<Frame>,
    ) -> bool {
        let until_ns = self.clock.now_ns() + RELEASE_NS;
        // an answer to an earlier frame is no confirmation, so the orders are sent again
        for round in 0.. {
            self.send(adapter, accounts, frames);
            self.receive_for(adapter, accounts, RELEASE_EVERY_NS, |_| false);
            adapter.end_cycle(false);
            if round >= RELEASES && adapter.is_released() || self.clock.now_ns() >= until_ns {
                break;
            }
        }
        adapter.is_released()
    }

    /// Receives until all queried drives have answered, or the time has expired.
    fn await_answers(&mut self, adapter: &mut Adapter, accounts: &mut [BusAccount]) {
        if let Some(within_ns) = self.answer_within_ns {
            self.receive_for(adapter, accounts, within_ns, Adapter::has_all_answers);
        }
    }

    fn receive_for(
        &mut self,
        adapter: &mut Adapter,
        accounts: &mut [BusAccount],
        within_ns: u64,
        is_enough: fn(&Adapter) -> bool,
    ) {
        let until_ns = self.clock.now_ns() + within_ns;
        loop {
            self.collect(adapter, accounts);
            let left_ns = until_ns.saturating_sub(self.clock.now_ns());
            if left_ns == 0 || is_enough(adapter) {
                return;
            }
            // an interface that is down would end the wait immediately
            let up = self.buses.iter().filter(|bus| bus.condition().can_send());
            self.waiting.wait(up.map(std::os::fd::AsFd::as_fd), left_ns);
        }
    }
}
