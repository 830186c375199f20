//! Recorded observations and actions.

use crate::environment::EnvironmentError;

/// Recorded observations of a task and the action that was taken for each observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Lengths of an observation and of an action.
    pub widths: [usize; 2],
    /// Observations, stored row by row.
    pub observations: Vec<f32>,
    /// Actions, stored row by row.
    pub actions: Vec<f32>,
}

/// Error of a recording that does not fit the task.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// Observations or actions have the wrong size.
    #[error(
        "a recorded {part} has {found} numbers, expected {expected}\n\
         help: record the task that is learned, with its own policy"
    )]
    Width {
        /// Kind of the row, `observation` or `action`.
        part: &'static str,
        /// Size found.
        found: usize,
        /// Size expected by the task.
        expected: usize,
    },
    /// The numbers of observations and actions differ, or a row is incomplete.
    #[error(
        "the recorded observations have {observations} numbers and the recorded actions have {actions} \
         numbers, which do not form equal numbers of complete rows"
    )]
    Rows {
        /// Total count of numbers in the observations.
        observations: usize,
        /// Total count of numbers in the actions.
        actions: usize,
    },
    /// A number is not finite.
    #[error("a recorded {part} contains {found}, expected finite numbers")]
    NotFinite {
        /// Kind of the row, `observation` or `action`.
        part: &'static str,
        /// Number found.
        found: f32,
    },
    /// The environment failed.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
}

impl Recorded {
    /// Checks all numbers for a task with these sizes of an observation and an action.
    pub(super) fn check(&self, expected: [usize; 2]) -> Result<(), RecordedError> {
        let parts = [("observation", &self.observations), ("action", &self.actions)];
        for (k, (part, numbers)) in parts.into_iter().enumerate() {
            let (found, expected) = (self.widths[k], expected[k]);
            if found != expected {
                return Err(RecordedError::Width { part, found, expected });
            }
            if let Some(&found) = numbers.iter().find(|number| !number.is_finite()) {
                return Err(RecordedError::NotFinite { part, found });
            }
        }
        let [observations, actions] = [self.observations.len(), self.actions.len()];
        let rows = actions / expected[1].max(1);
        if observations != rows * expected[0] || actions != rows * expected[1] {
            return Err(RecordedError::Rows { observations, actions });
        }
        Ok(())
    }
}
