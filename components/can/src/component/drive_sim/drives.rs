//! Delivery of frames to the drives of a robot.

use super::axis::Axis;
use super::config::DriveSimulationConfig;
use super::fault_injector::{DriveNode, FaultInjector, Sender};
use crate::Frame;
use crate::component::faults::Fault;

/// Drives that receive a frame.
pub(super) struct Drives<'a> {
    pub(super) axes: &'a mut [Axis],
    pub(super) faults: &'a [Fault],
    pub(super) config: &'a DriveSimulationConfig,
    pub(super) random: &'a mut u64,
    pub(super) lost: u64,
}

impl Drives<'_> {
    /// Delivers a frame to all drives of a bus. Passes the answer of each addressed drive to `answer_with`,
    /// with the drive's node and the time at which the answer is ready.
    pub(super) fn receive(
        &mut self,
        index: usize,
        frame: &Frame,
        time_ns: u64,
        answer_with: &mut dyn FnMut(Sender, Frame, u64),
    ) {
        let delay_ns = self.config.delay.ns;
        self.each_listener(index, |axis, injector| {
            let drive = DriveNode::from_axis(axis);
            let mut answer = |answer| injector.send(drive, answer, time_ns, delay_ns, answer_with);
            axis.drive.receive(frame, time_ns, &mut answer);
        });
    }

    /// Delivers the frame of one servo to the others on its serial line. The next servo in turn answers
    /// immediately.
    pub(super) fn observe(
        &mut self,
        index: usize,
        frame: &Frame,
        time_ns: u64,
        answer_with: &mut dyn FnMut(Sender, Frame, u64),
    ) {
        self.each_listener(index, |axis, injector| {
            let drive = DriveNode::from_axis(axis);
            axis.drive.observe(frame, &mut |answer| injector.send(drive, answer, time_ns, 0, answer_with));
        });
    }

    /// Calls `deliver` with each drive that receives the traffic of a bus.
    fn each_listener(&mut self, index: usize, mut deliver: impl FnMut(&mut Axis, &mut FaultInjector<'_>)) {
        let Self { axes, faults, config, random, lost } = self;
        let mut injector = FaultInjector { faults, config, random, lost };
        for axis in axes.iter_mut().filter(|axis| axis.bus == index && axis.is_on_bus()) {
            deliver(axis, &mut injector);
        }
    }

    /// Collects the unsolicited frames of the drives of a bus until `now_ns`.
    pub(super) fn report(
        &mut self,
        index: usize,
        now_ns: u64,
        answer_with: &mut dyn FnMut(Sender, Frame, u64),
    ) {
        let Self { axes, faults, config, random, lost } = self;
        let mut injector = FaultInjector { faults, config, random, lost };
        for axis in axes.iter_mut().filter(|axis| axis.bus == index) {
            let (drive, is_on_bus) = (DriveNode::from_axis(axis), axis.is_on_bus());
            axis.drive.report(now_ns, &mut |frame, time_ns| {
                if is_on_bus {
                    injector.send(drive, frame, time_ns, 0, answer_with);
                }
            });
        }
    }
}
