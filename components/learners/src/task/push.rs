//! Pushes of a task: horizontal forces on the base, at random times.

use rand::RngExt as _;
use serde::Deserialize;

use super::TaskError;
use crate::random::{Counter, Purpose};

/// Pushes on the base of a floating robot during training. Each interval has one push, whose start, force and
/// direction are uniformly distributed.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pushes {
    /// Maximum horizontal force \[N\], more than 0.
    pub force: f64,
    /// Duration of a push \[s\], more than 0. Default: 0.1.
    #[serde(default = "tenth")]
    pub duration: f64,
    /// Length of each interval \[s\], at least `duration`. Default: 5.
    #[serde(default = "five")]
    pub interval: f64,
}

fn tenth() -> f64 {
    0.1
}

fn five() -> f64 {
    5.0
}

impl Pushes {
    /// Checks all numbers.
    pub(super) fn check(&self) -> Result<(), TaskError> {
        for (key, number) in [("force", self.force), ("duration", self.duration)] {
            if !(number > 0.0 && number < 1e6) {
                return Err(TaskError::value(format!("pushes.{key}"), number, "above 0, below 1e6"));
            }
        }
        if !(self.interval >= self.duration && self.interval.is_finite()) {
            let expected = format!("at least the duration, {} s", self.duration);
            return Err(TaskError::value("pushes.interval", self.interval, expected));
        }
        Ok(())
    }

    /// Returns the horizontal force at a time of an episode \[N\], or `None` between pushes. The counter
    /// identifies the episode.
    pub(crate) fn force(&self, counter: Counter, time: f64) -> Option<[f64; 2]> {
        let number = (time / self.interval).floor();
        let mut random = Counter { step: number as u64, ..counter }.stream(Purpose::Push);
        let [start, force, direction]: [f64; 3] = core::array::from_fn(|_| random.random());
        let since = time - number * self.interval - start * (self.interval - self.duration);
        let (sine, cosine) = (core::f64::consts::TAU * direction).sin_cos();
        (0.0..self.duration).contains(&since).then(|| [cosine, sine].map(|part| part * force * self.force))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_interval_has_one_push() {
        let pushes = Pushes { force: 10.0, duration: 0.1, interval: 2.0 };
        let counter = Counter { seed: 3, ..Counter::default() };
        for interval in 0..20 {
            let times = (0..2000).map(|k| 2.0 * f64::from(interval) + 1e-3 * f64::from(k));
            let forces: Vec<_> = times.filter_map(|time| pushes.force(counter, time)).collect();
            assert!(forces.len().abs_diff(100) <= 1, "{interval}: {} ms", forces.len());
            assert!(forces.iter().all(|force| *force == forces[0] && force[0].hypot(force[1]) <= 10.0));
        }
        assert_eq!(pushes.force(counter, 1.0), pushes.force(counter, 1.0));
    }
}
