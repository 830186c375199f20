//! Injection of faults into the frames sent by drives.

use super::axis::Axis;
use super::config::DriveSimulationConfig;
use crate::Frame;
use crate::component::faults::{Fault, FaultKind};

/// Time between two frames of a babbling node, ns: shorter than a frame.
pub(super) const BABBLE_NS: u64 = 50_000;

/// Drive that sends a frame, with its node.
#[derive(Clone, Copy)]
pub(super) struct DriveNode {
    entry: usize,
    node: usize,
    /// Invalidates the device, state or a number in a frame.
    corrupt: fn(&mut Frame),
}

impl DriveNode {
    pub(super) fn from_axis(axis: &Axis) -> Self {
        Self { entry: axis.entry, node: axis.node, corrupt: axis.drive.corruption() }
    }
}

/// Injector of delays, losses and faults into the frames from a drive to its bus.
pub(super) struct FaultInjector<'a> {
    pub(super) faults: &'a [Fault],
    pub(super) config: &'a DriveSimulationConfig,
    pub(super) random: &'a mut u64,
    pub(super) lost: &'a mut u64,
}

impl FaultInjector<'_> {
    /// Sends a frame of a drive `delay_ns` after `time_ns`, with the faults scripted for that time.
    pub(super) fn send(
        &mut self,
        drive: DriveNode,
        frame: Frame,
        time_ns: u64,
        delay_ns: u64,
        answer_with: &mut dyn FnMut(Sender, Frame, u64),
    ) {
        let (faults, config) = (self.faults, self.config);
        let has = |kind| faults.iter().find(|fault| fault.befalls(kind, drive.entry, time_ns));
        let lost = config.loss > 0.0 && uniform(self.random) < config.loss;
        if has(FaultKind::Silent).is_some() || lost {
            *self.lost += 1;
            return;
        }
        let jitter_ns = match config.jitter.ns {
            0 => 0,
            jitter => (uniform(self.random) * jitter as f64) as u64,
        };
        let late_ns = has(FaultKind::Late).map_or(0, |fault| fault.delay_ns);
        let ready_ns = time_ns + delay_ns + jitter_ns + late_ns;
        let mut frame = frame;
        if has(FaultKind::WrongLength).is_some() {
            let length = frame.data().len().min(6).saturating_sub(1);
            frame = Frame::new(frame.id, frame.form, &frame.data()[..length]).unwrap_or(frame);
        } else if has(FaultKind::Corrupt).is_some() {
            (drive.corrupt)(&mut frame);
        }
        answer_with(Sender::Drive(drive.node), frame, ready_ns);
        if has(FaultKind::Duplicate).is_some() {
            answer_with(Sender::Drive(drive.node), frame, ready_ns);
        }
        if has(FaultKind::Twin).is_some() {
            answer_with(Sender::Twin, elsewhere(frame), ready_ns);
        }
    }
}

/// Node that sends an answer.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sender {
    /// The drive itself.
    Drive(usize),
    /// Another drive with the same number.
    Twin,
}

impl Sender {
    /// Returns the index of the node; `twin` is the node of the other drive.
    pub(super) fn node(self, twin: usize) -> usize {
        match self {
            Self::Drive(node) => node,
            Self::Twin => twin,
        }
    }
}

/// Returns the answer of another drive with the same number, at a different position.
fn elsewhere(mut answer: Frame) -> Frame {
    if let Some(position) = answer.data_mut().get_mut(1) {
        *position ^= 0x20;
    }
    answer
}

/// Returns a pseudo-random number from 0 to 1 (splitmix64).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z >> 11) as f64 / (1_u64 << 53) as f64
}
