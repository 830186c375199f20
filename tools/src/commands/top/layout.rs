//! Tables as lines of aligned cells, for the screen, which may be too narrow for all columns, and for plain
//! text.

/// Alignment and style of a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Tone {
    #[default]
    Plain,
    /// A heading.
    Strong,
    /// Unimportant.
    Dim,
    /// Needs attention.
    Warning,
    /// Wrong.
    Bad,
}

/// A piece of text.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Cell {
    pub(super) text: String,
    pub(super) tone: Tone,
}

impl Cell {
    pub(super) fn new(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone }
    }

    pub(super) fn text(text: impl Into<String>) -> Self {
        Self::new(text, Tone::Plain)
    }

    fn width(&self) -> usize {
        self.text.chars().count()
    }
}

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    /// Adjacent columns of the same group share this heading; empty for none.
    pub(super) group: &'static str,
    pub(super) name: &'static str,
    /// Text is aligned to the left, numbers to the right.
    pub(super) left: bool,
    /// Order in which columns are dropped if there is not enough space: highest first; 0 is never dropped.
    pub(super) rank: u8,
}

impl Column {
    pub(super) const fn text(name: &'static str, rank: u8) -> Self {
        Self { group: "", name, left: true, rank }
    }

    pub(super) const fn number(group: &'static str, name: &'static str, rank: u8) -> Self {
        Self { group, name, left: false, rank }
    }
}

/// A table.
#[derive(Debug, Clone, Default)]
pub(super) struct Sheet {
    pub(super) columns: Vec<Column>,
    pub(super) rows: Vec<Vec<Cell>>,
}

/// Blanks between two columns.
const GAP: usize = 2;

impl Sheet {
    /// Returns the lines of the table at the width of its columns. With a `width`, columns that do not fit
    /// are dropped.
    pub(super) fn lines(mut self, width: Option<usize>) -> Vec<Vec<Cell>> {
        if let Some(width) = width {
            self.fit(width);
        }
        let widths = self.widths();
        let mut lines = Vec::new();
        if self.columns.iter().any(|column| !column.group.is_empty()) {
            lines.push(self.groups(&widths));
        }
        let names = self.columns.iter().map(|column| Cell::new(column.name, Tone::Strong)).collect();
        for row in std::iter::once(names).chain(self.rows) {
            lines.push(padded(&self.columns, &widths, row));
        }
        lines
    }

    fn fit(&mut self, width: usize) {
        while self.widths().iter().map(|width| width + GAP).sum::<usize>() > width + GAP {
            let dearest = (0..self.columns.len()).rev().max_by_key(|i| self.columns[*i].rank);
            let Some(index) = dearest.filter(|i| self.columns[*i].rank > 0) else { return };
            self.columns.remove(index);
            self.rows.iter_mut().for_each(|row| drop(row.remove(index)));
        }
    }

    fn widths(&self) -> Vec<usize> {
        let mut widths: Vec<usize> = self.columns.iter().map(|column| column.name.chars().count()).collect();
        for row in &self.rows {
            widths.iter_mut().zip(row).for_each(|(width, cell)| *width = (*width).max(cell.width()));
        }
        for (first, last) in self.spans() {
            let room = widths[first..=last].iter().sum::<usize>() + GAP * (last - first);
            widths[last] += self.columns[first].group.chars().count().saturating_sub(room);
        }
        widths
    }

    /// Returns the first and last column of each run of columns of one group.
    fn spans(&self) -> Vec<(usize, usize)> {
        let mut spans: Vec<(usize, usize)> = Vec::new();
        for (i, column) in self.columns.iter().enumerate() {
            match spans.last_mut() {
                Some((first, last))
                    if !column.group.is_empty() && self.columns[*first].group == column.group =>
                {
                    *last = i;
                }
                _ => spans.push((i, i)),
            }
        }
        spans
    }

    fn groups(&self, widths: &[usize]) -> Vec<Cell> {
        let mut line = Vec::new();
        for (first, last) in self.spans() {
            let width = widths[first..=last].iter().sum::<usize>() + GAP * (last - first);
            let group = self.columns[first].group;
            // Centred over its columns, so that it is not mistaken for a neighbour's heading.
            line.push(Cell::new(format!("{group:^width$}"), Tone::Strong));
            line.push(Cell::text(" ".repeat(GAP)));
        }
        line
    }
}

fn padded(columns: &[Column], widths: &[usize], row: Vec<Cell>) -> Vec<Cell> {
    let mut line = Vec::new();
    for ((column, width), cell) in columns.iter().zip(widths).zip(row) {
        let Cell { text, tone } = cell;
        let text = if column.left { format!("{text:<width$}") } else { format!("{text:>width$}") };
        line.push(Cell::new(text, tone));
        line.push(Cell::text(" ".repeat(GAP)));
    }
    line
}

/// Returns a line as plain text.
pub(super) fn to_text(line: &[Cell]) -> String {
    let text: String = line.iter().map(|cell| cell.text.as_str()).collect();
    text.trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> Sheet {
        let row = |cells: [&str; 4]| cells.map(Cell::text).to_vec();
        Sheet {
            columns: vec![
                Column::text("name", 0),
                Column::number("time us", "p50", 2),
                Column::number("time us", "max", 1),
                Column::number("", "n", 3),
            ],
            rows: vec![row(["a", "1.0", "20.0", "7"]), row(["longer", "100", "3.5", "12345"])],
        }
    }

    fn text(sheet: Sheet, width: Option<usize>) -> Vec<String> {
        sheet.lines(width).iter().map(|line| to_text(line)).collect()
    }

    #[test]
    fn table_numbers_align_and_groups_span_columns() {
        let expected = [
            "         time us",
            "name    p50   max      n",
            "a       1.0  20.0      7",
            "longer  100   3.5  12345",
        ];
        assert_eq!(text(sheet(), None), expected);
    }

    #[test]
    fn least_important_columns_are_dropped_first() {
        assert_eq!(text(sheet(), Some(24)), text(sheet(), None));
        let header = |width| text(sheet(), Some(width))[1].clone();
        assert_eq!(header(23), "name    p50   max");
        assert_eq!(header(16), "name        max", "the group still fits over the one that is left");
        assert_eq!(text(sheet(), Some(3))[0], "name", "some are never left out");
    }

    #[test]
    fn a_table_without_groups_has_one_line_of_names() {
        let sheet = Sheet { columns: vec![Column::text("name", 0)], rows: vec![vec![Cell::text("a")]] };
        assert_eq!(text(sheet, None), ["name", "a"]);
    }
}
