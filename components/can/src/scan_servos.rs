//! Scan for servos on a serial line, which reports their numbers and protocols.

use core::time::Duration;

use crate::bus::{Bus, Received};
use crate::frame::Frame;
use crate::servo::{EVERYBODY, Instruction, LONGEST, Packet, Protocol, write};

/// Servo that answers on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoFound {
    /// Number of the servo.
    pub number: u8,
    /// Protocol of the servo.
    pub protocol: Protocol,
    /// Model number and firmware version; `None` if not reported. Only servos with protocol 2.0 report them.
    pub model: Option<(u16, u8)>,
    /// Error flags of the servo; 0 without an error.
    pub error: u8,
}

/// Speeds at which servos are searched, bit/s; factory defaults come first.
pub const SPEEDS: [u32; 8] = [1_000_000, 57_600, 115_200, 500_000, 2_000_000, 3_000_000, 4_000_000, 9_600];

/// Time for the answers of all protocol 2.0 servos to one packet.
const ALL: Duration = Duration::from_millis(300);
/// Time for the answer of one servo.
const ONE: Duration = Duration::from_millis(3);

/// Finds the servos on a serial line by pinging each number up to `last`, at the speed with which the line
/// was opened. Pinging has no side effects. `pass` advances time on the line by the given duration.
///
/// ```no_run
/// use motorium_can::{SERVO_SPEEDS, ServoBus, scan_servos};
///
/// for speed in SERVO_SPEEDS {
///     let mut line = ServoBus::open("/dev/ttyACM0", speed)?;
///     for servo in scan_servos(&mut line, 253, |_, time| std::thread::sleep(time)) {
///         println!("{speed} bit/s: servo {} of protocol {:?}", servo.number, servo.protocol);
///     }
/// }
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
pub fn scan_servos<B: Bus>(
    line: &mut B,
    last: u8,
    mut pass: impl FnMut(&mut B, Duration),
) -> Vec<ServoFound> {
    let mut found = Vec::new();
    let mut ask = |protocol, number, time| {
        let mut packet = [0; LONGEST];
        let length = write(protocol, number, &Instruction::Ping, &mut packet).unwrap_or(0);
        line.send(&Frame::packet(number, &packet[..length]).into_iter().collect::<Vec<_>>());
        pass(line, time);
        take(line, &mut found);
    };
    // all protocol 2.0 servos answer one packet, one after the other
    ask(Protocol::Two, EVERYBODY, ALL);
    for number in 0..=last.min(EVERYBODY - 1) {
        ask(Protocol::One, number, ONE);
    }
    found.sort_by_key(|servo| servo.number);
    found.dedup();
    found
}

fn take(line: &mut impl Bus, found: &mut Vec<ServoFound>) {
    let mut inbox = [Received::default(); 32];
    loop {
        let count = line.receive(&mut inbox);
        for received in &inbox[..count] {
            let mut packet = Packet::default();
            // lines with an echo return the requests, which are skipped
            if let Ok(status) = packet.status(received.frame.data()) {
                let model = match (status.protocol, status.data) {
                    (Protocol::Two, [low, high, firmware]) => {
                        Some((u16::from_le_bytes([*low, *high]), *firmware))
                    }
                    (Protocol::One, []) => None,
                    _ => continue,
                };
                let is_echo = status.protocol == Protocol::One && status.error == 1;
                if !is_echo {
                    let (number, protocol, error) = (status.servo, status.protocol, status.error);
                    found.push(ServoFound { number, protocol, model, error });
                }
            }
        }
        if count < inbox.len() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AnySimulatedDrive, Overrides, Rates, SimulatedBus, Table};

    /// Line with servos.
    struct Line {
        bus: SimulatedBus,
        servos: Vec<AnySimulatedDrive>,
        now_ns: u64,
    }

    impl Bus for Line {
        fn send(&mut self, frames: &[Frame]) -> usize {
            self.bus.port(0, self.now_ns).send(frames)
        }

        fn receive(&mut self, frames: &mut [Received]) -> usize {
            self.bus.port(0, self.now_ns).receive(frames)
        }
    }

    impl Line {
        fn pass(&mut self, time: Duration) {
            for _ in 0..10 {
                self.now_ns += time.as_nanos() as u64 / 10;
                let mut inbox = [Received::default(); 8];
                let heard = self.bus.port(1, self.now_ns).receive(&mut inbox);
                for received in &inbox[..heard] {
                    for (node, servo) in (2..).zip(&mut self.servos) {
                        let time_ns = received.time_ns;
                        servo.receive(&received.frame, time_ns, &mut |answer| {
                            self.bus.enqueue(node, answer, time_ns + 50_000);
                        });
                    }
                }
            }
        }
    }

    fn servo(protocol: &str, node: u8) -> AnySimulatedDrive {
        let text = format!(
            "[[bus]]\nname = \"line\"\nkind = \"serial\"\nbitrate = 1_000_000\n\n[[drive]]\njoint = \"a\"\nbus = \"line\"\n\
             protocol = \"{protocol}\"\nnode = {node}\nwatchdog = \"0 s\"\nranges = {{ position = 3.0, velocity = 4.0, torque = 1.0 }}\n"
        );
        AnySimulatedDrive::new(&Table::parse(&text).unwrap(), 0, Overrides::default())
    }

    #[test]
    fn servos_of_both_protocols_are_found_without_motion() {
        let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
        let servos = vec![servo("dynamixel", 12), servo("feetech", 3), servo("dynamixel", 200)];
        let mut line = Line { bus: SimulatedBus::new(rates, 5, 64), servos, now_ns: 0 };
        let found = scan_servos(&mut line, 253, |line, time| line.pass(time));
        let all: Vec<_> = found.iter().map(|servo| (servo.number, servo.protocol, servo.error)).collect();
        assert_eq!(all, [(3, Protocol::One, 0), (12, Protocol::Two, 0), (200, Protocol::Two, 0)]);
        assert!(found[1].model.is_some() && found[0].model.is_none());
        assert!(!line.servos.iter().any(AnySimulatedDrive::is_enabled));
        line.servos.clear();
        assert!(scan_servos(&mut line, 20, |line, time| line.pass(time)).is_empty());
    }
}
