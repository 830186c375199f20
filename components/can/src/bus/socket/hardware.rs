//! Conversion of timestamps from a controller's clock to the computer's clock.

/// Converter from a controller's clock to the computer's clock. The offset between the clocks is estimated
/// from frames with both timestamps.
///
/// The kernel timestamps a frame later than the controller, by the transfer time of the frame. The smallest
/// observed offset is therefore the most accurate. Between frames with a smaller offset, the estimate grows
/// at the maximum drift rate, to follow clocks that drift apart.
///
/// ```
/// use motorium_can::bus::socket::HardwareClock;
///
/// let mut clock = HardwareClock::default();
/// assert_eq!(clock.to_computer(1_000, 501_000), 501_000);
/// assert_eq!(clock.to_computer(2_000, 501_700), 501_700, "it was nearer to the truth");
/// // It came late to the kernel: as near as before, but for the drift of 7.3 us.
/// assert_eq!(clock.to_computer(3_000, 509_000), 502_701);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct HardwareClock {
    /// Computer time minus controller time, ns, and the computer time of this estimate, ns.
    distance: Option<(i64, u64)>,
}

/// Largest drift between the two clocks, parts per million.
const DRIFT: u64 = 200;
/// Change of the offset that indicates a restarted controller, ns.
const JUMP: i64 = 1_000_000_000;

impl HardwareClock {
    /// Converts the receive time of a frame to the clock of the computer, from both timestamps, ns.
    pub fn to_computer(&mut self, hardware_ns: u64, computer_ns: u64) -> u64 {
        let seen = computer_ns as i64 - hardware_ns as i64;
        let distance = match self.distance {
            Some((distance, at_ns)) if (seen - distance).abs() < JUMP => {
                let drifted = computer_ns.saturating_sub(at_ns) * DRIFT / 1_000_000;
                seen.min(distance + drifted as i64)
            }
            _ => seen,
        };
        self.distance = Some((distance, computer_ns));
        (hardware_ns as i64 + distance).max(0) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drifting_clocks_and_late_frames_are_tracked() {
        let mut clock = HardwareClock::default();
        for k in 0..100_000_u64 {
            let truth = 5_000_000_000 + k * 1_000_000;
            // 50 parts per million fast, with a kernel delay of up to 300 us
            let hardware = k * 1_000_050;
            let late = [7_000, 300_000, 90_000][(k % 3) as usize];
            let found = clock.to_computer(hardware, truth + late);
            assert!(found >= truth && found <= truth + late);
            assert!(k < 3 || found - truth < 9_000, "{k}: {}", found - truth);
        }
    }

    #[test]
    fn a_restarted_controller_resets_the_offset() {
        let mut clock = HardwareClock::default();
        clock.to_computer(90_000_000_000, 100_000_000_000);
        assert_eq!(clock.to_computer(5_000, 101_000_000_000), 101_000_000_000);
    }
}
