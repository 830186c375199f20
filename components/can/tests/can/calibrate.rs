//! Measuring offsets in a known pose, with simulated drives on a bus without bit times.

use core::time::Duration;

use motorium_can::adapter::WrongSetting;
use motorium_can::drive::Command;
use motorium_can::{
    AnySimulatedDrive, Bus, Calibrated, CalibrationError, Frame, Overrides, Received, Table, calibrate,
};

const TIME: Duration = Duration::from_millis(200);

/// Bus whose drives answer immediately.
struct Desk {
    drives: Vec<AnySimulatedDrive>,
    /// Positions of the shafts, rad.
    shafts: Vec<f64>,
    received: Vec<Received>,
    now_ns: u64,
    has_moved: bool,
}

impl Bus for Desk {
    fn send(&mut self, frames: &[Frame]) -> usize {
        let Self { drives, received, now_ns, .. } = self;
        for frame in frames {
            for drive in drives.iter_mut() {
                drive.receive(frame, *now_ns, &mut |frame| {
                    received.push(Received { frame, time_ns: *now_ns + 500_000 });
                });
            }
        }
        frames.len()
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        let count = self.received.len().min(frames.len());
        frames[..count].copy_from_slice(&self.received[..count]);
        self.received.drain(..count);
        count
    }
}

/// Two drives; the second has a gear, is reversed, and has an offset.
fn table(protocol: &str, more: &str) -> Table {
    let drive = |joint: &str, node: u8, gear: &str| {
        format!(
            "[[drive]]\njoint = \"{joint}\"\nbus = \"bus\"\nprotocol = \"{protocol}\"\nnode = {node}\nwatchdog = \"40 ms\"\n\
             ranges = {{ position = 12.5, velocity = 30.0, torque = 10.0 }}\n{more}\n{gear}\n"
        )
    };
    let bus = "[[bus]]\nname = \"bus\"\nbitrate = 1_000_000\ndata_bitrate = 5_000_000\n";
    let geared = drive("b", 2, "ratio = 4.0\nreversed = true\noffset = 0.3");
    Table::parse(&format!("{bus}{}{geared}", drive("a", 1, ""))).unwrap()
}

fn desk(table: &Table, shafts: [f64; 2]) -> Desk {
    let drive = |index| AnySimulatedDrive::new(table, index, Overrides::default());
    let drives = vec![drive(0), drive(1)];
    Desk { drives, shafts: shafts.to_vec(), received: Vec::new(), now_ns: 0, has_moved: false }
}

fn measured(table: &Table, desk: &mut Desk) -> Result<Vec<Calibrated>, CalibrationError> {
    let joints = ["a".to_string(), "b".to_string()];
    let pose = (&joints[..], &[0.2, -0.4][..]);
    calibrate(table, pose, core::slice::from_mut(desk), TIME, |desks, time| {
        let desk = &mut desks[0];
        desk.now_ns += time.as_nanos() as u64;
        let Desk { drives, shafts, received, now_ns, .. } = desk;
        if desk.has_moved {
            shafts[0] += 0.01;
        }
        for (drive, shaft) in drives.iter_mut().zip(shafts) {
            assert_eq!(drive.step(*shaft, 0.0, *now_ns), 0.0, "no drive is enabled");
            drive.report(*now_ns, &mut |frame, time_ns| received.push(Received { frame, time_ns }));
        }
        desk.now_ns
    })
}

#[test]
fn measured_offsets_reproduce_the_pose() {
    for (protocol, more) in [
        ("damiao", ""),
        ("mini_cheetah", ""),
        ("moteus", ""),
        ("odrive", ""),
        ("cia402", "increments = 65536.0\nrated_torque = 5.0"),
    ] {
        let table = table(protocol, more);
        let shafts = [0.5, 1.0];
        let found = measured(&table, &mut desk(&table, shafts)).expect(protocol);
        for (index, (calibrated, pose)) in found.iter().zip([0.2, -0.4]).enumerate() {
            let gear = table.transmission(index);
            // the drive's angle over the signed ratio, plus the offset
            let position = shafts[index] / gear.ratio + calibrated.offset;
            assert!((position - pose).abs() < 1e-3, "{protocol} {calibrated:?}");
            assert!(calibrated.answers >= 15 && calibrated.spread < 1e-3, "{protocol} {calibrated:?}");
            assert_eq!(calibrated.before, gear.offset);
        }
    }
}

#[test]
fn invalid_measurements_are_reported() {
    let table = table("damiao", "");
    let fresh = || desk(&table, [0.5, 1.0]);
    let silent = Desk { drives: fresh().drives.split_off(1), ..fresh() };
    let error = |mut desk: Desk| measured(&table, &mut desk).unwrap_err();
    assert_eq!(error(silent), CalibrationError::Silent { joint: "a".into() });
    let moved = error(Desk { has_moved: true, ..fresh() });
    assert!(
        matches!(&moved, CalibrationError::Moved { joint, spread } if joint == "a" && *spread > 0.05),
        "{moved}"
    );
    let stronger = Overrides { torque: Some(18.0), ..Overrides::default() };
    let mut other = fresh();
    other.drives[1] = AnySimulatedDrive::new(&table, 1, stronger);
    let wrong = error(other);
    assert!(
        matches!(&wrong, CalibrationError::Setting { joint, wrong: WrongSetting::Range { .. } } if joint == "b"),
        "{wrong}"
    );
    // another program's command, which a kernel socket delivers to every listener
    let frame = table.drive(1).unwrap().command(&Command::default());
    let commanded = Desk { received: vec![Received { frame, time_ns: 0 }], ..fresh() };
    assert_eq!(error(commanded), CalibrationError::Commanded { joint: "b".into() });
}
