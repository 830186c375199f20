//! Discrete actions: a policy chooses one row of a table.

use motorium_models::policy::Policy;

use super::{CHOICES, Task, TaskError};

/// The actions among which a policy with discrete actions chooses: a table with one row per action.
///
/// ```
/// use motorium_learners::task::Task;
///
/// let task = Task::parse(
///     r#"
///     title = "Balance a pole"
///     robot = "cart-pole"
///     step = 0.005
///     decimation = 4
///     duration = 10.0
///     observations = [{ term = "joint_positions" }, { term = "joint_velocities" }]
///     rewards = [{ term = "alive" }]
///     [start]
///     position = [0.0, 3.14]
///     [action]
///     joints = ["slider"]
///     kind = "effort"
///     scale = 10.0
///     default_pose = [0.0]
///     choices = [[-1.0], [0.0], [1.0]]
///     "#,
/// )?;
/// let choices = task.choices()?.expect("a discrete action");
/// assert_eq!((choices.count(), choices.row(2)), (3, &[1.0][..]));
/// # Ok::<(), motorium_learners::task::TaskError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Choices {
    rows: Vec<f32>,
    width: usize,
}

impl Task {
    /// Returns the actions of a discrete task, which are the rows of `action.choices`; `None` if the task's
    /// actions are continuous.
    ///
    /// # Errors
    ///
    /// [`TaskError`] if the rows are not distinct actions within the bounds.
    pub fn choices(&self) -> Result<Option<Choices>, TaskError> {
        self.action.get(CHOICES).map(|rows| Choices::read(rows, &self.policy()?)).transpose()
    }
}

impl Choices {
    /// Maximum number of rows.
    pub const MOST: usize = 256;

    /// Reads the rows of a task with a policy.
    fn read(rows: &toml::Value, policy: &Policy) -> Result<Self, TaskError> {
        let key = |row: Option<usize>| {
            row.map_or_else(|| "action.choices".to_owned(), |row| format!("action.choices[{row}]"))
        };
        let numbers: Vec<Vec<f64>> = rows
            .clone()
            .try_into()
            .map_err(|_| TaskError::value(key(None), rows, "a list of actions, each a list of numbers"))?;
        if !(2..=Self::MOST).contains(&numbers.len()) {
            let found = format!("{} rows", numbers.len());
            return Err(TaskError::value(key(None), found, format!("2 to {} rows", Self::MOST)));
        }
        let width = policy.outputs();
        let [low, high] = policy.action.bounds().unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        for (index, row) in numbers.iter().enumerate() {
            let wrong =
                |expected: String| Err(TaskError::value(key(Some(index)), format!("{row:?}"), expected));
            if row.len() != width {
                return wrong(format!("{width} numbers, as in `action`"));
            }
            if !row.iter().all(|number| number.is_finite() && (low..=high).contains(number)) {
                return wrong("finite numbers within the bounds of the action".to_owned());
            }
            if numbers[..index].contains(row) {
                return wrong("a row that differs from all other rows".to_owned());
            }
        }
        Ok(Self { rows: numbers.into_iter().flatten().map(|number| number as f32).collect(), width })
    }

    /// Every combination of `bins` values between -1 and 1 for each active number, the last fastest; other
    /// numbers are 0. `None` if there are more than [`MOST`](Self::MOST).
    pub(crate) fn grid(active: &[bool], bins: usize) -> Option<Self> {
        let moving = active.iter().filter(|active| **active).count();
        let count = bins.checked_pow(u32::try_from(moving).ok()?).filter(|count| *count <= Self::MOST)?;
        let mut rows = vec![0.0; count * active.len()];
        for (choice, row) in rows.chunks_exact_mut(active.len()).enumerate() {
            let mut rest = choice;
            for (number, _) in row.iter_mut().zip(active).rev().filter(|(_, active)| **active) {
                *number = 2.0 * (rest % bins) as f32 / (bins - 1) as f32 - 1.0;
                rest /= bins;
            }
        }
        Some(Self { rows, width: active.len() })
    }

    /// Maps every row by a function of a row and its image.
    pub(crate) fn map(&self, image: impl Fn(&[f32], &mut [f32])) -> Self {
        let mut rows = vec![0.0; self.rows.len()];
        let pairs = self.rows.chunks_exact(self.width).zip(rows.chunks_exact_mut(self.width));
        pairs.for_each(|(row, mapped)| image(row, mapped));
        Self { rows, width: self.width }
    }

    /// Returns the number of rows.
    pub fn count(&self) -> usize {
        self.rows.len() / self.width
    }

    /// Returns the number of values of an action.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the action of a choice.
    ///
    /// # Panics
    ///
    /// If `choice` is out of range.
    pub fn row(&self, choice: usize) -> &[f32] {
        &self.rows[choice * self.width..][..self.width]
    }

    /// Returns the row with the smallest squared distance from an action, the first one in a tie.
    pub(crate) fn nearest(&self, action: &[f32]) -> usize {
        let distance = |row: &[f32]| row.iter().zip(action).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        best(self.rows.chunks_exact(self.width).map(|row| -distance(row)))
    }

    /// Returns the values of all rows, row by row.
    pub fn rows(&self) -> &[f32] {
        &self.rows
    }
}

/// Index of the first largest value.
pub(crate) fn best(values: impl IntoIterator<Item = f32>) -> usize {
    let first = (0, f32::NEG_INFINITY);
    values.into_iter().enumerate().fold(first, |best, (k, q)| if q > best.1 { (k, q) } else { best }).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_hold_all_combinations_of_moving_joints() {
        let rows = |active: &[bool], bins| Choices::grid(active, bins).map(|choices| choices.rows);
        assert_eq!(rows(&[true, false], 3), Some(vec![-1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
        let two = rows(&[true, true], 2).expect("four choices");
        assert_eq!(two, [-1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0]);
        assert_eq!(rows(&[true; 6], 3), None);
        assert_eq!(best([1.0, 3.0, 3.0, 2.0]), 1);
    }

    #[test]
    fn mistakes_in_rows_are_named() {
        let text = include_str!("../../../../tasks/cart-pole.toml");
        let task =
            |rows: &str| Task::parse(&text.replace("[action]", &format!("[action]\nchoices = {rows}")));
        for (rows, key) in [
            ("[[1.0, 0.0]]", "action.choices"),
            ("[1.0, 0.0]", "action.choices"),
            ("[[1.0, 0.0], [0.0]]", "action.choices[1]"),
            ("[[1.5, 0.0], [0.0, 0.0]]", "action.choices[0]"),
            ("[[1.0, 0.0], [nan, 0.0]]", "action.choices[1]"),
            ("[[1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]", "action.choices[2]"),
        ] {
            let error = task(rows).expect_err(rows);
            assert!(matches!(&error, TaskError::Value { key: found, .. } if found == key), "{rows}: {error}");
        }
        let task = task("[[-1, 0], [1, 0]]").expect("two choices");
        let choices = task.choices().expect("rows").expect("a discrete action");
        assert_eq!((choices.count(), choices.width(), choices.rows()), (2, 2, &[-1.0, 0.0, 1.0, 0.0][..]));
        assert!(!task.policy_text(None).expect("a policy").contains("choices"), "the network has the rows");
    }
}
