//! Returns of the episodes of a run.

use serde_json::{Value, json};

use crate::task::End;

/// Statistics of the finished episodes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Score {
    episodes: u64,
    sum: f64,
    lowest: f64,
    highest: f64,
    steps: u64,
    failures: u64,
    successes: u64,
    truncations: u64,
}

impl Score {
    /// Adds an episode.
    pub(super) fn add(&mut self, total: f64, steps: usize, end: End) {
        let is_first = self.episodes == 0;
        self.lowest = if is_first { total } else { self.lowest.min(total) };
        self.highest = if is_first { total } else { self.highest.max(total) };
        self.episodes += 1;
        self.sum += total;
        self.steps += steps as u64;
        *match end {
            End::Failure => &mut self.failures,
            End::Success => &mut self.successes,
            End::Truncated => &mut self.truncations,
        } += 1;
    }

    /// Returns the result of the component, with the reason for missing returns from the time of the running
    /// episode and its longest duration \[s\].
    pub(super) fn report(&self, [time, duration]: [f64; 2]) -> Value {
        let no_value = (self.episodes == 0).then(|| {
            format!(
                "no episode ended: the run covers {time:.2} s of an episode, which lasts up to {duration} s"
            )
        });
        let some = |value: f64| (self.episodes > 0).then_some(value);
        json!({
            "episodes": self.episodes,
            "mean_return": some(self.sum / self.episodes as f64),
            "lowest_return": some(self.lowest),
            "highest_return": some(self.highest),
            "mean_length": some(self.steps as f64 / self.episodes as f64),
            "failures": self.failures,
            "successes": self.successes,
            "truncations": self.truncations,
            "no_value": no_value,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_cover_finished_episodes() {
        let mut score = Score::default();
        let report = score.report([2.98, 8.0]);
        assert_eq!(report["mean_return"], Value::Null);
        assert_eq!(
            report["no_value"],
            "no episode ended: the run covers 2.98 s of an episode, which lasts up to 8 s"
        );
        score.add(-2.0, 10, End::Failure);
        score.add(5.0, 30, End::Truncated);
        let report = score.report([0.5, 8.0]);
        assert_eq!(report["no_value"], Value::Null);
        assert_eq!((&report["mean_return"], &report["mean_length"]), (&json!(1.5), &json!(20.0)));
        assert_eq!((&report["lowest_return"], &report["highest_return"]), (&json!(-2.0), &json!(5.0)));
        let ends = ["failures", "successes", "truncations"].map(|key| report[key].as_u64());
        assert_eq!(ends, [Some(1), Some(0), Some(1)]);
    }
}
