//! slcan: the codec, compared with lines of published documents, and the bus over a pseudo-terminal.

#![allow(unsafe_code)] // a pseudo-terminal needs a few libc calls

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::os::fd::FromRawFd as _;
use std::time::{Duration, Instant};

use motorium_can::bus::slcan::{LONGEST, Line, Reader, write};
use motorium_can::{
    Bus, Condition, ErrorState, Form, Frame, Id, OpenError, Rates, Received, Report, SlcanBus, Table,
};
use proptest::prelude::*;

fn text(frame: &Frame) -> String {
    let mut line = [0; LONGEST];
    let length = write(frame, &mut line);
    String::from_utf8(line[..length].to_vec()).unwrap()
}

fn lines(text: &[u8]) -> Vec<Line> {
    let mut reader = Reader::default();
    text.iter().filter_map(|byte| reader.push(*byte)).collect()
}

#[test]
fn frames_match_the_lines_in_the_manuals() {
    let standard = Frame::classic(Id::Standard(0x7ff), &[0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]);
    assert_eq!(text(&standard), "t7FF81122334455667788\r");
    assert_eq!(text(&Frame::classic(Id::Standard(0x0a7), &[])), "t0A70\r");
    assert_eq!(text(&Frame::classic(Id::Extended(0x0c34_567f), &[1, 2])), "T0C34567F20102\r");
    let fast = Frame::new(Id::Standard(0x123), Form::FdFast, &[0xaa; 12]).unwrap();
    assert_eq!(text(&fast), "b1239AAAAAAAAAAAAAAAAAAAAAAAA\r");
    let slow = Frame::new(Id::Extended(1), Form::Fd, &[7; 64]).unwrap();
    assert!(text(&slow).starts_with("D00000001F0707") && text(&slow).len() == 1 + 8 + 1 + 128 + 1);
}

#[test]
fn timestamps_either_case_and_states_are_decoded() {
    let frame = Frame::classic(Id::Standard(0x100), &[0x11, 0x33]);
    assert_eq!(lines(b"t10021133\rt10021133A902\rt100211e3\r")[..2], [Line::Frame(frame); 2]);
    assert_eq!(lines(b"\rz\rZ\r\x07"), [Line::Done, Line::Done, Line::Done, Line::Refused]);
    let state =
        |state, counters| Report { state: Some(state), counters: Some(counters), ..Report::default() };
    assert_eq!(lines(b"sa000000\r"), [Line::Report(state(ErrorState::Active, [0, 0]))]);
    // the receive error counter comes first
    assert_eq!(lines(b"sp012136\r"), [Line::Report(state(ErrorState::Passive, [136, 12]))]);
    assert_eq!(lines(b"sb255130\r"), [Line::Report(state(ErrorState::Off, [130, 255]))]);
    assert_eq!(lines(b"e1a\r"), [Line::Report(Report { is_unacknowledged: true, ..Report::default() })]);
}

#[test]
fn the_reader_recovers_after_an_invalid_line() {
    for broken in [
        "t",
        "t12",
        "t1239",
        "t12G0",
        "t8000",
        "T2000000000",
        "t123201",
        "t12320102F",
        "b123A00",
        "x1",
        "sa12",
        "sx000000",
        "e2a",
        "e0",
        "r1230",
        "V1013",
        "d1238",
    ] {
        let found = lines(format!("{broken}\rt0A70\r").as_bytes());
        let good = Line::Frame(Frame::classic(Id::Standard(0x0a7), &[]));
        assert_eq!(found, [Line::Other, good], "{broken}");
    }
    let endless = [b"t".repeat(10_000), b"\rt0A70\r".to_vec()].concat();
    assert_eq!(lines(&endless).len(), 2);
}

proptest! {
    #[test]
    fn every_frame_round_trips(
        id in 0_u32..1 << 29, extended: bool, form in 0..3_usize, length in 0..16_usize, data: [u8; 32],
    ) {
        let form = [Form::Classic, Form::Fd, Form::FdFast][form];
        let length = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64][length].min(form.capacity());
        let id = if extended { Id::Extended(id) } else { Id::Standard(id as u16 & 0x7ff) };
        let data: Vec<u8> = data.iter().chain(&data).copied().take(length).collect();
        let frame = Frame::new(id, form, &data).unwrap();
        prop_assert_eq!(lines(text(&frame).as_bytes()), vec![Line::Frame(frame)]);
    }

    #[test]
    fn any_decoded_frame_can_be_encoded(bytes: Vec<u8>) {
        for line in lines(&bytes) {
            if let Line::Frame(frame) = line {
                prop_assert_eq!(lines(text(&frame).as_bytes()), vec![Line::Frame(frame)]);
            }
        }
    }
}

/// Other end of a pseudo-terminal, and its path.
pub(super) fn terminal() -> (File, String) {
    // SAFETY: the calls open a new descriptor, which the file then owns, and fill a buffer of the length
    // passed to them.
    unsafe {
        let master = libc::posix_openpt(libc::O_RDWR | libc::O_NOCTTY | libc::O_NONBLOCK);
        assert!(master >= 0 && libc::grantpt(master) == 0 && libc::unlockpt(master) == 0);
        let mut name = [0; 64];
        assert_eq!(libc::ptsname_r(master, name.as_mut_ptr(), name.len()), 0);
        let path = core::ffi::CStr::from_ptr(name.as_ptr()).to_str().unwrap().to_string();
        (File::from_raw_fd(master), path)
    }
}

const RATES: Rates = Rates { nominal: 1_000_000, fast: 5_000_000 };

/// Bytes that have arrived on a terminal so far.
pub(super) fn written(terminal: &mut File) -> Vec<u8> {
    let (mut all, mut bytes) = (Vec::new(), [0; 4096]);
    while let Ok(length @ 1..) = terminal.read(&mut bytes) {
        all.extend_from_slice(&bytes[..length]);
    }
    all
}

/// Opens the bus on a terminal whose other end answers its commands with `answer`.
fn opened(answer: &'static [u8], is_fd: bool) -> (File, Result<SlcanBus, OpenError>, Vec<u8>) {
    let (mut terminal, path) = terminal();
    let adapter = std::thread::spawn(move || {
        let (mut all, until) = (Vec::new(), Instant::now() + Duration::from_millis(500));
        while Instant::now() < until && !all.ends_with(b"O\r") {
            let new = written(&mut terminal);
            for _ in new.iter().filter(|byte| **byte == b'\r') {
                terminal.write_all(answer).unwrap();
            }
            all.extend(new);
            std::thread::sleep(Duration::from_millis(1));
        }
        (terminal, all)
    });
    let bus = SlcanBus::open(&path, RATES, is_fd);
    let (terminal, commands) = adapter.join().unwrap();
    (terminal, bus, commands)
}

#[test]
fn a_bus_exchanges_frames_and_tracks_its_state() {
    let (mut terminal, bus, commands) = opened(b"\r", true);
    assert_eq!(String::from_utf8(commands).unwrap(), "\rC\rS8\rY5\rO\r");
    let mut bus = bus.unwrap();
    let frame = Frame::new(Id::Standard(0x123), Form::FdFast, &[1; 16]).unwrap();
    assert_eq!(bus.send(&[frame, Frame::classic(Id::Standard(1), &[2])]), 2);
    assert_eq!(
        lines(&written(&mut terminal)),
        [Line::Frame(frame), Line::Frame(Frame::classic(Id::Standard(1), &[2]))]
    );
    let mut inbox = [Received::default(); 4];
    assert_eq!(bus.receive(&mut inbox), 0, "nothing has arrived, and the call does not block");
    // a line in two parts, a line of a filtered node, and a report
    bus.receive_only(&[Id::Standard(0x0a7)]);
    terminal.write_all(b"\rt0A7").unwrap();
    assert_eq!(bus.receive(&mut inbox), 0);
    terminal.write_all(b"12A\rt7FF0\rsp000128\r").unwrap();
    assert_eq!(bus.receive(&mut inbox), 1);
    assert_eq!(inbox[0].frame, Frame::classic(Id::Standard(0x0a7), &[0x2a]));
    assert_eq!((bus.condition(), bus.counters()), (Condition::Passive, [128, 0]));
    terminal.write_all(b"sb255000\r").unwrap();
    bus.receive(&mut inbox);
    assert_eq!((bus.condition(), bus.counts().bus_off, bus.send(&[frame])), (Condition::Off, 1, 0));
}

#[test]
fn the_channel_is_closed_at_the_end() {
    let (mut terminal, bus, _) = opened(b"\r", false);
    let mut bus = bus.unwrap();
    let frame = Frame::classic(Id::Standard(1), &[2]);
    assert_eq!(bus.send(&[frame]), 1);
    drop(bus);
    assert_eq!(written(&mut terminal), [text(&frame).as_bytes(), b"C\r"].concat());
}

#[test]
fn an_unread_line_accepts_whole_frames_only() {
    let (mut terminal, bus, _) = opened(b"", false);
    let mut bus = bus.unwrap();
    let frame = |k: u32| Frame::classic(Id::Extended(k), &k.to_le_bytes());
    let mut taken = 0;
    let mut full = false;
    for k in 0..2_000 {
        let sent = bus.send(&[frame(2 * k), frame(2 * k + 1)]);
        taken += sent;
        full |= sent < 2;
        if full {
            break;
        }
    }
    assert!(full && taken > 20, "{taken}");
    assert!(bus.counts().queue_full > 0);
    // once the terminal is read again, the rest of the partly written frame arrives, followed by whole frames
    let mut all = written(&mut terminal);
    let until = Instant::now() + Duration::from_secs(10);
    while Instant::now() < until {
        let sent = bus.send(&[frame(1 << 20)]);
        all.extend(written(&mut terminal));
        if sent == 1 {
            break;
        }
    }
    all.extend(written(&mut terminal));
    let found: Vec<Frame> = lines(&all)
        .into_iter()
        .map(|line| match line {
            Line::Frame(frame) => frame,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(found.len(), taken + 1);
    assert!(found[..taken].iter().zip(0..).all(|(found, k)| *found == frame(k)));
    assert_eq!(found[taken], frame(1 << 20));
}

#[test]
fn an_unplugged_adapter_is_gone() {
    let (terminal, bus, _) = opened(b"", false);
    let mut bus = bus.unwrap();
    drop(terminal);
    let mut inbox = [Received::default(); 4];
    assert_eq!(bus.receive(&mut inbox), 0);
    assert_eq!((bus.condition(), bus.counts().down), (Condition::Gone, 1));
    assert_eq!(bus.send(&[Frame::classic(Id::Standard(1), &[])]), 0);
}

#[test]
fn a_refusing_adapter_and_a_missing_line_are_reported() {
    let (_, bus, _) = opened(b"\x07", false);
    let error = bus.unwrap_err();
    assert!(error.to_string().contains("the adapter refuses the bitrate"), "{error}");
    let error = SlcanBus::open("/dev/no-such-line", RATES, false).unwrap_err();
    assert_eq!(error.to_string(), "the serial line `/dev/no-such-line` does not exist");
    assert!(error.advice().contains("/dev/serial/by-id"));
    let odd = Rates { nominal: 333_333, fast: 333_333 };
    let error = SlcanBus::open("/dev/no-such-line", odd, false).unwrap_err();
    assert_eq!(error.to_string(), "the adapter on `/dev/no-such-line` does not support 333333 bit/s");
}

#[test]
fn a_drive_table_accepts_a_serial_line_as_interface() {
    let text = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\ninterface = \"/dev/serial/by-id/usb-CANable-if00\"\n\
                [[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = 1\nwatchdog = \"20 ms\"\n\
                ranges = { position = 12.5, velocity = 30.0, torque = 10.0 }\n";
    assert!(Table::parse(text).unwrap().is_real());
}
