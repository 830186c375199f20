//! Recorded quadratic programs, for bug reports and solver comparisons.
//!
//! A file contains one problem, or a list of consecutive problems, as JSON objects. Consecutive problems of
//! the same size form a [`Stream`], as one controller produces them:
//!
//! ```text
//! { "P": [[...], ...], "q": [...],                      1/2 x'Px + q'x
//!   "A": [[...], ...], "b": [...],                      A x = b
//!   "G": [[...], ...], "lg": [...], "ug": [...],        lg <= G x <= ug
//!   "lb": [...], "ub": [...] }                          lb <= x <= ub
//! ```
//!
//! Matrices are lists of rows; `P` is symmetric, or given by its upper triangle. Missing entries are empty or
//! unbounded. Magnitudes of 1e20 and more mean infinity.
//!
//! A matrix whose numbers are all single-precision values counts as recorded in single precision, and its
//! rounding is tolerated. `P` may have negative curvature and may differ from its transpose by n times the
//! spacing of single precision (1.2e-7) relative to its largest number. In double precision, the tolerance is
//! 1e-9. Rows of `A` that are dependent within this tolerance are treated as exactly dependent.

mod precision;
mod replay;

pub use replay::{Each, Record, Replay, Status, replay, replay_streams};

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use super::{Problem, Sides, Structure};

/// Error returned when recorded problems cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// The file is not JSON of the expected form.
    #[error("expected one problem or a list of problems, each with P and q: {0}")]
    Syntax(#[from] serde_json::Error),
    /// A token is not a JSON number.
    #[error("`{word}` at line {line} column {column}, expected a finite number; write infinity as 1e20")]
    NoNumber {
        /// Text of the token.
        word: &'static str,
        /// Line of the token, from 1.
        line: usize,
        /// Column of the token, from 1.
        column: usize,
    },
    /// The list is empty.
    #[error("the list is empty, expected at least one problem")]
    Empty,
    /// A problem has no variables.
    #[error("problem {problem}: `q` is empty, expected one number per variable")]
    NoVariables {
        /// Number of the problem, from 0.
        problem: usize,
    },
    /// The matrix `P` is not symmetric.
    #[error(
        "problem {problem}: `P` has {upper} in row {row}, column {column} and {lower} on the other side of the diagonal, expected a \
         symmetric matrix, or zeros below the diagonal; rows and columns count from 0"
    )]
    Asymmetric {
        /// Number of the problem, from 0.
        problem: usize,
        /// Row of the entry above the diagonal.
        row: usize,
        /// Column of the entry above the diagonal.
        column: usize,
        /// Entry above the diagonal.
        upper: f64,
        /// Entry below the diagonal.
        lower: f64,
    },
    /// A matrix or vector has an inconsistent size.
    #[error("problem {problem}: `{key}` is {found}, expected {expected}")]
    Size {
        /// Number of the problem, from 0.
        problem: usize,
        /// Key of the matrix or vector.
        key: &'static str,
        /// The size in the file.
        found: String,
        /// The expected size.
        expected: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with P and q")]
struct Numbers {
    #[serde(rename = "P")]
    p: Vec<Vec<f64>>,
    q: Vec<f64>,
    #[serde(rename = "A", default)]
    a: Vec<Vec<f64>>,
    #[serde(default)]
    b: Vec<f64>,
    #[serde(rename = "G", default)]
    g: Vec<Vec<f64>>,
    lg: Option<Vec<f64>>,
    ug: Option<Vec<f64>>,
    lb: Option<Vec<f64>>,
    ub: Option<Vec<f64>>,
}

/// Consecutive problems of the same size.
#[derive(Clone, Debug)]
pub struct Stream {
    /// The structure common to all problems.
    pub structure: Structure,
    /// The problems, at least one.
    pub problems: Vec<Problem>,
}

/// Reads the problems of a file, whose sizes may differ. Returns one stream for each run of problems with
/// equal sizes, in order.
///
/// ```
/// use motorium_qp::recorded;
///
/// let text = r#"[{ "P": [[2.0]], "q": [-2.0] }, { "P": [[1.0]], "q": [3.0] },
///     { "P": [[2.0, 0.0], [0.0, 2.0]], "q": [-2.0, -5.0] }]"#;
/// let streams = recorded::read_streams(text)?;
/// let sizes: Vec<_> = streams.iter().map(|stream| stream.structure.variables()).collect();
/// assert_eq!(sizes, [1, 2]);
/// assert_eq!(streams[0].problems.len(), 2);
/// # Ok::<_, recorded::RecordedError>(())
/// ```
///
/// # Errors
/// [`RecordedError`] names the problem and the key.
pub fn read_streams(text: &str) -> Result<Vec<Stream>, RecordedError> {
    let mut streams: Vec<((usize, usize, usize), Vec<Problem>)> = Vec::new();
    for (problem, numbers) in parse(text)?.into_iter().enumerate() {
        let sizes = numbers.sizes(problem)?;
        let parsed = numbers.problem(problem, sizes)?;
        match streams.last_mut() {
            Some((same, problems)) if *same == sizes => problems.push(parsed),
            _ => streams.push((sizes, vec![parsed])),
        }
    }
    let stream = |problems: Vec<Problem>| Stream { structure: structure(&problems), problems };
    Ok(streams.into_iter().map(|(_, problems)| stream(problems)).collect())
}

/// Reads the problems of a file, which must all have the same size, and returns them with their common
/// structure.
///
/// ```
/// use motorium_qp::recorded;
///
/// let text = r#"{ "P": [[2.0, 0.0], [0.0, 2.0]], "q": [-2.0, -5.0], "lb": [0.0, 0.0] }"#;
/// let (structure, problems) = recorded::read(text)?;
/// assert_eq!((structure.variables(), problems.len()), (2, 1));
/// # Ok::<_, recorded::RecordedError>(())
/// ```
///
/// # Errors
/// [`RecordedError`] names the problem and the key.
pub fn read(text: &str) -> Result<(Structure, Vec<Problem>), RecordedError> {
    let all = parse(text)?;
    let sizes = all[0].sizes(0)?;
    let problems: Vec<Problem> = all
        .into_iter()
        .enumerate()
        .map(|(problem, numbers)| numbers.problem(problem, sizes))
        .collect::<Result<_, _>>()?;
    Ok((structure(&problems), problems))
}

/// Parses the entries of a file, at least one.
fn parse(text: &str) -> Result<Vec<Numbers>, RecordedError> {
    let all: Result<Vec<Numbers>, _> = match text.trim_start().starts_with('[') {
        true => serde_json::from_str(text),
        false => serde_json::from_str(text).map(|numbers| vec![numbers]),
    };
    let all = all.map_err(|error| no_number(text, &error).unwrap_or(RecordedError::Syntax(error)))?;
    if all.is_empty() { Err(RecordedError::Empty) } else { Ok(all) }
}

impl Numbers {
    /// Returns the numbers of variables, equalities and rows, from the vectors `q` and `b` and the matrix
    /// `G`.
    fn sizes(&self, problem: usize) -> Result<(usize, usize, usize), RecordedError> {
        match self.q.len() {
            0 => Err(RecordedError::NoVariables { problem }),
            variables => Ok((variables, self.b.len(), self.g.len())),
        }
    }

    fn problem(self, problem: usize, (n, m, p): (usize, usize, usize)) -> Result<Problem, RecordedError> {
        let vector = |key, numbers: Vec<f64>, expected: usize| {
            let found = numbers.len();
            if found == expected {
                return Ok(DVector::from_vec(numbers));
            }
            let (found, expected) = (format!("{found} numbers"), format!("{expected}"));
            Err(RecordedError::Size { problem, key, found, expected })
        };
        let matrix = |key, rows: Vec<Vec<f64>>, expected: usize| {
            let found = match rows.iter().enumerate().find(|(_, row)| row.len() != n) {
                Some((index, row)) => format!("a matrix with {} numbers in row {index}", row.len()),
                None if rows.len() != expected => format!("{} x {n}", rows.len()),
                None => return Ok(DMatrix::from_row_iterator(expected, n, rows.into_iter().flatten())),
            };
            Err(RecordedError::Size { problem, key, found, expected: format!("{expected} x {n}") })
        };
        let side = |key, numbers: Option<Vec<f64>>, count, infinite: f64| {
            vector(key, numbers.unwrap_or_else(|| vec![infinite; count]), count)
        };
        let mut problem = Problem {
            hessian: symmetric(problem, matrix("P", self.p, n)?)?,
            gradient: vector("q", self.q, n)?,
            equality_matrix: matrix("A", self.a, m)?,
            equality_value: vector("b", self.b, m)?,
            row_matrix: matrix("G", self.g, p)?,
            row_lower: side("lg", self.lg, p, f64::NEG_INFINITY)?,
            row_upper: side("ug", self.ug, p, f64::INFINITY)?,
            lower: side("lb", self.lb, n, f64::NEG_INFINITY)?,
            upper: side("ub", self.ub, n, f64::INFINITY)?,
        };
        precision::clean(&mut problem);
        Ok(problem)
    }
}

/// Tokens that other programs write for numbers that JSON cannot represent.
const NO_NUMBERS: [&str; 6] = ["NaN", "nan", "Infinity", "-Infinity", "inf", "-inf"];

/// Returns the error for a token such as `NaN` at the position of a syntax error; `None` for any other text.
fn no_number(text: &str, error: &serde_json::Error) -> Option<RecordedError> {
    let (line, column) = (error.line(), error.column());
    let before = text.lines().nth(line.checked_sub(1)?)?;
    // the error position may be the first or second character of the token
    (column.saturating_sub(2)..=column.saturating_sub(1)).find_map(|start| {
        let rest = before.get(start..)?;
        let word = *NO_NUMBERS.iter().find(|word| rest.starts_with(**word))?;
        Some(RecordedError::NoNumber { word, line, column: start + 1 })
    })
}

/// Returns the symmetric matrix. Its triangles must agree within rounding, or the lower one must be empty.
fn symmetric(problem: usize, matrix: DMatrix<f64>) -> Result<DMatrix<f64>, RecordedError> {
    let rounding = precision::rounding(&matrix) * matrix.amax();
    let above = || (0..matrix.ncols()).flat_map(|column| (0..column).map(move |row| (row, column)));
    let differ =
        |(row, column): &(usize, usize)| (matrix[(*row, *column)] - matrix[(*column, *row)]).abs() > rounding;
    if above().all(|(row, column)| matrix[(column, row)] == 0.0) {
        return Ok(matrix);
    }
    match above().find(differ) {
        None => Ok(matrix),
        Some((row, column)) => {
            let (upper, lower) = (matrix[(row, column)], matrix[(column, row)]);
            Err(RecordedError::Asymmetric { problem, row, column, upper, lower })
        }
    }
}

/// Returns the structure whose declared sides are finite in at least one of the problems.
fn structure(problems: &[Problem]) -> Structure {
    let first = &problems[0];
    let sides = |lower: fn(&Problem) -> &DVector<f64>, upper: fn(&Problem) -> &DVector<f64>, i: usize| {
        let below = problems.iter().any(|problem| lower(problem)[i] > -Problem::INFINITE);
        let above = problems.iter().any(|problem| upper(problem)[i] < Problem::INFINITE);
        match (below, above) {
            (true, true) => Sides::Both,
            (true, false) => Sides::Lower,
            (false, true) => Sides::Upper,
            (false, false) => Sides::Neither,
        }
    };
    let mut structure = Structure::new(first.gradient.len()).equalities(first.equality_value.len());
    for row in 0..first.row_lower.len() {
        structure = structure.rows(1, sides(|p| &p.row_lower, |p| &p.row_upper, row));
    }
    for variable in 0..first.gradient.len() {
        structure = structure.bound(variable, sides(|p| &p.lower, |p| &p.upper, variable));
    }
    structure
}
