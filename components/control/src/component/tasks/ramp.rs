//! Parameters of tasks whose changes take time.

use motorium::prelude::*;

use super::TaskBounds;

/// A parameter of a task: a change of it takes effect within [`TaskBounds::ramp`], evenly, so that a task that is switched on, off or
/// weighed anew in a running controller moves no joint by a jump.
pub(in crate::component) struct Ramped {
    parameter: Parameter<f64>,
    change: Change,
}

impl Ramped {
    pub(super) fn new(parameter: Parameter<f64>) -> Self {
        let value = parameter.get();
        Self { parameter, change: Change { value, wanted: value, rate: 0.0 } }
    }

    /// The value for this step.
    pub(super) fn follow(&mut self, bounds: &TaskBounds) -> f64 {
        let wanted = self.parameter.get();
        if bounds.begins {
            self.change = Change { value: wanted, wanted, rate: 0.0 };
        }
        self.change.follow(wanted, bounds.dt, bounds.ramp)
    }
}

/// A value on its way to another one.
struct Change {
    value: f64,
    wanted: f64,
    /// Speed of the change, 1/s.
    rate: f64,
}

impl Change {
    fn follow(&mut self, wanted: f64, dt: f64, ramp: f64) -> f64 {
        if wanted != self.wanted {
            (self.wanted, self.rate) = (wanted, (wanted - self.value).abs() / ramp.max(dt));
        }
        let step = self.rate * dt;
        self.value = if (wanted - self.value).abs() <= step {
            wanted
        } else {
            self.value + step.copysign(wanted - self.value)
        };
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_takes_the_time_of_the_ramp_whatever_its_size_and_ends_exactly() {
        for (from, to) in [(0.0, 1.0), (1.0, 0.0), (3.0, 700.0)] {
            let mut change = Change { value: from, wanted: from, rate: 0.0 };
            let share = |value: f64| (value - from) / (to - from);
            for step in 1..=100 {
                let value = change.follow(to, 1e-3, 0.1);
                assert!((share(value) - f64::from(step) / 100.0).abs() < 1e-9, "step {step}: {value}");
            }
            assert_eq!(change.follow(to, 1e-3, 0.1), to);
            // turned back half-way, the way back takes the ramp, too
            for _ in 0..50 {
                change.follow(from, 1e-3, 0.1);
            }
            assert!((share(change.value) - 0.5).abs() < 1e-9);
            change.follow(to, 1e-3, 0.1);
            assert!((share(change.value) - 0.505).abs() < 1e-9);
        }
    }

    #[test]
    fn without_a_ramp_a_change_takes_effect_at_once() {
        let mut change = Change { value: 1.0, wanted: 1.0, rate: 0.0 };
        assert_eq!(change.follow(5.0, 1e-3, 0.0), 5.0);
    }
}
