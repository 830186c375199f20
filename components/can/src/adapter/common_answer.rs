//! Common answer of the servos on a line to a fast read, which is split into one answer per servo.

use crate::frame::{DecodeError, Form, Frame, Id};
use crate::servo::{EVERYBODY, FastReader, LONGEST, write_status};

/// Consecutive fast reads without any answer after which the servos are assumed not to support them.
const GIVEN_UP_AFTER: u32 = 3;

/// Common answers on a line whose servos answer together.
#[derive(Clone, Debug, Default)]
pub(super) struct CommonAnswer {
    reader: FastReader,
    is_expected: bool,
    unanswered: u32,
}

impl CommonAnswer {
    /// Returns `true` if the frame may be part of a common answer.
    pub(super) fn is_part(frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(EVERYBODY.into())
    }

    /// Begins a cycle. Returns `true` if the servos should answer together, each with `count` bytes.
    pub(super) fn ask(&mut self, count: u8) -> bool {
        self.unanswered += u32::from(core::mem::take(&mut self.is_expected));
        if self.unanswered >= GIVEN_UP_AFTER {
            return false;
        }
        self.reader.expect(count);
        self.is_expected = true;
        true
    }

    /// Appends a part of the common answer.
    pub(super) fn push(&mut self, frame: &Frame) {
        self.reader.push(frame.data());
    }

    /// Returns the next servo's answer, in the format of an individual answer.
    pub(super) fn next(&mut self) -> Option<Result<Frame, DecodeError>> {
        let share = match self.reader.next()? {
            Ok(share) => share,
            Err(error) => return Some(Err(error)),
        };
        (self.is_expected, self.unanswered) = (false, 0);
        let mut packet = [0; LONGEST];
        let length = write_status(share.protocol, share.servo, share.error, share.data, &mut packet)?;
        Frame::packet(share.servo, &packet[..length]).map(Ok)
    }
}
