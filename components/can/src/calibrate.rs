//! Drive offsets, measured while the robot is held in a known pose.

use core::time::Duration;

use crate::adapter::{Adapter, OnTrip, WrongSetting};
use crate::bus::{Bus, Received};
use crate::frame::Frame;
use crate::table::{Table, TableError};

/// Calibrated offset of a drive whose joint was held in a known pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// Name of the joint.
    pub joint: String,
    /// Mean of the measured positions, computed with the offset in the table, rad or m.
    pub position: f64,
    /// Calibrated offset, rad or m. With this offset, the measured position equals the joint's position in
    /// the pose.
    pub offset: f64,
    /// Offset in the table before calibration, rad or m.
    pub before: f64,
    /// Difference between the largest and smallest measured position, rad or m.
    pub spread: f64,
    /// Number of averaged answers.
    pub answers: u64,
}

/// Error returned when the offsets cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// The robot and the table do not match.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Another program commands a drive.
    #[error(
        "another program commands the drive of `{joint}`: stop that program, because calibration disables all drives"
    )]
    Commanded {
        /// Name of the joint that the drive moves.
        joint: String,
    },
    /// A setting of the drive differs from the table, so its positions may be wrong.
    #[error("the drive of `{joint}`: {wrong}")]
    Setting {
        /// Joint of the drive.
        joint: String,
        /// Setting that differs.
        wrong: WrongSetting,
    },
    /// A drive did not answer.
    #[error("the drive of `{joint}` does not answer: check its power and its number in the table")]
    Silent {
        /// Joint of the drive.
        joint: String,
    },
    /// A joint moved.
    #[error("joint `{joint}` moved by {spread:.3} rad or m while it was measured: hold the joint still")]
    Moved {
        /// Name of the joint.
        joint: String,
        /// Difference between the largest and the smallest measured position of the joint, rad or m.
        spread: f64,
    },
}

/// Time spent listening for another program that commands the drives.
const LISTEN: Duration = Duration::from_millis(300);
/// Time from one query to the next.
const CYCLE: Duration = Duration::from_millis(10);
/// Cycles within which each drive must have answered, including the check of its settings.
const ANSWER_TIMEOUT: u32 = 300;
/// Largest position difference of a joint at rest, rad or m.
const STILL: f64 = 0.05;

/// Measures the offsets of all drives for `time` while the robot is held at `pose` \[rad or m\], which has
/// one position per joint in `joints`. Homed drives are skipped, and no drive is enabled. `buses` are in the
/// order of the table. `pass` advances time on the buses and returns the current time, ns.
///
/// # Errors
/// Returns an error if another program commands a drive, or if a drive has a setting that differs from the
/// table, does not answer, or moves.
///
/// # Panics
/// Panics if `pose` and `joints` differ in length, or if there are fewer buses than in the table.
pub fn calibrate<B: Bus>(
    table: &Table,
    (joints, pose): (&[String], &[f64]),
    buses: &mut [B],
    time: Duration,
    mut pass: impl FnMut(&mut [B], Duration) -> u64,
) -> Result<Vec<Calibrated>, CalibrationError> {
    assert_eq!(joints.len(), pose.len(), "positions of the pose");
    let order = table.of_joints(joints)?;
    let mut now_ns = pass(buses, LISTEN);
    let mut inbox = [Received::default(); 32];
    let commanded = (0..table.buses.len()).find_map(|bus| {
        loop {
            let count = buses[bus].receive(&mut inbox);
            let found = inbox[..count].iter().find_map(|received| commanded(table, bus, &received.frame));
            if found.is_some() || count < inbox.len() {
                break found;
            }
        }
    });
    if let Some(joint) = commanded {
        return Err(CalibrationError::Commanded { joint });
    }
    let mut adapter = Adapter::new(table, &order, &vec![0.0; order.len()], OnTrip::Disable).observer();
    adapter.set_cycle(CYCLE.as_nanos() as u64);
    let mut taken: Vec<Taken> = vec![Taken::default(); order.len()];
    let (mut frames, mut waited, mut left) = (Vec::new(), 0, time);
    while !left.is_zero() {
        for (bus, port) in buses.iter_mut().enumerate().take(table.buses.len()) {
            frames.clear();
            adapter.write(bus, &mut frames);
            let count = port.send(&frames);
            adapter.sent(bus, count, now_ns);
        }
        now_ns = pass(buses, CYCLE);
        for (bus, port) in buses.iter_mut().enumerate().take(table.buses.len()) {
            loop {
                let count = port.receive(&mut inbox);
                inbox[..count].iter().for_each(|received| adapter.take(bus, received));
                if count < inbox.len() {
                    break;
                }
            }
        }
        adapter.end_cycle(true);
        if let Some((joint, wrong)) = adapter.wrong_setting() {
            return Err(CalibrationError::Setting { joint: joints[joint].clone(), wrong });
        }
        let silent = adapter.links().iter().position(|link| link.received_ns().is_none());
        match silent {
            Some(joint) if waited >= ANSWER_TIMEOUT => {
                return Err(CalibrationError::Silent { joint: joints[joint].clone() });
            }
            Some(_) => waited += 1,
            None => {
                left = left.saturating_sub(CYCLE);
                for (taken, link) in taken.iter_mut().zip(adapter.links()) {
                    taken.take(link.received_ns(), link.state().0);
                }
            }
        }
    }
    // the offset of a homed joint refers to its mark, and its encoder has an arbitrary zero
    let is_measured = |(index, _): &(usize, &Taken)| !table.drives[order[*index]].is_homed();
    let result = taken.iter().enumerate().filter(is_measured).map(|(index, taken)| {
        let (joint, before) = (joints[index].clone(), table.transmission(order[index]).offset);
        let (position, spread) = (taken.sum / taken.count.max(1) as f64, taken.most - taken.least);
        if spread > STILL {
            return Err(CalibrationError::Moved { joint, spread });
        }
        let offset = before + pose[index] - position;
        Ok(Calibrated { joint, position, offset, before, spread, answers: taken.count })
    });
    result.collect()
}

/// Positions of a joint.
#[derive(Clone, Copy, Debug)]
struct Taken {
    last_ns: Option<u64>,
    sum: f64,
    count: u64,
    least: f64,
    most: f64,
}

impl Default for Taken {
    fn default() -> Self {
        Self { last_ns: None, sum: 0.0, count: 0, least: f64::INFINITY, most: f64::NEG_INFINITY }
    }
}

impl Taken {
    /// Adds a position if it was received after the previous one.
    fn take(&mut self, received_ns: Option<u64>, position: f64) {
        if self.last_ns != received_ns {
            self.last_ns = received_ns;
            (self.sum, self.count) = (self.sum + position, self.count + 1);
            (self.least, self.most) = (self.least.min(position), self.most.max(position));
        }
    }
}

/// Returns the joint of the drive on this bus that another program's frame commands.
fn commanded(table: &Table, bus: usize, frame: &Frame) -> Option<String> {
    let mut drives = table.drives.iter().enumerate().filter(|(_, drive)| table.bus_of(drive) == Some(bus));
    let found =
        drives.find(|(index, drive)| drive.protocol.definition().is_command(&table.setup(*index), frame));
    found.map(|(_, drive)| drive.joint.clone())
}
