//! Frames in the kernel's format.

use libc::{CAN_EFF_FLAG, CAN_EFF_MASK, CAN_ERR_FLAG, CAN_ERR_MASK, CAN_RTR_FLAG, CAN_SFF_MASK, canfd_frame};

use crate::bus::report::Report;
use crate::frame::{Form, Frame, Id};

/// Flag of a CAN FD frame whose data are sent at the data bitrate.
const FAST: u8 = libc::CANFD_BRS as u8;
/// Flag of a CAN FD frame on sockets that accept both forms.
const IS_FD: u8 = 0x04;

/// Converts a frame to the kernel's format.
pub(super) fn to_kernel(frame: &Frame) -> canfd_frame {
    let can_id = match frame.id {
        Id::Standard(id) => u32::from(id),
        Id::Extended(id) => id | CAN_EFF_FLAG,
    };
    let flags = match frame.form {
        Form::Classic | Form::Packet => 0,
        Form::Fd => IS_FD,
        Form::FdFast => IS_FD | FAST,
    };
    let mut data = [0; 64];
    data[..frame.data().len()].copy_from_slice(frame.data());
    empty(can_id, frame.data().len() as u8, flags, data)
}

/// Converts a report to the kernel's format.
pub(super) fn of_report(report: &Report) -> canfd_frame {
    let (classes, bytes) = report.encode();
    let mut data = [0; 64];
    data[..8].copy_from_slice(&bytes);
    empty(classes & CAN_ERR_MASK | CAN_ERR_FLAG, 8, 0, data)
}

/// Returns a zeroed frame, including the reserved fields.
#[allow(unsafe_code)] // the reserved fields have no names, and the structure has no default
fn zero_frame() -> canfd_frame {
    // SAFETY: a plain structure of numbers, for which zero is a valid value.
    unsafe { core::mem::zeroed() }
}

fn empty(can_id: u32, len: u8, flags: u8, data: [u8; 64]) -> canfd_frame {
    // the unnamed fields are reserved and stay zero
    let mut frame = zero_frame();
    (frame.can_id, frame.len, frame.flags, frame.data) = (can_id, len, flags, data);
    frame
}

/// Frame as delivered by the kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Delivered {
    /// Data frame.
    Data(Frame),
    /// Report of the controller.
    Report(Report),
    /// Remote request, or an invalid frame.
    Other,
}

/// Parses a frame delivered by the kernel.
pub(super) fn of_kernel(raw: &canfd_frame, is_fd: bool) -> Delivered {
    if raw.can_id & CAN_ERR_FLAG != 0 {
        let mut data = [0; 8];
        data.copy_from_slice(&raw.data[..8]);
        return Delivered::Report(Report::decode(raw.can_id & CAN_ERR_MASK, &data));
    }
    let id = if raw.can_id & CAN_EFF_FLAG != 0 {
        Id::Extended(raw.can_id & CAN_EFF_MASK)
    } else {
        Id::Standard((raw.can_id & CAN_SFF_MASK) as u16)
    };
    let form = match (is_fd, raw.flags & FAST != 0) {
        (false, _) => Form::Classic,
        (true, false) => Form::Fd,
        (true, true) => Form::FdFast,
    };
    let data = raw.data.get(..usize::from(raw.len)).filter(|_| raw.can_id & CAN_RTR_FLAG == 0);
    data.and_then(|data| Frame::new(id, form, data)).map_or(Delivered::Other, Delivered::Data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::report::ErrorState;

    #[test]
    fn frames_of_every_form_round_trip_through_the_kernel() {
        for (id, form, length) in [
            (Id::Standard(0x7ff), Form::Classic, 8),
            (Id::Extended(0x1fff_ffff), Form::Classic, 0),
            (Id::Standard(1), Form::FdFast, 64),
            (Id::Extended(7), Form::Fd, 12),
        ] {
            let frame = Frame::new(id, form, &vec![0xa5; length]).unwrap();
            assert_eq!(of_kernel(&to_kernel(&frame), form != Form::Classic), Delivered::Data(frame));
        }
    }

    #[test]
    fn remote_requests_and_invalid_lengths_are_not_data() {
        let mut raw = to_kernel(&Frame::classic(Id::Standard(1), &[1; 8]));
        raw.len = 9;
        assert_eq!(of_kernel(&raw, false), Delivered::Other);
        raw.len = 200;
        assert_eq!(of_kernel(&raw, true), Delivered::Other);
        (raw.len, raw.can_id) = (8, 1 | CAN_RTR_FLAG);
        assert_eq!(of_kernel(&raw, false), Delivered::Other);
        let report = Report { state: Some(ErrorState::Off), ..Report::default() };
        assert_eq!(of_kernel(&of_report(&report), false), Delivered::Report(report));
    }
}
