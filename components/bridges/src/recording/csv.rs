//! Recordings as tables.

use std::io::{self, Write};

use motorium::state::{Decoder, FieldValue, Number};

use super::Recording;
use super::signals::SignalsError;

/// The table cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The recording cannot be read.
    #[error(transparent)]
    Signals(#[from] SignalsError),
    /// A message contains too many numbers and texts for a table.
    #[error("channel `{topic}` has too many numbers and texts for a table, expected at most {most}")]
    Wide {
        /// Name of the channel.
        topic: String,
        /// Maximum number of columns.
        most: usize,
    },
    /// The output cannot be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// Writes a topic as comma-separated values and returns the number of rows. Each sample is a row with its
/// time (since 1970, or since the start of a lockstep run), its stamp, and one column per number. A counted
/// array has one column per entry in use in the first sample. Numbers are written without loss, so reading
/// them back is exact.
///
/// # Errors
/// Returns an error if the recording cannot be read or the table cannot be written.
pub fn write_csv(recording: &Recording, topic: usize, out: &mut impl Write) -> Result<u64, TableError> {
    let decoder = Decoder::new(&recording.topics()[topic].layout).map_err(SignalsError::from)?;
    let mut widths: Option<Vec<usize>> = None;
    let mut rows = 0;
    for sample in recording.samples() {
        let sample = sample.map_err(SignalsError::from)?;
        if sample.topic != topic {
            continue;
        }
        let decoded = decoder.decode(&sample.bytes).map_err(SignalsError::from)?;
        let widths = match &widths {
            Some(widths) => widths,
            None => {
                let found: Vec<usize> =
                    decoded.0.iter().map(|(_, value)| value.numbers().len().max(1)).collect();
                write!(out, "time_ns,sequence,publish_time_ns,source_time_ns,episode")?;
                for ((name, value), width) in decoded.0.iter().zip(&found) {
                    match value {
                        FieldValue::Many(_) => {
                            (0..*width).try_for_each(|entry| write!(out, ",{name}[{entry}]"))?
                        }
                        FieldValue::One(_) | FieldValue::Text(_) => write!(out, ",{name}")?,
                    }
                }
                writeln!(out)?;
                widths.insert(found)
            }
        };
        let stamp = &sample.stamp;
        write!(
            out,
            "{},{},{},{},{}",
            sample.time_ns, stamp.sequence, stamp.publish_time, stamp.source_time, stamp.episode
        )?;
        for ((_, value), width) in decoded.0.iter().zip(widths) {
            match value {
                FieldValue::Text(text) => write!(out, ",\"{}\"", text.replace('"', "\"\""))?,
                value => {
                    for entry in 0..*width {
                        match value.numbers().get(entry) {
                            Some(Number::Double(number)) => write!(out, ",{number}")?,
                            Some(Number::Single(number)) => write!(out, ",{number}")?,
                            Some(whole) => write!(out, ",{whole}")?,
                            None => write!(out, ",")?,
                        }
                    }
                }
            }
        }
        writeln!(out)?;
        rows += 1;
    }
    Ok(rows)
}
