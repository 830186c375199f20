//! Time budget of a cycle: checks that all commands and answers fit on the bus, and displays the arithmetic.

use core::fmt;

use super::bits::{Bits, Rates};
use crate::frame::Form;

/// Properties of a frame that determine its length on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// `true` if the identifier has 29 bits.
    pub extended: bool,
    /// Form of the frame.
    pub form: Form,
    /// Number of data bytes.
    pub bytes: usize,
}

impl Shape {
    /// Returns the least number of bits of a frame of this shape, without stuff bits.
    pub fn least(&self) -> Bits {
        Bits::nominal(self.extended, self.form, self.bytes)
    }

    /// Returns the worst-case number of bits of a frame of this shape, including stuff bits.
    pub fn worst(&self) -> Bits {
        Bits::worst(self.extended, self.form, self.bytes)
    }
}

/// Time budget of one bus: each drive exchanges a command and an answer once per cycle.
///
/// ```
/// use motorium_can::{Budget, Form, Rates, Shape};
///
/// let frame = Shape { extended: false, form: Form::Classic, bytes: 8 };
/// let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
/// let mut budget = Budget { rates, exchanges: vec![(frame, frame); 3], others: vec![], turn_round_ns: 50_000, cycle_ns: 1_000_000 };
/// assert_eq!(budget.busy_ns(), 810_000);
/// assert!(budget.fits() && budget.share() > Budget::COMFORTABLE);
/// budget.exchanges.push((frame, frame));
/// assert!(!budget.fits());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// Bitrates of the bus.
    pub rates: Rates,
    /// Command and answer of each drive.
    pub exchanges: Vec<(Shape, Shape)>,
    /// Additional frames, such as synchronisation frames and second answers.
    pub others: Vec<Shape>,
    /// Maximum turnaround time from a command to the start of its answer, ns.
    pub turn_round_ns: u64,
    /// Time from one batch of commands to the next, ns.
    pub cycle_ns: u64,
}

impl Budget {
    /// Bus load, as a fraction of the cycle, beyond which a single disturbed frame delays other frames into
    /// the next cycle.
    pub const COMFORTABLE: f64 = 0.8;

    /// Returns the worst-case time of all bits of a cycle, ns.
    pub fn busy_ns(&self) -> u64 {
        let exchanges = self.exchanges.iter().map(|(command, answer)| self.ns(command) + self.ns(answer));
        exchanges.sum::<u64>() + self.others.iter().map(|shape| self.ns(shape)).sum::<u64>()
    }

    /// Returns the worst-case time from the first bit of the commands to the last bit of the answers, ns.
    /// This time is [`busy_ns`](Self::busy_ns) plus one turnaround time, for the last answer, during which
    /// the bus is idle.
    pub fn complete_ns(&self) -> u64 {
        self.busy_ns() + self.turn_round_ns
    }

    /// Returns the worst-case bus load, as a fraction of the cycle.
    pub fn share(&self) -> f64 {
        self.busy_ns() as f64 / self.cycle_ns as f64
    }

    /// Returns `true` if all answers arrive before the next cycle.
    pub fn fits(&self) -> bool {
        self.complete_ns() <= self.cycle_ns
    }

    /// Returns the largest number of drives that fit into a cycle if each adds the average bus time per drive
    /// in [`exchanges`](Self::exchanges), including its share of [`others`](Self::others).
    pub fn most(&self) -> u64 {
        let count = self.exchanges.len() as u64;
        if count == 0 {
            return 0;
        }
        // the time of each drive includes its share of the additional frames
        let each_ns = self.busy_ns().div_ceil(count);
        self.cycle_ns.saturating_sub(self.turn_round_ns) / each_ns
    }

    fn ns(&self, shape: &Shape) -> u64 {
        shape.worst().ns(&self.rates)
    }
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| ns as f64 / 1e3;
        let mut begun = false;
        let mut rest = &self.exchanges[..];
        while let Some(first) = rest.first() {
            let alike = rest.iter().take_while(|exchange| *exchange == first).count();
            let bits = |shape: &Shape| {
                let bits = shape.worst();
                bits.nominal + bits.fast
            };
            let plus = if begun { " + " } else { "" };
            write!(f, "{plus}{alike} x ({} + {} bits)", bits(&first.0), bits(&first.1))?;
            (begun, rest) = (true, &rest[alike..]);
        }
        let mut rest = &self.others[..];
        while let Some(first) = rest.first() {
            let alike = rest.iter().take_while(|shape| *shape == first).count();
            let bits = first.worst();
            write!(f, " + {alike} x {} bits", bits.nominal + bits.fast)?;
            rest = &rest[alike..];
        }
        write!(
            f,
            " with maximum stuffing = {:.0} us at {} kbit/s",
            us(self.busy_ns()),
            self.rates.nominal / 1000
        )?;
        if self.rates.fast != self.rates.nominal {
            write!(f, " and {} kbit/s", self.rates.fast / 1000)?;
        }
        write!(
            f,
            ", + {:.0} us turnaround = {:.0} us of {:.0} us ({:.0} % load)",
            us(self.turn_round_ns),
            us(self.complete_ns()),
            us(self.cycle_ns),
            100.0 * self.share()
        )
    }
}
