//! Curves of a training run, from its table `progress.csv`.

use std::path::Path;

use anyhow::{Context as _, ensure};
use motorium_learners::training::Summary;
use motorium_pictures::chart::{Chart, Series};

use crate::html;

/// The page in the folder of a run.
pub(super) const PAGE: &str = "report.html";

/// A table of numbers by update or iteration.
struct Table {
    head: Vec<String>,
    /// `None` for empty cells.
    rows: Vec<Vec<Option<f64>>>,
}

impl Table {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        let file = folder.join("progress.csv");
        let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
        let mut lines = text.lines();
        let head = lines.next().unwrap_or_default().split(',').map(str::to_owned).collect();
        let row = |line: &str| line.split(',').map(|cell| cell.parse().ok()).collect();
        Ok(Self { head, rows: lines.map(row).collect() })
    }

    fn column(&self, names: &[&str]) -> Option<usize> {
        self.head.iter().position(|name| names.contains(&&name[..]))
    }

    /// Returns the finite numbers of a column against another.
    fn points(&self, x: usize, y: usize) -> Vec<[f64; 3]> {
        let number = |row: &[Option<f64>], column: usize| {
            row.get(column).copied().flatten().filter(|number| number.is_finite())
        };
        self.rows.iter().filter_map(|row| Some([number(row, x)?, number(row, y)?, 0.0])).collect()
    }
}

/// Returns a chart of lines against the steps of all worlds.
pub(super) fn chart(title: &str, y: &str, series: Vec<Series>) -> Chart {
    let (title, x, y) = (title.to_owned(), "steps".to_owned(), y.to_owned());
    Chart { title, x, y, log_x: false, log_y: false, series }
}

/// Returns the mean return against steps.
pub(super) fn returns(folder: &Path) -> anyhow::Result<Series> {
    let table = Table::read(folder)?;
    let columns = table.column(&["steps", "labels"]).zip(table.column(&["mean_return"]));
    let (steps, returns) = columns.with_context(|| {
        format!("{}: progress.csv has no columns `steps` and `mean_return`", folder.display())
    })?;
    let points = table.points(steps, returns);
    ensure!(!points.is_empty(), "{}: no episode has ended, expected a longer run", folder.display());
    Ok(Series { name: folder.display().to_string(), points })
}

/// Returns a page with the curves of a run: return and length of episodes, and each value of an update.
pub(super) fn page(folder: &Path, title: &str, summary: &Summary) -> anyhow::Result<String> {
    let table = Table::read(folder)?;
    let steps = table.column(&["steps"]);
    let steps = steps.with_context(|| format!("{}: progress.csv has no column `steps`", folder.display()))?;
    let mut body = html::facts([
        ("algorithm", summary.algorithm.name().to_owned()),
        ("steps", summary.steps.to_string()),
        ("updates", summary.updates.to_string()),
        ("weights, SHA-256", summary.weights_sha256.clone()),
    ]);
    for (column, name) in table.head.iter().enumerate() {
        if ["update", "steps"].contains(&&name[..]) {
            continue;
        }
        let points = table.points(steps, column);
        if !points.is_empty() {
            let name = name.replace('_', " ");
            let series = Series { name: name.clone(), points };
            body += &chart(&name, &name, vec![series]).svg();
        }
    }
    Ok(html::page(title, &body))
}
