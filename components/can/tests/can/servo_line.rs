//! Line of serial servos over pseudo-terminals: the adapter's end, a wire, and the simulated servos' end.

use std::fs::File;
use std::io::Write as _;

use motorium_can::adapter::{Adapter, OnTrip, Phase};
use motorium_can::{AnySimulatedDrive, Bus as _, Condition, OpenError, Overrides, Received, ServoBus, Table};
use motorium_drive::JointSetpoint;

use super::slcan::{terminal, written};

const TABLE: &str = r#"
[[bus]]
name      = "line"
kind      = "serial"
interface = "/dev/ttyACM0"
bitrate   = 1_000_000

[[drive]]
joint    = "a"
bus      = "line"
protocol = "feetech"
node     = 1
ranges   = { position = 3.14, velocity = 4.7, torque = 1.9 }
watchdog = "0 s"

[[drive]]
joint    = "b"
bus      = "line"
protocol = "feetech"
node     = 2
ranges   = { position = 3.14, velocity = 4.7, torque = 1.9 }
watchdog = "0 s"
"#;

/// Wire between two terminals.
struct Wire {
    ends: [File; 2],
}

impl Wire {
    fn carry(&mut self) {
        for (from, to) in [(0, 1), (1, 0)] {
            let bytes = written(&mut self.ends[from]);
            self.ends[to].write_all(&bytes).unwrap();
        }
    }
}

#[test]
fn servos_are_enabled_and_follow_over_a_pseudo_terminal() {
    let ((near, path), (far, far_path)) = (terminal(), terminal());
    let mut wire = Wire { ends: [near, far] };
    let mut line = ServoBus::open(&path, 1_000_000).unwrap();
    let mut end = ServoBus::open(&far_path, 1_000_000).unwrap();
    assert!(line.is_virtual());
    let table = Table::parse(TABLE).unwrap();
    let mut adapter = Adapter::new(&table, &[0, 1], &[0.1, 0.1], OnTrip::Damp);
    adapter.without_bit_times(0);
    let mut servos = [0, 1].map(|index| AnySimulatedDrive::new(&table, index, Overrides::default()));
    let (mut frames, mut inbox) = (Vec::new(), [Received::default(); 16]);
    let mut torques = [0.0; 2];
    for cycle in 1..=50_u64 {
        let now_ns = cycle * 5_000_000;
        frames.clear();
        adapter.write(0, &mut frames);
        assert_eq!(line.send(&frames), frames.len());
        adapter.sent(0, frames.len(), now_ns);
        // terminals deliver bytes asynchronously
        for _ in 0..2000 {
            wire.carry();
            let count = end.receive(&mut inbox);
            for received in &inbox[..count] {
                for servo in &mut servos {
                    servo.receive(&received.frame, now_ns, &mut |answer| {
                        assert_eq!(end.send(&[answer]), 1);
                    });
                }
            }
            let count = line.receive(&mut inbox);
            for received in &inbox[..count] {
                adapter.take(0, &Received { frame: received.frame, time_ns: now_ns });
            }
            if adapter.has_all_answers() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_micros(50));
        }
        for (servo, torque) in servos.iter_mut().zip(&mut torques) {
            *torque = servo.step(0.5, 0.0, now_ns);
        }
        adapter.end_cycle(true);
        if cycle == 20 {
            let goal = |position: f64| JointSetpoint { position, kp: 1.0, ..JointSetpoint::default() };
            adapter.set(0, goal(0.52));
            adapter.set(1, goal(0.48));
        }
    }
    for link in adapter.links() {
        assert_eq!((link.phase(), link.counts().missing, link.counts().refused), (Phase::Enabled, 0, 0));
        assert!((link.state().0 - 0.5).abs() < 1e-3, "{}", link.state().0);
    }
    assert!(torques[0] > 0.3 && torques[1] < -0.3, "{torques:?}");
}

#[test]
fn a_closed_line_and_a_missing_line_are_reported() {
    let (master, path) = terminal();
    let mut line = ServoBus::open(&path, 1_000_000).unwrap();
    drop(master);
    assert_eq!(line.receive(&mut [Received::default(); 4]), 0);
    assert_eq!(line.condition(), Condition::Gone);
    assert!(matches!(ServoBus::open("/dev/tty-that-is-not-there", 1_000_000), Err(OpenError::NoLine(_))));
    let error = ServoBus::open(&path, 1_234_567).unwrap_err();
    assert!(
        matches!(error, OpenError::NoSpeed { speed: 1_234_567, .. }) && error.advice().contains("1000000")
    );
}

#[test]
fn bytes_outside_packets_are_skipped() {
    let (mut master, path) = terminal();
    let mut line = ServoBus::open(&path, 1_000_000).unwrap();
    master.write_all(&[0x00, 0xff, 0x12, 0xff, 0xff, 1, 3, 0, 0x20, 0xdb, 0xff, 0xff, 2]).unwrap();
    let mut inbox = [Received::default(); 4];
    let mut count = 0;
    for _ in 0..1000 {
        count += line.receive(&mut inbox[count..]);
        if count > 0 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_micros(100));
    }
    assert_eq!(count, 1);
    assert_eq!(inbox[0].frame.data(), [0xff, 0xff, 1, 3, 0, 0x20, 0xdb]);
}
