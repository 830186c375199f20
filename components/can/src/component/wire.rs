//! Frames as topics carry them.

use motorium::state::CanFrame;

use crate::{ErrorState, Form, Frame, Id, Report};

/// A frame of one bus for a topic; `time_ns` is when it was received, 0 for one to be sent.
pub(super) fn to_topic(frame: &Frame, bus: usize, time_ns: u64) -> CanFrame {
    let (id, extended) = match frame.id {
        Id::Standard(id) => (u32::from(id), 0),
        Id::Extended(id) => (id, CanFrame::EXTENDED),
    };
    let form = match frame.form {
        Form::Classic => 0,
        Form::Fd => CanFrame::FD,
        Form::FdFast => CanFrame::FD | CanFrame::BIT_RATE_SWITCH,
    };
    let (bus, length) = (bus as u32, frame.data().len() as u32);
    let mut out =
        CanFrame { receive_time: time_ns, id, flags: extended | form, bus, length, ..CanFrame::default() };
    out.data[..frame.data().len()].copy_from_slice(frame.data());
    out
}

/// The data frame that a topic carries; `None` for reports of errors, remote requests and what is no frame.
pub(super) fn from_topic(frame: &CanFrame) -> Option<Frame> {
    if frame.flags & (CanFrame::ERROR | CanFrame::REMOTE) != 0 {
        return None;
    }
    let id = if frame.flags & CanFrame::EXTENDED != 0 {
        Id::extended(frame.id)?
    } else {
        Id::standard(u16::try_from(frame.id).ok()?)?
    };
    let form = match (frame.flags & CanFrame::FD != 0, frame.flags & CanFrame::BIT_RATE_SWITCH != 0) {
        (false, _) => Form::Classic,
        (true, false) => Form::Fd,
        (true, true) => Form::FdFast,
    };
    Frame::new(id, form, frame.data.get(..frame.length as usize)?)
}

/// The report of a controller's state.
pub(super) fn report(state: ErrorState, is_back: bool, bus: usize, time_ns: u64) -> CanFrame {
    let (classes, bytes) = Report { state: Some(state), is_restart: is_back, ..Report::default() }.encode();
    let mut out = CanFrame {
        receive_time: time_ns,
        id: classes,
        flags: CanFrame::ERROR,
        bus: bus as u32,
        length: 8,
        ..CanFrame::default()
    };
    out.data[..8].copy_from_slice(&bytes);
    out
}

/// The report of a controller that a topic carries.
pub(super) fn report_of(frame: &CanFrame) -> Option<Report> {
    let data = frame.data.first_chunk::<8>()?;
    (frame.flags & CanFrame::ERROR != 0).then(|| Report::decode(frame.id, data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_survives_its_topic_in_every_form() {
        for (id, form, length) in [
            (Id::Standard(0x7ff), Form::Classic, 8),
            (Id::Extended(0x1fff_ffff), Form::Classic, 0),
            (Id::Standard(1), Form::FdFast, 64),
            (Id::Extended(7), Form::Fd, 12),
        ] {
            let frame = Frame::new(id, form, &vec![0xa5; length]).unwrap();
            assert_eq!(from_topic(&to_topic(&frame, 2, 9)), Some(frame));
        }
    }

    #[test]
    fn what_is_no_frame_is_none() {
        let frame = to_topic(&Frame::classic(Id::Standard(1), &[1; 8]), 0, 0);
        assert_eq!(from_topic(&CanFrame { length: 65, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { length: 9, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { id: 0x800, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { flags: CanFrame::REMOTE, ..frame }), None);
    }

    #[test]
    fn the_state_of_a_controller_survives_its_report() {
        for state in [ErrorState::Active, ErrorState::Passive, ErrorState::Off] {
            assert_eq!(report_of(&report(state, false, 0, 0)).unwrap().state, Some(state));
        }
    }
}
