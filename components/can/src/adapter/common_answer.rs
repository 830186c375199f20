//! The common answer of the servos of a line to a fast read: their shares become answers of each.

use crate::frame::{DecodeError, Form, Frame, Id};
use crate::servo::{EVERYBODY, FastReader, LONGEST, write_status};

/// Consecutive unanswered fast reads after which the servos count as not supporting them.
const GIVEN_UP_AFTER: u32 = 3;

/// The common answers on a line whose servos answer together.
#[derive(Clone, Debug, Default)]
pub(super) struct CommonAnswer {
    reader: FastReader,
    is_expected: bool,
    unanswered: u32,
}

impl CommonAnswer {
    /// True for a frame that may be a part of one.
    pub(super) fn is_part(frame: &Frame) -> bool {
        frame.form == Form::Packet && frame.id == Id::Standard(EVERYBODY.into())
    }

    /// Begins a cycle; with common answers, each servo returns this many bytes.
    pub(super) fn ask(&mut self, count: u8) -> bool {
        self.unanswered += u32::from(core::mem::take(&mut self.is_expected));
        if self.unanswered >= GIVEN_UP_AFTER {
            return false;
        }
        self.reader.expect(count);
        self.is_expected = true;
        true
    }

    /// Takes a part of it.
    pub(super) fn push(&mut self, frame: &Frame) {
        self.reader.push(frame.data());
    }

    /// The next answer in it, as the servo would give it alone.
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
