//! Text tables: a header of names, followed by one sample per line.

use ::csv::{ReaderBuilder, StringRecord, Trim};

use crate::error::{Place, RecordingError};
use crate::names::Columns;
use crate::selection::Selection;
use crate::table::Table;
use crate::time::Clock;

/// Reads a table. The separator is detected if `separator` is `None`.
pub(crate) fn table(
    path: &str,
    text: &str,
    separator: Option<u8>,
    selection: &Selection,
) -> Result<Table, RecordingError> {
    let malformed = |place: Place, found: String, expected: &str| RecordingError::Malformed {
        place: Box::new(place),
        found,
        expected: expected.into(),
        advice: None,
    };
    let mut reader = ReaderBuilder::new()
        .delimiter(separator.unwrap_or_else(|| guessed_separator(text)))
        .comment(Some(b'#'))
        .flexible(true)
        .has_headers(false)
        .trim(Trim::All)
        .from_reader(text.as_bytes());
    let mut record = StringRecord::new();
    let mut header: Option<(Vec<String>, Columns)> = None;
    let mut rows = Vec::new();
    while reader
        .read_record(&mut record)
        .map_err(|error| malformed(Place::file(path), error.to_string(), "a table of text"))?
    {
        let line = record.position().map_or(0, |position| position.line() as usize);
        let is_empty = record.iter().all(str::is_empty) && record.len() <= 1;
        if is_empty || record.get(0).is_some_and(|cell| cell.starts_with('#')) {
            continue;
        }
        let place = Place::line(path, line);
        let Some((names, columns)) = &header else {
            let names: Vec<String> = record.iter().map(|cell| unquoted(cell).to_string()).collect();
            if names.iter().all(|cell| cell.parse::<f64>().is_ok()) {
                return Err(malformed(
                    place,
                    "numbers only".into(),
                    "a header with the names of the columns",
                ));
            }
            let columns = Columns::select(&place, &names, selection)?;
            header = Some((names, columns));
            continue;
        };
        if record.len() != names.len() {
            let found = format!("{} {}", record.len(), if record.len() == 1 { "cell" } else { "cells" });
            return Err(malformed(place, found, &format!("{}, as in the header", names.len())));
        }
        let number = |index: usize| number(&record[index], || place.clone().column(index + 1, &names[index]));
        let time = match columns.clock {
            Some(Clock::Time(index, _) | Clock::Step(index, _)) => Some(number(index)?),
            _ => None,
        };
        let values = columns.channels.iter().map(|(index, _)| number(*index)).collect::<Result<_, _>>()?;
        rows.push((place, time, values));
    }
    let Some((_, columns)) = header else {
        return Err(malformed(Place::file(path), "nothing".into(), "a header and a line for each sample"));
    };
    Ok(Table { columns, rows })
}

/// Parses a finite number in a cell.
fn number(cell: &str, place: impl Fn() -> Place) -> Result<f64, RecordingError> {
    let cell = unquoted(cell);
    let found = if cell.is_empty() { "nothing".into() } else { format!("`{}`", excerpt(cell)) };
    let refused = |expected: &str, advice| RecordingError::Malformed {
        place: Box::new(place()),
        found: found.clone(),
        expected: expected.into(),
        advice,
    };
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(refused("a finite number", Some("cut the recording or fill the gap"))),
        Err(_) if cell.is_empty() => Err(refused("a number", Some("cut the recording or fill the gap"))),
        Err(_) if cell.replacen(',', ".", 1).parse::<f64>().is_ok() => {
            Err(refused("a number", Some("write decimals with a point")))
        }
        Err(_) if cell.split_whitespace().count() > 1 && cell.split_whitespace().all(is_number) => {
            Err(refused("a number", Some("separate columns by commas, semicolons or tabs")))
        }
        Err(_) => Err(refused("a number", None)),
    }
}

fn is_number(text: &str) -> bool {
    text.parse::<f64>().is_ok()
}

/// Removes the quotes of a cell that follow a space.
fn unquoted(cell: &str) -> &str {
    cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).unwrap_or(cell)
}

/// Largest number of characters of a cell in a message.
const LONGEST_EXCERPT: usize = 40;

/// Returns a cell for a message: its beginning, with control characters escaped.
fn excerpt(cell: &str) -> String {
    let shown: String = cell.chars().take(LONGEST_EXCERPT).flat_map(shown).collect();
    if cell.chars().count() > LONGEST_EXCERPT { format!("{shown}...") } else { shown }
}

fn shown(c: char) -> Vec<char> {
    if c.is_control() { c.escape_default().collect() } else { vec![c] }
}

/// Returns the separator that splits the header and the next line into the same number of cells.
fn guessed_separator(text: &str) -> u8 {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let (header, first) = (lines.next().unwrap_or_default(), lines.next().unwrap_or_default());
    let score = |separator: &u8| {
        let count = separators(header, *separator);
        (count > 0 && count == separators(first, *separator), count)
    };
    // the last of equals is chosen: a comma
    [b'\t', b';', b','].into_iter().max_by_key(score).unwrap_or(b',')
}

/// Counts the separators in a line outside quotes.
fn separators(line: &str, separator: u8) -> usize {
    let mut quoted = false;
    line.bytes()
        .filter(|byte| {
            quoted ^= *byte == b'"';
            !quoted && *byte == separator
        })
        .count()
}
