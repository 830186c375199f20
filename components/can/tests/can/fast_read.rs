//! Dynamixel servos that answer together in one packet.

use std::io::Write as _;

use motorium_can::adapter::Phase;
use motorium_can::servo::{EVERYBODY, FastTurn, LONGEST, fast_sum, write_fast_status};
use motorium_can::{Bus as _, Id, Overrides, Received, ServoBus, Table};

use super::drives::{Case, DYNAMIXEL, Rig};
use super::slcan::terminal;

const FAST: Case = Case { bus: "kind = \"serial\"\nfast_read = true", ..DYNAMIXEL };

/// Time from the query to the end of the last answer, ns.
fn answered_after_ns(rig: &mut Rig) -> u64 {
    let begin_ns = rig.cycle * rig.cycle_ns;
    rig.run(1);
    let times = rig.adapter.links().iter().filter_map(motorium_can::adapter::Link::received_ns);
    times.max().expect("answers") - begin_ns
}

#[test]
fn a_fast_read_saves_six_bytes_per_servo() {
    let (mut fast, mut plain) = (Rig::healthy(&FAST), Rig::healthy(&DYNAMIXEL));
    for link in fast.adapter.links() {
        assert_eq!((link.counts().missing, link.counts().late, link.counts().refused), (0, 0, 0));
    }
    assert_eq!(fast.adapter.stray(), 0);
    // two packets of 11 bytes plus the state, or one packet of 8 bytes plus 4 bytes and the state per servo;
    // ten bits per byte at 1 Mbit/s
    let saved_ns = answered_after_ns(&mut plain) - answered_after_ns(&mut fast);
    assert_eq!(saved_ns, (2 * 11 - (8 + 2 * 4)) * 10_000);
}

#[test]
fn servos_after_a_silent_one_are_polled_separately() {
    let mut rig = Rig::healthy(&FAST);
    rig.is_silent = true;
    rig.run(3);
    let [silent, other] = rig.adapter.links() else { panic!("two drives") };
    assert_eq!((silent.counts().missing, silent.counts().lost), (3, 1), "lost in its third cycle");
    assert_eq!((other.counts().missing, other.counts().lost, other.phase()), (1, 0, Phase::Enabled));
}

#[test]
fn servos_without_fast_read_are_polled_normally() {
    let mut rig = Rig::new(&FAST, Overrides::default());
    rig.is_old = true;
    rig.run(100);
    let missing = |rig: &Rig| rig.adapter.links()[0].counts().missing;
    let before = missing(&rig);
    rig.run(300);
    assert_eq!(missing(&rig), before, "each answers each cycle");
    assert!(rig.adapter.links().iter().all(|link| link.phase() == Phase::Enabled && link.counts().lost == 0));
}

#[test]
fn a_long_common_answer_arrives_in_parts() {
    let (mut master, path) = terminal();
    let mut line = ServoBus::open(&path, 1_000_000).unwrap();
    let (mut whole, mut share) = (Vec::new(), [0; LONGEST]);
    for servo in 1..=3 {
        let sum = fast_sum(0, &whole);
        let turn = if servo == 1 { FastTurn::First { servos: 3 } } else { FastTurn::After { sum } };
        let length = write_fast_status(turn, servo, 0, &[servo; 21], &mut share).unwrap();
        whole.extend_from_slice(&share[..length]);
    }
    let receive = |line: &mut ServoBus, least: usize| {
        let (mut inbox, mut found) = ([Received::default(); 4], Vec::new());
        for _ in 0..2000 {
            let count = line.receive(&mut inbox);
            found.extend(inbox[..count].iter().map(|received| received.frame));
            if found.len() >= least {
                break;
            }
            std::thread::sleep(std::time::Duration::from_micros(100));
        }
        found
    };
    // two of three answers: an incomplete packet
    master.write_all(&whole[..whole.len() - 25]).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(20));
    assert_eq!(line.receive(&mut [Received::default(); 4]), 0);
    let ask = motorium_can::Frame::packet(EVERYBODY, &[0xff; 4]).unwrap();
    assert_eq!(line.send(&[ask]), 1);
    master.write_all(&whole).unwrap();
    let parts = receive(&mut line, 2);
    assert!(parts.iter().all(|part| part.id == Id::Standard(EVERYBODY.into())));
    let lengths: Vec<_> = parts.iter().map(|part| part.data().len()).collect();
    assert_eq!(lengths, [64, whole.len() - 64]);
    let bytes: Vec<u8> = parts.iter().flat_map(|part| part.data().to_vec()).collect();
    assert_eq!(bytes, whole);
}

fn table(protocol: &str, servos: u8) -> String {
    let mut text =
        "[[bus]]\nname = \"line\"\nkind = \"serial\"\nbitrate = 1_000_000\nfast_read = true\n".to_string();
    for node in 1..=servos {
        text += &format!(
            "[[drive]]\njoint = \"j{node}\"\nbus = \"line\"\nprotocol = \"{protocol}\"\nnode = {node}\nwatchdog = \"0 s\"\n\
             ranges = {{ position = 3.14, velocity = 4.0, torque = 1.0 }}\n"
        );
    }
    text
}

#[test]
fn an_impossible_fast_read_is_refused() {
    let refused = |text: &str| Table::parse(text).unwrap_err().to_string();
    assert!(refused(&table("feetech", 2)).contains("a fast read is not supported by drives of Feetech"));
    assert!(refused(&table("dynamixel", 10)).contains("a fast read of 10 servos"));
    let text = table("dynamixel", 9);
    let (fast, plain) =
        (Table::parse(&text).unwrap(), Table::parse(&text.replace("fast_read = true", "")).unwrap());
    let time_ns = |table: &Table| table.budget(0, 10_000_000).complete_ns();
    // seven bytes fewer per servo, eight more in total, and one turnaround time of 100 us instead of nine
    assert_eq!(time_ns(&plain) - time_ns(&fast), (9 * 7 - 8) * 10_000 + 8 * 100_000);
}
