//! Reasons why a joint was not homed.

/// Reason why a joint was not homed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HomingFault {
    /// The timeout expired.
    #[error(
        "the mark was not found in time: does its switch work, is the way there free, is `timeout` long enough?"
    )]
    TimedOut,
    /// The drive reported a failure.
    #[error("the drive reports that homing failed: is its switch stuck, or its method wrong?")]
    Drive,
    /// The drive ended the homing before it was observed running.
    #[error("the drive reported the end of homing before its start: is homing configured in the drive?")]
    NotBegun,
    /// The drive disabled itself during the homing.
    #[error("the drive disabled itself during homing")]
    LetGo,
    /// The drive refused a homing object.
    #[error("the drive refuses an object of its homing: code 0x{0:08X}")]
    Refused(u32),
    /// The joint did not move off its stop.
    #[error("it does not move off the stop again: is it jammed, or its brake closed?")]
    Jammed,
    /// The joint came to rest at two different positions.
    #[error("its stop lies at two places, {0:.4} apart: is something soft in its way?")]
    Ambiguous(f64),
    /// The joint moved back when half of the effort held it at the stop.
    #[error(
        "with half of `effort` it does not stay where it came to rest: was it no stop, but its weight that stopped it?"
    )]
    Balanced,
    /// The joint moved much faster than commanded.
    #[error("it moves {0:.1} times as fast as it is commanded: does its load pull it?")]
    Runaway(f64),
}
