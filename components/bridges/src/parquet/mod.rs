//! Parquet files: column-oriented tables, readable by pandas, polars, DuckDB and LeRobot.
//!
//! A writer for the subset of the format that recordings need: columns without missing values, nested lists,
//! groups, no compression, and one page per column of a row group.
//! <https://parquet.apache.org/docs/file-format/>

mod thrift;

use std::io::{self, Write};
use std::ops::Range;
use std::sync::Arc;

use thrift::Struct;

/// Magic number at the start and the end of a file.
const MAGIC: &[u8; 4] = b"PAR1";

// Constants of the format.
const INT64: i64 = 2;
const FLOAT: i64 = 4;
const DOUBLE: i64 = 5;
const BYTE_ARRAY: i64 = 6;
const REQUIRED: i64 = 0;
const REPEATED: i64 = 2;
const CONVERTED_UTF8: i64 = 0;
const CONVERTED_LIST: i64 = 3;
const CONVERTED_UINT_64: i64 = 14;
const PLAIN: i64 = 0;
const RLE: i64 = 3;
const UNCOMPRESSED: i64 = 0;
const DATA_PAGE: i64 = 0;

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name of the column.
    pub name: String,
    /// Values of the column.
    pub values: Values,
}

/// Values of a column, one per row.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Signed integers.
    Int64(Vec<i64>),
    /// Unsigned integers.
    UInt64(Vec<u64>),
    /// Single-precision numbers.
    Float(Vec<f32>),
    /// Double-precision numbers.
    Double(Vec<f64>),
    /// Strings.
    Text(Vec<String>),
    /// Bytes, such as the contents of files.
    Bytes(Vec<Arc<[u8]>>),
    /// Lists.
    List {
        /// Number of entries in the list of each row.
        lengths: Vec<usize>,
        /// Entries of all lists, concatenated. They may themselves be lists.
        entries: Box<Values>,
    },
    /// Groups of named values, all with the same number of rows. The values of a group are neither lists nor
    /// groups.
    Group(Vec<Column>),
}

impl Values {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Int64(values) => values.len(),
            Self::UInt64(values) => values.len(),
            Self::Float(values) => values.len(),
            Self::Double(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Bytes(values) => values.len(),
            Self::List { lengths, .. } => lengths.len(),
            Self::Group(columns) => columns.first().map_or(0, |column| column.values.len()),
        }
    }

    /// Returns `true` if there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Codes of the physical and the converted type. A group has no type.
    fn kind(&self) -> (i64, Option<i64>) {
        match self {
            Self::Int64(_) => (INT64, None),
            Self::UInt64(_) => (INT64, Some(CONVERTED_UINT_64)),
            Self::Float(_) => (FLOAT, None),
            Self::Double(_) => (DOUBLE, None),
            Self::Text(_) => (BYTE_ARRAY, Some(CONVERTED_UTF8)),
            Self::Bytes(_) | Self::Group(_) => (BYTE_ARRAY, None),
            Self::List { entries, .. } => entries.kind(),
        }
    }

    /// Nesting depth of lists: 0 for plain values, 1 for lists of values.
    fn depth(&self) -> usize {
        match self {
            Self::List { entries, .. } => 1 + entries.depth(),
            _ => 0,
        }
    }

    /// Reports the repetition and definition levels of the next `count` values at a depth, in runs. `first`
    /// is the repetition level of the first value, `next` the index of the next value at each depth.
    fn shred(
        &self,
        (count, depth): (usize, usize),
        first: usize,
        next: &mut [usize],
        emit: &mut impl FnMut(usize, usize, usize),
    ) {
        let Self::List { lengths, entries } = self else {
            next[depth] += count;
            emit(first, depth, count.min(1));
            emit(depth, depth, count.saturating_sub(1));
            return;
        };
        for place in 0..count {
            let length = lengths[next[depth]];
            next[depth] += 1;
            let repeats = if place == 0 { first } else { depth };
            match length {
                // Parquet stores an entry for an empty list, too; its definition level marks the list as
                // empty.
                0 => emit(repeats, depth, 1),
                _ => entries.shred((length, depth + 1), repeats, next, emit),
            }
        }
    }

    /// Appends the values of some rows in PLAIN encoding.
    fn encode_plain(&self, rows: Range<usize>, out: &mut Vec<u8>) {
        match self {
            Self::Int64(values) => values[rows].iter().for_each(|value| out.extend(value.to_le_bytes())),
            Self::UInt64(values) => values[rows].iter().for_each(|value| out.extend(value.to_le_bytes())),
            Self::Float(values) => values[rows].iter().for_each(|value| out.extend(value.to_le_bytes())),
            Self::Double(values) => values[rows].iter().for_each(|value| out.extend(value.to_le_bytes())),
            Self::Text(values) => values[rows].iter().for_each(|text| {
                out.extend((text.len() as u32).to_le_bytes());
                out.extend(text.as_bytes());
            }),
            Self::Bytes(values) => values[rows].iter().for_each(|bytes| {
                out.extend((bytes.len() as u32).to_le_bytes());
                out.extend(&bytes[..]);
            }),
            Self::List { lengths, entries } => {
                let before: usize = lengths[..rows.start].iter().sum();
                let within: usize = lengths[rows].iter().sum();
                entries.encode_plain(before..before + within, out);
            }
            Self::Group(columns) => {
                columns.iter().for_each(|column| column.values.encode_plain(rows.clone(), out))
            }
        }
    }
}

impl Column {
    /// Leaves of the value tree with their paths: one per column of a group.
    fn leaves(&self) -> Vec<(Vec<&str>, &Values)> {
        let name = self.name.as_str();
        match &self.values {
            Values::Group(columns) => {
                columns.iter().map(|column| (vec![name, column.name.as_str()], &column.values)).collect()
            }
            values => {
                let levels = core::iter::repeat_n(["list", "element"], values.depth()).flatten();
                vec![(core::iter::once(name).chain(levels).collect(), values)]
            }
        }
    }
}

/// Writes a table. `groups` is the number of rows of each row group; its sum must be the number of rows.
/// `facts` is stored as metadata in the footer.
///
/// ```
/// use motorium_bridges::parquet::{Column, Values, write};
///
/// let columns = [
///     Column { name: "time_ns".into(), values: Values::Int64(vec![0, 1_000_000]) },
///     Column { name: "position".into(), values: Values::Double(vec![0.1, 0.2]) },
/// ];
/// let mut file = Vec::new();
/// write(&mut file, &columns, &[2], &[("made by", "motorium".to_string())])?;
/// assert!(file.starts_with(b"PAR1") && file.ends_with(b"PAR1"));
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// Returns an error if the file cannot be written, or if columns and groups differ in their number
/// of rows.
pub fn write(
    file: &mut dyn Write,
    columns: &[Column],
    groups: &[usize],
    facts: &[(&str, String)],
) -> io::Result<()> {
    let rows: usize = groups.iter().sum();
    let leaves = || columns.iter().flat_map(Column::leaves);
    if let Some((path, values)) = leaves().find(|(_, values)| values.len() != rows) {
        let reason = format!("column `{}` has {} rows, but the table has {rows}", path[0], values.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    }
    file.write_all(MAGIC)?;
    let mut offset = MAGIC.len() as i64;
    let mut first = 0;
    let mut row_groups = Vec::new();
    for length in groups.iter().copied().filter(|length| *length > 0) {
        let (mut chunks, mut bytes) = (Vec::new(), 0);
        for (path, values) in leaves() {
            let (page, entries) = page(values, first..first + length);
            file.write_all(&page)?;
            chunks.push(chunk((&path, values), offset, page.len() as i64, entries as i64));
            offset += page.len() as i64;
            bytes += page.len() as i64;
        }
        row_groups.push(Struct::new().structs(1, &chunks).i64(2, bytes).i64(3, length as i64));
        first += length;
    }
    let fact = |(key, value): &(&str, String)| Struct::new().text(1, key).text(2, value);
    let footer = Struct::new()
        .i32(1, 1)
        .structs(2, &schema(columns))
        .i64(3, rows as i64)
        .structs(4, &row_groups)
        .structs(5, &facts.iter().map(fact).collect::<Vec<_>>())
        .text(6, concat!("motorium version ", env!("CARGO_PKG_VERSION")))
        .finish();
    file.write_all(&footer)?;
    file.write_all(&(footer.len() as u32).to_le_bytes())?;
    file.write_all(MAGIC)
}

/// Flattened column tree: the root, then each column. Each level of lists adds two levels, a group adds one.
fn schema(columns: &[Column]) -> Vec<Struct> {
    let mut schema = vec![Struct::new().text(4, "schema").i32(5, columns.len() as i64)];
    let group =
        |name: &str, children: usize| Struct::new().i32(3, REQUIRED).text(4, name).i32(5, children as i64);
    for Column { name, values } in columns {
        let leaf = |name: &str, values: &Values| {
            let (kind, converted) = values.kind();
            let leaf = Struct::new().i32(1, kind).i32(3, REQUIRED).text(4, name);
            converted.into_iter().fold(leaf, |leaf, converted| leaf.i32(6, converted))
        };
        match values {
            Values::Group(columns) => {
                schema.push(group(name, columns.len()));
                schema.extend(columns.iter().map(|column| leaf(&column.name, &column.values)));
            }
            values => {
                let names = core::iter::once(name.as_str()).chain(core::iter::repeat("element"));
                for name in names.clone().take(values.depth()) {
                    schema.push(group(name, 1).i32(6, CONVERTED_LIST));
                    schema.push(Struct::new().i32(3, REPEATED).text(4, "list").i32(5, 1));
                }
                schema.extend(names.skip(values.depth()).take(1).map(|name| leaf(name, values)));
            }
        }
    }
    schema
}

/// Page with its header, and the number of its entries.
fn page(values: &Values, rows: Range<usize>) -> (Vec<u8>, usize) {
    let mut body = Vec::new();
    let mut entries = rows.len();
    if values.depth() > 0 {
        let (mut repetition, mut definition) = (Runs::default(), Runs::default());
        entries = 0;
        values.shred((rows.len(), 0), 0, &mut starts(values, rows.start), &mut |repeats, defined, count| {
            entries += count;
            repetition.push(repeats, count);
            definition.push(defined, count);
        });
        repetition.end(&mut body);
        definition.end(&mut body);
    }
    values.encode_plain(rows, &mut body);
    let data = Struct::new().i32(1, entries as i64).i32(2, PLAIN).i32(3, RLE).i32(4, RLE);
    let head = Struct::new()
        .i32(1, DATA_PAGE)
        .i32(2, body.len() as i64)
        .i32(3, body.len() as i64)
        .structure(5, &data)
        .finish();
    ([head, body].concat(), entries)
}

/// Index of the first value of a row at each depth.
fn starts(values: &Values, row: usize) -> Vec<usize> {
    let (mut starts, mut values) = (vec![row], values);
    while let Values::List { lengths, entries } = values {
        let before = starts.last().copied().unwrap_or(0);
        starts.push(lengths[..before].iter().sum());
        values = entries;
    }
    starts
}

/// Run-length encoded levels. There are few levels, so each fits in one byte.
#[derive(Default)]
struct Runs {
    encoded: Vec<u8>,
    last: Option<(usize, usize)>,
}

impl Runs {
    fn push(&mut self, level: usize, count: usize) {
        match &mut self.last {
            _ if count == 0 => {}
            Some((same, sum)) if *same == level => *sum += count,
            _ => {
                self.close();
                self.last = Some((level, count));
            }
        }
    }

    fn close(&mut self) {
        if let Some((level, count)) = self.last.take() {
            thrift::varint((count as u64) << 1, &mut self.encoded);
            self.encoded.push(level as u8);
        }
    }

    /// Appends the runs, preceded by their length in bytes.
    fn end(mut self, out: &mut Vec<u8>) {
        self.close();
        out.extend((self.encoded.len() as u32).to_le_bytes());
        out.extend(self.encoded);
    }
}

/// Entry of the footer for the page of a leaf.
fn chunk((path, values): (&[&str], &Values), offset: i64, bytes: i64, entries: i64) -> Struct {
    let meta = Struct::new()
        .i32(1, values.kind().0)
        .i32s(2, &[PLAIN, RLE])
        .texts(3, path)
        .i32(4, UNCOMPRESSED)
        .i64(5, entries)
        .i64(6, bytes)
        .i64(7, bytes)
        .i64(9, offset);
    Struct::new().i64(2, offset).structure(3, &meta)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_equal_levels_are_one_run() {
        let (mut runs, mut out) = (Runs::default(), Vec::new());
        for (level, count) in [(0, 1), (1, 2), (1, 0), (0, 1), (0, 99)] {
            runs.push(level, count);
        }
        runs.end(&mut out);
        // Lengths are doubled: 1, 2 and 100; the last one needs two bytes.
        assert_eq!(out, [7, 0, 0, 0, 2, 0, 4, 1, 200, 1, 0]);
    }

    /// Levels as in the Dremel paper: the repetition level is the depth at which the list continues.
    #[test]
    fn nested_lists_have_dremel_levels() {
        let inner =
            Values::List { lengths: vec![2, 1, 3], entries: Box::new(Values::Int64((0..6).collect())) };
        let outer = Values::List { lengths: vec![2, 0, 1], entries: Box::new(inner) };
        let (mut found, mut next) = (Vec::new(), starts(&outer, 0));
        outer.shred((3, 0), 0, &mut next, &mut |repeats, defined, count| {
            found.extend(core::iter::repeat_n((repeats, defined), count));
        });
        assert_eq!(found, [(0, 2), (2, 2), (1, 2), (0, 0), (0, 2), (2, 2), (2, 2)]);
        assert_eq!((next, starts(&outer, 2)), (vec![3, 3, 6], vec![2, 2, 3]));
    }

    #[test]
    fn table_with_unequal_columns_is_rejected() {
        let column =
            |name: &str, rows: usize| Column { name: name.to_string(), values: Values::Int64(vec![7; rows]) };
        let error = write(&mut Vec::new(), &[column("a", 3), column("b", 2)], &[3], &[]).unwrap_err();
        assert_eq!(error.to_string(), "column `b` has 2 rows, but the table has 3");
    }
}
