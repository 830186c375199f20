//! Errors of terrain.

/// The terrain cannot be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// A number is out of range.
    #[error("`{key}` is {value}, expected {expected}")]
    Value {
        /// Key of the number.
        key: String,
        /// The value found.
        value: f64,
        /// The range expected.
        expected: &'static str,
    },
    /// An equation does not parse.
    #[error("`{key}` = \"{text}\": {problem}")]
    Equation {
        /// Key of the equation.
        key: String,
        /// Text of the equation.
        text: String,
        /// Position and description of the problem.
        problem: String,
    },
    /// An image cannot be read.
    #[error("`{key}` = \"{file}\": {problem}")]
    Picture {
        /// Key of the image.
        key: String,
        /// Path of the image file.
        file: String,
        /// Actual and expected values.
        problem: String,
    },
    /// The grid is too fine: it has too many heights.
    #[error("a grid of {found:.3e} heights, expected at most {most:.0e}; raise `spacing` or lower `size`")]
    Fine {
        /// Requested number of heights.
        found: f64,
        /// Maximum number of heights.
        most: f64,
    },
    /// A height is not finite.
    #[error("the height at x = {x}, y = {y} is {height}, expected a finite number")]
    Height {
        /// Position along x \[m\].
        x: f64,
        /// Position along y \[m\].
        y: f64,
        /// Height \[m\].
        height: f64,
    },
}

impl TerrainError {
    pub(super) fn value(key: impl Into<String>, value: f64, expected: &'static str) -> Self {
        Self::Value { key: key.into(), value, expected }
    }
}
