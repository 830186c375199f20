//! Simulated drives on simulated buses.

use motorium::component::RunClock;
use motorium::prelude::*;

use super::channel::Channel;
use super::drives::Drives;
use super::endpoints::Endpoints;
use super::fault_injector::BABBLE_NS;
use crate::bus::simulated::Event;
use crate::component::faults::FaultKind;
use crate::{Condition, ErrorState, Form, Frame, Id, Report};

/// Simulated buses with their endpoints.
pub(super) struct Simulated {
    endpoints: Endpoints,
    buses: Vec<Channel>,
}

impl Simulated {
    pub(super) fn new(endpoints: Endpoints, buses: Vec<Channel>) -> Self {
        Self { endpoints, buses }
    }

    /// Advances the buses to the current time, and publishes the frames that the adapter receives.
    pub(super) fn run(
        &mut self,
        drives: &mut Drives<'_>,
        clock: &RunClock,
        now_ns: u64,
    ) -> Result<(), StepError> {
        let Self { endpoints, buses } = self;
        endpoints.receive(clock.stamp_ns(0), buses);
        self.begin_faults(drives, now_ns);
        for index in 0..self.buses.len() {
            self.run_bus(index, now_ns, drives);
        }
        drives.lost += self.endpoints.publish()?;
        Ok(())
    }

    /// Applies the faults of buses, and connects or disconnects their nodes.
    fn begin_faults(&mut self, drives: &mut Drives<'_>, now_ns: u64) {
        let faults = drives.faults;
        for (index, channel) in self.buses.iter_mut().enumerate() {
            let is_on = |kind| faults.iter().any(|fault| fault.befalls(kind, index, now_ns));
            let is_alone = is_on(FaultKind::Alone);
            let mut has_twin = false;
            for axis in drives.axes.iter_mut().filter(|axis| axis.bus == index) {
                has_twin |= faults.iter().any(|fault| fault.befalls(FaultKind::Twin, axis.entry, now_ns));
                channel.connect(axis.node, !is_alone && !axis.was_off);
                axis.is_cut_off = channel.bus.state(axis.node) == ErrorState::Off;
            }
            channel.connect(channel.babbler, !is_alone && is_on(FaultKind::Babbling));
            channel.connect(channel.twin, !is_alone && has_twin);
            channel.is_down = is_on(FaultKind::Down);
            let is_off = is_on(FaultKind::BusOff) || channel.is_down;
            match (is_off, channel.was_off) {
                (true, _) => channel.bus.switch_off(0),
                (false, true) => channel.bus.restart(0),
                (false, false) => {}
            }
            channel.was_off = is_off;
            if is_on(FaultKind::Disturbed) {
                channel.bus.disturb(1);
            }
            if is_on(FaultKind::Babbling) {
                // the node resumes after its last frame, without accumulating a backlog
                channel.babbled_ns = channel.babbled_ns.max(now_ns.saturating_sub(1_000_000));
                while channel.babbled_ns < now_ns {
                    let noise = Frame::classic(Id::Standard(0), &[0xff; 8]);
                    channel.bus.enqueue(channel.babbler, noise, channel.babbled_ns);
                    channel.babbled_ns += BABBLE_NS;
                }
            } else {
                channel.babbled_ns = now_ns;
            }
        }
    }

    /// Advances a bus to the current time: drives receive delivered frames, and their answers are sent on the
    /// bus.
    fn run_bus(&mut self, index: usize, now_ns: u64, drives: &mut Drives<'_>) {
        let Channel { bus, twin, .. } = &mut self.buses[index];
        drives.report(index, now_ns, &mut |sender, frame, ready_ns| {
            bus.enqueue(sender.node(*twin), frame, ready_ns);
        });
        while let Some(event) = self.buses[index].bus.next(now_ns) {
            let channel = &mut self.buses[index];
            match event {
                Event::Delivered { sender: 0, frame, time_ns } => {
                    let Channel { bus, twin, .. } = channel;
                    drives.receive(index, &frame, time_ns, &mut |sender, answer, ready_ns| {
                        bus.enqueue(sender.node(*twin), answer, ready_ns);
                    });
                }
                Event::Delivered { frame, time_ns, .. } if channel.bus.state(0) != ErrorState::Off => {
                    if frame.form == Form::Packet {
                        let Channel { bus, twin, .. } = channel;
                        drives.observe(index, &frame, time_ns, &mut |sender, answer, ready_ns| {
                            bus.enqueue(sender.node(*twin), answer, ready_ns);
                        });
                    }
                    self.endpoints.deliver(index, &frame, time_ns);
                }
                Event::Disturbed { sender: 0, is_unacknowledged: true, .. } => {
                    channel.is_unacknowledged = true
                }
                Event::Delivered { .. } | Event::Disturbed { .. } => {}
            }
        }
        self.report_interface(index, now_ns);
    }

    /// Reports changes of the adapter's interface since the last step.
    fn report_interface(&mut self, index: usize, now_ns: u64) {
        let channel = &mut self.buses[index];
        let state = channel.bus.state(0);
        let condition = if channel.is_down { Condition::Down } else { state.into() };
        let (before, unsent) = (core::mem::replace(&mut channel.condition, condition), channel.unsent);
        let is_unacknowledged = core::mem::take(&mut channel.is_unacknowledged);
        channel.unsent = 0;
        if condition == Condition::Down {
            if before != condition {
                self.endpoints.set_link_down(index, true, now_ns);
            }
            return;
        }
        if before == Condition::Down {
            self.endpoints.set_link_down(index, false, now_ns);
        }
        if before != condition || is_unacknowledged || unsent > 0 {
            let report = Report {
                state: (before != condition).then_some(state),
                is_unacknowledged,
                is_overflow: unsent > 0,
                is_restart: !before.can_send() && condition.can_send(),
                ..Report::default()
            };
            self.endpoints.report(index, &report, unsent, now_ns);
        }
    }
}
