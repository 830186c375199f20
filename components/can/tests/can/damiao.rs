//! Registers of Damiao drives.

use motorium_can::damiao::{Register, Request, Value};
use motorium_can::{DecodeError, Frame, Id};

const MASTER: Id = Id::Standard(0x11);

#[test]
fn a_request_has_the_published_bytes() {
    let request = Request { node: 1, register: Register::TorqueMax };
    assert_eq!(request.frame(), Frame::classic(Id::Standard(0x7ff), &[1, 0, 0x33, 23, 0, 0, 0, 0]));
    assert_eq!(Request::decode(&request.frame(), 1), Ok(request));
    assert_eq!(Request::decode(&request.frame(), 2), Err(DecodeError::Device { found: 1, expected: 2 }));
}

#[test]
fn ranges_and_watchdogs_round_trip() {
    for (register, value) in [
        (Register::VelocityMax, Value::Number(45.0)),
        (Register::Timeout, Value::Watchdog(Some(20_000_000))),
        (Register::Timeout, Value::Watchdog(None)),
    ] {
        let request = Request { node: 7, register };
        let answer = request.answer(MASTER, value);
        assert!(request.is_answer(&answer, MASTER));
        assert_eq!(request.value(&answer, MASTER), Ok(value));
    }
    // 20 ms are 400 units of 50 us
    let watchdog = Request { node: 7, register: Register::Timeout };
    let answer = watchdog.answer(MASTER, Value::Watchdog(Some(20_000_000)));
    assert_eq!(answer.data(), [7, 0, 0x33, 9, 0x90, 0x01, 0, 0]);
}

#[test]
fn an_answer_to_another_request_is_refused() {
    let (asked, other) = (
        Request { node: 7, register: Register::TorqueMax },
        Request { node: 7, register: Register::PositionMax },
    );
    let answer = other.answer(MASTER, Value::Number(1.0));
    assert_eq!(asked.value(&answer, MASTER), Err(DecodeError::Answer { found: 21, expected: 23 }));
    let endless = asked.answer(MASTER, Value::Number(f64::INFINITY));
    let refused = Err(DecodeError::NotFinite { field: "the number of a register" });
    assert_eq!(asked.value(&endless, MASTER), refused);
}
