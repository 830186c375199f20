//! Status reports of a controller, in the format of Linux error frames.

/// State of a controller on a bus, determined by its error counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ErrorState {
    /// Error-active: the controller participates and signals errors of other nodes.
    #[default]
    Active,
    /// Error warning: the controller participates, but has counted many errors.
    Warning,
    /// Error-passive: the controller participates, but does not disturb other nodes.
    Passive,
    /// Bus-off: the controller has left the bus.
    Off,
}

/// Report of a controller: events, and the resulting state.
///
/// ```
/// use motorium_can::{ErrorState, Report};
///
/// let nobody = Report::decode(0x20, &[0; 8]);
/// assert!(nobody.is_unacknowledged && nobody.state.is_none());
/// let passive = Report::decode(0x204, &[0, 0x20, 0, 0, 0, 0, 136, 0]);
/// assert_eq!((passive.state, passive.counters), (Some(ErrorState::Passive), Some([136, 0])));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Reported state; `None` if the report contains no state.
    pub state: Option<ErrorState>,
    /// `true` if a frame was sent and no node acknowledged it.
    pub is_unacknowledged: bool,
    /// `true` if the controller had no room for an incoming or outgoing frame.
    pub is_overflow: bool,
    /// `true` if a frame of any node was disturbed.
    pub is_disturbed: bool,
    /// `true` if the controller has restarted after bus-off.
    pub is_restart: bool,
    /// Transmit and receive error counters, if the driver reports them.
    pub counters: Option<[u8; 2]>,
}

// Classes of an error frame: bits of its identifier.
const CONTROLLER: u32 = 0x4;
const PROTOCOL: u32 = 0x8;
const NO_ACKNOWLEDGE: u32 = 0x20;
const BUS_OFF: u32 = 0x40;
const BUS_ERROR: u32 = 0x80;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;
// Controller status: bits of the second data byte.
const OVERFLOW: u8 = 0x01 | 0x02;
const WARNING: u8 = 0x04 | 0x08;
const PASSIVE: u8 = 0x10 | 0x20;
const ACTIVE: u8 = 0x40;

impl Report {
    /// Decodes an error frame from its data and its classes, which are the identifier without flags.
    pub fn decode(classes: u32, data: &[u8; 8]) -> Self {
        let has = |class: u32| classes & class != 0;
        let controller = if has(CONTROLLER) { data[1] } else { 0 };
        let state = match controller {
            _ if has(BUS_OFF) => Some(ErrorState::Off),
            bits if bits & PASSIVE != 0 => Some(ErrorState::Passive),
            bits if bits & WARNING != 0 => Some(ErrorState::Warning),
            bits if bits & ACTIVE != 0 || has(RESTARTED) => Some(ErrorState::Active),
            _ => None,
        };
        Self {
            state,
            is_unacknowledged: has(NO_ACKNOWLEDGE),
            is_overflow: controller & OVERFLOW != 0,
            is_disturbed: has(PROTOCOL | BUS_ERROR),
            is_restart: has(RESTARTED),
            counters: has(COUNTERS).then_some([data[6], data[7]]),
        }
    }

    /// Encodes the report as an error frame: classes and data.
    pub fn encode(&self) -> (u32, [u8; 8]) {
        let mut data = [0; 8];
        let mut classes = 0;
        let mut set = |is: bool, class: u32| classes |= if is { class } else { 0 };
        set(self.is_unacknowledged, NO_ACKNOWLEDGE);
        set(self.is_disturbed, PROTOCOL | BUS_ERROR);
        set(self.is_restart, RESTARTED);
        set(self.counters.is_some(), COUNTERS);
        set(self.state == Some(ErrorState::Off), BUS_OFF);
        data[1] = match self.state {
            Some(ErrorState::Active) => ACTIVE,
            Some(ErrorState::Warning) => 0x08,
            Some(ErrorState::Passive) => 0x20,
            Some(ErrorState::Off) | None => 0,
        };
        data[1] |= u8::from(self.is_overflow);
        set(data[1] != 0, CONTROLLER);
        if let Some([sender, receiver]) = self.counters {
            (data[6], data[7]) = (sender, receiver);
        }
        (classes, data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_round_trips_through_its_frame() {
        for state in [
            None,
            Some(ErrorState::Active),
            Some(ErrorState::Warning),
            Some(ErrorState::Passive),
            Some(ErrorState::Off),
        ] {
            for bits in 0..16 {
                let report = Report {
                    state,
                    is_unacknowledged: bits & 1 != 0,
                    is_overflow: bits & 2 != 0,
                    is_disturbed: bits & 4 != 0,
                    is_restart: bits & 8 != 0 && state == Some(ErrorState::Active),
                    counters: (bits & 4 != 0).then_some([96, 127]),
                };
                let (classes, data) = report.encode();
                assert_eq!(Report::decode(classes, &data), report);
            }
        }
    }

    #[test]
    fn error_passive_takes_precedence_over_warning() {
        assert_eq!(Report::decode(0x4, &[0, 0x2c, 0, 0, 0, 0, 0, 0]).state, Some(ErrorState::Passive));
        assert_eq!(Report::decode(0x44, &[0, 0x20, 0, 0, 0, 0, 0, 0]).state, Some(ErrorState::Off));
    }

    #[test]
    fn a_report_matches_the_error_frame_library() {
        use socketcan::{CanErrorFrame, errors::ErrorCause};
        for (classes, data) in [
            (0x20_u32, [0_u8; 8]),
            (0x40, [0; 8]),
            (0x100, [0; 8]),
            (0x204, [0, 0x30, 0, 0, 0, 0, 136, 128]),
            (0x8c, [0, 0x01, 2, 0, 0, 0, 0, 0]),
        ] {
            let report = Report::decode(classes, &data);
            let theirs = CanErrorFrame::new_error(classes, &data).unwrap().into_error();
            let has = |want: fn(&ErrorCause) -> bool| theirs.causes().any(want);
            assert_eq!(report.is_unacknowledged, has(|cause| matches!(cause, ErrorCause::NoAck)));
            assert_eq!(
                report.state == Some(ErrorState::Off),
                has(|cause| matches!(cause, ErrorCause::BusOff))
            );
            assert_eq!(report.is_restart, has(|cause| matches!(cause, ErrorCause::Restarted)));
            assert_eq!(report.counters.map(|[tx, rx]| (tx, rx)), theirs.counters());
        }
    }
}
