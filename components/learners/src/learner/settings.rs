//! Settings of learners, read from the tables of a task.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Algorithm, ConvolutionSettings, check_convolutions};
use crate::task::{CHOICES, Task, TaskError};

/// Reads the table of an algorithm. Missing keys have their defaults; all settings serialise to at least one
/// key.
pub(crate) fn read_settings<S: Default + Serialize + DeserializeOwned>(
    algorithms: &toml::Table,
    algorithm: Algorithm,
) -> Result<S, TaskError> {
    let name = algorithm.name();
    let invalid = |message: String| TaskError::Parse(format!("`algorithms.{name}`: {message}"));
    let mut table = settings_table(algorithm, &S::default())?;
    let given = match algorithms.get(name) {
        None => return Ok(S::default()),
        Some(given) => given.as_table().ok_or_else(|| invalid("expected a table".to_owned()))?,
    };
    for (key, value) in given {
        if !table.contains_key(key) {
            let keys: Vec<&str> = table.keys().map(String::as_str).collect();
            return Err(invalid(format!("unknown field `{key}`, expected one of {}", keys.join(", "))));
        }
        table.insert(key.clone(), value.clone());
    }
    table.try_into().map_err(|error: toml::de::Error| invalid(error.to_string()))
}

/// Returns settings as a table.
pub(crate) fn settings_table(
    algorithm: Algorithm,
    settings: &impl Serialize,
) -> Result<toml::Table, TaskError> {
    toml::Table::try_from(settings)
        .map_err(|error| TaskError::Parse(format!("`algorithms.{}`: {error}", algorithm.name())))
}

/// Range checks of settings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Check(pub(crate) Algorithm);

impl Check {
    /// Returns the error of a setting.
    pub(crate) fn error(self, key: &str, found: f64, expected: &str) -> TaskError {
        TaskError::Value {
            key: format!("algorithms.{}.{key}", self.0.name()),
            found: found.to_string(),
            expected: expected.to_owned(),
        }
    }

    /// Checks that the table of a task with discrete actions has no setting that continuous ones need.
    pub(crate) fn absent_with_choices(self, task: &Task, key: &str) -> Result<(), TaskError> {
        let given = task.algorithms.get(self.0.name()).and_then(|table| table.get(key));
        match given.filter(|_| task.action.contains_key(CHOICES)) {
            None => Ok(()),
            Some(found) => {
                let expected = "no value: the task has `action.choices`";
                Err(TaskError::value(format!("algorithms.{}.{key}", self.0.name()), found, expected))
            }
        }
    }

    /// Checks counts, which are at least 1.
    pub(crate) fn counts<const N: usize>(self, counts: [(&str, u64); N]) -> Result<(), TaskError> {
        let zero = counts.into_iter().find(|(_, count)| *count == 0);
        zero.map_or(Ok(()), |(key, _)| Err(self.error(key, 0.0, "at least 1")))
    }

    /// Checks that numbers are above 0.
    pub(crate) fn positive<const N: usize>(self, numbers: [(&str, f64); N]) -> Result<(), TaskError> {
        let wrong = numbers.into_iter().find(|(_, found)| !(*found > 0.0 && found.is_finite()));
        wrong.map_or(Ok(()), |(key, found)| Err(self.error(key, found, "above 0")))
    }

    /// Checks that numbers are at least 0.
    pub(crate) fn not_negative<const N: usize>(self, numbers: [(&str, f64); N]) -> Result<(), TaskError> {
        let wrong = numbers.into_iter().find(|(_, found)| !(*found >= 0.0 && found.is_finite()));
        wrong.map_or(Ok(()), |(key, found)| Err(self.error(key, found, "at least 0")))
    }

    /// Checks that numbers are from 0 to 1.
    pub(crate) fn shares<const N: usize>(self, numbers: [(&str, f64); N]) -> Result<(), TaskError> {
        let wrong = numbers.into_iter().find(|(_, found)| !(0.0..=1.0).contains(found));
        wrong.map_or(Ok(()), |(key, found)| Err(self.error(key, found, "0 to 1")))
    }

    /// Checks the discount, the convolutions and the hidden units.
    pub(crate) fn network(
        self,
        discount: f64,
        convolutions: &[ConvolutionSettings],
        hidden: &[usize],
    ) -> Result<(), TaskError> {
        check_convolutions(self.0.name(), convolutions)?;
        if !(discount > 0.0 && discount < 1.0) {
            return Err(self.error("discount", discount, "above 0, below 1"));
        }
        if hidden.is_empty() || hidden.contains(&0) {
            return Err(self.error("hidden", 0.0, "at least one layer of at least one unit"));
        }
        Ok(())
    }
}
