//! Conversion between frames and their topic format.

use motorium::state::CanFrame;

use crate::{Form, Frame, Id, Report};

/// Maximum number of frames in one batch for all buses.
pub(super) const BATCH: usize = 128;

/// Converts a frame of one bus for a topic; `time_ns` is its receive time, 0 for an outgoing frame.
pub(super) fn to_topic(frame: &Frame, bus: usize, time_ns: u64) -> CanFrame {
    let (id, extended) = match frame.id {
        Id::Standard(id) => (u32::from(id), 0),
        Id::Extended(id) => (id, CanFrame::EXTENDED),
    };
    let form = match frame.form {
        Form::Classic => 0,
        Form::Fd => CanFrame::FD,
        Form::FdFast => CanFrame::FD | CanFrame::BIT_RATE_SWITCH,
        Form::Packet => CanFrame::PACKET,
    };
    let (bus, length) = (bus as u32, frame.data().len() as u32);
    let mut out =
        CanFrame { receive_time: time_ns, id, flags: extended | form, bus, length, ..CanFrame::default() };
    out.data[..frame.data().len()].copy_from_slice(frame.data());
    out
}

/// Converts a data frame from a topic; `None` for error reports, remote requests and invalid frames.
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
        _ if frame.flags & CanFrame::PACKET != 0 => Form::Packet,
        (false, _) => Form::Classic,
        (true, false) => Form::Fd,
        (true, true) => Form::FdFast,
    };
    Frame::new(id, form, frame.data.get(..frame.length as usize)?)
}

/// Converts the report of a controller, with the number of frames that did not fit into its queue.
pub(super) fn report(report: &Report, unsent: u8, bus: usize, time_ns: u64) -> CanFrame {
    let (classes, bytes) = report.encode();
    let mut out = CanFrame {
        receive_time: time_ns,
        id: classes,
        flags: CanFrame::ERROR,
        bus: bus as u32,
        length: 8,
        ..CanFrame::default()
    };
    out.data[..8].copy_from_slice(&bytes);
    out.data[UNSENT] = unsent;
    out
}

/// Index of the byte of an error frame that drivers may use freely.
const UNSENT: usize = 5;

/// Reports that the interface of a simulated bus is down, as an empty report.
pub(super) fn down(bus: usize, time_ns: u64) -> CanFrame {
    CanFrame { receive_time: time_ns, flags: CanFrame::ERROR, bus: bus as u32, ..CanFrame::default() }
}

/// Status change of a simulated interface.
#[derive(Debug, PartialEq)]
pub(super) enum News {
    /// The interface is down.
    Down,
    /// Report of its controller, with the number of frames that did not fit into its queue.
    Report(Report, u8),
}

/// Returns the status change in a topic frame; `None` for a data frame.
pub(super) fn news_of(frame: &CanFrame) -> Option<News> {
    let data = frame.data.first_chunk::<8>()?;
    match (frame.flags & CanFrame::ERROR != 0, frame.length) {
        (false, _) => None,
        (true, 0) => Some(News::Down),
        (true, _) => Some(News::Report(Report::decode(frame.id, data), data[UNSENT])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorState;

    #[test]
    fn frames_of_every_form_round_trip_through_a_topic() {
        for (id, form, length) in [
            (Id::Standard(0x7ff), Form::Classic, 8),
            (Id::Extended(0x1fff_ffff), Form::Classic, 0),
            (Id::Standard(1), Form::FdFast, 64),
            (Id::Extended(7), Form::Fd, 12),
            (Id::Standard(6), Form::Packet, 33),
        ] {
            let frame = Frame::new(id, form, &vec![0xa5; length]).unwrap();
            assert_eq!(from_topic(&to_topic(&frame, 2, 9)), Some(frame));
        }
    }

    #[test]
    fn invalid_frames_are_ignored() {
        let frame = to_topic(&Frame::classic(Id::Standard(1), &[1; 8]), 0, 0);
        assert_eq!(from_topic(&CanFrame { length: 65, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { length: 9, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { id: 0x800, ..frame }), None);
        assert_eq!(from_topic(&CanFrame { flags: CanFrame::REMOTE, ..frame }), None);
    }

    #[test]
    fn interface_status_round_trips_through_a_topic() {
        for state in [ErrorState::Active, ErrorState::Passive, ErrorState::Off] {
            let sent = Report { state: Some(state), is_overflow: true, ..Report::default() };
            assert_eq!(news_of(&report(&sent, 7, 0, 0)), Some(News::Report(sent, 7)));
        }
        assert_eq!(news_of(&down(1, 2)), Some(News::Down));
        assert_eq!(news_of(&to_topic(&Frame::classic(Id::Standard(1), &[]), 0, 0)), None);
    }
}
