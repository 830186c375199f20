//! Ranges of the numbers in MIT frames, and the fields that represent them.

use super::command::Command;
use crate::drives::range::{Fields, Range};

/// Ranges of the fields, in units of the drive's output shaft.
///
/// ```
/// use motorium_can::mit::Ranges;
///
/// assert_eq!(Ranges::MINI_CHEETAH.velocity.max, 65.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranges {
    /// Positions, rad.
    pub position: Range,
    /// Velocities, rad/s.
    pub velocity: Range,
    /// Position gains, N m/rad.
    pub kp: Range,
    /// Velocity gains, N m s/rad.
    pub kd: Range,
    /// Torques, N m.
    pub torque: Range,
}

impl Ranges {
    /// Ranges of the published firmware for the mini cheetah's drives.
    pub const MINI_CHEETAH: Self = Self::new(12.5, 65.0, 18.0);
    /// Ranges of the CubeMars AK80-64.
    pub const AK80_64: Self = Self::new(12.5, 8.0, 144.0);
    /// Ranges of the RobStride RS00.
    pub const RS00: Self = Self::new(12.57, 33.0, 14.0);

    /// Creates ranges from the largest position, velocity and torque, with gains up to 500 N m/rad and 5 N m
    /// s/rad.
    pub const fn new(position: f64, velocity: f64, torque: f64) -> Self {
        Self {
            position: Range::symmetric(position),
            velocity: Range::symmetric(velocity),
            kp: Range::from_zero(500.0),
            kd: Range::from_zero(5.0),
            torque: Range::symmetric(torque),
        }
    }

    /// Clamps each field of a command to its range.
    pub fn clamped(&self, command: &Command) -> Command {
        Command {
            position: self.position.nearest(command.position),
            velocity: self.velocity.nearest(command.velocity),
            kp: self.kp.nearest(command.kp),
            kd: self.kd.nearest(command.kd),
            torque: self.torque.nearest(command.torque),
        }
    }

    /// Fields of a frame that represent these ranges.
    pub const fn fields(&self) -> CommandFields {
        let ranges = [self.position, self.velocity, self.kp, self.kd, self.torque];
        CommandFields(Fields::new(ranges, [16, 12, 12, 12, 12]))
    }

    /// Replaces the largest gains.
    #[must_use]
    pub const fn with_gains(self, kp: f64, kd: f64) -> Self {
        Self { kp: Range::from_zero(kp), kd: Range::from_zero(kd), ..self }
    }
}

/// Fields of a frame with the factors of their [`Ranges`]: the fields of a command, three of which also occur
/// in an answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandFields(Fields<5>);

/// Twelve bits of a number, starting with bit `from`.
#[inline]
const fn twelve(packed: u64, from: u32) -> u16 {
    (packed >> from) as u16 & 0xfff
}

impl CommandFields {
    /// Command as the drive decodes it: each field clamped to its range and rounded to its resolution.
    ///
    /// ```
    /// use motorium_can::mit::{Command, Ranges};
    ///
    /// let ranges = Ranges::new(12.5, 30.0, 10.0);
    /// let read = ranges.fields().rounded(&Command { torque: 1.234, ..Command::default() });
    /// assert!((read.torque - 1.234).abs() <= ranges.torque.resolution(12) / 2.0);
    /// assert!(read.velocity < 0.0, "no integer stands for zero in the middle of a range");
    /// ```
    pub fn rounded(&self, command: &Command) -> Command {
        self.command(self.pack(command))
    }

    /// Packs the fields of a command into one number, with the first byte of its frame as the most
    /// significant one.
    #[inline]
    pub(super) fn pack(&self, command: &Command) -> u64 {
        let Command { position, velocity, kp, kd, torque } = *command;
        let [p, v, kp, kd, t] = self.0.encode_from_end([position, velocity, kp, kd, torque]);
        // the fields fill the whole number, so all are inverted together
        !(p << 48 | v << 36 | kp << 24 | kd << 12 | t)
    }

    /// Unpacks a command.
    #[inline]
    pub(super) fn command(&self, packed: u64) -> Command {
        Command {
            position: self.0.decode::<0>((packed >> 48) as u16),
            velocity: self.0.decode::<1>(twelve(packed, 36)),
            kp: self.0.decode::<2>(twelve(packed, 24)),
            kd: self.0.decode::<3>(twelve(packed, 12)),
            torque: self.0.decode::<4>(twelve(packed, 0)),
        }
    }

    /// Packs position, velocity and torque of an answer into one number, from the lowest bit on.
    pub(super) fn pack_motion(&self, position: f64, velocity: f64, torque: f64) -> u64 {
        let [p, v, _, _, t] = self.0.encode([position, velocity, 0.0, 0.0, torque]);
        p << 24 | v << 12 | t
    }

    /// Unpacks position, velocity and torque.
    #[inline]
    pub(super) fn motion(&self, packed: u64) -> [f64; 3] {
        [
            self.0.decode::<0>((packed >> 24) as u16),
            self.0.decode::<1>(twelve(packed, 12)),
            self.0.decode::<4>(twelve(packed, 0)),
        ]
    }
}
