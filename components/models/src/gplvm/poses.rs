//! Poses from CSV files.
//!
//! The first line contains the column names, separated by commas; each further line is a pose. The columns
//! `clip`, `frame` and `key` are labels and are skipped. Line `i` of every file in a folder is the same
//! instant.

use std::path::Path;

use super::SpaceData;

/// Poses of one space, read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Name of the space: the file name without its extension.
    pub name: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Values of the poses, row by row; each row is a pose.
    pub values: Vec<f64>,
    /// Rows at which movements start: the first row, and each row whose label `clip` differs from the
    /// previous row's.
    pub starts: Vec<usize>,
}

/// Error of an invalid file of poses.
#[derive(Debug, thiserror::Error)]
pub enum PosesError {
    /// The file cannot be read.
    #[error("{path}: {error}")]
    Io {
        /// Path of the file.
        path: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// A cell or line is invalid.
    #[error("{path}: line {line}, column {column}: found {found}, expected {expected}")]
    Cell {
        /// Path of the file.
        path: String,
        /// Line, counted from 1.
        line: usize,
        /// Column of the table, from 1.
        column: usize,
        /// Text found.
        found: String,
        /// Description of a valid value.
        expected: String,
    },
}

const LABELS: [&str; 3] = ["clip", "frame", "key"];

impl Poses {
    /// Reads the poses of a file.
    ///
    /// # Errors
    /// [`PosesError`] if the file cannot be read, a line is too short or long, or a cell is not a finite
    /// number.
    pub fn read(path: &Path) -> Result<Self, PosesError> {
        let shown = path.display().to_string();
        let text =
            std::fs::read_to_string(path).map_err(|error| PosesError::Io { path: shown.clone(), error })?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(&name, &shown, &text)
    }

    /// Parses poses from a text. `path` is used in errors.
    ///
    /// # Errors
    /// [`PosesError`] if a line is too short or long, or a cell is not a finite number.
    pub fn parse(name: &str, path: &str, text: &str) -> Result<Self, PosesError> {
        let wrong = |line: usize, column: usize, found: String, expected: String| PosesError::Cell {
            path: path.to_string(),
            line: line + 1,
            column: column + 1,
            found,
            expected,
        };
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let header: Vec<&str> =
            lines.next().map_or(vec![], |(_, line)| line.split(',').map(str::trim).collect());
        let used: Vec<usize> = (0..header.len()).filter(|c| !LABELS.contains(&header[*c])).collect();
        if used.is_empty() || header[used[0]].parse::<f64>().is_ok() {
            return Err(wrong(0, 0, "no names".to_string(), "a header of column names".to_string()));
        }
        let clip_column = header.iter().position(|name| *name == "clip");
        let (mut values, mut starts, mut clip, mut rows) = (vec![], vec![], None, 0);
        for (index, line) in lines {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            if cells.len() != header.len() {
                let (found, expected) = (format!("{} cells", cells.len()), format!("{} cells", header.len()));
                return Err(wrong(index, cells.len().min(header.len()), found, expected));
            }
            let label = clip_column.map(|column| cells[column].to_string());
            if rows == 0 || label != clip {
                starts.push(rows);
            }
            (clip, rows) = (label, rows + 1);
            for column in &used {
                let value = cells[*column].parse::<f64>().ok().filter(|value| value.is_finite());
                let found = || format!("{:?}", cells[*column]);
                values.push(
                    value.ok_or_else(|| wrong(index, *column, found(), "a finite number".to_string()))?,
                );
            }
        }
        if values.is_empty() {
            return Err(wrong(1, 0, "no poses".to_string(), "at least one line of numbers".to_string()));
        }
        let columns = used.iter().map(|column| header[*column].to_string()).collect();
        Ok(Self { name: name.to_string(), columns, values, starts })
    }

    /// Returns the number of poses.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns.len()
    }

    /// Returns `true` if there are no poses.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the poses whose index satisfies a condition. Each pose starts a movement.
    pub(super) fn select(&self, keep: impl Fn(usize) -> bool) -> Self {
        let rows = self.values.chunks_exact(self.columns.len()).enumerate();
        let values: Vec<f64> = rows.filter(|(i, _)| keep(*i)).flat_map(|(_, row)| row.to_vec()).collect();
        let starts = (0..values.len() / self.columns.len()).collect();
        Self { values, starts, ..self.clone() }
    }

    /// Returns the poses with these indices, in this order. Each pose starts a movement.
    pub(super) fn rows_at(&self, indices: &[usize]) -> Self {
        let d = self.columns.len();
        let values = indices.iter().flat_map(|i| &self.values[i * d..(i + 1) * d]).copied().collect();
        Self { values, starts: (0..indices.len()).collect(), ..self.clone() }
    }

    /// Returns the poses as training data of one observed space of a shared GP-LVM.
    pub fn data(&self) -> SpaceData<'_> {
        SpaceData { name: &self.name, columns: self.columns.clone(), values: &self.values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_skipped_and_bad_cells_located() {
        let poses = Poses::parse("human", "human.csv", "clip,frame,a,b\n02_01,3,1.5,-2\n\n02_01,4,0,1e-3\n");
        let poses = poses.expect("poses");
        assert_eq!((poses.columns.join(" "), poses.values), ("a b".to_string(), vec![1.5, -2.0, 0.0, 1e-3]));
        let clips = Poses::parse("human", "human.csv", "clip,a\nx,1\nx,2\ny,3\n").expect("poses");
        assert_eq!(clips.starts, [0, 2]);
        let error = |text: &str| Poses::parse("x", "x.csv", text).expect_err("an error").to_string();
        assert_eq!(
            error("a,b\n1,2\n1,inf\n"),
            "x.csv: line 3, column 2: found \"inf\", expected a finite number"
        );
        assert_eq!(error("a,b\n1\n"), "x.csv: line 2, column 2: found 1 cells, expected 2 cells");
        assert!(error("1,2\n3,4\n").contains("expected a header"));
        assert!(error("a\n").contains("no poses"));
    }
}
