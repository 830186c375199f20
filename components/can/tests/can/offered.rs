//! Simulated buses for other programs: over unix sockets, and over pseudo-terminals as slcan adapters or as a
//! line of servos.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use motorium_can::bus::offered::{Offer, Place, UnixBus};
use motorium_can::{
    Bus as _, Condition, ErrorState, Form, Frame, Id, OpenError, Rates, RealBus, Received, Report, SlcanBus,
    Table,
};

const RATES: Rates = Rates { nominal: 1_000_000, fast: 5_000_000 };

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::classic(Id::Standard(id), data)
}

/// Name that is unique to a test.
fn name(test: &str) -> String {
    format!("test-{test}-{}", std::process::id())
}

fn path(test: &str) -> String {
    std::env::temp_dir().join(name(test)).to_str().unwrap().to_string()
}

/// Receives until `count` frames have arrived.
fn received(bus: &mut RealBus, count: usize) -> Vec<Frame> {
    let (mut all, mut inbox) = (Vec::new(), [Received::default(); 16]);
    let until = Instant::now() + Duration::from_secs(10);
    while all.len() < count && Instant::now() < until {
        let count = bus.receive(&mut inbox);
        all.extend(inbox[..count].iter().map(|received| received.frame));
        std::thread::sleep(Duration::from_micros(100));
    }
    all
}

#[test]
fn programs_share_a_bus_over_a_socket() {
    let name = name("shared");
    let mut offer = Offer::open(Place::Socket(&name), RATES, true, false).unwrap();
    let mut one = RealBus::open(&format!("unix:{name}"), &RATES, true).unwrap();
    let mut two = RealBus::open(&format!("unix:{name}"), &RATES, true).unwrap();
    assert!(!one.is_virtual(), "its frames take time");
    let long = Frame::new(Id::Extended(0x1234_5678), Form::FdFast, &[7; 48]).unwrap();
    assert_eq!(one.send(&[frame(1, &[1, 2]), long]), 2);
    let mut inbox = [Received::default(); 16];
    assert_eq!(offer.receive(&mut inbox), 2);
    assert_eq!([inbox[0].frame, inbox[1].frame], [frame(1, &[1, 2]), long]);
    assert!(inbox[0].time_ns > 0 && inbox[0].time_ns == inbox[1].time_ns);
    assert_eq!(received(&mut two, 2), [frame(1, &[1, 2]), long], "frames of the other program");
    assert_eq!(one.receive(&mut inbox), 0, "not its own frames");

    two.receive_only(&[Id::Standard(0x11)]).unwrap();
    offer.deliver(&Received { frame: frame(0x11, &[3]), time_ns: 42 });
    offer.deliver(&Received { frame: frame(0x12, &[4]), time_ns: 43 });
    let off = Report { state: Some(ErrorState::Off), counters: Some([255, 0]), ..Report::default() };
    offer.report(&off, 3);
    assert_eq!(offer.flush(), 0);
    assert_eq!(received(&mut one, 2), [frame(0x11, &[3]), frame(0x12, &[4])]);
    assert_eq!(received(&mut two, 1), [frame(0x11, &[3])]);
    for bus in [&mut one, &mut two] {
        assert_eq!(bus.receive(&mut inbox), 0);
        assert_eq!((bus.condition(), bus.counts().bus_off, bus.counts().queue_full), (Condition::Off, 1, 1));
        assert_eq!(bus.send(&[frame(1, &[])]), 0, "a bus-off controller sends nothing");
    }
    offer.set_link_down(true);
    offer.flush();
    assert_eq!((one.receive(&mut inbox), one.condition(), one.counts().down), (0, Condition::Down, 1));
    offer.report(&Report { state: Some(ErrorState::Active), ..Report::default() }, 0);
    offer.flush();
    assert_eq!(
        (one.receive(&mut inbox), one.condition(), one.send(&[frame(2, &[])])),
        (0, Condition::Active, 1)
    );
}

#[test]
fn a_bus_disappears_and_returns_with_its_simulator() {
    let name = name("gone");
    assert!(matches!(UnixBus::open(&name), Err(OpenError::NotOffered(_))));
    let offer = Offer::open(Place::Socket(&name), RATES, false, false).unwrap();
    let again = Offer::open(Place::Socket(&name), RATES, false, false).unwrap_err();
    assert!(again.to_string().contains("another program of this user already offers this bus"), "{again}");
    let mut bus = UnixBus::open(&name).unwrap();
    drop(offer);
    let mut inbox = [Received::default(); 4];
    assert_eq!((bus.receive(&mut inbox), bus.condition(), bus.counts().down), (0, Condition::Gone, 1));
    let mut offer = Offer::open(Place::Socket(&name), RATES, false, false).unwrap();
    let until = Instant::now() + Duration::from_secs(20);
    while bus.send(&[frame(5, &[5])]) == 0 && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!((offer.receive(&mut inbox), inbox[0].frame), (1, frame(5, &[5])));
    assert_eq!(bus.condition(), Condition::Active);
}

/// Adapter simulated by a thread until this value is dropped. It answers each frame with a frame of the next
/// identifier.
struct Device<'a> {
    stop: &'a AtomicBool,
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn serve(offer: &mut Offer, stop: &AtomicBool) {
    let mut inbox = [Received::default(); 8];
    while !stop.load(Ordering::Relaxed) {
        let count = offer.receive(&mut inbox);
        for Received { frame, time_ns } in &inbox[..count] {
            let Id::Standard(id) = frame.id else { continue };
            let answer = Frame::new(Id::Standard(id + 1), frame.form, frame.data()).unwrap();
            offer.deliver(&Received { frame: answer, time_ns: *time_ns });
        }
        offer.flush();
        std::thread::sleep(Duration::from_micros(200));
    }
}

#[test]
fn an_offered_terminal_acts_as_an_slcan_adapter() {
    let (path, stop) = (path("slcan"), AtomicBool::new(false));
    let mut offer = Offer::open(Place::Terminal(&path), RATES, true, false).unwrap();
    std::thread::scope(|scope| {
        let device = Device { stop: &stop };
        scope.spawn(|| serve(&mut offer, &stop));
        let slow = Rates { nominal: 500_000, fast: 5_000_000 };
        let error = SlcanBus::open(&path, slow, true).unwrap_err();
        assert!(error.to_string().contains("the adapter refuses the bitrate"), "{error}");
        let mut bus = RealBus::open(&format!("pty:{path}"), &RATES, true).unwrap();
        let fast = Frame::new(Id::Standard(0x20), Form::FdFast, &[9; 12]).unwrap();
        assert_eq!(bus.send(&[frame(0x10, &[1, 2, 3]), fast]), 2);
        let answer = Frame::new(Id::Standard(0x21), Form::FdFast, &[9; 12]).unwrap();
        assert_eq!(received(&mut bus, 2), [frame(0x11, &[1, 2, 3]), answer]);
        drop(device);
    });
    let mut bus = SlcanBus::open(&path, RATES, true).unwrap();
    // the pending request in the terminal is handled now
    assert_eq!(offer.receive(&mut [Received::default(); 8]), 0);
    for (state, condition) in [
        (ErrorState::Warning, Condition::Warning),
        (ErrorState::Passive, Condition::Passive),
        (ErrorState::Off, Condition::Off),
        (ErrorState::Active, Condition::Active),
    ] {
        let report = Report { state: Some(state), is_unacknowledged: true, ..Report::default() };
        offer.report(&report, 0);
        offer.flush();
        std::thread::sleep(Duration::from_millis(5));
        assert_eq!(bus.receive(&mut [Received::default(); 4]), 0);
        assert_eq!(bus.condition(), condition);
    }
    assert_eq!((bus.counts().unacknowledged, bus.counts().bus_off), (4, 1));
    offer.set_link_down(true);
    assert_eq!((bus.receive(&mut [Received::default(); 4]), bus.condition()), (0, Condition::Gone));
    assert!(matches!(SlcanBus::open(&path, RATES, true), Err(OpenError::NoLine(_))));
    offer.set_link_down(false);
    assert!(SlcanBus::open(&path, RATES, true).is_ok());
    drop(offer);
    assert!(std::path::Path::new(&path).symlink_metadata().is_err(), "its link is gone");
}

#[test]
fn an_offered_line_of_servos_carries_packets_of_both_protocols() {
    let path = path("servos");
    let mut offer = Offer::open(Place::Terminal(&path), RATES, false, true).unwrap();
    let mut line = RealBus::open_servos(&format!("pty:{path}"), 1_000_000).unwrap();
    let packets: [&[u8]; 2] = [&[0xff, 0xff, 1, 2, 1, 0xfb], &[0xff, 0xff, 0xfd, 0, 1, 3, 0, 1, 0x19, 0x4e]];
    let packets = packets.map(|packet| Frame::packet(1, packet).unwrap());
    assert_eq!(line.send(&packets), 2);
    let mut inbox = [Received::default(); 4];
    let until = Instant::now() + Duration::from_secs(10);
    let mut count = 0;
    while count < 2 && Instant::now() < until {
        count += offer.receive(&mut inbox[count..]);
    }
    assert_eq!(inbox[..count].iter().map(|received| received.frame).collect::<Vec<_>>(), packets);
    offer.deliver(&inbox[1]);
    offer.flush();
    assert_eq!(received(&mut line, 1), packets[1..]);
}

#[test]
fn an_existing_file_at_a_terminal_path_is_kept() {
    let path = path("file");
    std::fs::write(&path, "mine").unwrap();
    assert!(Offer::open(Place::Terminal(&path), RATES, false, false).is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn bus_addresses_of_a_drive_table_are_checked() {
    let table = |one: &str, two: &str| {
        let bus =
            |name: &str, more: &str| format!("[[bus]]\nname = \"{name}\"\nbitrate = 1_000_000\n{more}\n");
        let drive = "[[drive]]\njoint = \"a\"\nbus = \"one\"\nprotocol = \"damiao\"\nnode = 1\nwatchdog = \"20 ms\"\n\
                     ranges = { position = 12.5, velocity = 30.0, torque = 10.0 }\n";
        Table::parse(&format!("{}{}{drive}", bus("one", one), bus("two", two)))
            .map_err(|error| error.to_string())
    };
    let good = table("interface = \"unix:one\"", "interface = \"pty:/tmp/two\"").unwrap();
    assert!(good.is_real() && good.is_offered());
    let refused = |one: &str, two: &str| table(one, two).unwrap_err();
    let mixed = refused("interface = \"unix:one\"", "interface = \"can0\"");
    assert!(
        mixed.contains("the table contains both simulated buses and interfaces of the computer"),
        "{mixed}"
    );
    assert!(refused("interface = \"unix:\"", "").contains("the socket name \"\" is invalid"));
    assert!(
        refused("interface = \"pty:can0\"", "").contains("the terminal \"can0\" is not an absolute path")
    );
    assert!(
        refused("interface = \"unix:a\"", "interface = \"unix:a\"")
            .contains("another bus already uses this interface")
    );
}
