//! Encoder of a simulated drive: its zero, and the mark that determines it.

/// Mark of a simulated drive whose position is unknown after power-up, such as a switch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// The mark works.
    #[default]
    Works,
    /// The mark is never met.
    Missing,
    /// The mark is met at every position.
    Stuck,
}

/// Shaft position at which an encoder reads zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Zero {
    /// Zero of the table.
    Absolute,
    /// Position at power-up, which is not known yet.
    PowerOn,
    /// This position, rad.
    At(f64),
}
