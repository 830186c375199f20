//! Reasons why a joint was not homed.

/// Reason why a joint was not homed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HomingFault {
    /// The timeout expired.
    #[error(
        "the mark was not found in time: does its switch work, is the path to it free, is `timeout` long enough?"
    )]
    TimedOut,
    /// The drive reported a failure.
    #[error("the drive reports that homing failed: is its switch stuck, or the method wrong?")]
    Drive,
    /// The drive reported the end of the homing before the adapter had observed its start.
    #[error("the drive reported the end of homing before its start: is homing configured in the drive?")]
    NotBegun,
    /// The drive disabled itself during the homing.
    #[error("the drive disabled itself during homing")]
    LetGo,
    /// The drive refused an object of its homing, with this abort code.
    #[error("the drive refuses an object of its homing: code 0x{0:08X}")]
    Refused(u32),
    /// The joint did not move away from its stop.
    #[error("the joint does not move away from the stop: is it jammed, or is its brake engaged?")]
    Jammed,
    /// The stop was found at two positions, this far apart \[rad or m\].
    #[error("the stop was found at two positions, {0:.4} rad or m apart: is there a soft obstacle?")]
    Ambiguous(f64),
    /// The joint moved back from the stop when the effort was halved, as a joint stopped only by its weight
    /// does.
    #[error(
        "the joint does not stay at rest with half of `effort`: was it stopped by its weight instead of a mechanical stop?"
    )]
    Balanced,
    /// The joint moved much faster than commanded, by this factor.
    #[error("the joint moves {0:.1} times as fast as commanded: is it pulled by its load?")]
    Runaway(f64),
}
