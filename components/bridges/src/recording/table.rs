//! A topic of a recording as a Parquet table.

use std::io::Write;

use motorium::state::{Decoder, FieldValue, Number};

use super::csv::TableError;
use super::signals::{SignalsError, as_f64};
use super::{RecordedSample, Recording};
use crate::parquet::{Column, Values, write};

/// Rows per row group.
const GROUP: usize = 1 << 16;

/// Writes a topic as a Parquet table, with one row per sample: its time (since 1970, or since the start of a
/// lockstep run), its stamp, and one column per field. An array is a list of its used entries. Returns the
/// number of rows.
///
/// # Errors
/// Returns an error if the recording cannot be read, or if the table cannot be written.
pub fn write_parquet(recording: &Recording, topic: usize, out: &mut impl Write) -> Result<u64, TableError> {
    let decoder = Decoder::new(&recording.topics()[topic].layout).map_err(SignalsError::from)?;
    let mut stamps = [const { Vec::new() }; 5];
    let mut fields: Vec<Column> = Vec::new();
    for sample in recording.samples() {
        let sample = sample.map_err(SignalsError::from)?;
        if sample.topic != topic {
            continue;
        }
        let decoded = decoder.decode(&sample.bytes).map_err(SignalsError::from)?;
        if fields.is_empty() {
            let column = |(name, value): &(&str, FieldValue)| Column {
                name: (*name).to_string(),
                values: empty(value),
            };
            fields = decoded.0.iter().map(column).collect();
        }
        stamps.iter_mut().zip(stamp(&sample)).for_each(|(column, value)| column.push(value));
        fields.iter_mut().zip(&decoded.0).for_each(|(column, (_, value))| push(&mut column.values, value));
    }
    let rows = stamps[0].len();
    let names = ["time_ns", "sequence", "publish_time_ns", "source_time_ns", "episode"];
    let stamps = names.into_iter().zip(stamps);
    let stamps =
        stamps.map(|(name, values)| Column { name: name.to_string(), values: Values::UInt64(values) });
    let columns: Vec<Column> = stamps.chain(fields).collect();
    let groups: Vec<usize> = (0..rows).step_by(GROUP).map(|first| GROUP.min(rows - first)).collect();
    let facts = [
        ("motorium.topic", recording.topics()[topic].name.clone()),
        ("motorium.type", recording.topics()[topic].layout.type_name.clone()),
    ];
    write(out, &columns, &groups, &facts)?;
    Ok(rows as u64)
}

fn stamp(sample: &RecordedSample) -> [u64; 5] {
    let stamp = &sample.stamp;
    [sample.time_ns, stamp.sequence, stamp.publish_time, stamp.source_time, stamp.episode]
}

/// Creates an empty column for values of this type. An array that is empty in the first sample is assumed to
/// contain doubles, like all counted arrays.
fn empty(value: &FieldValue) -> Values {
    let of = |number: Option<&Number>| match number {
        Some(Number::Natural(_)) => Values::UInt64(Vec::new()),
        Some(Number::Integer(_)) => Values::Int64(Vec::new()),
        Some(Number::Single(_)) => Values::Float(Vec::new()),
        Some(Number::Double(_)) | None => Values::Double(Vec::new()),
    };
    match value {
        FieldValue::One(number) => of(Some(number)),
        FieldValue::Many(numbers) => {
            Values::List { lengths: Vec::new(), entries: Box::new(of(numbers.first())) }
        }
        FieldValue::Text(_) => Values::Text(Vec::new()),
    }
}

fn push(values: &mut Values, value: &FieldValue) {
    match (values, value) {
        (Values::Text(texts), FieldValue::Text(text)) => texts.push(text.clone()),
        (Values::List { lengths, entries }, FieldValue::Many(numbers)) => {
            lengths.push(numbers.len());
            numbers.iter().for_each(|number| push_number(entries, *number));
        }
        (values, FieldValue::One(number)) => push_number(values, *number),
        // The layout of a topic does not change.
        _ => {}
    }
}

fn push_number(values: &mut Values, number: Number) {
    match values {
        Values::UInt64(values) => values.push(if let Number::Natural(number) = number { number } else { 0 }),
        Values::Int64(values) => values.push(if let Number::Integer(number) = number { number } else { 0 }),
        Values::Float(values) => values.push(as_f64(number) as f32),
        Values::Double(values) => values.push(as_f64(number)),
        Values::Text(_) | Values::Bytes(_) | Values::List { .. } | Values::Group(_) => {}
    }
}
