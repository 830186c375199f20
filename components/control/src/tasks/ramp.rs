//! Task parameters whose changes are ramped.

use motorium::prelude::*;

/// Step settings that a controller passes to its tasks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TaskBounds {
    /// `true` in the first step at a state.
    pub(crate) begins: bool,
    /// Duration of parameter ramps, s.
    pub(crate) ramp: f64,
    /// Time since the previous step, s.
    pub(crate) dt: f64,
    /// The largest gain: half the tick rate, 1/s.
    pub(crate) max_gain: f64,
    /// Age beyond which a target is treated as stationary, ns.
    pub(crate) target_timeout_ns: u64,
}

/// Difference between two presences that is treated as rounding.
const SAME: f64 = 1e-9;

/// A ramped task parameter. A change is applied linearly over [`TaskBounds::ramp`], so that enabling,
/// disabling or reweighting a task at run time causes no discontinuity.
///
/// A weight of 0 disables a task. Under strict priorities a small weight acts like a large one, so ramping a
/// weight to 0 would still end in a discontinuity. Instead, the weight keeps its value while its presence
/// falls from 1 to 0, and the controller mixes the solutions with and without the task by its [`Fades`].
pub(crate) struct Ramped {
    parameter: Parameter<f64>,
    value: Change,
    /// Presence of a weight, from 0 to 1; `None` for other parameters.
    presence: Option<Change>,
}

impl Ramped {
    pub(super) fn new(parameter: Parameter<f64>, is_weight: bool) -> Self {
        let value = parameter.get();
        let presence = is_weight.then(|| Change::constant(presence(value)));
        Self { parameter, value: Change::constant(value), presence }
    }

    /// Returns the value for this step and this part of the mixture.
    pub(super) fn follow(&mut self, bounds: &TaskBounds, fades: &mut Fades) -> f64 {
        if fades.begins {
            self.advance(self.parameter.get(), bounds);
        }
        let Some(present) = self.presence.as_ref().map(|presence| presence.value) else {
            return self.value.value;
        };
        if fades.begins {
            fades.note(present);
        }
        if present > 0.0 && present >= fades.threshold - SAME { self.value.value } else { 0.0 }
    }

    fn advance(&mut self, desired: f64, bounds: &TaskBounds) {
        let &TaskBounds { begins, dt, ramp, .. } = bounds;
        let absent = self.presence.as_ref().is_some_and(|presence| presence.value == 0.0);
        if begins {
            (self.value, self.presence) = (
                Change::constant(desired),
                self.presence.as_ref().map(|_| Change::constant(presence(desired))),
            );
        }
        match &mut self.presence {
            Some(present) => {
                present.follow(presence(desired), dt, ramp);
                match desired {
                    // it fades out with its previous value
                    0.0 => self.value = Change::constant(self.value.value),
                    desired if absent => self.value = Change::constant(desired),
                    desired => self.value.follow(desired, dt, ramp),
                }
            }
            None => self.value.follow(desired, dt, ramp),
        }
    }
}

fn presence(weight: f64) -> f64 {
    if weight > 0.0 { 1.0 } else { 0.0 }
}

/// Mixture of solutions while weights fade. For presences `1 > a_1 > ... > a_n > 0`, the solution without the
/// fading weights has the share `1 - a_1`. The solution with the weights whose presence is at least `a_1` has
/// the share `a_1 - a_2`, and so on. The solution with all weights has the share `a_n`.
///
/// The mixture is continuous in all presences (the Lovasz extension of a set function). As a convex
/// combination it satisfies every limit that all its solutions satisfy, and preserves the solution of higher
/// levels.
pub(crate) struct Fades {
    /// Distinct presences in descending order.
    presences: Vec<f64>,
    /// Minimum presence of a participating weight.
    threshold: f64,
    /// `true` while the parameters advance by a step.
    begins: bool,
}

impl Fades {
    /// Creates a mixture with capacity for `most` weights.
    pub(crate) fn new(most: usize) -> Self {
        Self { presences: Vec::with_capacity(most), threshold: 0.0, begins: true }
    }

    /// Starts a step, in which all weights with nonzero presence participate.
    pub(crate) fn begin(&mut self) {
        self.presences.clear();
        (self.threshold, self.begins) = (0.0, true);
    }

    fn note(&mut self, present: f64) {
        let known = self.presences.iter().any(|other| (other - present).abs() <= SAME);
        if present <= 0.0 || present >= 1.0 || known || self.presences.len() == self.presences.capacity() {
            return;
        }
        let place = self.presences.iter().take_while(|other| **other > present).count();
        self.presences.insert(place, present);
    }

    /// Number of solutions in the step; 1 without fading. The last one includes all weights with nonzero
    /// presence.
    pub(crate) fn parts(&self) -> usize {
        self.presences.len() + 1
    }

    /// Starts a part of the mixture and returns its share.
    pub(crate) fn part(&mut self, part: usize) -> f64 {
        let above = if part == 0 { 1.0 } else { self.presences[part - 1] };
        (self.threshold, self.begins) = (above, false);
        above - self.presences.get(part).copied().unwrap_or(0.0)
    }
}

/// A ramped change of a value.
struct Change {
    value: f64,
    desired: f64,
    /// Speed of the change, 1/s.
    rate: f64,
}

impl Change {
    fn constant(value: f64) -> Self {
        Self { value, desired: value, rate: 0.0 }
    }

    fn follow(&mut self, desired: f64, dt: f64, ramp: f64) {
        if desired != self.desired {
            (self.desired, self.rate) = (desired, (desired - self.value).abs() / ramp.max(dt));
        }
        let step = self.rate * dt;
        self.value = if (desired - self.value).abs() <= step {
            desired
        } else {
            self.value + step.copysign(desired - self.value)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_lasts_one_ramp_and_ends_exactly() {
        for (from, to) in [(0.0, 1.0), (1.0, 0.0), (3.0, 700.0)] {
            let mut change = Change::constant(from);
            let share = |value: f64| (value - from) / (to - from);
            for step in 1..=100 {
                change.follow(to, 1e-3, 0.1);
                let value = change.value;
                assert!((share(value) - f64::from(step) / 100.0).abs() < 1e-9, "step {step}: {value}");
            }
            change.follow(to, 1e-3, 0.1);
            assert_eq!(change.value, to);
            // reversed half-way, the return also lasts one ramp
            for _ in 0..50 {
                change.follow(from, 1e-3, 0.1);
            }
            assert!((share(change.value) - 0.5).abs() < 1e-9);
            change.follow(to, 1e-3, 0.1);
            assert!((share(change.value) - 0.505).abs() < 1e-9);
        }
    }

    #[test]
    fn without_a_ramp_a_change_takes_effect_immediately() {
        let mut change = Change::constant(1.0);
        change.follow(5.0, 1e-3, 0.0);
        assert_eq!(change.value, 5.0);
    }

    /// Mixture of a function of the set of participating weights.
    fn mixed(presences: &[f64], of: impl Fn(&[bool]) -> f64) -> f64 {
        let mut fades = Fades::new(presences.len());
        fades.begin();
        presences.iter().for_each(|present| fades.note(*present));
        (0..fades.parts())
            .map(|part| {
                let share = fades.part(part);
                let set: Vec<bool> = presences
                    .iter()
                    .map(|present| *present > 0.0 && *present >= fades.threshold - SAME)
                    .collect();
                share * of(&set)
            })
            .sum()
    }

    #[test]
    fn mixture_is_a_continuous_function_of_all_presences() {
        // a set function without any structure
        let of = |set: &[bool]| {
            let number = set.iter().enumerate().map(|(place, is)| usize::from(*is) << place).sum::<usize>();
            ((number * 2_654_435_761) % 97) as f64
        };
        assert_eq!(mixed(&[1.0, 0.0, 1.0], of), of(&[true, false, true]));
        let half = mixed(&[1.0, 0.5, 0.0], of);
        assert!((half - 0.5 * (of(&[true, true, false]) + of(&[true, false, false]))).abs() < 1e-12);
        let mut before = mixed(&[1.0, 0.0, 0.7], of);
        for step in 1..=10_000 {
            let time = f64::from(step) * 1e-4;
            let now = mixed(&[1.0 - time, time, (0.7 - 2.0 * time).abs().min(1.0)], of);
            assert!((now - before).abs() < 97.0 * 4.0 * 1e-4, "{time}: {before} {now}");
            before = now;
        }
    }
}
